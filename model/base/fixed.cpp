#include "model/base/fixed.hpp"

#include <array>

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

}  // namespace

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
