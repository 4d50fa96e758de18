#include <fstream>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/map_config.hpp"
#include "tests/support/host_errors.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::BeamKind;
using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::load_map_config;
using leadline::host::map_config_to_json;
using leadline::host::map_config_to_toml;
using leadline::host::MapConfig;
using leadline::host::NoReturn;
using leadline::host::parse_map_config;
using leadline::host::Rule;

const std::string kGrid = "[grid]\ncell_mm = 1000\nsize = [4, 5, 6]\norigin_mm = [0, -1, 2]\n";
const std::string kCone = "[sonar]\nbeam_half_angle_deg = 3\n";

MapConfig parse(const std::string& text) { return parse_map_config(text, "c.toml", ""); }

/// The message of the HostError kUsage that the text has to raise.
std::string error_of(const std::string& text) {
  return leadline::test::error_of(ExitCode::kUsage, [&] { (void)parse(text); });
}

void assert_error(const std::string& text, const std::string& part) {
  const std::string message = error_of(text);
  if (message.find(part) == std::string::npos) {
    fail_msg("\"%s\" is not in \"%s\"", part.c_str(), message.c_str());
  }
}

TEST(the_smallest_configuration_gets_the_documented_defaults) {
  const MapConfig config = parse(kGrid + kCone);
  assert_int_equal(config.schema_version, 1);
  assert_int_equal(config.grid.cell_mm, 1000);
  assert_int_equal(config.grid.size[0], 4);
  assert_int_equal(config.grid.size[1], 5);
  assert_int_equal(config.grid.size[2], 6);
  assert_int_equal(config.grid.voxel_count(), 120);
  assert_int_equal(config.grid.origin_mm[1], -1);
  assert_int_equal(config.sonar.beam, BeamKind::kCone);
  assert_near(config.sonar.beam_half_angle_deg, 3, 0);
  assert_false(config.sonar.max_half_angle_deg.has_value());
  assert_near(config.sonar.sigma_pointing_deg, 0, 0);
  assert_int_equal(config.sonar.min_range_mm, 0);
  assert_int_equal(config.sonar.max_range_mm, 8'777);  // sqrt(4^2 + 5^2 + 6.002^2) m
  assert_int_equal(config.sonar.no_return, NoReturn::kIgnore);
  assert_false(config.sonar.detect_range_mm.has_value());
  assert_int_equal(config.sonar.sound_speed_mm_s, 1'500'000);
  assert_near(config.sonar.detection_fraction, 0.1, 0);
  assert_near(config.navigation.sigma_position_mm[2], 0, 0);
  assert_near(config.navigation.sigma_correlated_mm[0], 0, 0);
  assert_false(config.frame.epsg.has_value());
}

TEST(the_default_range_reaches_every_voxel_from_the_surface) {
  leadline::host::GridConfig grid;
  grid.cell_mm = 1000;
  grid.size[0] = 128;
  grid.size[1] = 128;
  grid.size[2] = 32;
  grid.origin_mm[2] = 56'000;  // bottom at 88 m: sqrt(128^2 + 128^2 + 88^2) m
  assert_int_equal(leadline::host::default_max_range_mm(grid), 201'276);
  grid.origin_mm[2] = -40'000;  // in the air, bottom at -8 m
  assert_int_equal(leadline::host::default_max_range_mm(grid), 185'387);
  grid.cell_mm = 1'000'000;
  assert_int_equal(leadline::host::default_max_range_mm(grid), 20'000'000);
}

TEST(every_key_is_read) {
  const MapConfig config = parse(
      "schema_version = 1\n" + kGrid +
      "[sonar]\naperture_along_mm = 100.5\naperture_across_mm = 50\nfrequency_hz = 2e5\n"
      "max_half_angle_deg = 20\nsigma_pointing_deg = 0.5\nsigma_range_mm = 20\nmin_range_mm = 300\n"
      "max_range_mm = 50000.0\nno_return = \"empty\"\ndetect_range_mm = 40000\n"
      "sound_speed_mm_s = 1480000\ndetection_fraction = 0.25\n"
      "[navigation]\nsigma_position_mm = [1, 2.5, 3]\nsigma_correlated_mm = [4, 5, 6]\n"
      "[model]\nrule = \"weighted_mean\"\nk_p = 1\n"
      "[frame]\nlat = 46.2\nlon = -122\nepsg = 32610\nvertical_datum = \"MLLW\"\n");
  assert_int_equal(config.sonar.beam, BeamKind::kAperture);
  assert_near(config.sonar.aperture_along_mm, 100.5, 0);
  assert_near(config.sonar.aperture_across_mm, 50, 0);
  assert_near(config.sonar.frequency_hz, 200'000, 0);
  assert_near(config.sonar.max_half_angle_deg.value(), 20, 0);
  assert_near(config.sonar.sigma_pointing_deg, 0.5, 0);
  assert_near(config.sonar.sigma_range_mm, 20, 0);
  assert_int_equal(config.sonar.min_range_mm, 300);
  assert_int_equal(config.sonar.max_range_mm, 50'000);
  assert_int_equal(config.sonar.no_return, NoReturn::kEmpty);
  assert_int_equal(config.sonar.detect_range_mm.value(), 40'000);
  assert_int_equal(config.sonar.sound_speed_mm_s, 1'480'000);
  assert_near(config.sonar.detection_fraction, 0.25, 0);
  assert_near(config.navigation.sigma_position_mm[1], 2.5, 0);
  assert_near(config.navigation.sigma_correlated_mm[2], 6, 0);
  assert_int_equal(config.model.rule, Rule::kWeightedMean);
  assert_near(config.model.k_p, 1, 0);
  assert_near(config.frame.lat_deg.value(), 46.2, 0);
  assert_near(config.frame.lon_deg.value(), -122, 0);
  assert_int_equal(config.frame.epsg.value(), 32610);
  assert_string_equal(config.frame.vertical_datum.value().c_str(), "MLLW");
}

TEST(each_beam_description_is_understood) {
  assert_int_equal(
      parse(kGrid + "[sonar]\npiston_diameter_mm = 80\nfrequency_hz = 115000\n").sonar.beam,
      BeamKind::kPiston);
  assert_int_equal(parse(kGrid + "[sonar]\npattern_file = \"p.csv\"\n").sonar.beam,
                   BeamKind::kPattern);
  // A frequency alone describes no beam and disturbs none.
  assert_int_equal(parse(kGrid + kCone + "frequency_hz = 115000\n").sonar.beam, BeamKind::kCone);
}

TEST(exactly_one_beam_description) {
  assert_error(kGrid, "needs one beam description");
  assert_error(kGrid + "[sonar]\nfrequency_hz = 1000\n", "needs one beam description");
  assert_error(kGrid + kCone + "piston_diameter_mm = 80\n",
               "more than one beam description (beam_half_angle_deg, piston_diameter_mm)");
  assert_error(kGrid + kCone + "pattern_file = \"p\"\n", "more than one beam description");
  assert_error(kGrid + "[sonar]\npiston_diameter_mm = 80\n",
               "c.toml:6: [sonar] piston_diameter_mm needs");
  assert_error(kGrid + "[sonar]\naperture_along_mm = 80\nfrequency_hz = 1000\n", "needs both");
}

TEST(pattern_files_are_relative_to_the_configuration) {
  const auto pattern = [](const std::string& file, const std::string& base) {
    return parse_map_config(kGrid + "[sonar]\npattern_file = \"" + file + "\"\n", "c.toml", base)
        .sonar.pattern_file;
  };
  assert_string_equal(pattern("beam.csv", "/survey").c_str(), "/survey/beam.csv");
  assert_string_equal(pattern("../beam.csv", "a/b").c_str(), "a/b/../beam.csv");
  assert_string_equal(pattern("/etc/beam.csv", "/survey").c_str(), "/etc/beam.csv");
  assert_string_equal(pattern("beam.csv", "").c_str(), "beam.csv");

  const std::string directory = leadline::test::scratch_directory();
  std::ofstream(directory + "/map.toml") << kGrid << "[sonar]\npattern_file = \"beam.csv\"\n";
  assert_string_equal(load_map_config(directory + "/map.toml").sonar.pattern_file.c_str(),
                      (directory + "/beam.csv").c_str());
}

TEST(unknown_keys_are_errors_with_a_suggestion) {
  assert_error("shema_version = 1\n" + kGrid + kCone,
               "c.toml:1: shema_version: unknown key; did you mean \"schema_version\"?");
  assert_error(kGrid + "cell = 3\n" + kCone,
               "c.toml:5: [grid] cell: unknown key; did you mean \"cell_mm\"?");
  assert_error(kGrid + kCone + "sigma_position_mm = [0, 0, 0]\n",
               "c.toml:7: [sonar] sigma_position_mm: unknown key; it belongs to [navigation]");
  assert_error(kGrid + kCone + "epgs = 1\n", "did you mean \"epsg\" of [frame]?");
  assert_error(kGrid + kCone + "[nav]\n",
               "c.toml:7: nav: unknown key; did you mean \"navigation\"?");
  assert_error(kGrid + kCone + "[zebra]\nx = 1\n",
               "c.toml:7: zebra: unknown key; known are: schema_version");
  assert_error(kGrid + kCone + "\"quo\\u001bte\" = 1\n", "quo\\x1bte: unknown key");
}

TEST(values_outside_their_limits_name_line_key_and_value) {
  struct Case {
    std::string text;
    const char* message;
  };
  const std::string size = "origin_mm = [0, 0, 0]\ncell_mm = 1000\nsize = ";
  const std::vector<Case> cases = {
      {"schema_version = 2\n" + kGrid + kCone, "c.toml:1: schema_version = 2: this program reads"},
      {"schema_version = \"1\"\n" + kGrid + kCone, "schema_version = \"1\": this program reads"},
      {"[grid]\n" + size + "[0, 4, 4]\n" + kCone,
       "c.toml:4: [grid] size[0] = 0: has to be 1 to 1048576"},
      {"[grid]\n" + size + "[4, -4, 4]\n" + kCone, "size[1] = -4: has to be 1 to"},
      {"[grid]\n" + size + "[4, 4]\n" + kCone, "size = [ 4, 4 ]: has to be an array of three"},
      {"[grid]\n" + size + "4\n" + kCone, "size = 4: has to be an array of three"},
      {"[grid]\n" + size + "[4, 4, \"4\"]\n" + kCone, "size[2] = \"4\": has to be a whole number"},
      {"[grid]\n" + size + "[4, 4.5, 4]\n" + kCone, "size[1] = 4.5: has to be a whole number"},
      {"[grid]\ncell_mm = 0\nsize = [1, 1, 1]\norigin_mm = [0, 0, 0]\n" + kCone,
       "cell_mm = 0: has to be 1 to"},
      {"[grid]\ncell_mm = nan\nsize = [1, 1, 1]\norigin_mm = [0, 0, 0]\n" + kCone,
       "cell_mm = nan: has to be"},
      {"[grid]\ncell_mm = 1\nsize = [1, 1, 1]\norigin_mm = [0, 2000000001, 0]\n" + kCone,
       "origin_mm[1] = 2000000001: has to be"},
      {"[grid]\ncell_mm = 1000\nsize = [1, 1, 1]\norigin_mm = [0, 2000000000, 0]\n" + kCone,
       "the grid ends 2000001000 mm east"},
      {"[grid]\ncell_mm = 1000000\nsize = [1, 1, 1048576]\norigin_mm = [0, 0, 0]\n" + kCone,
       "mm down"},
      {"grid = 5\n" + kCone, "c.toml:1: grid: has to be a table: [grid]"},
      {"[[grid]]\ncell_mm = 5\n" + kCone, "grid: has to be a table"},
      {kCone, "the table [grid] with cell_mm, size and origin_mm is missing"},
      {"[grid]\ncell_mm = 5\nsize = [1, 1, 1]\n" + kCone, "[grid] origin_mm is missing"},
      {kGrid + "[sonar]\nbeam_half_angle_deg = 0\n",
       "beam_half_angle_deg = 0: has to be over 0 to 90"},
      {kGrid + "[sonar]\nbeam_half_angle_deg = 90.1\n", "beam_half_angle_deg = 90.1: has to be"},
      {kGrid + "[sonar]\nbeam_half_angle_deg = \"3\"\n",
       "beam_half_angle_deg = \"3\": has to be a number"},
      {kGrid + "[sonar]\npattern_file = \"\"\n", "has to be the name of a file"},
      {kGrid + "[sonar]\npattern_file = 5\n", "has to be the name of a file"},
      {kGrid + kCone + "sigma_range_mm = -1\n",
       "c.toml:7: [sonar] sigma_range_mm = -1: has to be 0 to"},
      {kGrid + kCone + "sigma_range_mm = inf\n", "sigma_range_mm = inf: has to be"},
      {kGrid + kCone + "sigma_pointing_deg = 1e9\n", "sigma_pointing_deg = "},
      {kGrid + kCone + "min_range_mm = 5\nmax_range_mm = 4\n",
       "min_range_mm = 5: has to be below max_range_mm = 4"},
      {kGrid + kCone + "no_return = \"none\"\n",
       "no_return = \"none\": has to be one of \"ignore\", \"empty\""},
      {kGrid + kCone + "no_return = \"empty\"\n", "needs detect_range_mm"},
      {kGrid + kCone + "max_range_mm = 9\ndetect_range_mm = 10\n",
       "detect_range_mm = 10: has to be at most max_range_mm = 9"},
      {kGrid + kCone + "detection_fraction = 1\n", "has to be over 0 to below 1"},
      {kGrid + kCone + "sound_speed_mm_s = 1500\n", "sound_speed_mm_s = 1500: has to be 200000 to"},
      {kGrid + kCone + "[navigation]\nsigma_position_mm = 5\n", "has to be an array of three"},
      {kGrid + kCone + "[navigation]\nsigma_correlated_mm = [0, -1, 0]\n",
       "sigma_correlated_mm[1] = -1"},
      {kGrid + kCone + "[model]\nrule = \"magic\"\n",
       "rule = \"magic\": has to be one of \"weighted_mean\", \"log_odds\""},
      {kGrid + kCone + "[model]\nk_p = 0\n", "k_p = 0: has to be over 0 to 1"},
      {kGrid + kCone + "[frame]\nlat = 91\nlon = 0\n", "lat = 91: has to be -90 to 90"},
      {kGrid + kCone + "[frame]\nlat = 9\n", "lat and lon have to be given together"},
      {kGrid + kCone + "[frame]\nepsg = 0\n", "epsg = 0: has to be"},
      {kGrid + kCone + "[frame]\nvertical_datum = \"a\\nb\"\n", "has to be a text"},
  };
  for (const Case& bad : cases) {
    assert_error(bad.text, bad.message);
  }
}

TEST(all_findings_come_at_once_in_the_order_of_the_file) {
  const std::string message =
      error_of("[grid]\ncell_mm = 0\nsize = [0, 1, 1]\n[sonar]\nbeam = 3\n");
  const std::vector<const char*> parts = {"c.toml:2: ", "c.toml:3: ", "c.toml:5: ", "c.toml: "};
  std::size_t at = 0;
  for (const char* const part : parts) {
    const std::size_t found = message.find(part, at);
    assert_true(found != std::string::npos);
    at = found;
  }
}

TEST(what_is_not_toml_names_the_line) {
  assert_error("[grid]\ncell_mm = = 3\n", "c.toml:2: not valid TOML");
  assert_error("[grid]\n[grid]\n", "c.toml:2: not valid TOML");
  assert_error("[grid\n", "c.toml:1: not valid TOML");
  assert_error("\na = \"\xff\xfe\"\n", "c.toml:2: not valid TOML: not UTF-8");
  assert_error(std::string(5000, '['), "c.toml:1: not valid TOML");
  assert_error("[grid]\ncell_mm = 1\n\n[[[\n[sonar]\n", "c.toml:4: not valid TOML");
}

TEST(characters_outside_ascii_are_kept_in_strings_and_refused_elsewhere) {
  const std::string e = "\xc3\xa9";
  const MapConfig config =
      parse("\xEF\xBB\xBF# " + e + "\n" + kGrid + "[sonar] # \xe2\x80\xa8\npattern_file = \"" + e +
            "t" + e + "~7e/~.csv\"\n[frame]\nvertical_datum = '\xe6\xb0\xb4'\n");
  assert_string_equal(config.sonar.pattern_file.c_str(), (e + "t" + e + "~7e/~.csv").c_str());
  assert_string_equal(config.frame.vertical_datum.value().c_str(), "\xe6\xb0\xb4");
  assert_error(kGrid + kCone + e + " = 1\n", "c.toml:7: not valid TOML");
  assert_error(kGrid + kCone + "k_p = 1" + e + "\n", "c.toml:7: not valid TOML");
  assert_error(kGrid + kCone + "\"" + e + "\" = 1\n", "c.toml:7: [sonar] \\xc3\\xa9: unknown key");
  assert_error(kGrid + kCone + "x = \"\\u007e41\"\n", "c.toml:7: write ~ itself");
}

TEST(an_empty_file_is_told_what_it_needs) {
  assert_error("", "the table [grid]");
  assert_error("", "needs one beam description");
}

TEST(files_that_cannot_be_read_are_configuration_errors) {
  for (const char* const path : {"/nowhere/map.toml", "/tmp"}) {
    ExitCode code = ExitCode::kOk;
    std::string message;
    try {
      (void)load_map_config(path);
    } catch (const HostError& error) {
      code = error.code();
      message = error.what();
    }
    assert_int_equal(code, ExitCode::kUsage);
    assert_true(message.find(path) != std::string::npos);
  }
}

TEST(the_resolved_configuration_reads_back_the_same) {
  const std::vector<std::string> texts = {
      kGrid + kCone,
      kGrid +
          "[sonar]\npiston_diameter_mm = 80.25\nfrequency_hz = 115000\nmax_half_angle_deg = 1e-3\n"
          "no_return = \"empty\"\ndetect_range_mm = 1\n[model]\nrule = \"weighted_mean\"\n",
      kGrid +
          "[sonar]\naperture_along_mm = 0.1e2\naperture_across_mm = 50\nfrequency_hz = 1e8\n"
          "[frame]\nlat = -0.0\nlon = 1e-20\nvertical_datum = \"NAVD 88 \\\"x\\\" \\u00e9\"\n",
      kGrid + "[sonar]\npattern_file = \"a \\\"b\\\" \\\\c\"\n",
  };
  for (const std::string& text : texts) {
    const std::string resolved = map_config_to_toml(parse(text));
    assert_string_equal(map_config_to_toml(parse(resolved)).c_str(), resolved.c_str());
  }
}

TEST(json_holds_the_same_values) {
  const std::string json = map_config_to_json(parse(kGrid + kCone + "[frame]\nepsg = 32610\n"));
  for (const char* const part :
       {"{\"schema_version\": 1, \"grid\": {\"cell_mm\": 1000, \"size\": [4, 5, 6]",
        "\"sonar\": {\"beam_half_angle_deg\": 3, ", "\"no_return\": \"ignore\"",
        "\"frame\": {\"epsg\": 32610}}"}) {
    assert_true(json.find(part) != std::string::npos);
  }
}

TEST(the_scenes_configurations_are_read) {
  const MapConfig config =
      load_map_config(leadline::test::require_data("scenes/helens_high/map.toml"));
  assert_int_equal(config.grid.voxel_count(), 128 * 128 * 32);
  assert_near(config.navigation.sigma_position_mm[0], 3000, 0);
}

}  // namespace
