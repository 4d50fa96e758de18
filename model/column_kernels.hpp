// The inner loops: one run of voxels of one column. Scalar and vector forms give the same bits.
//
// Scaling and overflow. An increment is weight_q7 * tap_q15 = Q22, plus a dither in [0, 2^22) in steps of
// 2^6, shifted down by 22: its expected value over the dither is the product to 2^-16 of a unit, so that
// weights far below one unit neither vanish nor round in one direction. weight_q7 <= kMaxWeight_q7 (255
// units) and tap_q15 <= 32767, hence twice their product and the dither stay below 2^32, in 16-bit halves;
// a tap of zero adds nothing. Accumulation saturates at 65535 per half voxel.
#pragma once

#include <cstdint>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "model/base/saturating.h"
#include "model/grid.hpp"
#include "model/localization_table.hpp"

namespace leadline::model {

/// Largest weight: 255 units of evidence.
inline constexpr std::uint32_t kMaxWeight_q7 = 32640;
/// Dither of voxel k of a column: an additive golden-ratio sequence of 16 bits, equidistributed along the
/// column and, through `base` (its low 16 bits count), from ping to ping.
inline constexpr std::uint32_t kDitherStep = 0x9E37U;

[[nodiscard]] constexpr std::uint32_t dither_q22(std::uint32_t base, std::uint32_t k) {
  return ((base + k * kDitherStep) & 0xFFFFU) << 6U;
}

/// One weighted pair of increments: evidence for a surface and against it, 0 .. kMaxWeight_q7 each.
struct Evidence {
  std::uint32_t hit_q7;
  std::uint32_t miss_q7;
};

/// Adds `taps[i] * evidence` to voxels[i], i in [0, count); `first` is the index of voxels[0] in its
/// column (for the dither). The vector form may read and rewrite unchanged up to 7 voxels beyond, and
/// read 7 taps beyond.
inline void add_shell(Voxel* voxels, const std::int16_t* taps, std::int32_t count,
                      std::uint32_t first, const Evidence& evidence, std::uint32_t dither_base);

/// The same for `count` taps from row[first] on of a whole kernel row (zero outside of them), which is
/// faster; `dither_start` is the dither of voxels[0]. Room as above.
inline void add_shell_taps(Voxel* voxels, const std::int16_t (&row)[kKernelTaps],
                           std::int32_t first, std::int32_t count, std::uint32_t dither_start,
                           const Evidence& evidence);

/// Adds `evidence` (each half times one) to voxels[i], i in [0, count). Reads and rewrites as above.
inline void add_uniform(Voxel* voxels, std::int32_t count, std::uint32_t first,
                        const Evidence& evidence, std::uint32_t dither_base);

/// What a pulling rule does to a voxel: a share of it, at the peak of a shell's taps or in all of a run,
/// and the signal that it is pulled to.
struct Pull {
  std::uint32_t
      gain_q15;  ///< share per unit of tap (Q15 of 1), may exceed 1: a voxel's is limited to it
  std::uint32_t signal_q16;  ///< rho, 0 .. 65535
};

/// Pulls voxels[i] by taps[i] * gain, i in [0, count): kCertaintyFactor or kRecursive. Rounding is unbiased
/// as above; the halves stay within 0 .. 65535 without saturating.
void pull_shell(Rule rule, Voxel* voxels, const std::int16_t* taps, std::int32_t count,
                std::uint32_t first, const Pull& pull, std::uint32_t dither_base);
/// Pulls voxels[i] by the gain itself.
void pull_uniform(Rule rule, Voxel* voxels, std::int32_t count, std::uint32_t first,
                  const Pull& pull, std::uint32_t dither_base);

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

#if defined(__SSE2__)

namespace vector {

// Unaligned; __m128i may alias anything, and the casts through void* are how the intrinsics want it.
inline __m128i load(const void* address) {
  return _mm_loadu_si128(static_cast<const __m128i*>(address));
}
inline void store(void* address, __m128i value) {
  _mm_storeu_si128(static_cast<__m128i*>(address), value);
}
inline __m128i lanes16(std::uint32_t value) {
  return _mm_set1_epi16(static_cast<std::int16_t>(static_cast<std::uint16_t>(value)));
}

// Dithers of eight voxels from `start` on, 16 bits.
inline __m128i dither_lanes(std::uint32_t start) {
  constexpr std::uint32_t kStep = kDitherStep;
  const auto at = [](std::uint32_t k) { return static_cast<std::int16_t>((k * kStep) & 0xFFFFU); };
  return _mm_add_epi16(lanes16(start),
                       _mm_set_epi16(at(7), at(6), at(5), at(4), at(3), at(2), at(1), at(0)));
}

// All ones in the first `count` of eight lanes.
inline __m128i lane_mask(std::int32_t count) {
  return _mm_cmpgt_epi16(_mm_set1_epi16(static_cast<std::int16_t>(count < 8 ? count : 8)),
                         _mm_set_epi16(7, 6, 5, 4, 3, 2, 1, 0));
}

// (tap * weight + dither) >> 22 in 16-bit lanes: twice the tap times twice the weight is Q24, its two
// halves are added to the dither with the carry between them.
inline __m128i increments(__m128i twice_tap_q15, __m128i twice_weight_q7, __m128i dither) {
  const __m128i low = _mm_mullo_epi16(twice_tap_q15, twice_weight_q7);
  const __m128i dither_low = _mm_slli_epi16(dither, 8);
  const __m128i no_carry =
      _mm_cmpeq_epi16(_mm_adds_epu16(low, dither_low), _mm_add_epi16(low, dither_low));
  const __m128i high = _mm_sub_epi16(_mm_mulhi_epu16(twice_tap_q15, twice_weight_q7),
                                     _mm_xor_si128(no_carry, _mm_set1_epi16(-1)));
  return _mm_srli_epi16(_mm_add_epi16(high, _mm_srli_epi16(dither, 8)), 8);
}

// Adds eight pairs of increments.
inline void accumulate(Voxel* voxels, __m128i hit, __m128i miss) {
  store(voxels, _mm_adds_epu16(load(voxels), _mm_unpacklo_epi16(hit, miss)));
  store(voxels + 4, _mm_adds_epu16(load(voxels + 4), _mm_unpackhi_epi16(hit, miss)));
}

}  // namespace vector

inline void add_shell(Voxel* voxels, const std::int16_t* taps, std::int32_t count,
                      std::uint32_t first, const Evidence& evidence, std::uint32_t dither_base) {
  const __m128i hit_weight = vector::lanes16(2U * evidence.hit_q7);
  const __m128i miss_weight = vector::lanes16(2U * evidence.miss_q7);
  __m128i dither = vector::dither_lanes(dither_base + first * kDitherStep);
  for (std::int32_t i = 0; i < count; i += 8) {
    const __m128i tap =
        _mm_and_si128(_mm_slli_epi16(vector::load(taps + i), 1), vector::lane_mask(count - i));
    const __m128i hit = vector::increments(tap, hit_weight, dither);
    // A tap of zero adds nothing; a weight of zero neither, which is what most shells have here.
    const __m128i miss =
        evidence.miss_q7 == 0 ? _mm_setzero_si128() : vector::increments(tap, miss_weight, dither);
    vector::accumulate(voxels + i, hit, miss);
    dither = _mm_add_epi16(dither, vector::lanes16(8U * kDitherStep));
  }
}

inline void add_shell_taps(Voxel* voxels, const std::int16_t (&row)[kKernelTaps],
                           std::int32_t first, std::int32_t count, std::uint32_t dither_start,
                           const Evidence& evidence) {
  if (count > 8 || first > kKernelTaps - 8) {
    add_shell(voxels, row + first, count, 0, evidence, dither_start);
    return;
  }
  // Eight taps from `first` on lie inside the row, and those beyond `count` are zero: no mask.
  const __m128i tap = _mm_slli_epi16(vector::load(row + first), 1);
  const __m128i dither = vector::dither_lanes(dither_start);
  const __m128i hit = vector::increments(tap, vector::lanes16(2U * evidence.hit_q7), dither);
  const __m128i miss =
      evidence.miss_q7 == 0
          ? _mm_setzero_si128()
          : vector::increments(tap, vector::lanes16(2U * evidence.miss_q7), dither);
  vector::accumulate(voxels, hit, miss);
}

inline void add_uniform(Voxel* voxels, std::int32_t count, std::uint32_t first,
                        const Evidence& evidence, std::uint32_t dither_base) {
  const __m128i hit_value = vector::lanes16(2U * evidence.hit_q7);
  const __m128i miss_value = vector::lanes16(2U * evidence.miss_q7);
  __m128i dither = vector::dither_lanes(dither_base + first * kDitherStep);
  for (std::int32_t i = 0; i < count; i += 8) {
    const __m128i high = _mm_srli_epi16(dither, 8);
    const __m128i mask = vector::lane_mask(count - i);
    const __m128i hit = _mm_srli_epi16(_mm_add_epi16(hit_value, high), 8);
    const __m128i miss = _mm_srli_epi16(_mm_add_epi16(miss_value, high), 8);
    vector::accumulate(voxels + i, _mm_and_si128(hit, mask), _mm_and_si128(miss, mask));
    dither = _mm_add_epi16(dither, vector::lanes16(8U * kDitherStep));
  }
}

#else

inline void add_shell(Voxel* voxels, const std::int16_t* taps, std::int32_t count,
                      std::uint32_t first, const Evidence& evidence, std::uint32_t dither_base) {
  add_shell_scalar(voxels, taps, count, first, evidence, dither_base);
}

inline void add_shell_taps(Voxel* voxels, const std::int16_t (&row)[kKernelTaps],
                           std::int32_t first, std::int32_t count, std::uint32_t dither_start,
                           const Evidence& evidence) {
  add_shell_scalar(voxels, row + first, count, 0, evidence, dither_start);
}

inline void add_uniform(Voxel* voxels, std::int32_t count, std::uint32_t first,
                        const Evidence& evidence, std::uint32_t dither_base) {
  add_uniform_scalar(voxels, count, first, evidence, dither_base);
}

#endif

}  // namespace leadline::model
