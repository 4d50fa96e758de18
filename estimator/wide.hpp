// Products of two 64-bit integers, without 128-bit types: a 32-bit microcontroller has none.
#pragma once

#include <cstdint>

namespace leadline::estimator {

/// Unsigned 128-bit number.
struct Wide {
  std::uint64_t high;
  std::uint64_t low;
};

/// The exact product. O(1).
[[nodiscard]] Wide multiply(std::uint64_t a, std::uint64_t b);

/// a * b / c, rounded to nearest (halves away from zero), limited to +-INT64_MAX; c >= 1 (a smaller c
/// counts as 1). 64 steps of shift and subtract where the product is longer than 64 bits, else one
/// division.
[[nodiscard]] std::int64_t mul_div(std::int64_t a, std::int64_t b, std::int64_t c);

/// a * b / 2^shift, rounded to nearest (halves away from zero), limited to +-INT64_MAX; shift 1 .. 62.
/// O(1).
[[nodiscard]] std::int64_t mul_round(std::int64_t a, std::int64_t b, int shift);

/// a + b limited to +-INT64_MAX.
[[nodiscard]] std::int64_t add_limited(std::int64_t a, std::int64_t b);

}  // namespace leadline::estimator
