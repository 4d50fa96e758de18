#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>

#include "hal/wire.hpp"
#include "tests/support/test.hpp"
#include "tests/support/wide_integer.hpp"

namespace {

using namespace leadline::hal;  // NOLINT: the file tests one header
using leadline::test::wide;
using leadline::test::WideInteger;

constexpr std::uint8_t kBytes[] = {0x01, 0x82, 0x03, 0x84, 0x05, 0x86, 0x07, 0x88};

std::uint32_t bits_of(float value) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
}

/// number * scale to the nearest integer, halves away from zero, exact; limited to +-limit (below 2^63).
std::int64_t product(double number, std::int64_t scale, std::int64_t limit) {
  int exponent = 0;
  const double fraction = std::frexp(std::fabs(number), &exponent);
  // The size is whole * 2^(exponent - 53).
  const WideInteger whole = wide(static_cast<std::uint64_t>(std::ldexp(fraction, 53))) *
                            wide(static_cast<std::uint64_t>(scale));
  const int down = 53 - exponent;
  WideInteger size;
  if (down > 0) {
    size = (whole + (wide(1) << (down - 1))) >> down;
  } else if (-down < 64 && whole < (wide(1) << (127 + down))) {
    size = whole << -down;
  } else {
    size = whole == wide(0) ? whole : wide(UINT64_MAX);
  }
  const std::int64_t result =
      wide(static_cast<std::uint64_t>(limit)) < size ? limit : static_cast<std::int64_t>(size.low);
  return number < 0 ? -result : result;
}

}  // namespace

TEST(reads_both_orders) {
  static_assert(read_u16_le(kBytes) == 0x8201U, "usable at compile time");
  assert_int_equal(read_u16_be(kBytes), 0x0182);
  assert_int_equal(read_u32_le(kBytes), 0x84038201U);
  assert_int_equal(read_u32_be(kBytes), 0x01820384U);
  assert_true(read_u64_le(kBytes) == 0x8807860584038201U);
  assert_true(read_u64_be(kBytes) == 0x0182038405860788U);
  assert_int_equal(read_u32_le(kBytes + 1), 0x05840382U);  // any alignment
}

TEST(writes_what_it_reads) {
  std::uint8_t bytes[4] = {};
  write_u16_le(bytes, 0xA1B2);
  assert_int_equal(read_u16_le(bytes), 0xA1B2);
  assert_int_equal(bytes[0], 0xB2);
  write_u16_be(bytes, 0xA1B2);
  assert_int_equal(read_u16_be(bytes), 0xA1B2);
  assert_int_equal(bytes[0], 0xA1);
  write_u32_le(bytes, 0xA1B2C3D4U);
  assert_int_equal(read_u32_le(bytes), 0xA1B2C3D4U);
  assert_int_equal(bytes[3], 0xA1);
  write_u32_be(bytes, 0xA1B2C3D4U);
  assert_int_equal(read_u32_be(bytes), 0xA1B2C3D4U);
  assert_int_equal(bytes[3], 0xD4);
}

TEST(signs_at_the_edges) {
  assert_int_equal(as_i16(0x7FFF), 32767);
  assert_int_equal(as_i16(0x8000), -32768);
  assert_int_equal(as_i16(0xFFFF), -1);
  assert_int_equal(as_i32(0x7FFFFFFFU), std::numeric_limits<std::int32_t>::max());
  assert_int_equal(as_i32(0x80000000U), std::numeric_limits<std::int32_t>::min());
  assert_int_equal(as_i32(0xFFFFFFFFU), -1);
}

TEST(floats_by_bits) {
  std::int64_t value = 0;
  assert_true(f32_bits_to_integer(bits_of(1.5F), 1'000'000, value));
  assert_int_equal(value, 1'500'000);
  assert_true(f32_bits_to_integer(bits_of(-0.0F), 1'000'000, value));
  assert_int_equal(value, 0);
  assert_true(f32_bits_to_integer(bits_of(0.5F), 1, value));
  assert_int_equal(value, 1);  // halves away from zero
  assert_true(f32_bits_to_integer(bits_of(-0.5F), 1, value));
  assert_int_equal(value, -1);
  assert_true(f32_bits_to_integer(bits_of(0.49999997F), 1, value));
  assert_int_equal(value, 0);
  assert_true(f32_bits_to_integer(bits_of(16777215.0F), 1, value));
  assert_int_equal(value, 16777215);
  assert_true(f32_bits_to_integer(1, kMaxFloatScale, value));  // the smallest denormal
  assert_int_equal(value, 0);
  assert_true(f32_bits_to_integer(bits_of(4611686018427387904.0F), 1, value));  // 2^62
  assert_true(value == (std::int64_t{1} << 62U));
}

TEST(floats_that_are_no_integer) {
  std::int64_t value = 77;
  assert_false(f32_bits_to_integer(bits_of(std::numeric_limits<float>::infinity()), 1, value));
  assert_false(f32_bits_to_integer(bits_of(-std::numeric_limits<float>::infinity()), 1, value));
  assert_false(f32_bits_to_integer(bits_of(std::numeric_limits<float>::quiet_NaN()), 1, value));
  assert_false(f32_bits_to_integer(bits_of(std::numeric_limits<float>::max()), 1, value));
  assert_false(f32_bits_to_integer(bits_of(9223372036854775808.0F), 1, value));  // 2^63
  assert_false(f32_bits_to_integer(bits_of(1.0F), 0, value));
  assert_false(f32_bits_to_integer(bits_of(1.0F), kMaxFloatScale + 1, value));
  assert_int_equal(value, 77);
}

TEST(floats_against_wide_integers) {
  leadline::test::Random random(1);
  constexpr std::int64_t kMost = std::numeric_limits<std::int64_t>::max();
  int taken = 0;
  for (int i = 0; i < 200'000; ++i) {
    const auto bits = static_cast<std::uint32_t>(random.next());
    const std::int64_t scale = random.between(1, 1'000'000'000);
    float number = 0;
    std::memcpy(&number, &bits, sizeof number);
    std::int64_t value = 0;
    if (!f32_bits_to_integer(bits, scale, value)) {
      assert_true(!std::isfinite(number) || std::llabs(product(number, scale, kMost)) == kMost);
      continue;
    }
    ++taken;
    assert_true(value == product(number, scale, kMost));
  }
  assert_true(taken > 100'000);
}

TEST(doubles_by_bits) {
  const auto taken = [](double value, std::int64_t scale, std::int64_t& out) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    return f64_bits_to_integer(bits, scale, out);
  };
  std::int64_t value = 0;
  assert_true(taken(48.123456789, 1'000'000'000, value));
  assert_int_equal(value, 48'123'456'789);
  assert_true(taken(-179.999999999, 1'000'000'000, value));
  assert_int_equal(value, -179'999'999'999);
  assert_true(taken(0.5, 1, value));
  assert_int_equal(value, 1);
  assert_true(taken(-0.4999999, 1, value));
  assert_int_equal(value, 0);
  assert_true(taken(0x1.0p61, 1, value));
  assert_true(value == std::int64_t{1} << 61);
  assert_true(taken(5e-324, 1, value));
  assert_int_equal(value, 0);
  value = 5;
  assert_false(taken(0x1.0p62, 1, value));
  assert_false(taken(1e300, 1, value));
  assert_false(taken(std::numeric_limits<double>::quiet_NaN(), 1, value));
  assert_false(taken(-std::numeric_limits<double>::infinity(), 1, value));
  assert_false(taken(1.0, 0, value));
  assert_false(taken(1.0, kMaxDoubleScale + 1, value));
  assert_int_equal(value, 5);
}

TEST(doubles_against_wide_integers) {
  leadline::test::Random random(9);
  constexpr std::int64_t kTooMuch = std::int64_t{1} << 62U;
  for (int i = 0; i < 20'000; ++i) {
    // Every magnitude about the edges of the scaled range.
    const double number =
        std::ldexp(random.uniform() - 0.5, static_cast<int>(random.between(-70, 66)));
    const std::int64_t scale = random.between(1, kMaxDoubleScale);
    std::uint64_t bits = 0;
    std::memcpy(&bits, &number, sizeof bits);
    const std::int64_t expected = product(number, scale, kTooMuch);
    std::int64_t value = 0;
    const bool taken = f64_bits_to_integer(bits, scale, value);
    assert_int_equal(taken, std::llabs(expected) < kTooMuch);
    assert_true(!taken || value == expected);
  }
}

TEST(signed_64_bits) {
  assert_true(as_i64(0) == 0 && as_i64(UINT64_MAX) == -1);
  assert_true(as_i64(0x8000000000000000U) == std::numeric_limits<std::int64_t>::min());
  assert_true(as_i64(0x7FFFFFFFFFFFFFFFU) == std::numeric_limits<std::int64_t>::max());
}
