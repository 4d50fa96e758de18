// `leadline scene`: named surveys, their parameters by name, and the run from options to a folder.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/settings.hpp"
#include "host_tools/sim/simulator.hpp"
#include "host_tools/sim/terrain_sources.hpp"

namespace leadline::host {

enum class TerrainKind : std::uint8_t {
  kProcedural,
  kPlane,
  kRaster,
};

/// Everything that makes a scene, before it is built. Lengths in metres unless a name says cells.
struct Scenario {
  std::string name;
  TerrainKind terrain = TerrainKind::kProcedural;
  std::string raster_path;  ///< kRaster
  std::size_t north_count = 128;
  std::size_t east_count = 128;
  double cell_m = 1.0;
  double shallowest_depth_m = 60.0;
  double relief_cells = 24.0;  ///< kProcedural, kRaster (there 0 keeps the raster's heights)
  std::optional<std::uint64_t> terrain_seed;  ///< kProcedural; unset: the scene's seed
  double slope_deg = 0.0;                     ///< kPlane
  double dip_azimuth_deg = 0.0;               ///< kPlane
  std::size_t raster_first_row = 0;           ///< kRaster: the part used, see RasterTerrainOptions
  std::size_t raster_first_column = 0;
  std::size_t raster_rows = 0;
  std::size_t raster_columns = 0;
  double range_bin_cells = 0.125;  ///< sets scene.echo.range_bin_m
  Scene scene;
};

struct PresetInfo {
  std::string name;
  std::string summary;  ///< one line
};

/// The presets that preset_scenario() knows: the demo and the eight kinds of scenes that the product's
/// accuracy is stated on.
[[nodiscard]] const std::vector<PresetInfo>& simulate_presets();

/// A preset's parameters. The helens and monterey kinds need a raster (terrain = kRaster, the path is
/// empty until set). Throws HostError kUsage for an unknown name, with a suggestion.
[[nodiscard]] Scenario preset_scenario(const std::string& name);

/// Every parameter that apply_setting() can change, in a sensible order for a help text.
[[nodiscard]] const std::vector<SettingInfo>& simulate_settings();

/// Sets one parameter from text: decimals for numbers, "true"/"false" for switches, names for kinds
/// ("survey=random", "survey=lawnmower"). Throws HostError kUsage naming key and value for an unknown
/// key (with a suggestion) or a value that does not parse.
void apply_setting(Scenario* scenario, const std::string& key, const std::string& value);

/// The text of a parameter as apply_setting() takes it; "" for an optional one that is unset.
[[nodiscard]] std::string setting_text(const Scenario& scenario, const std::string& key);

/// Builds the terrain. Throws HostError (kUsage for parameters, kInput for the raster).
[[nodiscard]] Terrain build_terrain(const Scenario& scenario);

/// What `leadline scene` is asked to do.
struct SimulateOptions {
  std::string preset = "demo";
  /// "" = what the preset says; "procedural"; "plane"; else a raster that GDAL reads.
  std::string terrain;
  std::optional<std::uint64_t> seed;
  /// "key=value" each, applied in order after the preset; keys as in simulate_settings().
  std::vector<std::string> settings;
  std::string out_dir;  ///< required; created, files of an earlier run are replaced
  bool json = false;    ///< the summary as one JSON object on standard output
};

/// The preset with terrain, seed and settings applied. Throws HostError kUsage.
[[nodiscard]] Scenario resolve_scenario(const SimulateOptions& options);

/// Simulates and writes the scene folder; prints a summary to standard output and, on a terminal, a
/// progress bar. Returns 0. Throws HostError: kUsage for options, kInput for the raster, kOutput for
/// the folder.
int run_simulate(const SimulateOptions& options);

}  // namespace leadline::host
