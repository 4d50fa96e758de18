// The tests' own 128-bit integers: by hand, and against the compiler's.
#include "tests/support/test.hpp"
#include "tests/support/wide_integer.hpp"

namespace {

using leadline::test::Random;
using leadline::test::wide;
using leadline::test::WideInteger;

TEST(carries_and_borrows_by_hand) {
  const WideInteger carried = wide(UINT64_MAX) + wide(1);
  assert_true(carried.high == 1 && carried.low == 0);
  assert_true(carried - wide(1) == wide(UINT64_MAX));
  assert_true(wide(0) - wide(1) == (WideInteger{UINT64_MAX, UINT64_MAX}));
  assert_true(wide(UINT64_MAX) < carried && !(carried < wide(UINT64_MAX)));
  assert_false(carried < carried);
  // (2^64 - 1)^2 = 2^128 - 2^65 + 1
  const WideInteger square = wide(UINT64_MAX) * wide(UINT64_MAX);
  assert_true(square.high == UINT64_MAX - 1 && square.low == 1);
  assert_true(square / wide(UINT64_MAX) == wide(UINT64_MAX));
  assert_true((square - wide(1)) / wide(UINT64_MAX) == wide(UINT64_MAX - 1));
  assert_true(carried << 63 == (WideInteger{std::uint64_t{1} << 63U, 0}));
  assert_true(carried << 64 == wide(0) && carried << 200 == wide(0) && carried >> 200 == wide(0));
  assert_true(carried >> 64 == wide(1) && carried >> 1 == wide(std::uint64_t{1} << 63U));
  assert_true(carried >> 0 == carried && carried << 0 == carried);
}

#ifdef __SIZEOF_INT128__

__extension__ typedef unsigned __int128 UInt128;  // NOLINT: a typedef takes the extension mark

UInt128 native(WideInteger value) { return (UInt128{value.high} << 64U) | value.low; }

// Of any length.
WideInteger any(Random& random) {
  const WideInteger value{random.next(), random.next()};
  return value >> static_cast<int>(random.between(0, 127));
}

TEST(every_operation_is_the_compilers) {
  Random random(1);
  for (int i = 0; i < 20'000; ++i) {
    const WideInteger a = any(random);
    const WideInteger b = i % 10 == 0 ? a : any(random);
    const int bits = static_cast<int>(random.between(0, 127));
    const WideInteger divisor = (b >> 1) == wide(0) ? wide(3) : b >> 1;
    assert_true(native(a + b) == native(a) + native(b));
    assert_true(native(a - b) == native(a) - native(b));
    assert_true(native(a * b) == native(a) * native(b));
    assert_true(native(a / divisor) == native(a) / native(divisor));
    assert_true(native(a << bits) == native(a) << bits);
    assert_true(native(a >> bits) == native(a) >> bits);
    assert_true((a < b) == (native(a) < native(b)));
    assert_true((a == b) == (native(a) == native(b)));
  }
}

#endif

}  // namespace
