// The inner loops: one run of voxels of one column. Scalar and vector forms give the same bits.
//
// Scaling and overflow. An increment is weight_q7 * tap_q15 = Q22, plus a dither in [0, 2^22) in steps of
// 2^6, shifted down by 22: its expected value over the dither is the product to 2^-16 of a unit, so that
// weights far below one unit neither vanish nor round in one direction. weight_q7 <= kMaxWeight_q7 (255
// units) and tap_q15 <= 32767, hence twice their product and the dither stay below 2^32, in 16-bit halves;
// a tap of zero adds nothing. Accumulation saturates at 65535 per half voxel.
#pragma once

#include <cstdint>

// One vector form at most; LEADLINE_SCALAR_KERNELS (a build option) leaves the scalar one.
#if defined(LEADLINE_SCALAR_KERNELS)
#elif defined(__SSE2__)
#define LEADLINE_KERNELS_SSE2
#include <emmintrin.h>
#elif defined(__aarch64__) && defined(__ARM_NEON)
#define LEADLINE_KERNELS_NEON
#include <arm_neon.h>
#elif defined(__ARM_FEATURE_SIMD32)
#define LEADLINE_KERNELS_SIMD32
#include <cstring>

#include <arm_acle.h>
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

/// Dither along the runs of one column, for add_misses(): that of the next voxel.
struct RunDither;
/// Adds miss_q7 against a surface to voxels[i], i in [0, count), and moves the dither on by count, unless that is odd:
/// then this was the last run. What add_uniform() does without evidence for one. Room as there.
inline void add_misses(Voxel* voxels, std::int32_t count, std::uint32_t miss_q7, RunDither& dither);

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

/// Where the hits of a column are: cells [first, end), none when first >= end.
struct HitSpan {
  std::int32_t first;
  std::int32_t end;
};
/// O(depth). Reads past the column as gather_profile() does.
[[nodiscard]] HitSpan hit_span(const Voxel* voxels, std::int32_t depth_cells);

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

#if defined(LEADLINE_KERNELS_SSE2)

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

#elif defined(LEADLINE_KERNELS_NEON)

namespace vector {

// Eight dithers from `start` on.
inline uint16x8_t dither_lanes(std::uint32_t start) {
  constexpr std::uint16_t kIndex[8] = {0, 1, 2, 3, 4, 5, 6, 7};
  return vmlaq_n_u16(vdupq_n_u16(static_cast<std::uint16_t>(start)), vld1q_u16(kIndex),
                     static_cast<std::uint16_t>(kDitherStep));
}

// All ones in the first `count` of eight lanes.
inline uint16x8_t lane_mask(std::int32_t count) {
  constexpr std::uint16_t kIndex[8] = {0, 1, 2, 3, 4, 5, 6, 7};
  return vcltq_u16(vld1q_u16(kIndex),
                   vdupq_n_u16(static_cast<std::uint16_t>(count < 8 ? count : 8)));
}

// (tap * weight + dither) >> 22, in 32 bits.
inline uint16x8_t increments(uint16x8_t tap_q15, std::uint32_t weight_q7, uint16x8_t dither) {
  const auto weight = static_cast<std::uint16_t>(weight_q7);
  const uint32x4_t low =
      vmlal_n_u16(vshll_n_u16(vget_low_u16(dither), 6), vget_low_u16(tap_q15), weight);
  const uint32x4_t high =
      vmlal_n_u16(vshll_n_u16(vget_high_u16(dither), 6), vget_high_u16(tap_q15), weight);
  return vshrq_n_u16(vcombine_u16(vshrn_n_u32(low, 16), vshrn_n_u32(high, 16)), 6);
}

// Adds eight pairs of increments.
inline void accumulate(Voxel* voxels, uint16x8_t hit, uint16x8_t miss) {
  auto* const halves = reinterpret_cast<std::uint16_t*>(voxels);
  uint16x8x2_t pairs = vld2q_u16(halves);
  pairs.val[0] = vqaddq_u16(pairs.val[0], hit);
  pairs.val[1] = vqaddq_u16(pairs.val[1], miss);
  vst2q_u16(halves, pairs);
}

}  // namespace vector

inline void add_shell(Voxel* voxels, const std::int16_t* taps, std::int32_t count,
                      std::uint32_t first, const Evidence& evidence, std::uint32_t dither_base) {
  uint16x8_t dither = vector::dither_lanes(dither_base + first * kDitherStep);
  for (std::int32_t i = 0; i < count; i += 8) {
    // A tap of zero adds nothing.
    const uint16x8_t tap =
        vandq_u16(vreinterpretq_u16_s16(vld1q_s16(taps + i)), vector::lane_mask(count - i));
    vector::accumulate(voxels + i, vector::increments(tap, evidence.hit_q7, dither),
                       vector::increments(tap, evidence.miss_q7, dither));
    dither = vaddq_u16(dither, vdupq_n_u16(static_cast<std::uint16_t>(8U * kDitherStep)));
  }
}

inline void add_shell_taps(Voxel* voxels, const std::int16_t (&row)[kKernelTaps],
                           std::int32_t first, std::int32_t count, std::uint32_t dither_start,
                           const Evidence& evidence) {
  add_shell(voxels, row + first, count, 0, evidence, dither_start);
}

inline void add_uniform(Voxel* voxels, std::int32_t count, std::uint32_t first,
                        const Evidence& evidence, std::uint32_t dither_base) {
  const uint16x8_t hit_value = vdupq_n_u16(static_cast<std::uint16_t>(2U * evidence.hit_q7));
  const uint16x8_t miss_value = vdupq_n_u16(static_cast<std::uint16_t>(2U * evidence.miss_q7));
  uint16x8_t dither = vector::dither_lanes(dither_base + first * kDitherStep);
  for (std::int32_t i = 0; i < count; i += 8) {
    const uint16x8_t high = vshrq_n_u16(dither, 8);
    const uint16x8_t mask = vector::lane_mask(count - i);
    vector::accumulate(voxels + i, vandq_u16(vshrq_n_u16(vaddq_u16(hit_value, high), 8), mask),
                       vandq_u16(vshrq_n_u16(vaddq_u16(miss_value, high), 8), mask));
    dither = vaddq_u16(dither, vdupq_n_u16(static_cast<std::uint16_t>(8U * kDitherStep)));
  }
}

#elif defined(LEADLINE_KERNELS_SIMD32)

// A voxel is one register, its halves two lanes of 16 bits that saturate alike.
namespace vector {

inline std::uint32_t load(const Voxel* voxel) {
  std::uint32_t halves = 0;
  std::memcpy(&halves, __builtin_assume_aligned(voxel, alignof(std::uint32_t)), sizeof halves);
  return halves;
}
inline void store(Voxel* voxel, std::uint32_t halves) {
  std::memcpy(__builtin_assume_aligned(voxel, alignof(std::uint32_t)), &halves, sizeof halves);
}

// What a run adds to each voxel: whole units, and one more where the dither carries out of the rest.
struct Uniform {
  std::uint32_t rest_q16;  // of a unit, both halves
  std::uint32_t units;
  std::uint32_t units_and_one;
};

constexpr std::uint32_t kDitherSteps = kDitherStep << 16U | kDitherStep;

// What a run adds to one voxel.
inline std::uint32_t units_of(const Uniform& run, std::uint32_t dither) {
  static_cast<void>(__uadd16(dither, run.rest_q16));  // its carries choose
  return __sel(run.units_and_one, run.units);
}

inline void add_one(Voxel* voxel, const Uniform& run, std::uint32_t& dither) {
  store(voxel, __uqadd16(load(voxel), units_of(run, dither)));
  dither = __uadd16(dither, kDitherSteps);
}

// Two voxels whose halves against are added to: the lanes of `run` and of `dither` are theirs.
inline void add_two_misses(Voxel* voxels, const Uniform& run, std::uint32_t& dither) {
  const std::uint32_t both = units_of(run, dither);
  store(voxels, __uqadd16(load(voxels), both << 16U));
  store(voxels + 1, __uqadd16(load(voxels + 1), both & 0xFFFF0000U));
  dither = __uadd16(dither, (kDitherStep << 17U) | ((2U * kDitherStep) & 0xFFFFU));
}

// The step of four voxels: eighteen instructions. In assembly, as the compiler neither loads nor stores several
// words at once here, and moves the steps into each other until registers run out.
// Only where it has been measured, on the M profile: for a Linux ARM gcc 12 does not always find a register for every
// operand, and not optimized it never does.
#if defined(__OPTIMIZE__) && defined(__ARM_ARCH_PROFILE) && __ARM_ARCH_PROFILE == 'M'
#define LEADLINE_FOUR_IN_ASSEMBLY 1
#else
#define LEADLINE_FOUR_IN_ASSEMBLY 0
#endif
inline void add_four(Voxel*& voxels, const Uniform& run, std::uint32_t& dither) {
#if LEADLINE_FOUR_IN_ASSEMBLY
  std::uint32_t units = 0;
  asm volatile(
      "ldmia %[at], {r0, r1, r2, r3}\n\t"
      "uadd16 %[units], %[dither], %[rest]\n\t"
      "sel %[units], %[more], %[less]\n\t"
      "uadd16 %[dither], %[dither], %[step]\n\t"
      "uqadd16 r0, r0, %[units]\n\t"
      "uadd16 %[units], %[dither], %[rest]\n\t"
      "sel %[units], %[more], %[less]\n\t"
      "uadd16 %[dither], %[dither], %[step]\n\t"
      "uqadd16 r1, r1, %[units]\n\t"
      "uadd16 %[units], %[dither], %[rest]\n\t"
      "sel %[units], %[more], %[less]\n\t"
      "uadd16 %[dither], %[dither], %[step]\n\t"
      "uqadd16 r2, r2, %[units]\n\t"
      "uadd16 %[units], %[dither], %[rest]\n\t"
      "sel %[units], %[more], %[less]\n\t"
      "uadd16 %[dither], %[dither], %[step]\n\t"
      "uqadd16 r3, r3, %[units]\n\t"
      "stmia %[at]!, {r0, r1, r2, r3}"
      : [at] "+r"(voxels), [dither] "+r"(dither), [units] "=&r"(units)
      : [rest] "r"(run.rest_q16), [more] "r"(run.units_and_one), [less] "r"(run.units),
        [step] "r"(kDitherSteps)
      : "r0", "r1", "r2", "r3", "cc", "memory");
#else
  for (int i = 0; i < 4; ++i, ++voxels) {
    add_one(voxels, run, dither);
  }
#endif
}

// The same where only the halves against are added to, which is what log-odds ask for: one step of the dither
// serves two voxels, sixteen instructions for four. The lanes of `run` and of `dither` are those of two
// neighbours here.
inline void add_four_misses(Voxel*& voxels, const Uniform& run, std::uint32_t& dither) {
#if LEADLINE_FOUR_IN_ASSEMBLY
  constexpr std::uint32_t kStep = (2U * kDitherStep) & 0xFFFFU;
  std::uint32_t first = 0;
  std::uint32_t second = 0;
  asm volatile(
      "ldmia %[at], {r0, r1, r2, r3}\n\t"
      "uadd16 %[second], %[dither], %[rest]\n\t"
      "sel %[second], %[more], %[less]\n\t"
      "uadd16 %[dither], %[dither], %[step]\n\t"
      "lsl %[first], %[second], #16\n\t"
      "bfc %[second], #0, #16\n\t"
      "uqadd16 r0, r0, %[first]\n\t"
      "uqadd16 r1, r1, %[second]\n\t"
      "uadd16 %[second], %[dither], %[rest]\n\t"
      "sel %[second], %[more], %[less]\n\t"
      "uadd16 %[dither], %[dither], %[step]\n\t"
      "lsl %[first], %[second], #16\n\t"
      "bfc %[second], #0, #16\n\t"
      "uqadd16 r2, r2, %[first]\n\t"
      "uqadd16 r3, r3, %[second]\n\t"
      "stmia %[at]!, {r0, r1, r2, r3}"
      : [at] "+r"(voxels), [dither] "+r"(dither), [first] "=&r"(first), [second] "=&r"(second)
      : [rest] "r"(run.rest_q16), [more] "r"(run.units_and_one), [less] "r"(run.units),
        [step] "r"(kStep << 16U | kStep)
      : "r0", "r1", "r2", "r3", "cc", "memory");
#else
  for (int i = 0; i < 4; i += 2, voxels += 2) {
    add_two_misses(voxels, run, dither);
  }
#endif
}

constexpr std::uint32_t kDitherStep_q32 = kDitherStep << 16U;

// What one half gets of a tap: both factors have 15 bits.
inline std::uint32_t units_of_tap(std::uint32_t tap_q15, std::uint32_t weight_q7,
                                  std::uint32_t dither_q32) {
  return (tap_q15 * weight_q7 + (dither_q32 >> 10U)) >> 22U;
}

// One tap that speaks for a surface, and two: fifteen instructions where the compiler's own are twenty.
inline void add_tap(Voxel*& voxels, const std::int16_t*& taps, std::uint32_t weight_q7,
                    std::uint32_t& dither_q32) {
  const auto tap = static_cast<std::uint16_t>(*taps);
  store(voxels, __uqadd16(load(voxels), units_of_tap(tap, weight_q7, dither_q32)));
  dither_q32 += kDitherStep_q32;
  ++taps;
  ++voxels;
}
inline void add_two_taps(Voxel*& voxels, const std::int16_t*& taps, std::uint32_t weight_q7,
                         std::uint32_t& dither_q32) {
#if LEADLINE_FOUR_IN_ASSEMBLY
  std::uint32_t pair = 0;
  std::uint32_t units = 0;
  asm volatile(
      "ldr %[pair], [%[taps]], #4\n\t"  // a word may lie at any half
      "ldrd r0, r1, [%[at]]\n\t"
      "lsr %[units], %[dither], #10\n\t"
      "smlabb %[units], %[pair], %[weight], %[units]\n\t"
      "add %[dither], %[dither], %[step]\n\t"
      "lsr %[units], %[units], #22\n\t"
      "uqadd16 r0, r0, %[units]\n\t"
      "lsr %[units], %[dither], #10\n\t"
      "smlatb %[units], %[pair], %[weight], %[units]\n\t"
      "add %[dither], %[dither], %[step]\n\t"
      "lsr %[units], %[units], #22\n\t"
      "uqadd16 r1, r1, %[units]\n\t"
      "strd r0, r1, [%[at]], #8"
      : [at] "+r"(voxels), [taps] "+r"(taps), [dither] "+r"(dither_q32), [pair] "=&r"(pair),
        [units] "=&r"(units)
      : [weight] "r"(weight_q7), [step] "r"(kDitherStep_q32)
      : "r0", "r1", "memory");
#else
  add_tap(voxels, taps, weight_q7, dither_q32);
  add_tap(voxels, taps, weight_q7, dither_q32);
#endif
}

}  // namespace vector

inline void add_shell(Voxel* voxels, const std::int16_t* taps, std::int32_t count,
                      std::uint32_t first, const Evidence& evidence, std::uint32_t dither_base) {
  std::uint32_t dither_q32 = (dither_base + first * kDitherStep) << 16U;
  const std::int16_t* const end = taps + count;
  // What log-odds always ask for.
  if (evidence.miss_q7 == 0) {
    if ((count & 1) != 0) {
      vector::add_tap(voxels, taps, evidence.hit_q7, dither_q32);
    }
    while (taps < end) {
      vector::add_two_taps(voxels, taps, evidence.hit_q7, dither_q32);
    }
    return;
  }
  for (; taps < end; ++taps, ++voxels) {
    const auto tap = static_cast<std::uint16_t>(*taps);
    const std::uint32_t hit = vector::units_of_tap(tap, evidence.hit_q7, dither_q32);
    const std::uint32_t miss = vector::units_of_tap(tap, evidence.miss_q7, dither_q32);
    vector::store(voxels, __uqadd16(vector::load(voxels), miss << 16U | hit));
    dither_q32 += vector::kDitherStep_q32;
  }
}

inline void add_shell_taps(Voxel* voxels, const std::int16_t (&row)[kKernelTaps],
                           std::int32_t first, std::int32_t count, std::uint32_t dither_start,
                           const Evidence& evidence) {
  add_shell(voxels, row + first, count, 0, evidence, dither_start);
}

// The dithers of two neighbours.
struct RunDither {
  explicit RunDither(std::uint32_t start)
      : lanes((start & 0xFFFFU) | (start + kDitherStep) << 16U) {}
  std::uint32_t lanes;
};

namespace vector {

template <int kCount>
inline void add_fours(Voxel*& voxels, const Uniform& run, std::uint32_t& dither) {
  add_four_misses(voxels, run, dither);
  if constexpr (kCount > 1) {
    add_fours<kCount - 1>(voxels, run, dither);
  }
}

}  // namespace vector

// Inline, or what surrounds the call costs a run more than four of its voxels.
[[gnu::always_inline]] inline void add_misses(Voxel* voxels, std::int32_t count,
                                              std::uint32_t miss_q7, RunDither& dither) {
  constexpr std::int32_t kWhole = 24;  // a whole run of a cone
  const std::uint32_t units = (miss_q7 >> 7U) * 0x00010001U;
  const vector::Uniform run{((miss_q7 & 0x7FU) << 9U) * 0x00010001U, units, units + 0x00010001U};
  std::uint32_t lanes = dither.lanes;
  for (; count > kWhole; count -= kWhole) {
    vector::add_fours<6>(voxels, run, lanes);
  }
  if (count == kWhole) {
    vector::add_fours<6>(voxels, run, lanes);
    dither.lanes = lanes;
    return;
  }
  if ((count & 16) != 0) {
    vector::add_fours<4>(voxels, run, lanes);
  }
  if ((count & 8) != 0) {
    vector::add_fours<2>(voxels, run, lanes);
  }
  if ((count & 4) != 0) {
    vector::add_fours<1>(voxels, run, lanes);
  }
  if ((count & 2) != 0) {
    vector::add_two_misses(voxels, run, lanes);
    voxels += 2;
  }
  dither.lanes = lanes;
  if ((count & 1) != 0) {
    vector::store(voxels, __uqadd16(vector::load(voxels), vector::units_of(run, lanes) << 16U));
  }
}

inline void add_uniform(Voxel* voxels, std::int32_t count, std::uint32_t first,
                        const Evidence& evidence, std::uint32_t dither_base) {
  if (evidence.hit_q7 == 0) {
    RunDither dither(dither_base + first * kDitherStep);
    add_misses(voxels, count, evidence.miss_q7, dither);
    return;
  }
  const std::uint32_t weights_q7 = evidence.miss_q7 << 16U | evidence.hit_q7;
  const std::uint32_t units = (weights_q7 >> 7U) & 0x01FF01FFU;
  const vector::Uniform run{(weights_q7 & 0x007F007FU) << 9U, units, units + 0x00010001U};
  const std::uint32_t start = (dither_base + first * kDitherStep) & 0xFFFFU;
  std::uint32_t dither = start << 16U | start;
  for (; count >= 8; count -= 8) {
    vector::add_four(voxels, run, dither);
    vector::add_four(voxels, run, dither);
  }
  if ((count & 4) != 0) {
    vector::add_four(voxels, run, dither);
  }
  if ((count & 2) != 0) {
    vector::add_one(voxels, run, dither);
    vector::add_one(voxels + 1, run, dither);
    voxels += 2;
  }
  if ((count & 1) != 0) {
    vector::add_one(voxels, run, dither);
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

#if !defined(LEADLINE_KERNELS_SIMD32)

struct RunDither {
  explicit RunDither(std::uint32_t start) : next(start) {}
  std::uint32_t next;
};

inline void add_misses(Voxel* voxels, std::int32_t count, std::uint32_t miss_q7,
                       RunDither& dither) {
  add_uniform(voxels, count, 0, Evidence{0, miss_q7}, dither.next);
  dither.next += static_cast<std::uint32_t>(count) * kDitherStep;
}

#endif

}  // namespace leadline::model
