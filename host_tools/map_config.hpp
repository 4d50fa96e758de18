// The survey's configuration: map.toml as physical values. Every key, its unit, default and limits
// stand at its field, here or in firmware/config/survey_sections.hpp for the tables shared with
// vehicle.toml; `leadline map --help` points here. Only [grid] and one beam description are
// needed. Integers are accepted for decimals, whole decimals (1000.0) for integers.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "firmware/config/survey_sections.hpp"

namespace leadline::host {

/// The one version of the schema that this program reads (key schema_version, optional).
inline constexpr std::int64_t kSchemaVersion = 1;

enum class BeamKind : std::uint8_t {
  kCone,      ///< beam_half_angle_deg
  kPiston,    ///< piston_diameter_mm and frequency_hz
  kAperture,  ///< aperture_along_mm, aperture_across_mm and frequency_hz
  kPattern,   ///< pattern_file
};

/// [sonar]: the head. Exactly one beam description.
struct SonarConfig : SonarRanges {
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
  /// Share of the echo's energy that has arrived when the head's detector fires; over 0, below 1.
  double detection_fraction = 0.1;
};

struct MapConfig {
  std::int64_t schema_version = kSchemaVersion;
  std::optional<std::string> survey_name;  ///< [survey] name: at most 64 bytes of printable text
  GridConfig grid;
  SonarConfig sonar;
  NavigationSigmas navigation;  ///< independent: from row to row
  ModelConfig model;
  FrameConfig frame;
};

/// Reads and checks `path`. Throws HostError: kUsage when it cannot be opened, is not TOML, has an
/// unknown key (with a suggestion), misses a key or has a value outside its limits; all findings are
/// in the one message, a line each, as `FILE:LINE: [table] key = value: reason`.
[[nodiscard]] MapConfig load_map_config(const std::string& path);

/// The same over text; `name` stands for the file in messages, `base_dir` is where a relative
/// pattern_file starts ("" leaves it as it is).
[[nodiscard]] MapConfig parse_map_config(std::string_view text, const std::string& name,
                                         const std::string& base_dir);

/// As load_map_config, but [grid] may be missing: what a table is made of.
[[nodiscard]] MapConfig load_beam_config(const std::string& path);

/// Every value after defaults, as TOML that parse_map_config(..., "") reads back to the same values.
[[nodiscard]] std::string map_config_to_toml(const MapConfig& config);
/// The same as one JSON object: tables are objects, unset optional keys are absent.
[[nodiscard]] std::string map_config_to_json(const MapConfig& config);

}  // namespace leadline::host
