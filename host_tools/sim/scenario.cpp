#include "host_tools/sim/scenario.hpp"

#include <cstdio>
#include <stdexcept>

#include "host_tools/exit_codes.hpp"
#include "host_tools/options.hpp"
#include "host_tools/progress.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

using Settings = SettingTable<Scenario>;

// Sets a swing's three numbers.
template <typename Field>
void add_swing(Settings* settings, const std::string& name, Field field) {
  struct Member {
    const char* suffix;
    const char* help;
    double Swing::*value;
  };
  static constexpr Member kMembers[] = {
      {"_deg", "amplitude of the sinusoidal motion, degrees", &Swing::amplitude_deg},
      {"_period_s", "its period", &Swing::period_s},
      {"_phase_rad", "its phase at time 0", &Swing::phase_rad}};
  for (const Member& member : kMembers) {
    const std::string key = name + member.suffix;
    double Swing::*const value = member.value;
    settings->decimal(
        key, name + " (lawnmower): " + member.help,
        [ field, value ](auto& s) -> auto& { return field(s).*value; });
  }
}

Settings make_settings() {
  Settings settings("--set");
  using S = Scenario;

  settings.count(
      "north_count", "cells of the terrain and of the grid, north",
      [](auto& s) -> auto& { return s.north_count; });
  settings.count(
      "east_count", "the same, east", [](auto& s) -> auto& { return s.east_count; });
  settings.decimal(
      "cell_m", "edge of a cell", [](auto& s) -> auto& { return s.cell_m; });
  settings.decimal(
      "shallowest_depth_m", "depth of the terrain's highest point",
      [](auto& s) -> auto& { return s.shallowest_depth_m; });
  settings.decimal(
      "relief_cells", "height of the terrain in cells; 0 (raster) = the raster's own",
      [](auto& s) -> auto& { return s.relief_cells; });
  settings.add({{"terrain_seed", "procedural terrain: its seed (default: that of the scene)"},
                [](const Settings& table, S* s, const std::string& v) {
                  s->terrain_seed = table.parse_count<std::uint64_t>("terrain_seed", v);
                },
                [](const S& s) {
                  return s.terrain_seed ? std::to_string(*s.terrain_seed) : std::string();
                }});
  settings.decimal(
      "slope_deg", "plane: its slope", [](auto& s) -> auto& { return s.slope_deg; });
  settings.decimal(
      "dip_azimuth_deg", "plane: direction in which it deepens, from north",
      [](auto& s) -> auto& { return s.dip_azimuth_deg; });
  settings.count(
      "raster_first_row", "raster: first row of the part used, from the north",
      [](auto& s) -> auto& { return s.raster_first_row; });
  settings.count(
      "raster_first_column", "raster: first column, from the west",
      [](auto& s) -> auto& { return s.raster_first_column; });
  settings.count(
      "raster_rows", "raster: rows of the part; all four 0 = largest central part",
      [](auto& s) -> auto& { return s.raster_rows; });
  settings.count(
      "raster_columns", "raster: columns of the part",
      [](auto& s) -> auto& { return s.raster_columns; });

  settings.add({{"survey", "random or lawnmower"},
                [](const Settings& table, S* s, const std::string& v) {
                  if (v == "random") {
                    s->scene.survey.kind = SurveyKind::kRandom;
                  } else if (v == "lawnmower") {
                    s->scene.survey.kind = SurveyKind::kLawnmower;
                  } else {
                    table.bad_value("survey", v, "is neither random nor lawnmower");
                  }
                },
                [](const S& s) {
                  return std::string(s.scene.survey.kind == SurveyKind::kRandom ? "random"
                                                                                : "lawnmower");
                }});
  settings.decimal(
      "interval_s", "time between transmissions",
      [](auto& s) -> auto& { return s.scene.survey.interval_s; });
  settings.count(
      "ping_count", "random: pings sent",
      [](auto& s) -> auto& { return s.scene.survey.ping_count; });
  settings.decimal(
      "altitude_min_m", "random: lowest altitude above ground",
      [](auto& s) -> auto& { return s.scene.survey.altitude_min_m; });
  settings.decimal(
      "altitude_max_m", "random: highest altitude above ground",
      [](auto& s) -> auto& { return s.scene.survey.altitude_max_m; });
  settings.decimal(
      "max_tilt_deg", "random: largest angle between beam and nadir",
      [](auto& s) -> auto& { return s.scene.survey.max_tilt_deg; });
  settings.decimal(
      "line_spacing_m", "lawnmower: between lines",
      [](auto& s) -> auto& { return s.scene.survey.line_spacing_m; });
  settings.decimal(
      "along_step_m", "lawnmower: between transmissions along a line",
      [](auto& s) -> auto& { return s.scene.survey.along_step_m; });
  settings.decimal(
      "altitude_m", "lawnmower: altitude above ground",
      [](auto& s) -> auto& { return s.scene.survey.altitude_m; });
  settings.decimal(
      "altitude_smoothing_m", "lawnmower: keep it over the mean of this far ahead and astern",
      [](auto& s) -> auto& { return s.scene.survey.altitude_smoothing_m; });
  settings.add({{"depth_m", "lawnmower: constant depth instead of an altitude"},
                [](const Settings& table, S* s, const std::string& v) {
                  s->scene.survey.depth_m = table.parse_decimal("depth_m", v);
                },
                [](const S& s) {
                  return s.scene.survey.depth_m ? number_text(*s.scene.survey.depth_m)
                                                : std::string();
                }});
  settings.count(
      "beam_count", "lawnmower: beams of the fan; 1 = an altimeter",
      [](auto& s) -> auto& { return s.scene.survey.beam_count; });
  settings.decimal(
      "opening_deg", "lawnmower: angle between the outermost beams",
      [](auto& s) -> auto& { return s.scene.survey.opening_deg; });
  add_swing(
      &settings, "roll", [](auto& s) -> auto& { return s.scene.survey.roll; });
  add_swing(
      &settings, "pitch", [](auto& s) -> auto& { return s.scene.survey.pitch; });
  add_swing(
      &settings, "yaw", [](auto& s) -> auto& { return s.scene.survey.yaw; });

  settings.decimal(
      "beam_half_angle_deg", "where the cone's weight reaches zero",
      [](auto& s) -> auto& { return s.scene.echo.beam_half_angle_deg; });
  settings.count(
      "ray_count", "rays per beam", [](auto& s) -> auto& { return s.scene.echo.ray_count; });
  settings.decimal(
      "detection_fraction", "share of the echo that has arrived when the range is taken",
      [](auto& s) -> auto& { return s.scene.echo.detection_fraction; });
  settings.decimal(
      "range_bin_cells", "range bins of the echo, in cells",
      [](auto& s) -> auto& { return s.range_bin_cells; });
  settings.decimal(
      "min_range_m", "stated in map.toml",
      [](auto& s) -> auto& { return s.scene.declared.min_range_m; });
  settings.decimal(
      "max_range_m", "stated in map.toml",
      [](auto& s) -> auto& { return s.scene.declared.max_range_m; });
  settings.count(
      "down_margin_cells", "of the stated grid above and below the terrain",
      [](auto& s) -> auto& { return s.scene.declared.down_margin_cells; });

  settings.decimal(
      "sigma_range_m", "range error, one sigma",
      [](auto& s) -> auto& { return s.scene.errors.sigma_range_m; });
  settings.decimal(
      "sigma_pointing_deg", "pointing error about each of two axes",
      [](auto& s) -> auto& { return s.scene.errors.sigma_pointing_deg; });
  settings.decimal(
      "sigma_north_m", "position error, independent per beam",
      [](auto& s) -> auto& { return s.scene.errors.sigma_position_m.x; });
  settings.decimal(
      "sigma_east_m", "the same, east",
      [](auto& s) -> auto& { return s.scene.errors.sigma_position_m.y; });
  settings.decimal(
      "sigma_down_m", "the same, down",
      [](auto& s) -> auto& { return s.scene.errors.sigma_position_m.z; });
  settings.decimal(
      "drift_sigma_m", "horizontal position drift, long-run sigma per axis",
      [](auto& s) -> auto& { return s.scene.errors.drift_sigma_m; });
  settings.decimal(
      "drift_time_s", "its correlation time",
      [](auto& s) -> auto& { return s.scene.errors.drift_time_s; });
  settings.flag(
      "declare_drift", "true or false: state the drift in map.toml (sigma_correlated_mm)",
      [](auto& s) -> auto& { return s.scene.declared.drift; });
  settings.decimal(
      "outlier_fraction", "returns replaced by one uniformly short of the range, 0 .. 1",
      [](auto& s) -> auto& { return s.scene.errors.outlier_fraction; });
  settings.decimal(
      "dropout_fraction", "returns lost, 0 .. 1",
      [](auto& s) -> auto& { return s.scene.errors.dropout_fraction; });
  return settings;
}

const Settings& settings_table() {
  static const Settings kSettings = make_settings();
  return kSettings;
}

// Like the scenes made after Stewart's simulations: random pings over Mount St. Helens.
Scenario random_over_helens(const std::string& name) {
  Scenario s;
  s.name = name;
  s.terrain = TerrainKind::kRaster;
  // The 256 x 256 posts of the DEM around the crater, two by two.
  s.raster_first_row = 60;
  s.raster_first_column = 30;
  s.raster_rows = 256;
  s.raster_columns = 256;
  SurveySpec& survey = s.scene.survey;
  survey.kind = SurveyKind::kRandom;
  survey.interval_s = 0.02;
  survey.ping_count = 34000;
  survey.altitude_min_m = 10.0;
  survey.altitude_max_m = 40.0;
  s.scene.echo.beam_half_angle_deg = 3.0;
  s.scene.errors.sigma_pointing_deg = 1.0;
  s.scene.errors.sigma_range_m = 1.5;
  s.scene.declared.max_range_m = 80.0;
  return s;
}

Scenario random_over_plane(const std::string& name) {
  Scenario s = random_over_helens(name);
  s.terrain = TerrainKind::kPlane;
  s.raster_first_row = s.raster_first_column = s.raster_rows = s.raster_columns = 0;
  s.north_count = s.east_count = 64;
  s.scene.survey.ping_count = 9000;
  s.scene.survey.altitude_max_m = 30.0;
  s.scene.errors.sigma_range_m = 1.0;
  s.scene.declared.max_range_m = 60.0;
  return s;
}

Scenario lawnmower_over_helens(const std::string& name) {
  Scenario s = random_over_helens(name);
  s.scene.survey = SurveySpec{};
  s.scene.errors = ErrorSpec{};
  return s;
}

// A BlueROV-class vehicle with a small multibeam, four to six metres over a seafloor of 32 x 32 m.
Scenario demo() {
  Scenario s;
  s.name = "demo";
  s.cell_m = 0.25;
  s.shallowest_depth_m = 12.0;
  s.relief_cells = 22.0;
  SurveySpec& survey = s.scene.survey;
  survey.line_spacing_m = 3.2;
  survey.along_step_m = 0.25;
  survey.interval_s = 0.5;
  survey.altitude_m = 5.0;
  survey.altitude_smoothing_m = 2.0;
  survey.beam_count = 48;
  survey.opening_deg = 90.0;
  survey.roll.amplitude_deg = 5.0;
  survey.pitch.amplitude_deg = 4.0;
  survey.yaw.amplitude_deg = 4.0;
  s.scene.echo.beam_half_angle_deg = 1.0;
  s.scene.errors.sigma_range_m = 0.05;
  s.scene.errors.sigma_pointing_deg = 0.5;
  s.scene.errors.sigma_position_m = {0.08, 0.08, 0.04};
  s.scene.errors.drift_sigma_m = 0.1;
  s.scene.errors.outlier_fraction = 0.01;
  s.scene.errors.dropout_fraction = 0.02;
  s.scene.declared.drift = true;
  s.scene.declared.min_range_m = 0.3;
  s.scene.declared.max_range_m = 30.0;
  return s;
}

struct Preset {
  PresetInfo info;
  Scenario (*make)(const std::string& name);
};

const std::vector<Preset>& presets_table() {
  static const std::vector<Preset> kPresets = {
      {{"demo", "a small multibeam over an invented seafloor of 32 x 32 m in 0.25 m cells"},
       [](const std::string&) { return demo(); }},
      {{"helens_low", "random pings from 10-40 m, 3 deg, no position error; needs --terrain"},
       random_over_helens},
      {{"helens_high", "the same with position errors of (3, 3, 1) m"},
       [](const std::string& name) {
         Scenario s = random_over_helens(name);
         s.scene.errors.sigma_position_m = {3.0, 3.0, 1.0};
         return s;
       }},
      {{"helens_half_altitude", "as helens_low, from 5-20 m"},
       [](const std::string& name) {
         Scenario s = random_over_helens(name);
         s.scene.survey.altitude_min_m = 5.0;
         s.scene.survey.altitude_max_m = 20.0;
         return s;
       }},
      {{"monterey_fan", "48 beams over 100 deg at 900 m, 30 m cells; needs --terrain"},
       [](const std::string& name) {
         Scenario s;
         s.name = name;
         s.terrain = TerrainKind::kRaster;
         s.cell_m = 30.0;
         s.shallowest_depth_m = 1800.0;
         SurveySpec& survey = s.scene.survey;
         survey.line_spacing_m = 720.0;
         survey.along_step_m = 45.0;
         survey.altitude_m = 900.0;
         survey.beam_count = 48;
         survey.opening_deg = 100.0;
         s.scene.echo.beam_half_angle_deg = 1.5;
         s.scene.errors.sigma_pointing_deg = 0.5;
         s.scene.errors.sigma_range_m = 15.0;
         s.scene.errors.sigma_position_m = {15.0, 15.0, 6.0};
         s.scene.errors.outlier_fraction = 0.02;
         s.scene.errors.dropout_fraction = 0.03;
         s.scene.declared.min_range_m = 15.0;
         s.scene.declared.max_range_m = 2600.0;
         return s;
       }},
      {{"helens_altimeter", "one 12.5 deg nadir beam, lines 4 m apart; needs --terrain"},
       [](const std::string& name) {
         Scenario s = lawnmower_over_helens(name);
         s.scene.echo.beam_half_angle_deg = 12.5;
         s.scene.errors.sigma_pointing_deg = 1.0;
         s.scene.errors.sigma_range_m = 0.2;
         s.scene.errors.sigma_position_m = {0.5, 0.5, 0.1};
         s.scene.declared.max_range_m = 60.0;
         return s;
       }},
      {{"helens_rolling_fan",
        "40 beams over 110 deg, rolling, 0.8 m of undeclared drift; needs --terrain"},
       [](const std::string& name) {
         Scenario s = lawnmower_over_helens(name);
         SurveySpec& survey = s.scene.survey;
         survey.line_spacing_m = 16.0;
         survey.altitude_m = 18.0;
         survey.beam_count = 40;
         survey.opening_deg = 110.0;
         survey.roll.amplitude_deg = 9.0;
         survey.pitch.amplitude_deg = 6.0;
         survey.yaw.amplitude_deg = 5.0;
         s.scene.echo.beam_half_angle_deg = 1.2;
         s.scene.errors.sigma_pointing_deg = 0.5;
         s.scene.errors.sigma_range_m = 0.3;
         s.scene.errors.sigma_position_m = {0.2, 0.2, 0.1};
         s.scene.errors.drift_sigma_m = 0.8;
         s.scene.errors.outlier_fraction = 0.01;
         s.scene.declared.max_range_m = 90.0;
         return s;
       }},
      {{"plane_flat", "9,000 random pings over a level plane"},
       [](const std::string& name) {
         Scenario s = random_over_plane(name);
         s.shallowest_depth_m = 40.0;
         return s;
       }},
      {{"plane_slope30", "the same over a plane that falls 30 deg to the west"},
       [](const std::string& name) {
         Scenario s = random_over_plane(name);
         s.shallowest_depth_m = 20.0;
         s.slope_deg = 30.0;
         s.dip_azimuth_deg = 270.0;
         return s;
       }},
  };
  return kPresets;
}

void print_summary(const Scenario& scenario, const Terrain& terrain, const Survey& survey,
                   const SimulateOptions& options, std::uint64_t seed) {
  std::size_t touched_count = 0;
  for (const std::uint8_t touched : survey.touched) {
    touched_count += touched;
  }
  const double touched_fraction =
      static_cast<double>(touched_count) / static_cast<double>(survey.touched.size());
  std::string text;
  if (options.json) {
    text = "{\"preset\": " + json_string(scenario.name) +
           ", \"out\": " + json_string(options.out_dir) + ", \"seed\": " + std::to_string(seed) +
           ", \"cells\": [" + std::to_string(terrain.north_count()) + ", " +
           std::to_string(terrain.east_count()) +
           "], \"cell_m\": " + json_number(terrain.cell_m()) +
           ", \"shallowest_m\": " + json_number(terrain.shallowest_m()) +
           ", \"deepest_m\": " + json_number(terrain.deepest_m()) +
           ", \"pings\": " + std::to_string(survey.pings.size()) +
           ", \"planned\": " + std::to_string(survey.planned_count) +
           ", \"missed\": " + std::to_string(survey.missed_count) +
           ", \"outliers\": " + std::to_string(survey.outlier_count) +
           ", \"dropouts\": " + std::to_string(survey.dropout_count) +
           ", \"touched_fraction\": " + json_number(touched_fraction) + "}\n";
  } else {
    char line[512];
    std::snprintf(line, sizeof(line),
                  "%s: %zu x %zu cells of %g m, depth %.2f to %.2f m, seed %llu\n"
                  "%zu pings (%zu sent, %zu missed the terrain; %zu outliers, %zu lost), "
                  "%.1f %% of the cells touched\n",
                  scenario.name.c_str(), terrain.north_count(), terrain.east_count(),
                  terrain.cell_m(), terrain.shallowest_m(), terrain.deepest_m(),
                  static_cast<unsigned long long>(seed), survey.pings.size(), survey.planned_count,
                  survey.missed_count, survey.outlier_count, survey.dropout_count,
                  100.0 * touched_fraction);
    text = std::string(line) + "written to " + options.out_dir +
           ": pings.csv, map.toml, truth.asc, touched.asc\n";
  }
  std::fputs(text.c_str(), stdout);
}

}  // namespace

const std::vector<PresetInfo>& simulate_presets() {
  static const std::vector<PresetInfo> kInfos = [] {
    std::vector<PresetInfo> infos;
    for (const Preset& preset : presets_table()) {
      infos.push_back(preset.info);
    }
    return infos;
  }();
  return kInfos;
}

Scenario preset_scenario(const std::string& name) {
  std::vector<std::string> names;
  for (const Preset& preset : presets_table()) {
    if (preset.info.name == name) {
      return preset.make(name);
    }
    names.push_back(preset.info.name);
  }
  const std::string near = closest_name(name, names);
  std::string all;
  for (const std::string& known : names) {
    all += (all.empty() ? "" : ", ") + known;
  }
  usage_error("simulate: unknown preset \"" + printable(name) + "\"" +
              (near.empty() ? "" : "; did you mean " + near + "?") + " (known: " + all + ")");
}

const std::vector<SettingInfo>& simulate_settings() {
  static const std::vector<SettingInfo> kInfos = settings_table().infos();
  return kInfos;
}

void apply_setting(Scenario* scenario, const std::string& key, const std::string& value) {
  settings_table().apply(scenario, key, value);
}

std::string setting_text(const Scenario& scenario, const std::string& key) {
  return settings_table().text(scenario, key);
}

Terrain build_terrain(const Scenario& scenario) {
  try {
    switch (scenario.terrain) {
      case TerrainKind::kProcedural: {
        ProceduralOptions options;
        options.seed = scenario.terrain_seed.value_or(scenario.scene.seed);
        options.north_count = scenario.north_count;
        options.east_count = scenario.east_count;
        options.cell_m = scenario.cell_m;
        options.shallowest_depth_m = scenario.shallowest_depth_m;
        options.relief_cells = scenario.relief_cells;
        return make_procedural_terrain(options);
      }
      case TerrainKind::kPlane: {
        PlaneOptions options;
        options.north_count = scenario.north_count;
        options.east_count = scenario.east_count;
        options.cell_m = scenario.cell_m;
        options.shallowest_depth_m = scenario.shallowest_depth_m;
        options.slope_deg = scenario.slope_deg;
        options.dip_azimuth_deg = scenario.dip_azimuth_deg;
        return make_plane_terrain(options);
      }
      case TerrainKind::kRaster:
        break;
    }
    if (scenario.raster_path.empty()) {
      usage_error("simulate: preset " + scenario.name +
                  " needs a terrain: --terrain FILE (any raster that GDAL reads), or --terrain "
                  "procedural");
    }
    RasterTerrainOptions options;
    options.first_row = scenario.raster_first_row;
    options.first_column = scenario.raster_first_column;
    options.rows = scenario.raster_rows;
    options.columns = scenario.raster_columns;
    options.north_count = scenario.north_count;
    options.east_count = scenario.east_count;
    options.cell_m = scenario.cell_m;
    options.relief_cells = scenario.relief_cells;
    options.shallowest_depth_m = scenario.shallowest_depth_m;
    return load_raster_terrain(scenario.raster_path, options);
  } catch (const std::invalid_argument& error) {
    usage_error(error.what());
  }
}

Scenario resolve_scenario(const SimulateOptions& options) {
  Scenario scenario = preset_scenario(options.preset);
  if (options.terrain == "procedural") {
    scenario.terrain = TerrainKind::kProcedural;
  } else if (options.terrain == "plane") {
    scenario.terrain = TerrainKind::kPlane;
  } else if (!options.terrain.empty()) {
    scenario.terrain = TerrainKind::kRaster;
    scenario.raster_path = options.terrain;
  }
  if (options.seed) {
    scenario.scene.seed = *options.seed;
  }
  for (const std::string& setting : options.settings) {
    settings_table().apply(&scenario, setting);
  }
  scenario.scene.echo.range_bin_m = scenario.range_bin_cells * scenario.cell_m;
  // The instrument hears as far as the terrain reaches; what it may report is stated in map.toml.
  scenario.scene.echo.max_range_m = 1e6;
  return scenario;
}

int run_simulate(const SimulateOptions& options) {
  if (options.out_dir.empty()) {
    usage_error("simulate: the folder to write to is missing (--out DIR)");
  }
  const Scenario scenario = resolve_scenario(options);
  const Terrain terrain = build_terrain(scenario);
  Survey survey;
  try {
    std::optional<Progress> bar;
    survey = simulate(terrain, scenario.scene, [&bar](std::uint64_t done, std::uint64_t planned) {
      if (!bar) {
        bar.emplace("simulating", planned);
      }
      bar->update(done);
    });
  } catch (const std::invalid_argument& error) {
    usage_error(error.what());
  }
  write_scene(options.out_dir, terrain, scenario.scene, survey);
  print_summary(scenario, terrain, survey, options, scenario.scene.seed);
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
