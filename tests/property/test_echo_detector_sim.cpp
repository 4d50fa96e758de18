// The detector beside the simulator's echo: the same beam over the same ground, once as the range that the
// scenes are made of, once as the intensities of a head with eight bits and noise.
#include <algorithm>
#include <cmath>
#include <vector>

#include "host_tools/sim/echo.hpp"
#include "model/echo_detector.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::RangeProfile;
using leadline::host::EchoModel;
using leadline::host::EchoSpec;
using leadline::host::Terrain;
using leadline::host::Vec3;
using leadline::model::detect_echo;
using leadline::model::EchoDetectorConfig;
using leadline::test::Random;

constexpr double kPi = 3.14159265358979323846;

// Slope, ripples and a boulder.
Terrain ground(double slope) {
  std::vector<double> depth;
  for (int n = 0; n < 120; ++n) {
    for (int e = 0; e < 120; ++e) {
      const double bump = std::exp(-(std::pow(n - 60, 2) + std::pow(e - 64, 2)) / 20.0);
      depth.push_back(40.0 + slope * 0.5 * (n - 60) + 0.2 * std::sin(0.8 * e) - 1.5 * bump);
    }
  }
  return Terrain(120, 120, 0.5, 0.0, 0.0, depth);
}

// Energy per bin of a cone of rays straight down: weights (cos t - cos T) / (1 - cos T).
std::vector<double> energies(const Terrain& terrain, Vec3 position, double half_angle, double bin_m,
                             int bins) {
  std::vector<double> energy(static_cast<std::size_t>(bins), 0.0);
  constexpr int kRings = 60;
  constexpr int kSpokes = 90;
  const double edge = std::cos(half_angle);
  for (int ring = 0; ring < kRings; ++ring) {
    // Equal solid angles.
    const double c = 1.0 - (1.0 - edge) * (ring + 0.5) / kRings;
    const double s = std::sqrt(1.0 - c * c);
    for (int spoke = 0; spoke < kSpokes; ++spoke) {
      const double a = 2 * kPi * (spoke + 0.5 * (ring % 2)) / kSpokes;
      const auto range =
          terrain.intersect(position, Vec3{s * std::cos(a), s * std::sin(a), c}, 100.0);
      if (range.has_value() && *range < bin_m * bins) {
        energy[static_cast<std::size_t>(*range / bin_m)] += (c - edge) / (1.0 - edge);
      }
    }
  }
  return energy;
}

TEST(intensities_give_the_range_that_the_scenes_have) {
  Random random(1);
  for (const double noise : {0.0, 2.0, 5.0}) {
    double sum = 0;
    double squares = 0;
    int count = 0;
    for (const double slope : {0.0, 0.3, 0.7}) {
      const Terrain terrain = ground(slope);
      EchoSpec spec;
      spec.beam_half_angle_deg = 6.0;
      spec.range_bin_m = 0.01;
      spec.ray_count = 6000;
      EchoModel echo(terrain, spec);
      for (int i = 0; i < 25; ++i) {
        const Vec3 position{22.0 + 16.0 * random.uniform(), 22.0 + 16.0 * random.uniform(), 12.0};
        const auto expected = echo.measure(position, Vec3{0.0, 0.0, 1.0});
        assert_true(expected.has_value());
        const double bin_m = 0.05;
        const std::vector<double> energy =
            energies(terrain, position, 6.0 * kPi / 180, bin_m, 1000);
        const double most = *std::max_element(energy.begin(), energy.end());
        std::vector<std::uint16_t> bins;
        for (const double value : energy) {
          const double heard = 30.0 + 200.0 * value / most + noise * random.normal();
          bins.push_back(static_cast<std::uint16_t>(std::clamp(std::lround(heard), 0L, 255L)));
        }
        const RangeProfile profile{bins.data(), 50'000, 25'000, 1000};
        const auto found = detect_echo(profile, EchoDetectorConfig{6554, 500'000, 50'000'000});
        assert_true(found.found);
        const double error = static_cast<double>(found.range_um) * 1e-6 - *expected;
        sum += error;
        squares += error * error;
        ++count;
      }
    }
    print_message("noise %g of 255: mean %.4f m, rms %.4f m over %d echoes, bins of 0.05 m\n",
                  noise, sum / count, std::sqrt(squares / count), count);
    assert_near(sum / count, 0.0, 0.02);
    assert_true(std::sqrt(squares / count) < 0.04 + 0.01 * noise);
  }
}

}  // namespace
