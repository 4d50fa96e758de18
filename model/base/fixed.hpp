// Fixed-point arithmetic of the ping path. Everything here is total (defined for every input),
// branch-light, O(1), and gives the same bits on every target.
#pragma once

#include <array>
#include <cstdint>

#include "model/base/units.hpp"

namespace leadline::base {

inline constexpr std::int32_t kOne_q30 = 1 << 30;

/// Number of leading zero bits; 32 for 0.
[[nodiscard]] constexpr int leading_zeros(std::uint32_t value) {
  return value == 0 ? 32 : __builtin_clz(value);
}
/// Number of leading zero bits; 64 for 0.
[[nodiscard]] constexpr int leading_zeros64(std::uint64_t value) {
  return value == 0 ? 64 : __builtin_clzll(value);
}

/// `value` limited to [low, high].
template <typename T>
[[nodiscard]] constexpr T clamp(T value, T low, T high) {
  return value < low ? low : (value > high ? high : value);
}

template <typename T>
[[nodiscard]] constexpr T min_of(T a, T b) {
  return b < a ? b : a;
}
template <typename T>
[[nodiscard]] constexpr T max_of(T a, T b) {
  return a < b ? b : a;
}

/// Product of two fixed-point numbers, shifted down, rounded towards minus infinity. The caller
/// guarantees that the product fits 64 bits; each use states its ranges.
[[nodiscard]] constexpr std::int64_t mul_shift(std::int64_t a, std::int64_t b, int shift) {
  return (a * b) >> shift;
}

/// floor(value / 2^16) of a Q16 number.
[[nodiscard]] constexpr std::int32_t floor_q16(std::int32_t value_q16) { return value_q16 >> 16; }
/// ceil(value / 2^16) of a Q16 number; value_q16 <= INT32_MAX - 65535.
[[nodiscard]] constexpr std::int32_t ceil_q16(std::int32_t value_q16) {
  return (value_q16 + 0xFFFF) >> 16;
}

// Starting values for the square root: sqrt of the middle of [i, i+1) * 2^24, for i in 64..255.
constexpr std::array<std::uint16_t, 256> make_sqrt_table() {
  std::array<std::uint16_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    const std::uint64_t target = (static_cast<std::uint64_t>(i) << 24U) + (1ULL << 23U);
    std::uint64_t root = 0;
    for (std::uint64_t bit = 1ULL << 16U; bit != 0; bit >>= 1U) {
      if ((root + bit) * (root + bit) <= target) {
        root += bit;
      }
    }
    table[i] = static_cast<std::uint16_t>(root > 0xFFFF ? 0xFFFF : root);
  }
  return table;
}

inline constexpr auto kSqrtTable = make_sqrt_table();

/// Square root, relative error below 2^-15 (exact for squares below 2^16). A normalized 8-bit table
/// start and one Newton step: one 32-bit division.
[[nodiscard]] inline std::uint32_t sqrt_u32(std::uint32_t value) {
  if (value == 0) {
    return 0;
  }
  const int shift = leading_zeros(value) & ~1;  // even, so that the root shifts by half of it
  const std::uint32_t x = value << static_cast<unsigned>(shift);
  std::uint32_t root = kSqrtTable[x >> 24U];
  // The step rounds the largest arguments up to 2^16: kept to 16 bits, so that sqrt_u64 can shift it.
  root = min_of<std::uint32_t>((root + x / root) >> 1U, 0xFFFFU);
  return root >> static_cast<unsigned>(shift / 2);
}
/// The same for 64 bits: relative error below 2^-14.
[[nodiscard]] inline std::uint32_t sqrt_u64(std::uint64_t value) {
  if ((value >> 32U) == 0) {
    return sqrt_u32(static_cast<std::uint32_t>(value));
  }
  const int shift = (33 - leading_zeros64(value)) & ~1;  // brings the value below 2^32, even
  return sqrt_u32(static_cast<std::uint32_t>(value >> static_cast<unsigned>(shift)))
         << static_cast<unsigned>(shift / 2);
}

/// numerator / denominator * 2^shift, saturated to 32 bits signed; 0 when denominator <= 0. The
/// quotient keeps at least 24 significant bits.
[[nodiscard]] inline std::int32_t ratio(std::int64_t numerator, std::int64_t denominator,
                                        int shift) {
  if (denominator <= 0) {
    return 0;
  }
  const bool negative = numerator < 0;
  std::uint64_t n =
      negative ? 0 - static_cast<std::uint64_t>(numerator) : static_cast<std::uint64_t>(numerator);
  if (n == 0) {
    return 0;  // no leading bit to align by
  }
  auto d = static_cast<std::uint64_t>(denominator);
  // Bring the denominator to at most 32 bits and the numerator as high as it goes: then one division.
  const int lower = 32 - leading_zeros64(d);
  if (lower > 0) {
    d >>= static_cast<unsigned>(lower);
    shift -= lower;
  }
  const int room = leading_zeros64(n);
  int up = min_of(shift, room);
  if (shift < 0) {
    up = 0;
    n = shift > -64 ? n >> static_cast<unsigned>(-shift) : 0;
    shift = 0;
  }
  n <<= static_cast<unsigned>(up);
  std::uint64_t q = n / d;
  const int rest = shift - up;
  if (rest > 0) {
    q = rest >= leading_zeros64(q) ? 0x7FFFFFFFFFFFFFFFULL : q << static_cast<unsigned>(rest);
  }
  const std::uint64_t limit = 0x7FFFFFFFULL;
  const auto magnitude = static_cast<std::int32_t>(q > limit ? limit : q);
  return negative ? -magnitude : magnitude;
}

/// Sine and cosine in Q30 of a binary angle: absolute error below kSineError_q30.
[[nodiscard]] std::int32_t sin_q30(Bam32 angle_bam32);
[[nodiscard]] std::int32_t cos_q30(Bam32 angle_bam32);
/// Worst absolute error of sin_q30 / cos_q30 in units of 2^-30 (swept by a test).
inline constexpr std::int32_t kSineError_q30 = 330;

/// One step of a 32-bit mixing function (used for rounding dither, not for security).
[[nodiscard]] constexpr std::uint32_t mix_u32(std::uint32_t value) {
  value ^= value >> 16U;
  value *= 0x7FEB352DU;
  value ^= value >> 15U;
  value *= 0x846CA68BU;
  value ^= value >> 16U;
  return value;
}

}  // namespace leadline::base
