// Decibels against the library's logarithms, over everything that is not silence.
#include <cmath>

#include "model/base/decibel.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::amplitude_of_attenuation;

TEST(attenuations_become_amplitudes) {
  double worst = 0;
  for (std::int64_t mdb = 0; mdb < 130'000; mdb += 7) {
    const double exact = 65535.0 * std::pow(10.0, -static_cast<double>(mdb) / 20'000.0);
    worst = std::max(worst, std::abs(exact - amplitude_of_attenuation(mdb)));
  }
  assert_true(worst <= 2.0);
}

TEST(the_ends) {
  assert_int_equal(amplitude_of_attenuation(0), 65535);
  assert_int_equal(amplitude_of_attenuation(-5), 65535);
  assert_int_equal(amplitude_of_attenuation(INT64_MIN), 65535);
  assert_int_equal(amplitude_of_attenuation(INT64_MAX), 0);
  assert_int_equal(amplitude_of_attenuation(119'999), 0);
}

}  // namespace
