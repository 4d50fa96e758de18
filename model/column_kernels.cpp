#include "model/column_kernels.hpp"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace leadline::model {

void add_shell_scalar(Voxel* voxels, const std::int16_t* taps, std::int32_t count,
                      std::uint32_t first, const Evidence& evidence, std::uint32_t dither_base) {
  for (std::int32_t i = 0; i < count; ++i) {
    const auto tap = static_cast<std::uint32_t>(taps[i]);
    const std::uint32_t dither = dither_q22(dither_base, first + static_cast<std::uint32_t>(i));
    voxels[i].hit = add_saturated(voxels[i].hit, (tap * evidence.hit_q7 + dither) >> 22U);
    voxels[i].miss = add_saturated(voxels[i].miss, (tap * evidence.miss_q7 + dither) >> 22U);
  }
}

void add_uniform_scalar(Voxel* voxels, std::int32_t count, std::uint32_t first,
                        const Evidence& evidence, std::uint32_t dither_base) {
  for (std::int32_t i = 0; i < count; ++i) {
    const std::uint32_t dither = dither_q22(dither_base, first + static_cast<std::uint32_t>(i));
    voxels[i].hit = add_saturated(voxels[i].hit, ((evidence.hit_q7 << 15U) + dither) >> 22U);
    voxels[i].miss = add_saturated(voxels[i].miss, ((evidence.miss_q7 << 15U) + dither) >> 22U);
  }
}

#if defined(__SSE2__)

namespace {

// Dithers of the four voxels from `k` on.
inline __m128i dither_lanes(std::uint32_t base, std::uint32_t k) {
  const __m128i start = _mm_set1_epi32(static_cast<int>(base + k * kDitherStep));
  const __m128i lanes = _mm_set_epi32(static_cast<int>(3U * kDitherStep), static_cast<int>(2U * kDitherStep),
                                      static_cast<int>(kDitherStep), 0);
  return _mm_add_epi32(start, lanes);
}

inline __m128i pack_halves(__m128i hit, __m128i miss) {
  return _mm_or_si128(hit, _mm_slli_epi32(miss, 16));
}

// All ones in the first `count` of four lanes.
inline __m128i lane_mask(std::int32_t count) {
  return _mm_cmpgt_epi32(_mm_set1_epi32(count), _mm_set_epi32(3, 2, 1, 0));
}

inline void accumulate(Voxel* voxels, __m128i increment) {
  auto* address = reinterpret_cast<__m128i*>(voxels);
  _mm_storeu_si128(address, _mm_adds_epu16(_mm_loadu_si128(address), increment));
}

}  // namespace

void add_shell(Voxel* voxels, const std::int16_t* taps, std::int32_t count, std::uint32_t first,
               const Evidence& evidence, std::uint32_t dither_base) {
  const __m128i hit_weight = _mm_set1_epi32(static_cast<int>(evidence.hit_q7));
  const __m128i miss_weight = _mm_set1_epi32(static_cast<int>(evidence.miss_q7));
  const __m128i step = _mm_set1_epi32(static_cast<int>(4U * kDitherStep));
  __m128i lanes = dither_lanes(dither_base, first);
  for (std::int32_t i = 0; i < count; i += 4) {
    const __m128i tap = _mm_unpacklo_epi16(
        _mm_loadl_epi64(reinterpret_cast<const __m128i*>(taps + i)), _mm_setzero_si128());
    const __m128i dither = _mm_srli_epi32(lanes, 10);
    const __m128i hit =
        _mm_srli_epi32(_mm_add_epi32(_mm_madd_epi16(tap, hit_weight), dither), 22);
    const __m128i miss =
        _mm_srli_epi32(_mm_add_epi32(_mm_madd_epi16(tap, miss_weight), dither), 22);
    const __m128i increment = pack_halves(hit, miss);
    accumulate(voxels + i, _mm_and_si128(increment, lane_mask(count - i)));
    lanes = _mm_add_epi32(lanes, step);
  }
}

void add_uniform(Voxel* voxels, std::int32_t count, std::uint32_t first, const Evidence& evidence,
                 std::uint32_t dither_base) {
  const __m128i hit_value = _mm_set1_epi32(static_cast<int>(evidence.hit_q7 << 15U));
  const __m128i miss_value = _mm_set1_epi32(static_cast<int>(evidence.miss_q7 << 15U));
  const __m128i step = _mm_set1_epi32(static_cast<int>(4U * kDitherStep));
  __m128i lanes = dither_lanes(dither_base, first);
  for (std::int32_t i = 0; i < count; i += 4) {
    const __m128i dither = _mm_srli_epi32(lanes, 10);
    const __m128i hit = _mm_srli_epi32(_mm_add_epi32(hit_value, dither), 22);
    const __m128i miss = _mm_srli_epi32(_mm_add_epi32(miss_value, dither), 22);
    accumulate(voxels + i, _mm_and_si128(pack_halves(hit, miss), lane_mask(count - i)));
    lanes = _mm_add_epi32(lanes, step);
  }
}

#else

void add_shell(Voxel* voxels, const std::int16_t* taps, std::int32_t count, std::uint32_t first,
               const Evidence& evidence, std::uint32_t dither_base) {
  add_shell_scalar(voxels, taps, count, first, evidence, dither_base);
}

void add_uniform(Voxel* voxels, std::int32_t count, std::uint32_t first, const Evidence& evidence,
                 std::uint32_t dither_base) {
  add_uniform_scalar(voxels, count, first, evidence, dither_base);
}

#endif

}  // namespace leadline::model
