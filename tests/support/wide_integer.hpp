// Unsigned integers of 128 bits for references of tests: compilers for 32-bit processors have none of their own.
// As plainly as it can be written, digit by binary digit; unit.support.wide_integer compares it with the
// compiler's where that exists. It shares nothing with estimator/wide.hpp, which it is a reference of.
#pragma once

#include <cstdint>

namespace leadline::test {

/// Modulo 2^128. Every operation at most 128 steps.
struct WideInteger {
  std::uint64_t high = 0;
  std::uint64_t low = 0;
};

[[nodiscard]] constexpr WideInteger wide(std::uint64_t value) { return {0, value}; }

[[nodiscard]] constexpr bool operator==(WideInteger a, WideInteger b) {
  return a.high == b.high && a.low == b.low;
}
[[nodiscard]] constexpr bool operator<(WideInteger a, WideInteger b) {
  return a.high < b.high || (a.high == b.high && a.low < b.low);
}

[[nodiscard]] constexpr WideInteger operator+(WideInteger a, WideInteger b) {
  const std::uint64_t low = a.low + b.low;
  return {a.high + b.high + (low < a.low ? 1U : 0U), low};
}
[[nodiscard]] constexpr WideInteger operator-(WideInteger a, WideInteger b) {
  return {a.high - b.high - (a.low < b.low ? 1U : 0U), a.low - b.low};
}

/// `bits` >= 0; from 128 on nothing is left.
[[nodiscard]] constexpr WideInteger operator<<(WideInteger a, int bits) {
  if (bits >= 64) {
    return {bits >= 128 ? 0 : a.low << (bits - 64), 0};
  }
  return bits == 0 ? a : WideInteger{(a.high << bits) | (a.low >> (64 - bits)), a.low << bits};
}
[[nodiscard]] constexpr WideInteger operator>>(WideInteger a, int bits) {
  if (bits >= 64) {
    return {0, bits >= 128 ? 0 : a.high >> (bits - 64)};
  }
  return bits == 0 ? a : WideInteger{a.high >> bits, (a.low >> bits) | (a.high << (64 - bits))};
}

[[nodiscard]] constexpr WideInteger operator*(WideInteger a, WideInteger b) {
  WideInteger product;
  for (; wide(0) < b; b = b >> 1, a = a << 1) {
    if ((b.low & 1U) != 0) {
      product = product + a;
    }
  }
  return product;
}

/// Towards zero; `divisor` below 2^127 and not zero.
[[nodiscard]] constexpr WideInteger operator/(WideInteger dividend, WideInteger divisor) {
  WideInteger quotient;
  WideInteger rest;
  for (int bit = 127; bit >= 0; --bit) {
    rest = (rest << 1) + wide((dividend >> bit).low & 1U);
    quotient = quotient << 1;
    if (!(rest < divisor)) {
      rest = rest - divisor;
      quotient = quotient + wide(1);
    }
  }
  return quotient;
}

}  // namespace leadline::test
