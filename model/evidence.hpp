// What shell and cone share about evidence: its strength by range and by rule.
#pragma once

#include <cstdint>

#include "model/base/fixed.hpp"
#include "model/column_kernels.hpp"
#include "model/event.hpp"

namespace leadline::model {

/// Strength of the empty evidence of one ping beside the peak that its shell would have had in the same
/// voxel: 1/2. A voxel is a surface when it was hit more than half as often as it was looked through.
inline constexpr int kEmptyShift = 1;
inline constexpr std::uint32_t kMostEmpty_q7 = kMaxWeight_q7 >> kEmptyShift;
/// Separates the dither sequences of columns (odd, so that it is a permutation).
inline constexpr std::uint32_t kColumnDither = 0x85EBCA6BU;

/// Confidence of "empty" at (i / 64) of the maximum range, Q15: logit(rho) / logit(0.02) with the
/// source's rho = 0.5 sqrt(r / R_max) (method 1.2), for log-odds; and 1 - 2 rho for the weighted mean,
/// whose evidence against is w (1 - rho).
inline constexpr std::uint16_t kEmptyLogit_q15[65] = {
    32767, 22800, 19647, 17754, 16384, 15301, 14402, 13630, 12952, 12346, 11796, 11293, 10829,
    10396, 9991,  9610,  9250,  8908,  8582,  8271,  7972,  7686,  7410,  7144,  6887,  6638,
    6397,  6163,  5935,  5713,  5497,  5287,  5081,  4880,  4683,  4490,  4301,  4116,  3934,
    3755,  3580,  3407,  3237,  3070,  2905,  2743,  2583,  2425,  2270,  2116,  1964,  1814,
    1666,  1519,  1374,  1231,  1089,  949,   809,   672,   535,   399,   265,   132,   0};
inline constexpr std::uint16_t kEmptyRho_q15[65] = {
    0,     2048,  2896,  3547,  4096,  4579,  5017,  5418,  5793,  6144,  6476,  6792,  7094,
    7384,  7663,  7932,  8192,  8444,  8689,  8927,  9159,  9385,  9606,  9822,  10033, 10240,
    10443, 10642, 10837, 11029, 11217, 11403, 11585, 11765, 11942, 12116, 12288, 12457, 12625,
    12790, 12953, 13114, 13273, 13430, 13585, 13738, 13890, 14040, 14189, 14336, 14482, 14626,
    14768, 14910, 15050, 15188, 15326, 15462, 15597, 15731, 15864, 15995, 16126, 16255, 16384};

/// Entry of the tables over range / max_range.
[[nodiscard]] inline std::uint32_t range_entry(const Scale& scale, std::int32_t range_q10) {
  const auto range =
      static_cast<std::uint64_t>(static_cast<std::uint32_t>(base::max_of(range_q10, 0)));
  return static_cast<std::uint32_t>(
      base::min_of<std::uint64_t>((range * scale.confidence_scale_q22) >> 22U, 64));
}

/// Gain of an event of `weight_q7` by a pulling rule.
[[nodiscard]] inline std::uint32_t pull_gain(std::uint32_t gain_q15, std::uint32_t weight_q7) {
  return static_cast<std::uint32_t>(static_cast<std::uint64_t>(gain_q15) * weight_q7 /
                                    kMaxWeight_q7);
}

}  // namespace leadline::model
