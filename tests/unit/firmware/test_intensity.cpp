// A head's intensities as energies.
#include <array>
#include <cmath>
#include <vector>

#include "firmware/pipeline/intensity.hpp"
#include "model/echo_detector.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::RangeProfile;
using leadline::firmware::energies_of;
using leadline::firmware::IntensityScale;
using Bins = std::vector<std::uint16_t>;

RangeProfile profile_of(const Bins& bins) {
  return {bins.data(), 10'000, 5'000, static_cast<std::uint16_t>(bins.size())};
}

Bins energies(const Bins& bins, IntensityScale scale, std::int32_t step_mdb = 0) {
  Bins out(bins.size());
  energies_of(profile_of(bins), scale, step_mdb, out.data());
  return out;
}

TEST(energy_stays_and_amplitude_is_squared) {
  assert_true(energies({0, 7, 65535}, IntensityScale::kEnergy) == Bins({0, 7, 65535}));
  assert_true(energies({0, 3, 255}, IntensityScale::kAmplitude) == Bins({0, 9, 65025}));
  // 16 bits: as many as fit.
  const Bins squares = energies({65535, 32768, 256, 0}, IntensityScale::kAmplitude);
  assert_in_range(squares[0], 65533, 65535);
  assert_in_range(squares[1], 16383, 16384);
  assert_int_equal(squares[2], 1);
  assert_int_equal(squares[3], 0);
}

TEST(decibels_become_energies_under_the_strongest) {
  const Bins out = energies({100, 90, 80, 0}, IntensityScale::kDecibel, 300);
  assert_int_equal(out[0], 65535);
  assert_near(out[1], 65535 * std::pow(10.0, -0.3), 2);
  assert_near(out[2], 65535 * std::pow(10.0, -0.6), 2);
  assert_near(out[3], 65535 * std::pow(10.0, -3.0), 2);
}

// The same echo on three scales is found at the same place; taken for energy, decibels put it elsewhere.
TEST(the_scale_decides_where_the_energy_has_arrived) {
  const leadline::model::EchoDetectorConfig config{6554, 0, 100'000'000};
  Bins amplitude(400);
  Bins decibel(400);
  for (std::size_t i = 0; i < 400; ++i) {
    const double away = (static_cast<double>(i) - 200.0) / 12.0;
    const double level = 2.0 + (i % 3 == 0 ? 1.0 : 0.0) + 250.0 * std::exp(-away * away);
    amplitude[i] = static_cast<std::uint16_t>(std::lround(level));
    decibel[i] = static_cast<std::uint16_t>(std::lround(20.0 * std::log10(level) / 0.3));
  }
  const auto range_mm = [&](const Bins& bins) {
    const auto echo = leadline::model::detect_echo(profile_of(bins), config);
    assert_true(echo.found);
    return static_cast<double>(echo.range_um) / 1000;
  };
  const double wanted_mm = range_mm(energies(amplitude, IntensityScale::kAmplitude));
  assert_near(range_mm(energies(decibel, IntensityScale::kDecibel, 300)), wanted_mm, 10);
  assert_true(std::abs(range_mm(decibel) - wanted_mm) > 30);
}

}  // namespace
