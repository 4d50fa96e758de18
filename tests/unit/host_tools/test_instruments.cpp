#include <algorithm>
#include <cmath>
#include <vector>

#include "host_tools/emulate/instruments.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::Attitude;
using leadline::host::build_ground;
using leadline::host::FixReading;
using leadline::host::Heard;
using leadline::host::Mission;
using leadline::host::MissionOptions;
using leadline::host::NavigationSensors;
using leadline::host::resolve_mission;
using leadline::host::SlowError;
using leadline::host::Sounder;
using leadline::host::Terrain;
using leadline::host::TouchedMask;
using leadline::host::Trajectory;
using leadline::host::TruePose;

// Level ground, no errors, no hull motion.
Mission quiet() {
  MissionOptions options;
  options.terrain = "plane";
  options.settings = {"north_count=48",     "east_count=48",        "line_spacing_m=4",
                      "roll_deg=0",         "pitch_deg=0",          "yaw_deg=0",
                      "sigma_range_m=0",    "outlier_fraction=0",   "dropout_fraction=0",
                      "misalignment_deg=0", "beam_half_angle_deg=2"};
  return resolve_mission(options);
}

constexpr std::int64_t kOnTheLine_us = 8'000'000;

TEST(ranges_over_level_ground_are_what_the_geometry_says) {
  const Mission mission = quiet();
  const Terrain ground = build_ground(mission);
  const Trajectory flight(ground, mission.motion);
  const double altitude_m = ground.shallowest_m() - flight.at(kOnTheLine_us).position_m.z;
  assert_near(altitude_m, 4.0, 0.05);
  for (std::size_t head = 0; head < 3; ++head) {
    Sounder sounder(ground, flight, mission, head);
    const Heard heard = sounder.ping(kOnTheLine_us, 0.0, nullptr);
    assert_true(heard.range_m.has_value());
    // Nearest part of a cone of two degrees, tilted by 0 or 15: a little short of the axis.
    const double tilt_deg = head == 0 ? 0.0 : 15.0;
    const double axis_m = (altitude_m - 0.1) / std::cos(tilt_deg * 0.0174533);
    assert_true(*heard.range_m > 0.99 * axis_m - 0.03);
    assert_true(*heard.range_m < axis_m + 0.03);
  }
}

TEST(the_port_head_looks_to_port_and_the_mask_says_so) {
  const Mission mission = quiet();
  const Terrain ground = build_ground(mission);
  const Trajectory flight(ground, mission.motion);
  const TruePose pose = flight.at(kOnTheLine_us);  // northwards: port is west
  const double signs[] = {0.0, -1.0, 1.0};
  for (std::size_t head = 0; head < 3; ++head) {
    Sounder sounder(ground, flight, mission, head);
    TouchedMask touched(ground.north_count() * ground.east_count(), 0);
    (void)sounder.ping(kOnTheLine_us, 0.0, &touched);
    double sum_m = 0.0;
    double count = 0.0;
    for (std::size_t k = 0; k < touched.size(); ++k) {
      const double east_m = ground.origin_east_m() +
                            (static_cast<double>(k % ground.east_count()) + 0.5) * ground.cell_m();
      sum_m += touched[k] * (east_m - pose.position_m.y);
      count += touched[k];
    }
    assert_true(count > 1.0);
    assert_near(sum_m / count, signs[head] * (0.2 + 4.0 * std::tan(15.0 * 0.0174533)), 0.3);
  }
}

TEST(an_echo_has_its_peak_at_the_range) {
  Mission mission = quiet();
  mission.profile = true;
  const Terrain ground = build_ground(mission);
  const Trajectory flight(ground, mission.motion);
  Sounder sounder(ground, flight, mission, 0);
  const Heard heard = sounder.ping(kOnTheLine_us, 0.0, nullptr);
  std::vector<std::uint8_t> samples(200);
  sounder.profile(1.0, 19.0, &samples);
  const auto peak = std::max_element(samples.begin(), samples.end());
  const double peak_m = 1.0 + 19.0 * (static_cast<double>(peak - samples.begin()) + 0.5) / 200.0;
  assert_near(peak_m, *heard.range_m, 0.2);
  assert_true(*peak >= 200);
  // Far from it there is noise and nothing else.
  for (std::size_t k = 100; k < 200; ++k) {
    assert_true(samples[k] < 120);
  }
}

TEST(outliers_and_dropouts_come_as_often_as_asked) {
  Mission mission = quiet();
  mission.errors.outlier_fraction = 0.2;
  mission.errors.dropout_fraction = 0.1;
  const Terrain ground = build_ground(mission);
  const Trajectory flight(ground, mission.motion);
  Sounder sounder(ground, flight, mission, 0);
  int outliers = 0;
  int dropouts = 0;
  constexpr int kPings = 2000;
  for (int k = 0; k < kPings; ++k) {
    const Heard heard = sounder.ping(kOnTheLine_us + 1000 * k, 0.0, nullptr);
    outliers += heard.outlier ? 1 : 0;
    dropouts += heard.dropout ? 1 : 0;
    assert_true(heard.dropout == !heard.range_m.has_value());
  }
  assert_near(dropouts, 0.1 * kPings, 5.0 * std::sqrt(0.09 * kPings));
  assert_near(outliers, 0.2 * 0.9 * kPings, 5.0 * std::sqrt(0.16 * kPings));
}

TEST(slow_errors_grow_to_their_sigma_and_stay_continuous) {
  double sum2 = 0.0;
  constexpr int kRuns = 2000;
  for (int run = 0; run < kRuns; ++run) {
    SlowError error(2.0, 10.0, static_cast<std::uint64_t>(run), 3);
    assert_near(error.at(0), 0.0, 0.0);
    const double settled = error.at(100'000'000);
    sum2 += settled * settled;
    assert_near(error.at(100'000'000), settled, 0.0);
    assert_near(error.at(100'001'000), settled, 0.2);
  }
  assert_near(std::sqrt(sum2 / kRuns), 2.0, 0.2);
}

TEST(sensors_tell_the_truth_but_for_their_noise) {
  Mission mission = quiet();
  mission.navigation.heading_drift_deg = 0.0;
  mission.navigation.fix_drift_m = 0.0;
  const Terrain ground = build_ground(mission);
  const Trajectory flight(ground, mission.motion);
  NavigationSensors sensors(flight, mission);
  const TruePose truth = flight.at(kOnTheLine_us);
  double roll2 = 0.0;
  double north_m = 0.0;
  double east_m = 0.0;
  double depth_m = 0.0;
  constexpr int kReadings = 4000;
  for (int k = 0; k < kReadings; ++k) {
    const Attitude attitude = sensors.attitude(kOnTheLine_us);
    roll2 += (attitude.roll_deg - truth.attitude.roll_deg) *
             (attitude.roll_deg - truth.attitude.roll_deg);
    const FixReading fix = sensors.fix(kOnTheLine_us);
    // Lengths of a degree at 54.18 north on WGS 84.
    north_m += (fix.latitude_deg - 54.18) * 111'318.6;
    east_m += (fix.longitude_deg - 7.89) * 65'305.2;
    depth_m += (sensors.pressure_pa(kOnTheLine_us) - 101'325.0) / (1029.0 * 9.80665);
  }
  assert_near(std::sqrt(roll2 / kReadings), 0.15, 0.01);
  assert_near(north_m / kReadings, truth.position_m.x, 0.02);
  assert_near(east_m / kReadings, truth.position_m.y, 0.02);
  assert_near(depth_m / kReadings, truth.position_m.z, 0.002);
}

}  // namespace
