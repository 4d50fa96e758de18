#include "model/base/fixed.hpp"

#include <array>

#include "model/base/root.hpp"

namespace leadline::base {
namespace {

constexpr int kSineSteps = 1024;  // per quarter turn

// Taylor's series in Q30 integers, at compile time: the same bits for every compiler and host. Its error
// (a few units) is far below that of the linear interpolation.
constexpr std::array<std::int32_t, kSineSteps + 2> make_sine_table() {
  std::array<std::int32_t, kSineSteps + 2> table{};
  constexpr std::int64_t kHalfPi_q30 = 1686629713;
  for (std::int64_t i = 0; i <= kSineSteps; ++i) {
    const std::int64_t x_q30 = kHalfPi_q30 * i / kSineSteps;
    const std::int64_t square_q30 = (x_q30 * x_q30) >> 30;
    std::int64_t term_q30 = x_q30;
    std::int64_t sum_q30 = x_q30;
    for (std::int64_t k = 1; k <= 9; ++k) {
      term_q30 = -((term_q30 * square_q30) >> 30) / ((2 * k) * (2 * k + 1));
      sum_q30 += term_q30;
    }
    table[static_cast<std::size_t>(i)] =
        static_cast<std::int32_t>(sum_q30 > kOne_q30 ? kOne_q30 : sum_q30);
  }
  table[kSineSteps + 1] = table[kSineSteps - 1];
  return table;
}

constexpr auto kSineTable = make_sine_table();

// Starting values for the square root: sqrt of the middle of [i, i+1) * 2^24, for i in 64..255.
constexpr std::array<std::uint16_t, 256> make_sqrt_table() {
  std::array<std::uint16_t, 256> table{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    const std::uint64_t target = (static_cast<std::uint64_t>(i) << 24U) + (1ULL << 23U);
    std::uint64_t root = 0;
    for (std::uint64_t bit = 1ULL << 16U; bit != 0; bit >>= 1U) {
      if ((root + bit) * (root + bit) <= target) {
        root += bit;
      }
    }
    table[i] = static_cast<std::uint16_t>(root > 0xFFFF ? 0xFFFF : root);
  }
  return table;
}

}  // namespace

constexpr std::array<std::uint16_t, 256> kRootTable = make_sqrt_table();
static_assert(kRootTable[64] >= 0x8000, "what root_step() wants of its start");

std::uint32_t sqrt_u32(std::uint32_t value) { return sqrt_u32_inline(value); }

std::uint32_t sqrt_u64(std::uint64_t value) { return sqrt_u64_inline(value); }

std::int32_t ratio(std::int64_t numerator, std::int64_t denominator, int shift) {
  if (denominator <= 0) {
    return 0;
  }
  const bool negative = numerator < 0;
  std::uint64_t n =
      negative ? 0 - static_cast<std::uint64_t>(numerator) : static_cast<std::uint64_t>(numerator);
  if (n == 0) {
    return 0;  // no leading bit to align by
  }
  auto d = static_cast<std::uint64_t>(denominator);
  // Bring the denominator to at most 32 bits and the numerator as high as it goes: then one division.
  const int lower = 32 - leading_zeros64(d);
  if (lower > 0) {
    d >>= static_cast<unsigned>(lower);
    shift -= lower;
  }
  const int room = leading_zeros64(n);
  int up = min_of(shift, room);
  if (shift < 0) {
    up = 0;
    n = shift > -64 ? n >> static_cast<unsigned>(-shift) : 0;
    shift = 0;
  }
  n <<= static_cast<unsigned>(up);
  // 2^32 and more is beyond the limit below, whatever it is.
  std::uint64_t q = (n >> 32U) >= d ? 1ULL << 32U : quotient_u32(n, static_cast<std::uint32_t>(d));
  const int rest = shift - up;
  if (rest > 0) {
    q = rest >= leading_zeros64(q) ? 0x7FFFFFFFFFFFFFFFULL : q << static_cast<unsigned>(rest);
  }
  const std::uint64_t limit = 0x7FFFFFFFULL;
  const auto magnitude = static_cast<std::int32_t>(q > limit ? limit : q);
  return negative ? -magnitude : magnitude;
}

std::int32_t sin_q30(Bam32 angle_bam32) {
  // Fold into the first quadrant: bit 31 is the sign, bit 30 mirrors.
  const std::uint32_t folded = (angle_bam32 & kBam32QuarterTurn) != 0 ? ~angle_bam32 : angle_bam32;
  const std::uint32_t position = folded & 0x3FFFFFFFU;
  const std::uint32_t index = position >> 20U;
  const auto fraction_q20 = static_cast<std::int64_t>(position & 0xFFFFFU);
  const std::int32_t a = kSineTable[index];
  const std::int32_t b = kSineTable[index + 1];
  const auto value =
      static_cast<std::int32_t>(a + (((static_cast<std::int64_t>(b) - a) * fraction_q20) >> 20));
  return (angle_bam32 & kBam32HalfTurn) != 0 ? -value : value;
}

std::int32_t cos_q30(Bam32 angle_bam32) { return sin_q30(angle_bam32 + kBam32QuarterTurn); }

}  // namespace leadline::base
