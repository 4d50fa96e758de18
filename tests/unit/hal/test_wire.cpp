#include <cstring>
#include <limits>

#include "hal/wire.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::hal;  // NOLINT: the file tests one header

constexpr std::uint8_t kBytes[] = {0x01, 0x82, 0x03, 0x84, 0x05, 0x86, 0x07, 0x88};

std::uint32_t bits_of(float value) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
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

TEST(floats_against_long_double) {
  leadline::test::Random random(1);
  int taken = 0;
  for (int i = 0; i < 200'000; ++i) {
    const auto bits = static_cast<std::uint32_t>(random.next());
    const std::int64_t scale = random.between(1, 1'000'000'000);
    float number = 0;
    std::memcpy(&number, &bits, sizeof number);
    // 24 bits times 30: exact in 64 bits of mantissa.
    const long double exact = static_cast<long double>(number) * static_cast<long double>(scale);
    std::int64_t value = 0;
    if (!f32_bits_to_integer(bits, scale, value)) {
      assert_false(std::fabs(exact) < 9223372036854775807.0L);
      continue;
    }
    ++taken;
    assert_true(value == std::llroundl(exact));
  }
  assert_true(taken > 100'000);
}
