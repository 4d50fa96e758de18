// IEEE singles of a wire with the range that their field can have. Vehicle code: no floating point.
#pragma once

#include <cstdint>

#include "hal/wire.hpp"

namespace leadline::hal {

/// The single with these bits times `scale`, rounded; false, and `out` left alone, when it is NaN,
/// infinite or outside [low, high] (in scaled units). A NaN cannot pass.
[[nodiscard]] constexpr bool f32_within(std::uint32_t bits, std::int64_t scale, std::int64_t low,
                                        std::int64_t high, std::int64_t& out) {
  std::int64_t value = 0;
  if (!f32_bits_to_integer(bits, scale, value) || value < low || value > high) {
    return false;
  }
  out = value;
  return true;
}

/// Neither NaN nor infinite.
[[nodiscard]] constexpr bool f32_is_finite(std::uint32_t bits) {
  return (bits & 0x7F800000U) != 0x7F800000U;
}

/// Bits of the single nearest to value / 1000 (of two, the even one); |value| < 2^40.
[[nodiscard]] constexpr std::uint32_t f32_bits_of_milli(std::int64_t value) {
  if (value == 0) {
    return 0;
  }
  const std::uint32_t sign = value < 0 ? 0x80000000U : 0;
  std::uint64_t magnitude = static_cast<std::uint64_t>(value < 0 ? -value : value);
  // A quotient of 24 bits: magnitude * 2^shift / 1000 within [2^23, 2^24).
  std::uint64_t divisor = 1000;
  std::uint32_t exponent = 127 + 23;
  while (magnitude < (divisor << 23U)) {
    magnitude <<= 1U;
    --exponent;
  }
  while (magnitude >= (divisor << 24U)) {
    divisor <<= 1U;
    ++exponent;
  }
  // A mantissa rounded up to 2^24 carries into the exponent, as it should.
  auto mantissa = static_cast<std::uint32_t>((magnitude + divisor / 2) / divisor);
  mantissa -= magnitude % divisor * 2 == divisor ? mantissa & 1U : 0U;
  return sign | ((exponent << 23U) + (mantissa - 0x800000U));
}

}  // namespace leadline::hal
