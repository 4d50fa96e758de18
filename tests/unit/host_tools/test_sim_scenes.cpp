// The simulator against the scenes that came with the requirements, which another program made: same
// terrain, same files, same ranges. Skipped where they are not at hand.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "host_tools/raster.hpp"
#include "host_tools/sim/scenario.hpp"
#include "host_tools/sim/simulator.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::build_terrain;
using leadline::host::format_map_toml;
using leadline::host::Raster;
using leadline::host::resolve_scenario;
using leadline::host::Scenario;
using leadline::host::simulate;
using leadline::host::SimulatedPing;
using leadline::host::SimulateOptions;
using leadline::host::Survey;
using leadline::host::Terrain;

std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
}

struct GivenRow {
  std::int64_t time_us;
  double columns[9];
};

std::vector<GivenRow> read_given(const std::string& path) {
  std::vector<GivenRow> rows;
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    GivenRow row{};
    std::stringstream fields(line);
    std::string field;
    for (int k = 0; std::getline(fields, field, ','); ++k) {
      if (k == 0) {
        row.time_us = std::atoll(field.c_str());
      } else if (k <= 9) {
        row.columns[k - 1] = field.empty() ? -1.0 : std::atof(field.c_str());
      }
    }
    if (std::count(line.begin(), line.end(), ',') == 9 && line.back() == ',') {
      row.columns[8] = -1.0;
    }
    rows.push_back(row);
  }
  return rows;
}

SimulateOptions given_options(const std::string& scene) {
  SimulateOptions options;
  options.preset = scene;
  if (scene.rfind("helens", 0) == 0) {
    options.terrain = leadline::test::require_data("dem_mt_st_helens/st_helens_30m.asc");
  }
  if (scene.rfind("monterey", 0) == 0) {
    // The canyon's own raster is not part of the shared data, its scene is.
    options.terrain = leadline::test::require_data("scenes/monterey_fan/truth.asc");
  }
  return options;
}

TEST(presets_reproduce_terrain_and_map_file_of_the_given_scenes) {
  for (const char* name : {"helens_low", "helens_high", "helens_half_altitude", "helens_altimeter",
                           "helens_rolling_fan", "monterey_fan", "plane_flat", "plane_slope30"}) {
    const std::string folder = leadline::test::require_data(std::string("scenes/") + name);
    const Scenario scenario = resolve_scenario(given_options(name));
    const Terrain terrain = build_terrain(scenario);
    assert_string_equal(format_map_toml(terrain, scenario.scene).c_str(),
                        read_file(folder + "/map.toml").c_str());
    const Raster truth = leadline::host::read_esri_ascii(folder + "/truth.asc");
    const Raster ours = leadline::host::terrain_elevation(terrain);
    assert_true(leadline::host::same_geometry(truth, ours));
    for (std::size_t k = 0; k < truth.values.size(); ++k) {
      assert_near(ours.values[k], truth.values[k], 0.00051);
    }
  }
}

// The plans of the lawn mowers carry no randomness, so each given range can be compared with the
// range that this echo model hears at the same true pose.
void compare_ranges(const std::string& name, double sigma_m, double least_same_share,
                    double rms_tolerance) {
  const std::vector<GivenRow> given =
      read_given(leadline::test::require_data("scenes/" + name + "/pings.csv"));
  Scenario scenario = resolve_scenario(given_options(name));
  scenario.scene.errors = leadline::host::ErrorSpec{};
  const Terrain terrain = build_terrain(scenario);
  const Survey ours = simulate(terrain, scenario.scene);
  std::map<std::int64_t, std::vector<double>> given_ranges;
  std::map<std::int64_t, std::vector<double>> our_ranges;
  for (const GivenRow& row : given) {
    given_ranges[row.time_us].push_back(row.columns[8]);
  }
  for (const SimulatedPing& ping : ours.pings) {
    our_ranges[ping.time_us].push_back(*ping.range_m);
  }
  double same = 0.0;
  double count = 0.0;
  double sum = 0.0;
  double square_sum = 0.0;
  for (const auto& [time_us, ranges] : our_ranges) {
    const auto found = given_ranges.find(time_us);
    if (found == given_ranges.end() || found->second.size() != ranges.size()) {
      continue;
    }
    same += 1.0;
    for (std::size_t k = 0; k < ranges.size(); ++k) {
      const double residual_m = found->second[k] - ranges[k];
      // Neither dropouts nor outliers.
      if (found->second[k] > 0.0 && std::fabs(residual_m) < 4.0 * sigma_m) {
        sum += residual_m;
        square_sum += residual_m * residual_m;
        count += 1.0;
      }
    }
  }
  const double mean_m = sum / count;
  const double rms_m = std::sqrt(square_sum / count);
  print_message(
      "%s: same beams heard in %.4f of the transmissions, residual %.4f +- %.4f m, rms %.4f m\n",
      name.c_str(), same / static_cast<double>(given_ranges.size()), mean_m,
      sigma_m / std::sqrt(count), rms_m);
  assert_true(same >= least_same_share * static_cast<double>(given_ranges.size()));
  assert_near(mean_m / terrain.cell_m(), 0.0, 0.02);
  assert_near(rms_m, sigma_m, rms_tolerance * sigma_m);
}

TEST(ranges_of_the_given_altimeter_are_ours_plus_noise) {
  compare_ranges("helens_altimeter", 0.2, 1.0, 0.03);
}
TEST(ranges_of_the_given_rolling_fan_are_ours_plus_noise) {
  compare_ranges("helens_rolling_fan", 0.3, 0.97, 0.02);
}
TEST(ranges_of_the_given_canyon_fan_are_ours_plus_noise) {
  // Canyon walls at grazing incidence: where two tracers may differ by a few metres.
  compare_ranges("monterey_fan", 15.0, 0.97, 0.05);
}

TEST(random_surveys_hear_as_often_as_the_given_ones) {
  struct Expected {
    const char* name;
    double rows;
    double planned;
  };
  for (const Expected& expected :
       {Expected{"plane_flat", 7311.0, 9000.0}, Expected{"plane_slope30", 7214.0, 9000.0},
        Expected{"helens_half_altitude", 31578.0, 34000.0}}) {
    const Scenario scenario = resolve_scenario(given_options(expected.name));
    const Survey survey = simulate(build_terrain(scenario), scenario.scene);
    const double rate = expected.rows / expected.planned;
    const double sigma = std::sqrt(2.0 * expected.planned * rate * (1.0 - rate));
    assert_near(static_cast<double>(survey.pings.size()), expected.rows, 4.0 * sigma);
  }
}

}  // namespace
