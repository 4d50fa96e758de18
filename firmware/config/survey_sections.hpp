// The tables that map.toml and vehicle.toml have in common, as physical values: where the grid lies, what
// ranges count, how good navigation is, which rule combines. Every key, its unit, default and limits
// stand at its field.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "firmware/config/toml_reader.hpp"
#include "model/base/units.hpp"
#include "model/config.hpp"
#include "model/work_bound.hpp"

namespace leadline::host {

enum class NoReturn : std::uint8_t {
  kIgnore,  ///< "ignore": an empty range says nothing
  kEmpty,   ///< "empty": nothing up to detect_range_mm
};

using model::Rule;

/// [grid]: voxels, half-open cells, axes north, east, down.
struct GridConfig {
  std::int32_t cell_mm = 0;          ///< required; 1 .. 1,000,000
  std::int32_t size[3] = {0, 0, 0};  ///< required; cells, each 1 .. 1,048,576
  /// Required; numerically lowest corner. The whole grid lies within +-2,000 km horizontally and
  /// +-20 km vertically.
  std::int64_t origin_mm[3] = {0, 0, 0};
  std::uint32_t size_line = 0;  ///< of `size` in its file, for messages; 0: in none

  /// Never overflows for a checked configuration (at most 2^60).
  [[nodiscard]] std::uint64_t voxel_count() const {
    return static_cast<std::uint64_t>(size[0]) * static_cast<std::uint64_t>(size[1]) *
           static_cast<std::uint64_t>(size[2]);
  }
};

/// [sonar], the part that is not the beam: which ranges count and what they mean.
struct SonarRanges {
  std::int64_t min_range_mm = 0;  ///< shorter returns are rejected; 0 .. below max_range_mm
  /// Longer returns are rejected; 1 .. 20,000,000. Default: default_max_range_mm(grid).
  std::int64_t max_range_mm = 0;
  std::uint32_t max_range_line = 0;  ///< of max_range_mm in its file, for messages; 0: in none
  NoReturn no_return = NoReturn::kIgnore;
  /// Up to where a target would have been heard: required with no_return = "empty";
  /// 1 .. max_range_mm.
  std::optional<std::int64_t> detect_range_mm;
  std::int64_t sound_speed_mm_s = 1'500'000;  ///< of the head's own reckoning
};

/// [navigation], what the model asks of it: one standard deviation of a Gaussian, per axis north, east,
/// down.
struct NavigationSigmas {
  double sigma_position_mm[3] = {0, 0, 0};    ///< independent from ping to ping; 0 .. 1,000,000
  double sigma_correlated_mm[3] = {0, 0, 0};  ///< a floor that no averaging lowers; 0 .. 1,000,000
};

/// [model]
struct ModelConfig {
  /// "weighted_mean", "log_odds", "certainty_factor", "recursive"
  Rule rule = Rule::kLogOdds;
  double k_p = 0.5;  ///< gain of the latter two, unused by the others; over 0 .. 1
};

/// [frame]: where the survey's origin lies; for georeferenced exports, no effect on the map.
struct FrameConfig {
  std::optional<double> lat_deg;              ///< key lat; -90 .. 90, needs lon
  std::optional<double> lon_deg;              ///< key lon; -180 .. 360, needs lat
  std::optional<std::int32_t> epsg;           ///< 1 .. 999,999
  std::optional<std::string> vertical_datum;  ///< at most 64 bytes of printable text
};

/// How far a transducer anywhere above the grid, between the surface (down 0) and the grid's bottom, can
/// be from a voxel: the diagonal of that box, rounded up, at most 20 km. Nothing plausible is longer.
[[nodiscard]] std::int64_t default_max_range_mm(const GridConfig& grid);

/// Keys of the tables above, for KnownTable.
[[nodiscard]] std::vector<std::string> grid_keys();
[[nodiscard]] std::vector<std::string> sonar_range_keys();
[[nodiscard]] std::vector<std::string> navigation_sigma_keys();
[[nodiscard]] std::vector<std::string> model_keys();
[[nodiscard]] std::vector<std::string> frame_keys();

/// Each reads its table; what is wrong becomes a finding of the reader.
[[nodiscard]] GridConfig read_grid(TomlReader* reader);
/// `sound_speed_mm_s`: what may be given.
void read_sonar_ranges(TomlReader* reader, const GridConfig& grid, const Limits& sound_speed_mm_s,
                       SonarRanges* ranges);
void read_navigation_sigmas(TomlReader* reader, NavigationSigmas* navigation);
[[nodiscard]] ModelConfig read_model(TomlReader* reader);
[[nodiscard]] FrameConfig read_frame(TomlReader* reader);

/// The model's own configuration of these. Throws HostError kUsage, `config_name` in front, when the
/// grid or the longest range is over the compiled-in capacity: with the numbers. `windowed`: not all voxels
/// have to fit.
[[nodiscard]] model::ModelConfig to_model_config(const GridConfig& grid, const SonarRanges& ranges,
                                                 const NavigationSigmas& navigation,
                                                 const ModelConfig& model,
                                                 const std::string& config_name,
                                                 bool windowed = false);
/// Throws HostError kUsage: one ping can touch more voxels than `budget_voxels`, with the numbers.
[[noreturn]] void refuse_work_bound(const model::WorkBound& bound, std::uint32_t budget_voxels,
                                    const std::string& config_name);

/// Names as written in TOML.
[[nodiscard]] const char* rule_name(Rule rule);
[[nodiscard]] const char* no_return_name(NoReturn policy);
/// "[1, 2, 3]"
[[nodiscard]] std::string array_text(const std::int32_t (&values)[3]);
[[nodiscard]] std::string array_text(const std::int64_t (&values)[3]);
[[nodiscard]] std::string array_text(const double (&values)[3]);

}  // namespace leadline::host
