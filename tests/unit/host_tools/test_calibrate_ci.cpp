// The patch test on simulated surveys whose misalignment is known.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "host_tools/calibrate.hpp"
#include "host_tools/calibrate_command.hpp"
#include "host_tools/calibrate_sources.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/sim/random.hpp"
#include "host_tools/sim/simulator.hpp"
#include "host_tools/sim/terrain_sources.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::Alignment;
using leadline::host::AlignmentParameter;
using leadline::host::Attitude;
using leadline::host::CalibratedParameter;
using leadline::host::Calibration;
using leadline::host::CalibrationSettings;
using leadline::host::HostError;
using leadline::host::kAlignmentParameters;
using leadline::host::kAlignmentTraits;
using leadline::host::PingRow;
using leadline::host::PingSoundings;
using leadline::host::Scene;
using leadline::host::SimulatedPing;
using leadline::host::Survey;
using leadline::host::SurveyGeometry;
using leadline::host::Terrain;
using leadline::host::Vec3;

constexpr std::size_t kRoll = 0;
constexpr std::size_t kPitch = 1;
constexpr std::size_t kHeading = 2;
constexpr std::size_t kLatency = 3;
constexpr std::size_t kForward = 4;
constexpr std::size_t kStarboard = 5;

Scene scene_of(std::uint64_t seed) {
  Scene scene;
  scene.seed = seed;
  scene.echo.beam_half_angle_deg = 0.5;
  scene.echo.ray_count = 9;
  scene.echo.detection_fraction = 0.5;
  scene.echo.range_bin_m = 0.005;
  scene.survey.interval_s = 0.1;
  scene.survey.line_spacing_m = 6.0;
  scene.survey.along_step_m = 0.25;
  scene.survey.altitude_m = 8.0;
  scene.survey.altitude_smoothing_m = 10.0;
  scene.survey.beam_count = 21;
  scene.survey.opening_deg = 100.0;
  scene.survey.roll = {4.0, 4.1, 0.0};
  scene.survey.pitch = {2.0, 5.3, 1.0};
  scene.survey.yaw = {3.0, 9.7, 2.0};
  scene.errors.sigma_range_m = 0.02;
  scene.errors.sigma_pointing_deg = 0.1;
  scene.errors.sigma_position_m = {0.02, 0.02, 0.01};
  scene.errors.outlier_fraction = 0.01;
  return scene;
}

Terrain hills(std::uint64_t seed) {
  leadline::host::ProceduralOptions options;
  options.seed = seed;
  options.north_count = 96;
  options.east_count = 96;
  options.relief_cells = 10.0;
  return leadline::host::make_procedural_terrain(options);
}

Terrain level() {
  return Terrain(96, 96, 0.5, 0.0, 0.0, std::vector<double>(std::size_t{96} * 96, 15.0));
}

leadline::base::Bam32 bam(double degrees) {
  return static_cast<leadline::base::Bam32>(
      static_cast<std::int64_t>(std::llround(degrees / 360.0 * 4294967296.0)));
}

/// What the vehicle would have reported, had it not known `truth`: directions as in a head that is turned on
/// its mount, attitudes of `latency` ago, positions of where it takes the head to be.
std::vector<PingRow> reported(const Survey& survey, const Alignment& truth) {
  const Attitude turned = {truth[kRoll], truth[kPitch], truth[kHeading]};
  const Vec3 axes[] = {world_from_vehicle(turned, {1, 0, 0}), world_from_vehicle(turned, {0, 1, 0}),
                       world_from_vehicle(turned, {0, 0, 1})};
  std::vector<std::pair<std::int64_t, Attitude>> attitudes;
  for (const SimulatedPing& ping : survey.pings) {
    if (attitudes.empty() || ping.time_us > attitudes.back().first) {
      attitudes.emplace_back(ping.time_us, ping.attitude);
    }
  }
  const auto late_us = static_cast<std::int64_t>(1000.0 * truth[kLatency]);
  std::vector<PingRow> rows;
  std::size_t now = 1;
  for (const SimulatedPing& ping : survey.pings) {
    while (now + 1 < attitudes.size() && attitudes[now].first < ping.time_us - late_us) {
      ++now;
    }
    const auto& [t_a, a] = attitudes[now - 1];
    const auto& [t_b, b] = attitudes[now];
    const double share =
        static_cast<double>(ping.time_us - late_us - t_a) / static_cast<double>(t_b - t_a);
    if (!ping.range_m || share < 0 || t_b - t_a > 200'000 ||
        std::fabs(std::remainder(b.heading_deg - a.heading_deg, 360.0)) > 10.0 ||
        std::fabs(std::remainder(ping.attitude.heading_deg - b.heading_deg, 360.0)) > 10.0) {
      continue;
    }
    const auto mix = [share](double from, double to) {
      return from + share * std::remainder(to - from, 360.0);
    };
    PingRow row{};
    row.t_us = ping.time_us;
    const Vec3 taken = ping.position_m -
                       world_from_vehicle(ping.attitude, {truth[kForward], truth[kStarboard], 0.0});
    row.position_um[0] = std::llround(1e6 * taken.x);
    row.position_um[1] = std::llround(1e6 * taken.y);
    row.position_um[2] = std::llround(1e6 * taken.z);
    row.attitude = {bam(mix(a.roll_deg, b.roll_deg)), bam(mix(a.pitch_deg, b.pitch_deg)),
                    bam(mix(a.heading_deg, b.heading_deg))};
    const Vec3 looks = vehicle_direction(ping.beam);
    const auto beam = leadline::host::beam_angles(
        {dot(looks, axes[0]), dot(looks, axes[1]), dot(looks, axes[2])});
    row.azimuth_bam32 = bam(beam.azimuth_deg);
    row.elevation_bam32 = bam(beam.elevation_deg);
    row.range_um = std::llround(1e6 * *ping.range_m);
    row.has_range = true;
    rows.push_back(row);
  }
  return rows;
}

Alignment random_truth(std::uint64_t seed) {
  leadline::host::Random random(seed, 99);
  Alignment truth{};
  truth[kRoll] = random.uniform(-2.0, 2.0);
  truth[kPitch] = random.uniform(-2.0, 2.0);
  truth[kHeading] = random.uniform(-3.0, 3.0);
  truth[kLatency] = random.uniform(-60.0, 60.0);
  truth[kStarboard] = random.uniform(-0.5, 0.5);
  return truth;
}

Calibration calibrated(const std::vector<PingRow>& rows, const CalibrationSettings& settings) {
  PingSoundings source{SurveyGeometry{}};
  source.add_line(rows);
  return calibrate(source, settings);
}

/// For people who work on this: LEADLINE_SHOW=1.
void show(const Calibration& result) {
  if (std::getenv("LEADLINE_SHOW") != nullptr) {
    for (std::size_t p = 0; p < kAlignmentParameters; ++p) {
      const CalibratedParameter& found = result.parameters[p];
      std::printf("%s %d %.4f +- %.4f %s\n", kAlignmentTraits[p].name, found.observable ? 1 : 0,
                  found.value, found.sigma, found.why_not.c_str());
    }
  }
}

}  // namespace

TEST(misalignments_come_out_within_their_sigmas) {
  constexpr std::uint64_t kSeeds = 24;
  double squares[kAlignmentParameters] = {};
  unsigned counts[kAlignmentParameters] = {};
  unsigned within_one[kAlignmentParameters] = {};
  double worst[kAlignmentParameters] = {};
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Alignment truth = random_truth(seed);
    const Calibration result =
        calibrated(reported(simulate(hills(seed), scene_of(seed)), truth), {});
    assert_true(result.spread_after_m < result.spread_before_m);
    for (std::size_t p = 0; p < kAlignmentParameters; ++p) {
      const CalibratedParameter& found = result.parameters[p];
      if (!found.observable) {
        continue;
      }
      const double off = (found.value - truth[p]) / found.sigma;
      if (std::getenv("LEADLINE_SHOW") != nullptr) {
        std::printf("seed %d %s: truth %.4f found %.4f +- %.4f (%.2f)\n", static_cast<int>(seed),
                    kAlignmentTraits[p].name, truth[p], found.value, found.sigma, off);
      }
      squares[p] += off * off;
      counts[p] += 1;
      worst[p] = std::max(worst[p], std::fabs(off));
      within_one[p] += std::fabs(off) <= 1.0 ? 1 : 0;
    }
  }
  for (std::size_t p = 0; p < kAlignmentParameters; ++p) {
    std::printf("%s: observable in %u of %u, rms of error over sigma %.2f, within one sigma %u\n",
                kAlignmentTraits[p].name, counts[p], static_cast<unsigned>(kSeeds),
                counts[p] == 0 ? 0.0 : std::sqrt(squares[p] / counts[p]), within_one[p]);
  }
  // Boresight, latency and starboard each time, errors as the sigmas say; forward goes with pitch.
  for (const std::size_t p : {kRoll, kPitch, kHeading, kLatency, kStarboard}) {
    assert_int_equal(counts[p], kSeeds);
    assert_true(std::sqrt(squares[p] / counts[p]) < 1.5);
    assert_true(worst[p] < 4.0);
    assert_true(5 * within_one[p] >= 2 * kSeeds);
  }
}

TEST(what_a_level_bottom_does_not_show_gets_no_number) {
  Scene scene = scene_of(3);
  scene.survey.roll.amplitude_deg = 0;
  scene.survey.pitch.amplitude_deg = 0;
  scene.survey.yaw.amplitude_deg = 0;
  Alignment truth{};
  truth[kRoll] = 1.5;
  const Calibration result = calibrated(reported(simulate(level(), scene), truth), {});
  show(result);
  const CalibratedParameter& roll = result.parameters[kRoll];
  assert_true(roll.observable);
  assert_true(std::fabs(roll.value - truth[kRoll]) < 4.0 * roll.sigma);
  for (const std::size_t p : {kHeading, kLatency, kForward, kStarboard}) {
    assert_false(result.parameters[p].observable);
    assert_false(result.parameters[p].why_not.empty());
  }
}

TEST(motion_over_a_level_bottom_shows_the_heading) {
  Alignment truth{};
  truth[kRoll] = 1.5;
  truth[kHeading] = 2.0;
  const Calibration result = calibrated(reported(simulate(level(), scene_of(3)), truth), {});
  show(result);
  for (const std::size_t p : {kRoll, kHeading, kLatency}) {
    const CalibratedParameter& found = result.parameters[p];
    assert_true(found.observable);
    assert_true(std::fabs(found.value - truth[p]) < 4.0 * found.sigma);
  }
}

TEST(a_single_line_shows_no_boresight) {
  Scene scene = scene_of(4);
  scene.survey.line_spacing_m = 48.0;
  scene.survey.beam_count = 61;
  const Calibration result = calibrated(reported(simulate(hills(4), scene), Alignment{}), {});
  assert_int_equal(result.shared_cells, 0);
  for (const std::size_t p : {kRoll, kPitch, kHeading}) {
    assert_false(result.parameters[p].observable);
    assert_true(result.parameters[p].why_not.find("two passes") != std::string::npos);
  }
}

TEST(a_wrong_sign_ends_the_command) {
  std::vector<PingRow> rows = reported(simulate(hills(5), scene_of(5)), Alignment{});
  std::string text =
      "time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m\n";
  const auto degrees = [](leadline::base::Bam32 angle) {
    return 360.0 / 4294967296.0 * static_cast<double>(static_cast<std::int32_t>(angle));
  };
  for (const PingRow& row : rows) {
    char line[256];
    std::snprintf(line, sizeof line, "%lld,%.4f,%.4f,%.4f,%.5f,%.5f,%.5f,%.5f,%.5f,%.4f\n",
                  static_cast<long long>(row.t_us), 1e-6 * static_cast<double>(row.position_um[0]),
                  1e-6 * static_cast<double>(row.position_um[1]),
                  1e-6 * static_cast<double>(row.position_um[2]), degrees(row.attitude.roll_bam32),
                  degrees(row.attitude.pitch_bam32), degrees(row.attitude.heading_bam32),
                  degrees(row.azimuth_bam32), degrees(row.elevation_bam32),
                  1e-6 * static_cast<double>(row.range_um));
    text += line;
  }
  leadline::host::CalibrateOptions options;
  options.survey.paths = {leadline::test::scratch_directory() + "/pings.csv"};
  leadline::host::write_file_whole(options.survey.paths.front(), text);
  assert_int_equal(leadline::host::run_calibrate(options), 0);
  options.json = true;
  options.survey.geometry.roll_sign = -1;
  std::string message;
  try {
    (void)leadline::host::run_calibrate(options);
  } catch (const HostError& error) {
    message = error.what();
  }
  if (message.find("with roll flipped") == std::string::npos) {
    fail_msg("\"%s\" does not say that roll is wrong", message.c_str());
  }
  options.survey.paths.emplace_back("line.xtf");
  assert_true(leadline::host::ExitCode::kUsage == [&] {
    try {
      (void)leadline::host::run_calibrate(options);
    } catch (const HostError& error) {
      return error.code();
    }
    return leadline::host::ExitCode::kOk;
  }());
}

TEST(too_few_soundings_are_said) {
  std::vector<PingRow> rows = reported(simulate(level(), scene_of(6)), Alignment{});
  rows.resize(200);
  std::string message;
  try {
    (void)calibrated(rows, {});
  } catch (const HostError& error) {
    message = error.what();
  }
  assert_true(message.find("at least 20") != std::string::npos);
}
