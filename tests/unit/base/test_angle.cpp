#include <cmath>

#include "model/base/angle.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::atan2_bam32;
using leadline::base::Bam32;

double error_bam(std::int64_t y, std::int64_t x) {
  const long double turn = std::atan2(static_cast<long double>(y), static_cast<long double>(x)) /
                           6.283185307179586476925L;
  const auto exact =
      static_cast<Bam32>(static_cast<std::int64_t>(std::floor(turn * 4294967296.0L + 0.5L)));
  return static_cast<double>(static_cast<std::int32_t>(atan2_bam32(y, x) - exact));
}

}  // namespace

TEST(axes_and_diagonals) {
  assert_int_equal(atan2_bam32(0, 0), 0);
  const std::int64_t r = 1'000'000'000;
  const std::int64_t points[8][2] = {{r, 0},  {r, r},   {0, r},  {-r, r},
                                     {-r, 0}, {-r, -r}, {0, -r}, {r, -r}};
  for (std::uint32_t i = 0; i < 8; ++i) {
    const auto off =
        static_cast<std::int32_t>(atan2_bam32(points[i][1], points[i][0]) - (i << 29U));
    assert_true(std::abs(off) <= leadline::base::kAtan2Error_bam32);
  }
}

TEST(the_stated_error_holds_all_around_and_for_all_lengths) {
  leadline::test::Random random;
  double worst = 0;
  for (int i = 0; i < 200'000; ++i) {
    const double length = std::exp2(20.0 + 40.9 * random.uniform());
    const double angle = 6.283185307179586 * random.uniform();
    const auto y = static_cast<std::int64_t>(length * std::sin(angle));
    const auto x = static_cast<std::int64_t>(length * std::cos(angle));
    worst = std::max(worst, std::fabs(error_bam(y, x)));
  }
  assert_true(worst <= leadline::base::kAtan2Error_bam32);
}

TEST(short_vectors_have_the_angle_of_their_numbers) {
  for (std::int64_t y = -9; y <= 9; ++y) {
    for (std::int64_t x = -9; x <= 9; ++x) {
      if (x != 0 || y != 0) {
        assert_true(std::fabs(error_bam(y, x)) <= leadline::base::kAtan2Error_bam32);
      }
    }
  }
}

TEST(the_longest_vectors) {
  const std::int64_t longest = leadline::base::kMaxAtan2Argument;
  assert_true(std::fabs(error_bam(longest, -longest)) <= leadline::base::kAtan2Error_bam32);
  assert_true(std::fabs(error_bam(-1, longest)) <= leadline::base::kAtan2Error_bam32);
}
