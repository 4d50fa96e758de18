// Fixed-point arithmetic against double and 64-bit arithmetic, over whole domains where they fit.
#include <algorithm>
#include <limits>

#include "model/base/fixed.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::base;  // NOLINT: a test of this namespace
using leadline::test::Random;

constexpr double kPi = 3.14159265358979323846;

TEST(leading_zeros_of_every_bit_and_of_zero) {
  assert_int_equal(leading_zeros(0), 32);
  assert_int_equal(leading_zeros64(0), 64);
  for (int bit = 0; bit < 32; ++bit) {
    assert_int_equal(leading_zeros(1U << static_cast<unsigned>(bit)), 31 - bit);
    assert_int_equal(leading_zeros((2U << static_cast<unsigned>(bit)) - 1U), 31 - bit);
  }
  for (int bit = 0; bit < 64; ++bit) {
    assert_int_equal(leading_zeros64(1ULL << static_cast<unsigned>(bit)), 63 - bit);
  }
}

TEST(clamp_min_and_max) {
  assert_int_equal(clamp(-5, -3, 4), -3);
  assert_int_equal(clamp(5, -3, 4), 4);
  assert_int_equal(clamp(0, -3, 4), 0);
  assert_int_equal(min_of(2, 3), 2);
  assert_int_equal(min_of(3, 2), 2);
  assert_int_equal(max_of(2, 3), 3);
  assert_int_equal(max_of(3, 2), 3);
}

TEST(shifts_round_towards_minus_infinity) {
  assert_int_equal(mul_shift(-1, 1, 4), -1);
  assert_int_equal(mul_shift(-16, 1, 4), -1);
  assert_int_equal(mul_shift(-17, 1, 4), -2);
  assert_int_equal(mul_shift(31, 1, 4), 1);
  assert_int_equal(floor_q16(-1), -1);
  assert_int_equal(floor_q16(65535), 0);
  assert_int_equal(ceil_q16(-65535), 0);
  assert_int_equal(ceil_q16(1), 1);
  assert_int_equal(ceil_q16(65536), 1);
  assert_int_equal(ceil_q16(std::numeric_limits<std::int32_t>::max() - 65535), 32767);
}

TEST(quotient_u32_is_the_quotient) {
  Random random(5);
  for (int i = 0; i < 300'000; ++i) {
    const auto divisor = static_cast<std::uint32_t>(std::max<std::uint64_t>(
        1, (random.next() & 0xFFFFFFFFU) >> static_cast<unsigned>(random.between(0, 31))));
    // Any quotient of 32 bits, with its ends and those of its digits; and any rest.
    std::uint64_t quotient =
        (random.next() & 0xFFFFFFFFU) >> static_cast<unsigned>(random.between(0, 31));
    if (i % 5 == 0) {
      quotient |= 0xFFFFU;
    } else if (i % 5 == 1) {
      quotient |= 0xFFFF0000U;
    }
    const std::uint64_t rest = i % 3 == 0 ? divisor - 1 : random.next() % divisor;
    const std::uint64_t numerator = quotient * divisor + rest;
    assert_true(quotient_u32(numerator, divisor) == quotient);
    assert_true(quotient_by_digits_u32(numerator, divisor) == quotient);
  }
}

TEST(quotients_of_64_bits_are_what_the_language_makes_of_them) {
  Random random(6);
  const auto any = [&random] {
    const auto size =
        static_cast<std::int64_t>(random.next() >> static_cast<unsigned>(random.between(1, 63)));
    return random.between(0, 1) == 0 ? size : -size;
  };
  for (int i = 0; i < 300'000; ++i) {
    const std::int64_t numerator = any();
    const std::int64_t divisor = any();
    if (divisor == 0) {
      continue;
    }
    assert_true(quotient_by_words(numerator, divisor) == numerator / divisor);
    assert_true(quotient(numerator, divisor) == numerator / divisor);
    const auto n = static_cast<std::uint64_t>(numerator < 0 ? -numerator : numerator);
    const auto d = static_cast<std::uint32_t>(divisor) | 1U;
    const auto limit = static_cast<std::uint32_t>(random.next());
    assert_true(limited_quotient_u32(n, d, limit) == std::min<std::uint64_t>(n / d, limit));
  }
  constexpr std::int64_t kLeast = std::numeric_limits<std::int64_t>::min();
  assert_true(quotient_by_words(kLeast, 3) == kLeast / 3);
  assert_true(quotient_by_words(kLeast, kLeast) == 1);
  assert_true(quotient_by_words(5, kLeast) == 0);
}

TEST(sqrt_u32_is_within_its_stated_error) {
  assert_int_equal(sqrt_u32(0), 0);
  // "exact for squares below 2^16".
  for (std::uint32_t root = 0; root < 256; ++root) {
    assert_int_equal(sqrt_u32(root * root), root);
  }
  double worst = 0.0;
  const auto check = [&worst](std::uint32_t value) {
    const double truth = std::sqrt(static_cast<double>(value));
    const double result = sqrt_u32(value);
    // The result is an integer: below 2^30 its own unit is coarser than the relative error.
    const double excess = std::fabs(result - truth) - 1.0;
    worst = std::max(worst, excess / truth);
  };
  // Every 1009th value, and the neighbourhood of every power of two and of every table step.
  for (std::uint64_t value = 1; value <= 0xFFFFFFFFULL; value += 1009) {
    check(static_cast<std::uint32_t>(value));
  }
  for (std::uint64_t step = 1; step < 256; ++step) {
    for (unsigned shift = 0; shift <= 24; ++shift) {
      check(static_cast<std::uint32_t>(step << shift));
      check(static_cast<std::uint32_t>((step << shift) - 1));
    }
  }
  check(0xFFFFFFFFU);
  print_message("sqrt_u32: worst relative error beyond one unit 2^%.2f\n", std::log2(worst));
  assert_true(worst < 0x1.0p-15);
}

TEST(sqrt_u64_is_within_its_stated_error) {
  Random random(1);
  double worst = 0.0;
  for (int i = 0; i < 2'000'000; ++i) {
    const auto bits = static_cast<unsigned>(random.between(0, 63));
    const std::uint64_t value = (random.next() >> bits) | 1U;
    const double truth = std::sqrt(static_cast<double>(value));
    const double excess = std::fabs(static_cast<double>(sqrt_u64(value)) - truth) - 1.0;
    worst = std::max(worst, excess / truth);
  }
  print_message("sqrt_u64: worst relative error beyond one unit 2^%.2f\n", std::log2(worst));
  assert_true(worst < 0x1.0p-14);
  assert_int_equal(sqrt_u64(0), 0);
  // The largest roots still fit their 32 bits: rounding up to 2^32 would make them zero.
  for (std::uint64_t down = 0; down < (1ULL << 46U); down = 2 * down + 1) {
    assert_near(sqrt_u64(~0ULL - down), 4294967295.0, 4294967296.0 * 0x1.0p-14);
  }
}

/// numerator * 2^shift / denominator, truncated, saturated, where the dividend fits 64 bits.
std::int32_t reference_ratio(std::int64_t numerator, std::int64_t denominator, int shift) {
  const std::int64_t quotient = numerator * (std::int64_t{1} << shift) / denominator;
  const std::int64_t limit = std::numeric_limits<std::int32_t>::max();
  return static_cast<std::int32_t>(clamp(quotient, -limit, limit));
}

TEST(ratio_of_small_operands_is_exact) {
  Random random(2);
  for (int i = 0; i < 1'000'000; ++i) {
    // Operands whose shifted numerator fits 64 bits and whose denominator fits 32: one plain division.
    const std::int64_t numerator = random.between(-(1LL << 40), 1LL << 40);
    const std::int64_t denominator = random.between(1, (1LL << 32) - 1);
    const int shift = static_cast<int>(random.between(0, 20));
    assert_int_equal(ratio(numerator, denominator, shift),
                     reference_ratio(numerator, denominator, shift));
  }
}

TEST(ratio_keeps_24_significant_bits) {
  Random random(3);
  double worst = 0.0;
  for (int i = 0; i < 2'000'000; ++i) {
    const auto numerator =
        static_cast<std::int64_t>(random.next()) >> static_cast<unsigned>(random.between(0, 62));
    const auto denominator = static_cast<std::int64_t>(
        (random.next() >> static_cast<unsigned>(random.between(1, 62))) | 1U);
    const int shift = static_cast<int>(random.between(0, 40));
    const double truth =
        std::ldexp(static_cast<double>(numerator) / static_cast<double>(denominator), shift);
    const auto result = static_cast<double>(ratio(numerator, denominator, shift));
    if (std::fabs(truth) > 2147483647.0) {
      assert_near(std::fabs(result), 2147483647.0, 2147483647.0 * 0x1.0p-24);
      continue;
    }
    // One unit for truncation.
    worst = std::max(worst, (std::fabs(result - truth) - 1.0) / std::max(1.0, std::fabs(truth)));
  }
  print_message("ratio: worst relative error beyond one unit 2^%.2f\n", std::log2(worst));
  assert_true(worst < 0x1.0p-23);
}

TEST(ratio_is_total) {
  const std::int64_t most = std::numeric_limits<std::int64_t>::max();
  const std::int64_t least = std::numeric_limits<std::int64_t>::min();
  assert_int_equal(ratio(5, 0, 4), 0);
  assert_int_equal(ratio(5, -1, 4), 0);
  assert_int_equal(ratio(0, 7, 30), 0);
  assert_int_equal(ratio(most, 1, 30), 0x7FFFFFFF);
  assert_int_equal(ratio(least, 1, 30), -0x7FFFFFFF);
  assert_int_equal(ratio(1, most, 0), 0);
  assert_int_equal(ratio(least, most, 0), -1);
  assert_int_equal(ratio(1, 1, 30), 1 << 30);
  // The denominator's shift leaves nothing of the numerator.
  assert_int_equal(ratio(1, most, 1), 0);
}

TEST(sine_and_cosine_over_the_whole_turn) {
  // Every 2039th of the 2^32 angles (2039 is prime, so that all table positions are met), and all
  // angles next to a table entry, where interpolation begins anew.
  double worst = 0.0;
  const auto check = [&worst](std::uint32_t angle) {
    const double radians = angle * (2.0 * kPi / 4294967296.0);
    worst = std::max(worst, std::fabs(sin_q30(angle) - std::sin(radians) * kOne_q30));
    worst = std::max(worst, std::fabs(cos_q30(angle) - std::cos(radians) * kOne_q30));
  };
  for (std::uint64_t angle = 0; angle < (1ULL << 32U); angle += 2039) {
    check(static_cast<std::uint32_t>(angle));
  }
  for (std::uint32_t entry = 0; entry < 4096; ++entry) {
    check(entry << 20U);
    check((entry << 20U) - 1U);
    check((entry << 20U) + (1U << 19U));
  }
  print_message("sine: worst error %.1f of 2^-30, stated %d\n", worst, kSineError_q30);
  assert_true(worst <= kSineError_q30);
  // The statement is tight: a bound that says nothing would hide a worse table.
  assert_true(worst > 0.8 * kSineError_q30);
}

TEST(sine_has_its_symmetries) {
  assert_int_equal(sin_q30(0), 0);
  assert_int_equal(cos_q30(0), sin_q30(kBam32QuarterTurn));
  Random random(4);
  for (int i = 0; i < 100'000; ++i) {
    const auto angle = static_cast<std::uint32_t>(random.next());
    // Half a turn changes the sign, bit for bit.
    assert_int_equal(sin_q30(angle + kBam32HalfTurn), -sin_q30(angle));
    const double sum = std::hypot(sin_q30(angle), cos_q30(angle));
    assert_near(sum, kOne_q30, 2.0 * kSineError_q30);
  }
}

TEST(mixing_spreads_consecutive_numbers) {
  // Consecutive ping numbers must give unrelated dithers: bits of the result flip half the time.
  int flips[32] = {};
  constexpr int kNumbers = 1 << 16;
  for (std::uint32_t i = 0; i < kNumbers; ++i) {
    const std::uint32_t difference = mix_u32(i) ^ mix_u32(i + 1);
    for (unsigned bit = 0; bit < 32; ++bit) {
      flips[bit] += static_cast<int>((difference >> bit) & 1U);
    }
  }
  for (const int count : flips) {
    assert_near(count, kNumbers / 2, 6.0 * std::sqrt(kNumbers / 4.0));
  }
}

}  // namespace
