// Fixed-point arithmetic of the ping path. Everything here is total (defined for every input),
// branch-light, O(1), and gives the same bits on every target.
#pragma once

#include <cstdint>

#include "model/base/saturating.h"
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

/// numerator / divisor where the quotient has 32 bits: numerator >> 32 < divisor. Two digits of 16 bits
/// (Knuth's algorithm D, The Art of Computer Programming 4.3.1).
[[nodiscard]] constexpr std::uint32_t quotient_by_digits_u32(std::uint64_t numerator,
                                                             std::uint32_t divisor) {
  const auto shift = static_cast<unsigned>(leading_zeros(divisor));
  const std::uint32_t d = divisor << shift;
  const std::uint64_t n = numerator << shift;
  const std::uint32_t d1 = d >> 16U;
  const std::uint32_t d0 = d & 0xFFFFU;
  auto rest = static_cast<std::uint32_t>(n >> 32U);
  std::uint32_t quotient = 0;
  for (unsigned i = 0; i < 2; ++i) {
    const unsigned place = 16U - 16U * i;
    const std::uint32_t next = static_cast<std::uint32_t>(n >> place) & 0xFFFFU;
    std::uint32_t digit = rest / d1;
    std::uint32_t left = rest - digit * d1;
    // Too large by two at most.
    for (int correction = 0; correction < 2; ++correction) {
      if (left <= 0xFFFFU && (digit > 0xFFFFU || digit * d0 > (left << 16U | next))) {
        --digit;
        left += d1;
      }
    }
    // Modulo 2^32: what remains is less than the divisor.
    rest = (rest << 16U | next) - digit * d;
    quotient = quotient << 16U | digit;
  }
  return quotient;
}
/// The same by what is fastest: on 32-bit machines 64-bit division is a function of the compiler's library that makes
/// both digits of whatever it is given, in sixty instructions.
[[nodiscard]] constexpr std::uint32_t quotient_u32(std::uint64_t numerator, std::uint32_t divisor) {
  if constexpr (sizeof(void*) > 4) {
    return static_cast<std::uint32_t>(numerator / divisor);
  }
  return (numerator >> 32U) == 0 ? static_cast<std::uint32_t>(numerator) / divisor
                                 : quotient_by_digits_u32(numerator, divisor);
}
/// min(numerator / divisor, limit), 0 < divisor.
[[nodiscard]] constexpr std::uint32_t limited_quotient_u32(std::uint64_t numerator,
                                                           std::uint32_t divisor,
                                                           std::uint32_t limit) {
  return (numerator >> 32U) >= divisor ? limit : min_of(quotient_u32(numerator, divisor), limit);
}
/// numerator / divisor by words, where their sizes fit; divisor not 0.
[[nodiscard]] constexpr std::int64_t quotient_by_words(std::int64_t numerator,
                                                       std::int64_t divisor) {
  const auto size = [](std::int64_t value) {
    return value < 0 ? 0 - static_cast<std::uint64_t>(value) : static_cast<std::uint64_t>(value);
  };
  const std::uint64_t n = size(numerator);
  const std::uint64_t d = size(divisor);
  const bool fits = (d >> 32U) == 0 && (n >> 32U) < d;
  const auto q =
      static_cast<std::int64_t>(fits ? quotient_u32(n, static_cast<std::uint32_t>(d)) : n / d);
  return (numerator ^ divisor) < 0 ? -q : q;
}
/// numerator / divisor by what is fastest.
[[nodiscard]] constexpr std::int64_t quotient(std::int64_t numerator, std::int64_t divisor) {
  if constexpr (sizeof(void*) > 4) {
    return numerator / divisor;
  }
  return quotient_by_words(numerator, divisor);
}

/// floor(value / 2^16) of a Q16 number.
[[nodiscard]] constexpr std::int32_t floor_q16(std::int32_t value_q16) { return value_q16 >> 16; }
/// ceil(value / 2^16) of a Q16 number; value_q16 <= INT32_MAX - 65535.
[[nodiscard]] constexpr std::int32_t ceil_q16(std::int32_t value_q16) {
  return (value_q16 + 0xFFFF) >> 16;
}

/// Square root, relative error below 2^-15 (exact for squares below 2^16). A normalized 8-bit table
/// start and one Newton step: one 32-bit division.
[[nodiscard]] std::uint32_t sqrt_u32(std::uint32_t value);
/// The same for 64 bits: relative error below 2^-14.
[[nodiscard]] std::uint32_t sqrt_u64(std::uint64_t value);

/// numerator / denominator * 2^shift, saturated to 32 bits signed; 0 when denominator <= 0. The
/// quotient keeps at least 24 significant bits.
[[nodiscard]] std::int32_t ratio(std::int64_t numerator, std::int64_t denominator, int shift);

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
