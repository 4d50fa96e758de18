#include <algorithm>
#include <cmath>
#include <fstream>
#include <iterator>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/map_config.hpp"
#include "host_tools/raster.hpp"
#include "host_tools/sim/scenario.hpp"
#include "host_tools/sim/simulator.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::apply_setting;
using leadline::host::build_terrain;
using leadline::host::ExitCode;
using leadline::host::format_map_toml;
using leadline::host::format_pings_csv;
using leadline::host::HostError;
using leadline::host::MapConfig;
using leadline::host::Raster;
using leadline::host::resolve_scenario;
using leadline::host::run_simulate;
using leadline::host::Scenario;
using leadline::host::Scene;
using leadline::host::simulate;
using leadline::host::SimulatedPing;
using leadline::host::SimulateOptions;
using leadline::host::Survey;
using leadline::host::SurveyKind;
using leadline::host::Terrain;
using leadline::host::Vec3;

std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
}

std::uint64_t hash_of(const std::string& text) {
  std::uint64_t hash = 0xCBF29CE484222325ULL;
  for (const char c : text) {
    hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001B3ULL;
  }
  return hash;
}

void assert_says(const std::string& text, const std::string& part) {
  if (text.find(part) == std::string::npos) {
    fail_msg("\"%s\" does not say \"%s\"", text.c_str(), part.c_str());
  }
}

// What a HostError said and its code; "" if there was none.
template <typename Action>
std::string complaint(ExitCode code, Action action) {
  try {
    action();
  } catch (const HostError& error) {
    assert_int_equal(static_cast<int>(error.code()), static_cast<int>(code));
    return error.what();
  }
  return "";
}

Terrain level(double depth_m) {
  return Terrain(60, 60, 1.0, 0.0, 0.0, std::vector<double>(3600, depth_m));
}

Scene quiet_fan() {
  Scene scene;
  scene.survey.line_spacing_m = 20.0;
  scene.survey.along_step_m = 2.0;
  scene.survey.altitude_m = 10.0;
  scene.survey.beam_count = 5;
  scene.survey.opening_deg = 80.0;
  scene.echo.range_bin_m = 0.01;
  scene.echo.beam_half_angle_deg = 1.0;
  return scene;
}

TEST(fan_is_reported_port_to_starboard_and_lines_alternate) {
  const Survey survey = simulate(level(40.0), quiet_fan());
  std::map<std::int64_t, std::vector<SimulatedPing>> transmissions;
  for (const SimulatedPing& ping : survey.pings) {
    transmissions[ping.time_us].push_back(ping);
  }
  // First line northwards at east 10, second southwards at east 30; 30 positions each.
  const std::vector<SimulatedPing>& north = transmissions.at(15 * 100000);
  assert_near(north[0].position_m.x, 30.5, 1e-9);
  assert_near(north[0].position_m.y, 10.0, 1e-9);
  assert_near(north[0].position_m.z, 30.0, 1e-9);
  assert_near(north[0].attitude.heading_deg, 0.0, 1e-9);
  const std::vector<SimulatedPing>& south = transmissions.at(45 * 100000);
  assert_near(south[0].position_m.x, 29.5, 1e-9);
  assert_near(south[0].position_m.y, 30.0, 1e-9);
  assert_near(south[0].attitude.heading_deg, 180.0, 1e-9);
  assert_int_equal(south.size(), 5);
  const double expected_el_deg[5] = {50.0, 70.0, 90.0, 70.0, 50.0};
  for (std::size_t k = 0; k < 5; ++k) {
    assert_near(south[k].beam.elevation_deg, expected_el_deg[k], 1e-9);
    if (k != 2) {
      assert_near(south[k].beam.azimuth_deg, k < 2 ? -90.0 : 90.0, 1e-9);
    }
    // First return: a little nearer than the axis on the slanted beams.
    const double axial_m = 10.0 / std::sin(expected_el_deg[k] * leadline::host::exact::kRadPerDeg);
    assert_true(south[k].range_m.has_value());
    assert_true(*south[k].range_m <= axial_m + 0.01 && *south[k].range_m > 0.975 * axial_m);
  }
}

// Reported pose, beam and range put the echo on the ground: the whole chain of conventions at once,
// on ground that is high in one corner only.
TEST(reported_columns_point_at_the_ground_that_was_hit) {
  std::vector<double> depth_m(3600);
  for (std::size_t i = 0; i < 60; ++i) {
    for (std::size_t j = 0; j < 60; ++j) {
      depth_m[i * 60 + j] = 40.0 - 0.1 * static_cast<double>(i) - 0.05 * static_cast<double>(j) -
                            (i > 40 && j < 20 ? 5.0 : 0.0);
    }
  }
  const Terrain terrain(60, 60, 1.0, 0.0, 0.0, depth_m);
  Scene scene = quiet_fan();
  scene.survey.roll.amplitude_deg = 15.0;
  scene.survey.pitch.amplitude_deg = 12.0;
  scene.survey.yaw.amplitude_deg = 20.0;
  scene.echo.beam_half_angle_deg = 0.05;
  for (const SurveyKind kind : {SurveyKind::kLawnmower, SurveyKind::kRandom}) {
    scene.survey.kind = kind;
    scene.survey.ping_count = 1000;
    const Survey survey = simulate(terrain, scene);
    assert_true(survey.pings.size() > 100);
    for (const SimulatedPing& ping : survey.pings) {
      const Vec3 hit =
          ping.position_m +
          *ping.range_m * leadline::host::world_from_vehicle(
                              ping.attitude, leadline::host::vehicle_direction(ping.beam));
      // The step has a steep face: there the pencil beam's width shows.
      const bool near_step = std::fabs(hit.x - 41.0) < 1.5 || std::fabs(hit.y - 20.0) < 1.5;
      if (!near_step) {
        assert_near(hit.z, terrain.depth_m(hit.x, hit.y), 0.05);
      }
    }
  }
}

TEST(random_survey_keeps_altitude_tilt_and_time) {
  Scene scene;
  scene.survey.kind = SurveyKind::kRandom;
  scene.survey.interval_s = 0.02;
  scene.survey.ping_count = 4000;
  scene.survey.altitude_min_m = 5.0;
  scene.survey.altitude_max_m = 15.0;
  scene.survey.max_tilt_deg = 30.0;
  const Terrain terrain = level(40.0);
  const Survey survey = simulate(terrain, scene);
  assert_int_equal(survey.planned_count, 4000);
  assert_int_equal(survey.pings.size() + survey.missed_count, 4000);
  std::int64_t last_us = -1;
  double cos_sum = 0.0;
  for (const SimulatedPing& ping : survey.pings) {
    assert_true(ping.time_us > last_us && ping.time_us % 20000 == 0);
    last_us = ping.time_us;
    const double altitude_m = 40.0 - ping.position_m.z;
    assert_true(altitude_m >= 5.0 && altitude_m <= 15.0);
    assert_true(ping.beam.elevation_deg >= 60.0 - 1e-9);
    assert_true(ping.attitude.heading_deg >= 0.0 && ping.attitude.heading_deg < 360.0);
    assert_true(terrain.contains(ping.position_m.x, ping.position_m.y));
    cos_sum += std::sin(ping.beam.elevation_deg * leadline::host::exact::kRadPerDeg);
  }
  // Uniform in solid angle: the mean cosine is half way (pings lost at the edges are tilted ones).
  const double mean_cos = cos_sum / static_cast<double>(survey.pings.size());
  assert_near(mean_cos, 0.5 * (1.0 + std::cos(30.0 * leadline::host::exact::kRadPerDeg)), 0.004);
}

TEST(errors_have_the_size_asked_for) {
  Scene quiet = quiet_fan();
  quiet.survey.along_step_m = 0.05;
  quiet.survey.opening_deg = 20.0;
  quiet.survey.line_spacing_m = 60.0;
  Scene noisy = quiet;
  noisy.errors.sigma_range_m = 0.3;
  noisy.errors.sigma_pointing_deg = 0.7;
  noisy.errors.sigma_position_m = {0.4, 0.2, 0.1};
  const Terrain terrain = level(40.0);
  const Survey a = simulate(terrain, quiet);
  const Survey b = simulate(terrain, noisy);
  assert_int_equal(a.pings.size(), b.pings.size());
  const double count = static_cast<double>(a.pings.size());
  assert_true(count > 5000.0);
  double range2 = 0.0;
  double angle2 = 0.0;
  double north2 = 0.0;
  double east2 = 0.0;
  double down2 = 0.0;
  for (std::size_t k = 0; k < a.pings.size(); ++k) {
    const double range_m = *b.pings[k].range_m - *a.pings[k].range_m;
    const Vec3 position = b.pings[k].position_m - a.pings[k].position_m;
    const Vec3 turn = leadline::host::vehicle_direction(b.pings[k].beam) -
                      leadline::host::vehicle_direction(a.pings[k].beam);
    range2 += range_m * range_m / count;
    angle2 += dot(turn, turn) / count;
    north2 += position.x * position.x / count;
    east2 += position.y * position.y / count;
    down2 += position.z * position.z / count;
    // Attitude is reported as it is; the pointing error is in the beam columns.
    assert_near(b.pings[k].attitude.roll_deg, a.pings[k].attitude.roll_deg, 0.0);
  }
  assert_near(std::sqrt(range2), 0.3, 0.015);
  // Two axes of 0.7 deg each.
  assert_near(std::sqrt(angle2 / 2.0) * leadline::host::exact::kDegPerRad, 0.7, 0.035);
  assert_near(std::sqrt(north2), 0.4, 0.02);
  assert_near(std::sqrt(east2), 0.2, 0.01);
  assert_near(std::sqrt(down2), 0.1, 0.005);
}

TEST(errors_come_from_separate_streams) {
  Scene all = quiet_fan();
  all.errors.sigma_range_m = 0.3;
  all.errors.sigma_pointing_deg = 0.7;
  all.errors.sigma_position_m = {0.4, 0.2, 0.1};
  all.errors.drift_sigma_m = 1.0;
  Scene fewer = all;
  fewer.errors.sigma_pointing_deg = 0.0;
  fewer.errors.drift_sigma_m = 0.0;
  Scene with_drops = all;
  with_drops.errors.dropout_fraction = 0.3;
  const Terrain terrain = level(40.0);
  const Survey a = simulate(terrain, all);
  const Survey b = simulate(terrain, fewer);
  const Survey c = simulate(terrain, with_drops);
  for (std::size_t k = 0; k < a.pings.size(); ++k) {
    assert_near(*a.pings[k].range_m, *b.pings[k].range_m, 0.0);
    assert_near(a.pings[k].position_m.z, b.pings[k].position_m.z, 0.0);
    assert_near(a.pings[k].position_m.x, c.pings[k].position_m.x, 0.0);
    if (c.pings[k].range_m.has_value()) {
      assert_near(*a.pings[k].range_m, *c.pings[k].range_m, 0.0);
    }
  }
}

TEST(drift_is_horizontal_slow_and_shared_by_a_transmission) {
  Scene scene = quiet_fan();
  scene.survey.along_step_m = 0.01;
  scene.survey.line_spacing_m = 15.0;
  scene.survey.beam_count = 2;
  scene.survey.opening_deg = 4.0;
  scene.survey.interval_s = 1.0;
  scene.echo.ray_count = 3;
  Scene drifting = scene;
  drifting.errors.drift_sigma_m = 0.8;
  drifting.errors.drift_time_s = 20.0;
  const Terrain terrain = level(40.0);
  const Survey a = simulate(terrain, scene);
  const Survey b = simulate(terrain, drifting);
  std::vector<double> north_m;
  for (std::size_t k = 0; k < a.pings.size(); k += 2) {
    const Vec3 first = b.pings[k].position_m - a.pings[k].position_m;
    const Vec3 second = b.pings[k + 1].position_m - a.pings[k + 1].position_m;
    assert_near(first.x, second.x, 1e-9);
    assert_near(first.z, 0.0, 0.0);
    north_m.push_back(first.x);
  }
  assert_near(north_m[0], 0.0, 1e-9);  // starts from a good fix
  double variance = 0.0;
  double lag20 = 0.0;
  const std::size_t lags = north_m.size() - 20;
  for (std::size_t k = 0; k < lags; ++k) {
    variance += north_m[k] * north_m[k] / static_cast<double>(lags);
    lag20 += north_m[k] * north_m[k + 20] / static_cast<double>(lags);
  }
  // 24,000 s are 1,200 correlation times.
  assert_true(north_m.size() > 20000);
  assert_near(std::sqrt(variance), 0.8, 0.08);
  assert_near(lag20 / variance, std::exp(-1.0), 0.08);
}

TEST(outliers_fall_short_and_dropouts_are_empty) {
  Scene scene = quiet_fan();
  scene.survey.along_step_m = 0.05;
  scene.survey.opening_deg = 20.0;
  Scene faulty = scene;
  faulty.errors.outlier_fraction = 0.10;
  faulty.errors.dropout_fraction = 0.20;
  const Terrain terrain = level(40.0);
  const Survey a = simulate(terrain, scene);
  const Survey b = simulate(terrain, faulty);
  const double count = static_cast<double>(a.pings.size());
  assert_int_equal(a.pings.size(), b.pings.size());
  std::size_t empty_count = 0;
  std::size_t short_count = 0;
  double share_sum = 0.0;
  for (std::size_t k = 0; k < a.pings.size(); ++k) {
    if (!b.pings[k].range_m.has_value()) {
      ++empty_count;
    } else if (*b.pings[k].range_m != *a.pings[k].range_m) {
      ++short_count;
      const double share = *b.pings[k].range_m / *a.pings[k].range_m;
      assert_true(share > 0.0 && share < 1.0);
      share_sum += share;
    }
  }
  assert_int_equal(empty_count, b.dropout_count);
  assert_int_equal(short_count, b.outlier_count);
  assert_near(static_cast<double>(empty_count) / count, 0.20, 0.02);
  assert_near(static_cast<double>(short_count) / count, 0.08, 0.012);
  assert_near(share_sum / static_cast<double>(short_count), 0.5, 0.05);
  // Both runs shone on the same ground.
  assert_true(a.touched == b.touched);
}

TEST(altitude_is_smoothed_but_stays_safe) {
  std::vector<double> depth_m(3600, 40.0);
  for (std::size_t j = 0; j < 60; ++j) {
    for (std::size_t i = 28; i < 32; ++i) {
      depth_m[i * 60 + j] = 33.0;  // a wall of 7 m
    }
  }
  const Terrain terrain(60, 60, 1.0, 0.0, 0.0, depth_m);
  Scene scene = quiet_fan();
  scene.survey.altitude_smoothing_m = 8.0;
  double last_z = 0.0;
  double steepest = 0.0;
  const Survey survey = simulate(terrain, scene);
  for (const SimulatedPing& ping : survey.pings) {
    if (ping.time_us >= 30 * 100000) {
      break;
    }
    assert_true(terrain.depth_m(ping.position_m.x, ping.position_m.y) - ping.position_m.z >=
                5.0 - 1e-9);
    if (ping.time_us > 0) {
      steepest = std::max(steepest, std::fabs(ping.position_m.z - last_z));
    }
    last_z = ping.position_m.z;
  }
  assert_true(steepest < 4.0);
  // A constant depth.
  scene.survey.depth_m = 20.0;
  for (const SimulatedPing& ping : simulate(terrain, scene).pings) {
    assert_near(ping.position_m.z, 20.0, 0.0);
  }
}

TEST(scene_options_are_checked) {
  const Terrain terrain = level(40.0);
  const auto says = [&](const Scene& scene, const char* field) {
    try {
      (void)simulate(terrain, scene);
      fail_msg("%s was accepted", field);
    } catch (const std::invalid_argument& error) {
      assert_says(error.what(), field);
    }
  };
  Scene scene = quiet_fan();
  scene.survey.interval_s = 0.0;
  says(scene, "interval_s");
  scene = quiet_fan();
  scene.survey.line_spacing_m = -1.0;
  says(scene, "line_spacing_m");
  scene = quiet_fan();
  scene.survey.along_step_m = std::nan("");
  says(scene, "along_step_m");
  scene = quiet_fan();
  scene.survey.along_step_m = 1e-12;
  says(scene, "along_step_m");
  scene = quiet_fan();
  scene.survey.beam_count = 0;
  says(scene, "beam_count");
  scene = quiet_fan();
  scene.survey.opening_deg = 180.0;
  says(scene, "opening_deg");
  scene = quiet_fan();
  scene.survey.depth_m = 45.0;
  says(scene, "depth_m");
  scene = quiet_fan();
  scene.survey.roll.period_s = 0.0;
  says(scene, "roll.period_s");
  scene = quiet_fan();
  scene.errors.outlier_fraction = 1.01;
  says(scene, "outlier_fraction");
  scene = quiet_fan();
  scene.errors.sigma_position_m.z = -0.1;
  says(scene, "sigma_position_m.down");
  scene.survey.kind = SurveyKind::kRandom;
  scene.errors.sigma_position_m.z = 0.0;
  scene.survey.altitude_max_m = 1.0;
  says(scene, "altitude_max_m");
  scene.survey.altitude_max_m = 40.0;
  scene.survey.max_tilt_deg = 90.0;
  says(scene, "max_tilt_deg");
  scene.survey.max_tilt_deg = 10.0;
  scene.survey.ping_count = 0;
  says(scene, "ping_count");
}

TEST(csv_has_four_decimals_and_no_negative_zero) {
  Survey survey;
  SimulatedPing ping;
  ping.time_us = 1234567;
  ping.position_m = {-0.00001, 2.00004, 3.5};
  ping.attitude = {-0.0, 1.0, 359.99996};
  ping.beam = {-90.0, 45.0};
  survey.pings.push_back(ping);
  ping.range_m = 12.34567;
  survey.pings.push_back(ping);
  assert_string_equal(
      format_pings_csv(survey).c_str(),
      "time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m\n"
      "1234567,0.0000,2.0000,3.5000,0.0000,1.0000,360.0000,-90.0000,45.0000,\n"
      "1234567,0.0000,2.0000,3.5000,0.0000,1.0000,360.0000,-90.0000,45.0000,12.3457\n");
}

// The bytes are part of the contract: figures quoted for a preset and a seed hold on every host.
TEST(presets_give_the_same_bytes_everywhere) {
  SimulateOptions options;
  options.settings = {"line_spacing_m=16", "along_step_m=1"};
  const Scenario scenario = resolve_scenario(options);
  const Terrain terrain = build_terrain(scenario);
  const std::string csv = format_pings_csv(simulate(terrain, scenario.scene));
  assert_true(hash_of(csv) == 0x9FE4AC641F9F5330ULL);
  assert_true(csv == format_pings_csv(simulate(terrain, scenario.scene)));
  options.seed = 2;
  const Scenario other = resolve_scenario(options);
  assert_true(csv != format_pings_csv(simulate(build_terrain(other), other.scene)));
}

TEST(demo_fits_a_small_microcontroller_and_its_map_file_is_understood) {
  const Scenario scenario = resolve_scenario(SimulateOptions{});
  const Terrain terrain = build_terrain(scenario);
  const MapConfig config =
      leadline::host::parse_map_config(format_map_toml(terrain, scenario.scene), "map.toml", "");
  assert_int_equal(config.grid.cell_mm, 250);
  assert_true(config.grid.voxel_count() <= 3U * 1024U * 1024U);
  // The grid holds the terrain with room above and below.
  assert_true(static_cast<double>(config.grid.origin_mm[2]) * 1e-3 <= terrain.shallowest_m() - 1.0);
  assert_true(
      static_cast<double>(config.grid.origin_mm[2] + config.grid.cell_mm * config.grid.size[2]) *
          1e-3 >=
      terrain.deepest_m() + 1.0);
  assert_near(config.sonar.beam_half_angle_deg, 1.0, 0.0);
  assert_near(config.sonar.sigma_range_mm, 50.0, 0.0);
  assert_near(config.navigation.sigma_position_mm[2], 40.0, 0.0);
  assert_near(config.navigation.sigma_correlated_mm[0], 100.0, 0.0);
  assert_near(config.sonar.detection_fraction, 0.1, 0.0);
}

TEST(settings_change_what_they_name) {
  Scenario scenario = leadline::host::preset_scenario("demo");
  for (const leadline::host::SettingInfo& info : leadline::host::simulate_settings()) {
    assert_true(!info.help.empty());
    const std::string before = leadline::host::setting_text(scenario, info.key);
    std::string value = "0.75";
    if (info.key == "survey") {
      value = "random";
    } else if (info.key == "declare_drift") {
      value = "false";
    } else if (info.key.find("_count") != std::string::npos || info.key == "terrain_seed" ||
               info.key.rfind("raster_", 0) == 0 || info.key == "down_margin_cells") {
      value = "17";
    }
    apply_setting(&scenario, info.key, value);
    assert_string_equal(leadline::host::setting_text(scenario, info.key).c_str(), value.c_str());
    assert_true(before != value);
    assert_true(
        !complaint(ExitCode::kUsage, [&] { apply_setting(&scenario, info.key, "1x"); }).empty());
    assert_says(complaint(ExitCode::kUsage, [&] { apply_setting(&scenario, info.key, ""); }),
                info.key);
  }
  assert_says(complaint(ExitCode::kUsage, [&] { apply_setting(&scenario, "altitud_m", "1"); }),
              "did you mean altitude_m");
  assert_says(complaint(ExitCode::kUsage, [&] { apply_setting(&scenario, "cell_m", "inf"); }),
              "cell_m=inf");
  assert_says(complaint(ExitCode::kUsage, [&] { apply_setting(&scenario, "ping_count", "-3"); }),
              "ping_count=-3");
}

TEST(options_are_checked_before_anything_is_written) {
  const std::string out = leadline::test::scratch_directory() + "/never";
  SimulateOptions options;
  options.out_dir = out;
  options.preset = "helens_lo";
  assert_says(complaint(ExitCode::kUsage, [&] { (void)run_simulate(options); }),
              "did you mean helens_low");
  options.preset = "helens_low";
  assert_says(complaint(ExitCode::kUsage, [&] { (void)run_simulate(options); }), "--terrain FILE");
  options.terrain = "/nowhere/terrain.tif";
  assert_says(complaint(ExitCode::kInput, [&] { (void)run_simulate(options); }),
              "/nowhere/terrain.tif");
  options = SimulateOptions{};
  assert_says(complaint(ExitCode::kUsage, [&] { (void)run_simulate(options); }), "--out DIR");
  options.out_dir = out;
  options.settings = {"altitude_m"};
  assert_says(complaint(ExitCode::kUsage, [&] { (void)run_simulate(options); }), "key=value");
  options.settings = {"altitude_m=-1"};
  assert_says(complaint(ExitCode::kUsage, [&] { (void)run_simulate(options); }), "altitude_m");
  options.settings = {"relief_cells=0"};
  assert_says(complaint(ExitCode::kUsage, [&] { (void)run_simulate(options); }), "relief_cells");
  assert_false(std::ifstream(out + "/pings.csv").good());
}

TEST(a_run_leaves_a_scene_folder) {
  SimulateOptions options;
  options.preset = "plane_slope30";
  options.out_dir = leadline::test::scratch_directory() + "/scene";
  options.settings = {"ping_count=200"};
  assert_int_equal(run_simulate(options), 0);
  const Raster truth = leadline::host::read_esri_ascii(options.out_dir + "/truth.asc");
  const Raster touched = leadline::host::read_esri_ascii(options.out_dir + "/touched.asc");
  assert_true(leadline::host::same_geometry(truth, touched));
  assert_near(truth.at(0, 63), -20.0, 1e-9);
  assert_near(truth.at(63, 0), -56.3731, 1e-9);
  std::size_t touched_count = 0;
  for (const double value : touched.values) {
    assert_true(value == 0.0 || value == 1.0);
    touched_count += value > 0.0 ? 1 : 0;
  }
  assert_true(touched_count > 500 && touched_count < 4096);
  const MapConfig config = leadline::host::load_map_config(options.out_dir + "/map.toml");
  assert_int_equal(config.grid.size[2], 45);
  const std::string csv = read_file(options.out_dir + "/pings.csv");
  assert_true(std::count(csv.begin(), csv.end(), '\n') > 150);
}

}  // namespace
