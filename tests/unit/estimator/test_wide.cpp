#include <cmath>

#include "estimator/wide.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::estimator::add_limited;
using leadline::estimator::mul_div;
using leadline::estimator::mul_round;
using leadline::estimator::multiply;
using leadline::test::Random;

// The host has 128 bits.
__extension__ typedef __int128 Int128;
__extension__ typedef unsigned __int128 UInt128;

std::int64_t limited(Int128 value) {
  if (value > INT64_MAX) {
    return INT64_MAX;
  }
  return value < -Int128{INT64_MAX} ? -INT64_MAX : static_cast<std::int64_t>(value);
}

std::int64_t divided(Int128 product, Int128 divisor) {
  const bool negative = product < 0;
  const Int128 magnitude = negative ? -product : product;
  const Int128 quotient = (magnitude + divisor / 2) / divisor;
  return limited(negative ? -quotient : quotient);
}

// Numbers of any length, the ends among them.
std::int64_t any(Random& random) {
  const std::int64_t value = static_cast<std::int64_t>(random.next()) >> random.between(0, 63);
  const std::int64_t ends[] = {0, 1, -1, INT64_MAX, -INT64_MAX, INT64_MIN};
  return random.between(0, 9) == 0 ? ends[random.between(0, 5)] : value;
}

TEST(products_are_exact) {
  Random random(1);
  for (int i = 0; i < 200'000; ++i) {
    const auto a = static_cast<std::uint64_t>(any(random));
    const auto b = static_cast<std::uint64_t>(any(random));
    const UInt128 expected = UInt128{a} * b;
    const auto product = multiply(a, b);
    assert_true(product.low == static_cast<std::uint64_t>(expected));
    assert_true(product.high == static_cast<std::uint64_t>(expected >> 64));
  }
}

TEST(quotients_of_products_round_to_nearest_and_are_limited) {
  Random random(2);
  for (int i = 0; i < 200'000; ++i) {
    const std::int64_t a = any(random);
    const std::int64_t b = any(random);
    const std::int64_t c = std::max<std::int64_t>(1, any(random));
    const std::int64_t expected = divided(Int128{a} * b, c);
    if (mul_div(a, b, c) != expected) {
      fail_msg("%ld * %ld / %ld: %ld, not %ld", a, b, c, mul_div(a, b, c), expected);
    }
  }
  assert_int_equal(mul_div(7, 1, 2), 4);  // halves away from zero
  assert_int_equal(mul_div(-7, 1, 2), -4);
  assert_int_equal(mul_div(5, 5, 0), 25);
  assert_int_equal(mul_div(5, 5, -3), 25);
}

TEST(shifted_products_round_to_nearest_and_are_limited) {
  Random random(3);
  for (int i = 0; i < 200'000; ++i) {
    const std::int64_t a = any(random);
    const std::int64_t b = any(random);
    const int shift = static_cast<int>(random.between(1, 62));
    const std::int64_t expected = divided(Int128{a} * b, Int128{1} << shift);
    if (mul_round(a, b, shift) != expected) {
      fail_msg("%ld * %ld >> %d: %ld, not %ld", a, b, shift, mul_round(a, b, shift), expected);
    }
  }
}

TEST(sums_are_limited) {
  Random random(4);
  for (int i = 0; i < 100'000; ++i) {
    const std::int64_t a = std::max(any(random), -INT64_MAX);
    const std::int64_t b = std::max(any(random), -INT64_MAX);
    assert_int_equal(add_limited(a, b), limited(Int128{a} + b));
  }
}

}  // namespace
