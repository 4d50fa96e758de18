#include "host_tools/map_config.hpp"

#include <algorithm>
#include <array>
#include <filesystem>
#include <utility>
#include <vector>

#include "firmware/config/toml_reader.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

constexpr std::size_t kMaxName_bytes = 64;

/// Every key there is: what is not here is an error.
std::vector<KnownTable> known_tables() {
  std::vector<std::string> sonar = {"beam_half_angle_deg", "piston_diameter_mm", "frequency_hz",
                                    "aperture_along_mm",   "aperture_across_mm", "pattern_file",
                                    "max_half_angle_deg",  "sigma_pointing_deg", "sigma_range_mm"};
  const std::vector<std::string> ranges = sonar_range_keys();
  sonar.insert(sonar.end(), ranges.begin(), ranges.end());
  sonar.emplace_back("detection_fraction");
  return {
      {"", {"schema_version", "survey", "grid", "sonar", "navigation", "model", "frame"}},
      {"survey", {"name"}},
      {"grid", grid_keys()},
      {"sonar", sonar},
      {"navigation", navigation_sigma_keys()},
      {"model", model_keys()},
      {"frame", frame_keys()},
  };
}

/// Which of the five marks are there, and what they say together.
void check_beam_marks(const TomlSection& section, SonarConfig* sonar) {
  static constexpr std::array<const char*, 5> kMarks = {"beam_half_angle_deg", "piston_diameter_mm",
                                                        "aperture_along_mm", "aperture_across_mm",
                                                        "pattern_file"};
  static constexpr std::array<BeamKind, 5> kKinds = {BeamKind::kCone, BeamKind::kPiston,
                                                     BeamKind::kAperture, BeamKind::kAperture,
                                                     BeamKind::kPattern};
  std::vector<std::string> given;
  bool mixed = false;
  for (std::size_t i = 0; i < kMarks.size(); ++i) {
    if (!section.has(kMarks[i])) {
      continue;
    }
    mixed = mixed || (!given.empty() && sonar->beam != kKinds[i]);
    sonar->beam = kKinds[i];
    given.emplace_back(kMarks[i]);
  }
  if (given.empty()) {
    section.find_missing(
        "needs one beam description: beam_half_angle_deg, or piston_diameter_mm and "
        "frequency_hz, or aperture_along_mm, aperture_across_mm and frequency_hz, or "
        "pattern_file");
    return;
  }
  const char* const last = given.back().c_str();
  if (mixed) {
    std::string names;
    for (const std::string& name : given) {
      names += (names.empty() ? "" : ", ") + name;
    }
    section.find(last, "more than one beam description (" + names + "): give exactly one");
    return;
  }
  const bool acoustic = sonar->beam == BeamKind::kPiston || sonar->beam == BeamKind::kAperture;
  if (acoustic && !section.has("frequency_hz")) {
    section.find(last, given.back() + " needs frequency_hz as well");
  }
  if (sonar->beam == BeamKind::kAperture && given.size() == 1) {
    section.find(last, "an aperture needs both aperture_along_mm and aperture_across_mm");
  }
}

void read_beam(const TomlSection& section, const std::string& base_dir, SonarConfig* sonar) {
  const Limits length_mm = {1, 10'000};
  section.read_number("frequency_hz", {100, 1e8}, &sonar->frequency_hz);
  section.read_number("beam_half_angle_deg", {0, 90, true}, &sonar->beam_half_angle_deg);
  section.read_number("piston_diameter_mm", length_mm, &sonar->piston_diameter_mm);
  section.read_number("aperture_along_mm", length_mm, &sonar->aperture_along_mm);
  section.read_number("aperture_across_mm", length_mm, &sonar->aperture_across_mm);
  section.read_path("pattern_file", base_dir, &sonar->pattern_file);
  check_beam_marks(section, sonar);
}

void read_sonar(TomlReader* reader, const std::string& base_dir, MapConfig* config) {
  SonarConfig& sonar = config->sonar;
  const TomlSection section = reader->section("sonar");
  if (!section.exists() && reader->root().has("sonar")) {
    return;  // no table: found by the check of keys
  }
  read_beam(section, base_dir, &sonar);
  double cap_deg = 0;
  if (section.read_number("max_half_angle_deg", {0, 90, true}, &cap_deg)) {
    sonar.max_half_angle_deg = cap_deg;
  }
  section.read_number("sigma_pointing_deg", {0, 45}, &sonar.sigma_pointing_deg);
  section.read_number("sigma_range_mm", {0, 1e6}, &sonar.sigma_range_mm);
  constexpr double kAir_mm_s = 200'000;
  constexpr double kSteel_mm_s = 6'000'000;
  read_sonar_ranges(reader, config->grid, {kAir_mm_s, kSteel_mm_s}, &sonar);
  section.read_number("detection_fraction", {0, 1, true, true}, &sonar.detection_fraction);
}

// ---- Writing ------------------------------------------------------------------------------------

std::vector<ConfigEntry> entries_of(const MapConfig& config) {
  std::vector<ConfigEntry> entries;
  const auto add = [&](const char* table, const char* key, std::string value) {
    entries.push_back({table, key, std::move(value), -1});
  };
  add("", "schema_version", std::to_string(config.schema_version));
  if (config.survey_name) {
    add("survey", "name", json_string(*config.survey_name));
  }
  add("grid", "cell_mm", std::to_string(config.grid.cell_mm));
  add("grid", "size", array_text(config.grid.size));
  add("grid", "origin_mm", array_text(config.grid.origin_mm));
  const SonarConfig& sonar = config.sonar;
  switch (sonar.beam) {
    case BeamKind::kCone:
      add("sonar", "beam_half_angle_deg", json_number(sonar.beam_half_angle_deg));
      break;
    case BeamKind::kPiston:
      add("sonar", "piston_diameter_mm", json_number(sonar.piston_diameter_mm));
      break;
    case BeamKind::kAperture:
      add("sonar", "aperture_along_mm", json_number(sonar.aperture_along_mm));
      add("sonar", "aperture_across_mm", json_number(sonar.aperture_across_mm));
      break;
    case BeamKind::kPattern:
      add("sonar", "pattern_file", json_string(sonar.pattern_file));
      break;
  }
  if (sonar.frequency_hz > 0) {
    add("sonar", "frequency_hz", json_number(sonar.frequency_hz));
  }
  if (sonar.max_half_angle_deg) {
    add("sonar", "max_half_angle_deg", json_number(*sonar.max_half_angle_deg));
  }
  add("sonar", "sigma_pointing_deg", json_number(sonar.sigma_pointing_deg));
  add("sonar", "sigma_range_mm", json_number(sonar.sigma_range_mm));
  add("sonar", "min_range_mm", std::to_string(sonar.min_range_mm));
  add("sonar", "max_range_mm", std::to_string(sonar.max_range_mm));
  add("sonar", "no_return", json_string(no_return_name(sonar.no_return)));
  if (sonar.detect_range_mm) {
    add("sonar", "detect_range_mm", std::to_string(*sonar.detect_range_mm));
  }
  add("sonar", "sound_speed_mm_s", std::to_string(sonar.sound_speed_mm_s));
  add("sonar", "detection_fraction", json_number(sonar.detection_fraction));
  add("navigation", "sigma_position_mm", array_text(config.navigation.sigma_position_mm));
  add("navigation", "sigma_correlated_mm", array_text(config.navigation.sigma_correlated_mm));
  add("model", "rule", json_string(rule_name(config.model.rule)));
  add("model", "k_p", json_number(config.model.k_p));
  const FrameConfig& frame = config.frame;
  if (frame.lat_deg) {
    add("frame", "lat", json_number(*frame.lat_deg));
  }
  if (frame.lon_deg) {
    add("frame", "lon", json_number(*frame.lon_deg));
  }
  if (frame.epsg) {
    add("frame", "epsg", std::to_string(*frame.epsg));
  }
  if (frame.vertical_datum) {
    add("frame", "vertical_datum", json_string(*frame.vertical_datum));
  }
  return entries;
}

}  // namespace

namespace {

MapConfig parse(std::string_view text, const std::string& name, const std::string& base_dir,
                bool needs_grid) {
  MapConfig config;
  TomlReader reader(text, name, known_tables());
  reader.read_schema_version(kSchemaVersion);
  std::string survey_name;
  if (reader.section("survey").read_text("name", kMaxName_bytes, &survey_name)) {
    config.survey_name = survey_name;
  }
  if (needs_grid || reader.root().has("grid")) {
    config.grid = read_grid(&reader);
  } else {
    config.grid =
        GridConfig{1000, {4096, 4096, 1024}, {0, 0, 0}, 0};  // limits no range of the beam
  }
  read_sonar(&reader, base_dir, &config);
  read_navigation_sigmas(&reader, &config.navigation);
  config.model = read_model(&reader);
  config.frame = read_frame(&reader);
  reader.finish();
  return config;
}

}  // namespace

MapConfig parse_map_config(std::string_view text, const std::string& name,
                           const std::string& base_dir) {
  return parse(text, name, base_dir, true);
}

MapConfig load_beam_config(const std::string& path) {
  return parse(read_config_text(path), path, std::filesystem::path(path).parent_path().string(),
               false);
}

MapConfig load_map_config(const std::string& path) {
  return parse_map_config(read_config_text(path), path,
                          std::filesystem::path(path).parent_path().string());
}

std::string map_config_to_toml(const MapConfig& config) {
  return entries_to_toml(entries_of(config));
}

std::string map_config_to_json(const MapConfig& config) {
  return entries_to_json(entries_of(config));
}

}  // namespace leadline::host
