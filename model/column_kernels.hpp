// The inner loops: one run of voxels of one column. Scalar and vector forms give the same bits.
//
// Scaling and overflow. An increment is weight_q7 * tap_q15 = Q22, plus a dither in [0, 2^22), shifted
// down by 22: the expected value over the dither is the exact product, so that weights far below one
// unit neither vanish nor round in one direction. weight_q7 <= 32767 and tap_q15 <= 32767, hence the
// product is below 2^30 and the sum below 2^31. Accumulation saturates at 65535 per half voxel.
#pragma once

#include <cstdint>

#include "model/grid.hpp"

namespace leadline::model {

inline constexpr std::uint32_t kDitherMask_q22 = (1U << 22U) - 1U;
/// Dither of voxel k of a column: an additive golden-ratio sequence, equidistributed along the column
/// and, through `base`, from ping to ping.
inline constexpr std::uint32_t kDitherStep = 0x9E3779B1U;

[[nodiscard]] constexpr std::uint32_t dither_q22(std::uint32_t base, std::uint32_t k) {
  return (base + k * kDitherStep) >> 10U;
}

/// Saturating sum of two halves.
[[nodiscard]] constexpr std::uint16_t add_saturated(std::uint32_t value, std::uint32_t increment) {
  const std::uint32_t sum = value + increment;
  return static_cast<std::uint16_t>(sum > 0xFFFFU ? 0xFFFFU : sum);
}

/// One weighted pair of increments: evidence for a surface and against it.
struct Evidence {
  std::uint32_t hit_q7;
  std::uint32_t miss_q7;
};

/// Adds `taps[i] * evidence` to voxels[i], i in [0, count); `first` is the index of voxels[0] in its
/// column (for the dither). The vector form may read and rewrite unchanged up to 3 voxels beyond.
void add_shell(Voxel* voxels, const std::int16_t* taps, std::int32_t count, std::uint32_t first,
               const Evidence& evidence, std::uint32_t dither_base);

/// Adds `evidence` (each half times one) to voxels[i], i in [0, count).
void add_uniform(Voxel* voxels, std::int32_t count, std::uint32_t first, const Evidence& evidence,
                 std::uint32_t dither_base);

/// Summary of a column's evidence profile.
struct ProfileSummary {
  std::uint32_t mass;  ///< sum of evidence
  std::uint32_t peak;  ///< largest smoothed value
  unsigned shift;      ///< `smoothed` was computed from evidence >> shift, so that it fits 15 bits
};

/// Guard cells that gather_profile() needs before and after `evidence`, and padding of its length.
inline constexpr std::int32_t kProfileGuard = 16;

/// Evidence of every voxel of a column (see column_depth()) into evidence[0, depth_cells), zeros into
/// the guards around it, and evidence smoothed by (1 2 3 2 1) into smoothed[0, depth_cells).
/// `smoothed` must have room for depth_cells + 8; up to 7 voxels past the column are read, whatever they
/// hold (the grid's storage has them). O(depth).
ProfileSummary gather_profile(const Voxel* voxels, std::int32_t depth_cells, Rule rule,
                              std::uint16_t* evidence, std::uint16_t* smoothed);
ProfileSummary gather_profile_scalar(const Voxel* voxels, std::int32_t depth_cells, Rule rule,
                                     std::uint16_t* evidence, std::uint16_t* smoothed);

/// The same, without vector instructions: the reference for tests and targets without them.
void add_shell_scalar(Voxel* voxels, const std::int16_t* taps, std::int32_t count,
                      std::uint32_t first, const Evidence& evidence, std::uint32_t dither_base);
void add_uniform_scalar(Voxel* voxels, std::int32_t count, std::uint32_t first,
                        const Evidence& evidence, std::uint32_t dither_base);

}  // namespace leadline::model
