// Integers from and to the bytes of a wire, whatever the byte order and alignment of the machine.
//
// Readers take a pointer to at least as many bytes as the name says; the caller has checked that they
// are there. Everything is constexpr, O(1), without unaligned access. Vehicle code.
#pragma once

#include <cstdint>
#include <limits>

namespace leadline::hal {

[[nodiscard]] constexpr std::uint16_t read_u16_le(const std::uint8_t* bytes) {
  return static_cast<std::uint16_t>(bytes[0] | (static_cast<unsigned>(bytes[1]) << 8U));
}
[[nodiscard]] constexpr std::uint32_t read_u32_le(const std::uint8_t* bytes) {
  return read_u16_le(bytes) | (static_cast<std::uint32_t>(read_u16_le(bytes + 2)) << 16U);
}
[[nodiscard]] constexpr std::uint64_t read_u64_le(const std::uint8_t* bytes) {
  return read_u32_le(bytes) | (static_cast<std::uint64_t>(read_u32_le(bytes + 4)) << 32U);
}
[[nodiscard]] constexpr std::uint16_t read_u16_be(const std::uint8_t* bytes) {
  return static_cast<std::uint16_t>((static_cast<unsigned>(bytes[0]) << 8U) | bytes[1]);
}
[[nodiscard]] constexpr std::uint32_t read_u32_be(const std::uint8_t* bytes) {
  return (static_cast<std::uint32_t>(read_u16_be(bytes)) << 16U) | read_u16_be(bytes + 2);
}
[[nodiscard]] constexpr std::uint64_t read_u64_be(const std::uint8_t* bytes) {
  return (static_cast<std::uint64_t>(read_u32_be(bytes)) << 32U) | read_u32_be(bytes + 4);
}

/// The same bits as a signed number (two's complement).
[[nodiscard]] constexpr std::int16_t as_i16(std::uint16_t bits) {
  return static_cast<std::int16_t>(bits < 0x8000U ? bits : static_cast<int>(bits) - 0x10000);
}
[[nodiscard]] constexpr std::int64_t as_i64(std::uint64_t bits) {
  // ~bits is below 2^63 where bits is not: no conversion leaves the range of the type.
  return bits < 0x8000000000000000U ? static_cast<std::int64_t>(bits)
                                    : -static_cast<std::int64_t>(~bits) - 1;
}
[[nodiscard]] constexpr std::int32_t as_i32(std::uint32_t bits) {
  return static_cast<std::int32_t>(bits < 0x80000000U
                                       ? static_cast<std::int64_t>(bits)
                                       : static_cast<std::int64_t>(bits) - 0x100000000);
}

constexpr void write_u16_le(std::uint8_t* bytes, std::uint16_t value) {
  bytes[0] = static_cast<std::uint8_t>(value);
  bytes[1] = static_cast<std::uint8_t>(value >> 8U);
}
constexpr void write_u32_le(std::uint8_t* bytes, std::uint32_t value) {
  write_u16_le(bytes, static_cast<std::uint16_t>(value));
  write_u16_le(bytes + 2, static_cast<std::uint16_t>(value >> 16U));
}
constexpr void write_u16_be(std::uint8_t* bytes, std::uint16_t value) {
  bytes[0] = static_cast<std::uint8_t>(value >> 8U);
  bytes[1] = static_cast<std::uint8_t>(value);
}
constexpr void write_u32_be(std::uint8_t* bytes, std::uint32_t value) {
  write_u16_be(bytes, static_cast<std::uint16_t>(value >> 16U));
  write_u16_be(bytes + 2, static_cast<std::uint16_t>(value));
}

/// Largest scale of f32_bits_to_integer(): a mantissa of 24 bits times it fits 63. Inclusive.
inline constexpr std::int64_t kMaxFloatScale = std::int64_t{1} << 38U;

/// The IEEE 754 single with these bits, times `scale` (1 .. kMaxFloatScale), rounded to the nearest
/// integer (halves away from zero), without floating point. False, and `out` left alone, for NaN,
/// infinity and whatever does not fit 63 bits. O(1).
[[nodiscard]] constexpr bool f32_bits_to_integer(std::uint32_t bits, std::int64_t scale,
                                                 std::int64_t& out) {
  const std::uint32_t biased = (bits >> 23U) & 0xFFU;
  if (biased == 0xFFU || scale < 1 || scale > kMaxFloatScale) {
    return false;
  }
  // value = mantissa * 2^exponent
  const std::uint32_t fraction = bits & 0x7FFFFFU;
  const std::uint64_t mantissa = biased == 0 ? fraction : fraction | 0x800000U;
  const int exponent = (biased == 0 ? 1 : static_cast<int>(biased)) - 150;
  std::uint64_t magnitude = mantissa * static_cast<std::uint64_t>(scale);
  if (exponent >= 0) {
    const auto limit = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
    if (magnitude != 0 && (exponent > 62 || magnitude > (limit >> exponent))) {
      return false;
    }
    magnitude = exponent > 62 ? 0 : magnitude << exponent;
  } else if (exponent < -63) {
    magnitude = 0;  // magnitude < 2^62: below a half
  } else {
    const int shift = -exponent;
    magnitude = (magnitude + (std::uint64_t{1} << (shift - 1))) >> shift;
  }
  const auto value = static_cast<std::int64_t>(magnitude);
  out = (bits & 0x80000000U) != 0 ? -value : value;
  return true;
}

/// Largest scale of f64_bits_to_integer(). Inclusive.
inline constexpr std::int64_t kMaxDoubleScale = 0xFFFFFFFF;

/// The IEEE 754 double with these bits, times `scale` (1 .. kMaxDoubleScale), rounded to the nearest
/// integer (halves away from zero), without floating point. False, and `out` left alone, for NaN,
/// infinity and whatever does not fit 62 bits. O(1).
[[nodiscard]] constexpr bool f64_bits_to_integer(std::uint64_t bits, std::int64_t scale,
                                                 std::int64_t& out) {
  const auto biased = static_cast<std::uint32_t>((bits >> 52U) & 0x7FFU);
  if (biased == 0x7FFU || scale < 1 || scale > kMaxDoubleScale) {
    return false;
  }
  // value = mantissa * 2^exponent; the product of 85 bits is high * 2^32 + low.
  const std::uint64_t fraction = bits & 0xFFFFFFFFFFFFFU;
  const std::uint64_t mantissa = biased == 0 ? fraction : fraction | 0x10000000000000U;
  const int exponent = (biased == 0 ? 1 : static_cast<int>(biased)) - 1075;
  const std::uint64_t low_part = (mantissa & 0xFFFFFFFFU) * static_cast<std::uint64_t>(scale);
  const std::uint64_t high =
      (mantissa >> 32U) * static_cast<std::uint64_t>(scale) + (low_part >> 32U);
  const std::uint64_t low = low_part & 0xFFFFFFFFU;
  constexpr std::uint64_t kLimit = std::uint64_t{1} << 62U;
  std::uint64_t magnitude = 0;
  if (exponent >= 0) {
    const bool fits = high < (std::uint64_t{1} << 30U);
    const std::uint64_t whole = (high << 32U) | low;
    if (whole != 0 || high != 0) {
      if (!fits || exponent > 61 || whole >= (kLimit >> exponent)) {
        return false;
      }
      magnitude = whole << exponent;
    }
  } else if (exponent >= -32) {
    const int shift = -exponent;
    if (high >= (std::uint64_t{1} << (30 + shift))) {
      return false;
    }
    magnitude = (high << (32 - shift)) + ((low + (std::uint64_t{1} << (shift - 1))) >> shift);
  } else if (exponent >= -94) {
    // What `low` adds is below a unit of `high`: it cannot make a half.
    const int shift = -exponent - 32;
    magnitude = (high + (std::uint64_t{1} << (shift - 1))) >> shift;
  }
  if (magnitude >= kLimit) {
    return false;
  }
  const auto value = static_cast<std::int64_t>(magnitude);
  out = (bits >> 63U) != 0 ? -value : value;
  return true;
}

/// The IEEE 754 single nearest to numerator / denominator (1 .. 2^24), |numerator| below 2^32: within one
/// unit in the last place for quotients above 2^-8, coarser below. O(1).
[[nodiscard]] constexpr std::uint32_t f32_bits_of_ratio(std::int64_t numerator,
                                                        std::uint32_t denominator) {
  const std::uint32_t sign = numerator < 0 ? 0x80000000U : 0U;
  const auto magnitude = static_cast<std::uint64_t>(numerator < 0 ? -numerator : numerator);
  // value = quotient * 2^-31
  std::uint64_t quotient = (magnitude << 31U) / denominator;
  if (quotient == 0) {
    return sign;
  }
  std::uint32_t biased = 127 + 23 - 31;
  for (; quotient >= (std::uint64_t{1} << 25U); ++biased) {
    quotient >>= 1U;
  }
  for (; quotient < (std::uint64_t{1} << 24U); --biased) {
    quotient <<= 1U;
  }
  // 25 bits: the last one rounds, and a carry runs into the exponent as it should.
  quotient = (quotient >> 1U) + (quotient & 1U);
  return sign | ((biased << 23U) + static_cast<std::uint32_t>(quotient));
}

}  // namespace leadline::hal
