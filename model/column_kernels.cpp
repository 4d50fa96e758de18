#include "model/column_kernels.hpp"

#include "model/base/fixed.hpp"

namespace leadline::model {
namespace {

using base::rounded_units;
using base::saturated_sum;

constexpr std::uint32_t kWholeTap_q15 = 32768;

// Smoothing multiplies by at most 9: evidence is brought below 2^11 to stay within 15 bits.
constexpr int kSmoothBits = 11;

// The other rules leave traces of empty evidence in both halves: there the difference speaks.
bool reads_hits(Rule rule) { return rule == Rule::kLogOdds || rule == Rule::kCertaintyFactor; }

unsigned smoothing_shift(std::uint32_t largest) {
  return static_cast<unsigned>(base::max_of(0, 32 - base::leading_zeros(largest) - kSmoothBits));
}

}  // namespace

ProfileSummary gather_profile_scalar(const Voxel* voxels, std::int32_t depth_cells, Rule rule,
                                     std::uint16_t* evidence, std::uint16_t* smoothed) {
  ProfileSummary out{0, 0, 0};
  std::uint32_t largest = 0;
  for (std::int32_t i = 1; i <= kProfileGuard; ++i) {
    evidence[-i] = 0;
    evidence[depth_cells - 1 + i] = 0;
  }
  for (std::int32_t k = 0; k < depth_cells; ++k) {
    const std::uint32_t hit = voxels[k].hit;
    const std::uint32_t miss = voxels[k].miss;
    // What speaks more against a surface than for it is none.
    const std::uint32_t value = miss > hit ? 0U : (reads_hits(rule) ? hit : hit - miss);
    evidence[k] = static_cast<std::uint16_t>(value);
    out.mass += value;
    largest = base::max_of(largest, value);
  }
  out.shift = smoothing_shift(largest);
  const auto at = [evidence, &out](std::int32_t k) {
    return static_cast<std::uint32_t>(evidence[k]) >> out.shift;
  };
  for (std::int32_t k = 0; k < depth_cells; ++k) {
    const std::uint32_t value =
        at(k - 2) + 2U * at(k - 1) + 3U * at(k) + 2U * at(k + 1) + at(k + 2);
    smoothed[k] = static_cast<std::uint16_t>(value);
    out.peak = base::max_of(out.peak, value);
  }
  return out;
}

namespace {

// Whether none of the kGroup voxels from here on has a hit.
constexpr std::int32_t kGroup = 8;
#if defined(LEADLINE_KERNELS_SSE2)
bool no_hits(const Voxel* voxels) {
  const __m128i any = _mm_or_si128(vector::load(voxels), vector::load(voxels + 4));
  return _mm_movemask_epi8(_mm_cmpeq_epi32(_mm_slli_epi32(any, 16), _mm_setzero_si128())) == 0xFFFF;
}
#elif defined(LEADLINE_KERNELS_SIMD32)
bool no_hits(const Voxel* voxels) {
  using vector::load;
  const std::uint32_t any = load(voxels) | load(voxels + 1) | load(voxels + 2) | load(voxels + 3) |
                            load(voxels + 4) | load(voxels + 5) | load(voxels + 6) |
                            load(voxels + 7);
  return any << 16U == 0;
}
#else
bool no_hits(const Voxel* voxels) {
  return (voxels[0].hit | voxels[1].hit | voxels[2].hit | voxels[3].hit | voxels[4].hit |
          voxels[5].hit | voxels[6].hit | voxels[7].hit) == 0;
}
#endif

}  // namespace

HitSpan hit_span(const Voxel* voxels, std::int32_t depth_cells) {
  const Voxel* first = voxels;
  const Voxel* end = voxels + depth_cells;
  while (first < end && no_hits(first)) {
    first += kGroup;
  }
  while (first < end && first->hit == 0) {
    ++first;
  }
  while (end - first >= kGroup && no_hits(end - kGroup)) {
    end -= kGroup;
  }
  while (end > first && end[-1].hit == 0) {
    --end;
  }
  return HitSpan{static_cast<std::int32_t>(first - voxels),
                 static_cast<std::int32_t>(end - voxels)};
}

void add_shell_scalar(Voxel* voxels, const std::int16_t* taps, std::int32_t count,
                      std::uint32_t first, const Evidence& evidence, std::uint32_t dither_base) {
  for (std::int32_t i = 0; i < count; ++i) {
    const auto tap = static_cast<std::uint32_t>(taps[i]);
    const std::uint32_t dither = dither_q22(dither_base, first + static_cast<std::uint32_t>(i));
    voxels[i].hit = saturated_sum(voxels[i].hit, rounded_units(tap, evidence.hit_q7, dither));
    voxels[i].miss = saturated_sum(voxels[i].miss, rounded_units(tap, evidence.miss_q7, dither));
  }
}

void add_uniform_scalar(Voxel* voxels, std::int32_t count, std::uint32_t first,
                        const Evidence& evidence, std::uint32_t dither_base) {
  for (std::int32_t i = 0; i < count; ++i) {
    const std::uint32_t dither = dither_q22(dither_base, first + static_cast<std::uint32_t>(i));
    voxels[i].hit =
        saturated_sum(voxels[i].hit, rounded_units(kWholeTap_q15, evidence.hit_q7, dither));
    voxels[i].miss =
        saturated_sum(voxels[i].miss, rounded_units(kWholeTap_q15, evidence.miss_q7, dither));
  }
}

namespace {

constexpr std::uint32_t kFull = 65535;
constexpr std::uint32_t kOne_q15 = 32768;

// The source's recursive filter, on the two halves; they round in opposite directions, so that their sum
// does not wander.
void pull_recursive(Voxel& voxel, std::uint32_t share_q15, std::uint32_t signal_q16,
                    std::uint32_t dither_q15) {
  voxel.hit = base::pulled_half(voxel.hit, signal_q16, share_q15, dither_q15);
  voxel.miss =
      base::pulled_half(voxel.miss, kFull - signal_q16, share_q15, kOne_q15 - 1 - dither_q15);
}

// The certainty factor x = hit - miss.
void pull_certainty(Voxel& voxel, std::uint32_t share_q15, std::uint32_t signal_q16,
                    std::uint32_t dither_q15) {
  const std::int32_t x = base::pulled_certainty(
      voxel.hit - voxel.miss, static_cast<std::int32_t>(signal_q16),
      static_cast<std::int32_t>(share_q15), static_cast<std::int32_t>(dither_q15));
  voxel.hit = static_cast<std::uint16_t>(x > 0 ? x : 0);
  voxel.miss = static_cast<std::uint16_t>(x < 0 ? -x : 0);
}

template <typename Share>
void pull_run(Rule rule, Voxel* voxels, std::int32_t count, std::uint32_t first, const Pull& pull,
              std::uint32_t dither_base, Share share_q15) {
  for (std::int32_t i = 0; i < count; ++i) {
    const std::uint32_t dither_q15 =
        dither_q22(dither_base, first + static_cast<std::uint32_t>(i)) >> 7U;
    const std::uint32_t share = base::min_of(share_q15(i), kOne_q15);
    if (rule == Rule::kRecursive) {
      pull_recursive(voxels[i], share, pull.signal_q16, dither_q15);
    } else {
      pull_certainty(voxels[i], share, pull.signal_q16, dither_q15);
    }
  }
}

}  // namespace

void pull_shell(Rule rule, Voxel* voxels, const std::int16_t* taps, std::int32_t count,
                std::uint32_t first, const Pull& pull, std::uint32_t dither_base) {
  const std::uint64_t gain_q15 = pull.gain_q15;
  pull_run(rule, voxels, count, first, pull, dither_base, [taps, gain_q15](std::int32_t i) {
    return static_cast<std::uint32_t>(base::min_of<std::uint64_t>(
        (gain_q15 * static_cast<std::uint32_t>(taps[i])) >> 15U, kOne_q15));
  });
}

void pull_uniform(Rule rule, Voxel* voxels, std::int32_t count, std::uint32_t first,
                  const Pull& pull, std::uint32_t dither_base) {
  const std::uint32_t share_q15 = base::min_of(pull.gain_q15, kOne_q15);
  pull_run(rule, voxels, count, first, pull, dither_base,
           [share_q15](std::int32_t) { return share_q15; });
}

#if defined(LEADLINE_KERNELS_SSE2)

namespace {

using vector::load;
using vector::store;

// Hit (or miss) halves of eight voxels as 16-bit lanes: sign-extended so that packing keeps the bits.
inline __m128i low_halves(__m128i a, __m128i b) {
  return _mm_packs_epi32(_mm_srai_epi32(_mm_slli_epi32(a, 16), 16),
                         _mm_srai_epi32(_mm_slli_epi32(b, 16), 16));
}
inline __m128i high_halves(__m128i a, __m128i b) {
  return _mm_packs_epi32(_mm_srai_epi32(a, 16), _mm_srai_epi32(b, 16));
}

}  // namespace

ProfileSummary gather_profile(const Voxel* voxels, std::int32_t depth_cells, Rule rule,
                              std::uint16_t* evidence, std::uint16_t* smoothed) {
  const __m128i zero = _mm_setzero_si128();
  store(evidence - 8, zero);
  __m128i sum = zero;
  __m128i any = zero;  // OR of all evidence: its leading bit is that of the largest
  const bool hits_only = reads_hits(rule);
  for (std::int32_t k = 0; k < depth_cells; k += 8) {
    const __m128i a = load(voxels + k);
    const __m128i b = load(voxels + k + 4);
    const __m128i hit = low_halves(a, b);
    const __m128i miss = high_halves(a, b);
    __m128i value;
    if (hits_only) {
      value = _mm_and_si128(hit, _mm_cmpeq_epi16(_mm_subs_epu16(miss, hit), zero));
    } else {
      value = _mm_subs_epu16(hit, miss);
    }
    if (k + 8 > depth_cells) {
      // The next column's voxels do not belong here.
      const __m128i lanes = _mm_set_epi16(7, 6, 5, 4, 3, 2, 1, 0);
      value = _mm_and_si128(
          value,
          _mm_cmpgt_epi16(_mm_set1_epi16(static_cast<std::int16_t>(depth_cells - k)), lanes));
    }
    store(evidence + k, value);
    any = _mm_or_si128(any, value);
    sum = _mm_add_epi32(
        sum, _mm_add_epi32(_mm_unpacklo_epi16(value, zero), _mm_unpackhi_epi16(value, zero)));
  }
  store(evidence + depth_cells, zero);
  store(evidence + depth_cells + 8, zero);
  alignas(16) std::uint32_t sums[4];
  alignas(16) std::uint16_t bits[8];
  store(sums, sum);
  store(bits, any);
  ProfileSummary out{sums[0] + sums[1] + sums[2] + sums[3], 0, 0};
  std::uint32_t all = 0;
  for (const std::uint16_t lane : bits) {
    all |= lane;
  }
  out.shift = smoothing_shift(all);
  const __m128i shift = _mm_cvtsi32_si128(static_cast<int>(out.shift));
  __m128i peak = zero;
  for (std::int32_t k = 0; k < depth_cells; k += 8) {
    const auto at = [&](std::int32_t offset) {
      return _mm_srl_epi16(load(evidence + k + offset), shift);
    };
    const __m128i centre = at(0);
    const __m128i near = _mm_add_epi16(_mm_add_epi16(at(-1), at(1)), centre);
    __m128i value = _mm_add_epi16(_mm_add_epi16(near, near),
                                  _mm_add_epi16(centre, _mm_add_epi16(at(-2), at(2))));
    if (k + 8 > depth_cells) {
      const __m128i lanes = _mm_set_epi16(7, 6, 5, 4, 3, 2, 1, 0);
      value = _mm_and_si128(
          value,
          _mm_cmpgt_epi16(_mm_set1_epi16(static_cast<std::int16_t>(depth_cells - k)), lanes));
    }
    store(smoothed + k, value);
    peak = _mm_max_epi16(peak, value);
  }
  alignas(16) std::uint16_t peaks[8];
  store(peaks, peak);
  for (const std::uint16_t lane : peaks) {
    out.peak = base::max_of<std::uint32_t>(out.peak, lane);
  }
  return out;
}

#elif defined(LEADLINE_KERNELS_SIMD32)

namespace {

// Two neighbours of 16 bits; on this machine a word may lie at any half.
inline std::uint32_t load_pair(const std::uint16_t* at) {
  std::uint32_t pair = 0;
  std::memcpy(&pair, at, sizeof pair);
  return pair;
}
inline void store_pair(std::uint16_t* at, std::uint32_t pair) {
  std::memcpy(at, &pair, sizeof pair);
}

// The upper half of `before` and the lower one of `after`.
inline std::uint32_t between(std::uint32_t before, std::uint32_t after) {
  return before >> 16U | after << 16U;
}

template <bool kHitsOnly>
std::uint32_t gather_pairs(const Voxel* voxels, std::int32_t pairs, std::uint16_t* evidence,
                           std::uint32_t& mass) {
  std::uint32_t any = 0;
  std::uint32_t sum = 0;
  for (const std::uint16_t* const end = evidence + 2 * pairs; evidence < end;
       evidence += 2, voxels += 2) {
    const std::uint32_t first = vector::load(voxels);
    const std::uint32_t second = vector::load(voxels + 1);
    const std::uint32_t hits = (first & 0xFFFFU) | second << 16U;
    const std::uint32_t misses = first >> 16U | (second & 0xFFFF0000U);
    // What speaks more against a surface than for it is none: the difference's carries choose.
    const std::uint32_t difference = __usub16(hits, misses);
    const std::uint32_t value = __sel(kHitsOnly ? hits : difference, 0U);
    store_pair(evidence, value);
    any |= value;
    sum += (value & 0xFFFFU) + (value >> 16U);
  }
  mass = sum;
  return any;
}

}  // namespace

ProfileSummary gather_profile(const Voxel* voxels, std::int32_t depth_cells, Rule rule,
                              std::uint16_t* evidence, std::uint16_t* smoothed) {
  for (std::int32_t i = 2; i <= kProfileGuard; i += 2) {
    store_pair(evidence - i, 0);
    store_pair(evidence + depth_cells - 2 + i, 0);
  }
  const std::int32_t pairs = depth_cells / 2;
  ProfileSummary out{0, 0, 0};
  std::uint32_t any = reads_hits(rule) ? gather_pairs<true>(voxels, pairs, evidence, out.mass)
                                       : gather_pairs<false>(voxels, pairs, evidence, out.mass);
  const bool odd = (depth_cells & 1) != 0;
  const std::int32_t last = depth_cells - 1;
  if (odd) {
    const std::uint32_t hit = voxels[last].hit;
    const std::uint32_t miss = voxels[last].miss;
    const std::uint32_t value = miss > hit ? 0U : (reads_hits(rule) ? hit : hit - miss);
    evidence[last] = static_cast<std::uint16_t>(value);
    out.mass += value;
    any |= value;
  }
  out.shift = smoothing_shift((any | any >> 16U) & 0xFFFFU);
  const unsigned shift = out.shift;
  const std::uint32_t mask = (0xFFFFU >> shift) * 0x00010001U;
  const auto at = [evidence, shift, mask](std::int32_t k) {
    return (load_pair(evidence + k) >> shift) & mask;
  };
  std::uint32_t peaks = 0;
  std::uint32_t before = 0;
  std::uint32_t here = at(0);
  std::uint32_t left = between(before, here);
  // Sums stay below 2^15 in both lanes. The pair after the last is a guard's, or begins with the odd cell.
  const auto smooth = [&](std::int32_t k) {
    const std::uint32_t after = at(k + 2);
    const std::uint32_t right = between(here, after);
    const std::uint32_t near = left + right + here;
    const std::uint32_t value = 2U * near + here + before + after;
    before = here;
    here = after;
    left = right;
    return value;
  };
  std::int32_t k = 0;
  for (; k < 2 * pairs; k += 2) {
    const std::uint32_t value = smooth(k);
    store_pair(smoothed + k, value);
    static_cast<void>(__usub16(value, peaks));
    peaks = __sel(value, peaks);
  }
  out.peak = base::max_of(peaks & 0xFFFFU, peaks >> 16U);
  if (odd) {
    const std::uint32_t value = smooth(k) & 0xFFFFU;
    smoothed[last] = static_cast<std::uint16_t>(value);
    out.peak = base::max_of(out.peak, value);
  }
  return out;
}

#else

ProfileSummary gather_profile(const Voxel* voxels, std::int32_t depth_cells, Rule rule,
                              std::uint16_t* evidence, std::uint16_t* smoothed) {
  return gather_profile_scalar(voxels, depth_cells, rule, evidence, smoothed);
}

#endif

}  // namespace leadline::model
