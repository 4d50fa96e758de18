#include <algorithm>
#include <array>

#include "estimator/wide.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wide_integer.hpp"

namespace {

using leadline::estimator::add_limited;
using leadline::estimator::mul_div;
using leadline::estimator::mul_round;
using leadline::estimator::multiply;
using leadline::test::Random;
using leadline::test::wide;
using leadline::test::WideInteger;

std::uint64_t magnitude(std::int64_t value) {
  return value < 0 ? std::uint64_t{0} - static_cast<std::uint64_t>(value)
                   : static_cast<std::uint64_t>(value);
}

std::int64_t limited(WideInteger size, bool negative) {
  const std::int64_t result =
      wide(INT64_MAX) < size ? INT64_MAX : static_cast<std::int64_t>(size.low);
  return negative ? -result : result;
}

// a * b / divisor, halves away from zero.
std::int64_t divided_product(std::int64_t a, std::int64_t b, std::uint64_t divisor) {
  const WideInteger product = wide(magnitude(a)) * wide(magnitude(b));
  return limited((product + wide(divisor / 2)) / wide(divisor), (a < 0) != (b < 0));
}

void assert_same(long long result, long long expected, const std::array<long long, 3>& of) {
  if (result != expected) {
    fail_msg("of %lld, %lld, %lld: %lld, not %lld", of[0], of[1], of[2], result, expected);
  }
}

// Numbers of any length, the ends among them.
std::int64_t any(Random& random) {
  const std::int64_t value = static_cast<std::int64_t>(random.next()) >> random.between(0, 63);
  const std::int64_t ends[] = {0, 1, -1, INT64_MAX, -INT64_MAX, INT64_MIN};
  return random.between(0, 9) == 0 ? ends[random.between(0, 5)] : value;
}

TEST(products_are_exact) {
  Random random(1);
  for (int i = 0; i < 100'000; ++i) {
    const auto a = static_cast<std::uint64_t>(any(random));
    const auto b = static_cast<std::uint64_t>(any(random));
    const WideInteger expected = wide(a) * wide(b);
    const auto product = multiply(a, b);
    assert_true(product.low == expected.low);
    assert_true(product.high == expected.high);
  }
}

TEST(quotients_of_products_round_to_nearest_and_are_limited) {
  Random random(2);
  for (int i = 0; i < 100'000; ++i) {
    const std::int64_t a = any(random);
    const std::int64_t b = any(random);
    const std::int64_t c = std::max<std::int64_t>(1, any(random));
    const std::int64_t expected = divided_product(a, b, static_cast<std::uint64_t>(c));
    assert_same(mul_div(a, b, c), expected, {a, b, c});
  }
  assert_int_equal(mul_div(7, 1, 2), 4);  // halves away from zero
  assert_int_equal(mul_div(-7, 1, 2), -4);
  assert_int_equal(mul_div(5, 5, 0), 25);
  assert_int_equal(mul_div(5, 5, -3), 25);
}

TEST(shifted_products_round_to_nearest_and_are_limited) {
  Random random(3);
  for (int i = 0; i < 100'000; ++i) {
    const std::int64_t a = any(random);
    const std::int64_t b = any(random);
    const int shift = static_cast<int>(random.between(1, 62));
    const std::int64_t expected = divided_product(a, b, std::uint64_t{1} << shift);
    assert_same(mul_round(a, b, shift), expected, {a, b, shift});
  }
}

TEST(sums_are_limited) {
  Random random(4);
  for (int i = 0; i < 100'000; ++i) {
    const std::int64_t a = std::max(any(random), -INT64_MAX);
    const std::int64_t b = std::max(any(random), -INT64_MAX);
    // Of unlike signs the difference of sizes, of like ones their sum.
    const WideInteger larger = wide(std::max(magnitude(a), magnitude(b)));
    const WideInteger smaller = wide(std::min(magnitude(a), magnitude(b)));
    const bool negative = magnitude(a) < magnitude(b) ? b < 0 : a < 0;
    assert_true(add_limited(a, b) ==
                limited((a < 0) == (b < 0) ? larger + smaller : larger - smaller, negative));
  }
}

}  // namespace
