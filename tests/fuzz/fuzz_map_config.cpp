// Any bytes as map.toml. What must hold: only HostError kUsage with a printable message comes out; a
// configuration that is accepted is inside every documented limit; and what is written as the resolved
// configuration reads back to the same values.
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

#include "host_tools/exit_codes.hpp"
#include "host_tools/map_config.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::fuzz::require;
using leadline::host::BeamKind;
using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::map_config_to_json;
using leadline::host::map_config_to_toml;
using leadline::host::MapConfig;
using leadline::host::NoReturn;
using leadline::host::parse_map_config;

bool within(double value, double low, double high) { return value >= low && value <= high; }

void check(const MapConfig& config) {
  require(config.schema_version == 1, "the schema version is the one that is read");
  require(within(config.grid.cell_mm, 1, 1'000'000), "cell_mm");
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t limit_mm = axis == 2 ? 20'000'000 : 2'000'000'000;
    require(within(config.grid.size[axis], 1, 1'048'576), "size");
    const std::int64_t far_mm =
        config.grid.origin_mm[axis] + std::int64_t{config.grid.size[axis]} * config.grid.cell_mm;
    require(config.grid.origin_mm[axis] >= -limit_mm && far_mm <= limit_mm, "the grid's corners");
    require(within(config.navigation.sigma_position_mm[axis], 0, 1e6), "sigma_position_mm");
    require(within(config.navigation.sigma_correlated_mm[axis], 0, 1e6), "sigma_correlated_mm");
  }
  require(config.grid.voxel_count() > 0 && config.grid.voxel_count() <= (std::uint64_t{1} << 60U),
          "voxel_count");
  const auto& sonar = config.sonar;
  switch (sonar.beam) {
    case BeamKind::kCone:
      require(sonar.beam_half_angle_deg > 0 && sonar.beam_half_angle_deg <= 90,
              "beam_half_angle_deg");
      break;
    case BeamKind::kPiston:
      require(within(sonar.piston_diameter_mm, 1, 10'000), "piston_diameter_mm");
      require(within(sonar.frequency_hz, 100, 1e8), "frequency_hz");
      break;
    case BeamKind::kAperture:
      require(within(sonar.aperture_along_mm, 1, 10'000), "aperture_along_mm");
      require(within(sonar.aperture_across_mm, 1, 10'000), "aperture_across_mm");
      require(within(sonar.frequency_hz, 100, 1e8), "frequency_hz");
      break;
    case BeamKind::kPattern:
      require(!sonar.pattern_file.empty(), "pattern_file");
      break;
  }
  require(!sonar.max_half_angle_deg ||
              (*sonar.max_half_angle_deg > 0 && *sonar.max_half_angle_deg <= 90),
          "max_half_angle_deg");
  require(within(sonar.sigma_pointing_deg, 0, 45), "sigma_pointing_deg");
  require(within(sonar.sigma_range_mm, 0, 1e6), "sigma_range_mm");
  require(sonar.min_range_mm >= 0 && sonar.min_range_mm < sonar.max_range_mm, "min_range_mm");
  require(sonar.max_range_mm >= 1 && sonar.max_range_mm <= 20'000'000, "max_range_mm");
  require(sonar.no_return == NoReturn::kIgnore || sonar.detect_range_mm, "detect_range_mm");
  require(!sonar.detect_range_mm || *sonar.detect_range_mm <= sonar.max_range_mm,
          "detect_range_mm");
  require(within(static_cast<double>(sonar.sound_speed_mm_s), 200'000, 6'000'000),
          "sound_speed_mm_s");
  require(sonar.detection_fraction > 0 && sonar.detection_fraction < 1, "detection_fraction");
  require(config.model.k_p > 0 && config.model.k_p <= 1, "k_p");
  require(config.frame.lat_deg.has_value() == config.frame.lon_deg.has_value(), "lat with lon");
  require(!config.frame.lat_deg || within(*config.frame.lat_deg, -90, 90), "lat");
  require(!config.frame.lon_deg || within(*config.frame.lon_deg, -180, 360), "lon");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  MapConfig config;
  try {
    config = parse_map_config(text, "f.toml", "");
  } catch (const HostError& error) {
    require(error.code() == ExitCode::kUsage, "only configuration errors");
    leadline::fuzz::require_message(error.what(), "f.toml");
    return 0;
  }
  check(config);
  const std::string resolved = map_config_to_toml(config);
  std::string again;
  try {
    again = map_config_to_toml(parse_map_config(resolved, "r.toml", ""));
  } catch (const HostError& error) {
    std::fprintf(stderr, "%s\n%s\n", resolved.c_str(), error.what());
    require(false, "the resolved configuration is accepted");
  }
  require(again == resolved, "the resolved configuration reads back to the same values");
  require(map_config_to_json(config).back() == '}', "JSON is closed");
  return 0;
}
