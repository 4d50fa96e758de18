// The survey's configuration: map.toml as physical values. Every key, its unit, default and limits
// stand at its field; `leadline map --help` points here. Only [grid] and one beam description are
// needed. Integers are accepted for decimals, whole decimals (1000.0) for integers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "model/base/units.hpp"

namespace leadline::host {

/// The one version of the schema that this program reads (key schema_version, optional).
inline constexpr std::int64_t kSchemaVersion = 1;

enum class BeamKind : std::uint8_t {
  kCone,      ///< beam_half_angle_deg
  kPiston,    ///< piston_diameter_mm and frequency_hz
  kAperture,  ///< aperture_along_mm, aperture_across_mm and frequency_hz
  kPattern,   ///< pattern_file
};

enum class NoReturn : std::uint8_t {
  kIgnore,  ///< "ignore": an empty range says nothing
  kEmpty,   ///< "empty": nothing up to detect_range_mm
};

enum class Rule : std::uint8_t { kWeightedMean, kLogOdds };

/// [grid]: voxels, half-open cells, axes north, east, down.
struct GridConfig {
  std::int32_t cell_mm = 0;          ///< required; 1 .. 1,000,000
  std::int32_t size[3] = {0, 0, 0};  ///< required; cells, each 1 .. 1,048,576
  /// Required; numerically lowest corner. The whole grid lies within +-2,000 km horizontally and
  /// +-20 km vertically.
  std::int64_t origin_mm[3] = {0, 0, 0};

  /// Never overflows for a checked configuration (at most 2^60).
  [[nodiscard]] std::uint64_t voxel_count() const {
    return static_cast<std::uint64_t>(size[0]) * static_cast<std::uint64_t>(size[1]) *
           static_cast<std::uint64_t>(size[2]);
  }
};

/// [sonar]: the head. Exactly one beam description.
struct SonarConfig {
  BeamKind beam = BeamKind::kCone;
  double beam_half_angle_deg = 0;  ///< kCone: where the cone's weight reaches zero; over 0 .. 90
  double piston_diameter_mm = 0;   ///< kPiston; 1 .. 10,000
  double frequency_hz = 0;         ///< kPiston, kAperture; 100 .. 100,000,000
  double aperture_along_mm = 0;    ///< kAperture: along the mount's forward axis; 1 .. 10,000
  double aperture_across_mm = 0;   ///< kAperture: the other axis; 1 .. 10,000
  /// kPattern: a relative path in the file is relative to the TOML file; here it is resolved.
  std::string pattern_file;
  std::optional<double> max_half_angle_deg;  ///< caps the table's envelope; over 0 .. 90
  double sigma_pointing_deg = 0;             ///< isotropic about the axis; 0 .. 45
  double sigma_range_mm = 0;                 ///< 0 .. 1,000,000
  std::int64_t min_range_mm = 0;  ///< shorter returns are rejected; 0 .. below max_range_mm
  /// Longer returns are rejected; 1 .. 20,000,000. Default: default_max_range_mm(grid).
  std::int64_t max_range_mm = 0;
  NoReturn no_return = NoReturn::kIgnore;
  /// Up to where a target would have been heard: required with no_return = "empty";
  /// 1 .. max_range_mm.
  std::optional<std::int64_t> detect_range_mm;
  std::int64_t sound_speed_mm_s = 1'500'000;  ///< 200,000 .. 6,000,000 (air .. steel)
  /// Share of the echo's energy that has arrived when the head's detector fires; over 0, below 1.
  double detection_fraction = 0.1;
};

/// [navigation]: sigmas are one standard deviation of a Gaussian, per axis north, east, down.
struct NavigationConfig {
  double sigma_position_mm[3] = {0, 0, 0};    ///< independent from row to row; 0 .. 1,000,000
  double sigma_correlated_mm[3] = {0, 0, 0};  ///< a floor that no averaging lowers; 0 .. 1,000,000
};

/// [model]
struct ModelConfig {
  Rule rule = Rule::kLogOdds;  ///< "weighted_mean" or "log_odds"
  double k_p = 0.5;            ///< gain of recursive rules, unused by the two above; over 0 .. 1
};

/// [frame]: where the survey's origin lies; for georeferenced exports, no effect on the map.
struct FrameConfig {
  std::optional<double> lat_deg;              ///< key lat; -90 .. 90, needs lon
  std::optional<double> lon_deg;              ///< key lon; -180 .. 360, needs lat
  std::optional<std::int32_t> epsg;           ///< 1 .. 999,999
  std::optional<std::string> vertical_datum;  ///< at most 64 bytes of printable text
};

struct MapConfig {
  std::int64_t schema_version = kSchemaVersion;
  GridConfig grid;
  SonarConfig sonar;
  NavigationConfig navigation;
  ModelConfig model;
  FrameConfig frame;
};

/// How far a transducer anywhere above the grid, between the surface (down 0) and the grid's bottom, can
/// be from a voxel: the diagonal of that box, rounded up, at most 20 km. Nothing plausible is longer.
[[nodiscard]] std::int64_t default_max_range_mm(const GridConfig& grid);

/// Reads and checks `path`. Throws HostError: kUsage when it cannot be opened, is not TOML, has an
/// unknown key (with a suggestion), misses a key or has a value outside its limits; all findings are
/// in the one message, a line each, as `FILE:LINE: [table] key = value: reason`.
[[nodiscard]] MapConfig load_map_config(const std::string& path);

/// The same over text; `name` stands for the file in messages, `base_dir` is where a relative
/// pattern_file starts ("" leaves it as it is).
[[nodiscard]] MapConfig parse_map_config(std::string_view text, const std::string& name,
                                         const std::string& base_dir);

/// Every value after defaults, as TOML that parse_map_config(..., "") reads back to the same values.
[[nodiscard]] std::string map_config_to_toml(const MapConfig& config);
/// The same as one JSON object: tables are objects, unset optional keys are absent.
[[nodiscard]] std::string map_config_to_json(const MapConfig& config);

/// Names as written in TOML.
[[nodiscard]] const char* rule_name(Rule rule);
[[nodiscard]] const char* beam_kind_name(BeamKind kind);
[[nodiscard]] const char* no_return_name(NoReturn policy);

}  // namespace leadline::host
