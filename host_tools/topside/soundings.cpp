#include "host_tools/topside/soundings.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

constexpr double kDegPerRad = 57.29577951308232;

void append_angle(std::string* text, base::Bam32 angle_bam32, bool full_turn) {
  const double raw = full_turn ? static_cast<double>(angle_bam32)
                               : static_cast<double>(static_cast<std::int32_t>(angle_bam32));
  *text += ',';
  append_fixed(text, raw * (360.0 / 4294967296.0), 6);
}

void append_metres(std::string* text, std::int64_t value_um) {
  *text += ',';
  append_fixed(text, static_cast<double>(value_um) * 1e-6, 6);
}

/// Variance of a tangent, as a table has it, to degrees of one sigma.
double sigma_deg(std::uint32_t variance_q30) {
  return std::atan(std::sqrt(static_cast<double>(variance_q30) / 1073741824.0)) * kDegPerRad;
}

}  // namespace

void Soundings::take(const firmware::Vehicle& vehicle) {
  pings_.insert(pings_.end(), vehicle.mapped(), vehicle.mapped() + vehicle.mapped_count());
}

std::string Soundings::csv() const {
  std::vector<const firmware::MappedPing*> order;
  order.reserve(pings_.size());
  for (const firmware::MappedPing& ping : pings_) {
    order.push_back(&ping);
  }
  // Heads with different latencies come out of step.
  std::stable_sort(order.begin(), order.end(), [](const auto* a, const auto* b) {
    return a->ping.t_transmit_us < b->ping.t_transmit_us;
  });
  std::string text =
      "time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m\n";
  for (const firmware::MappedPing* const mapped : order) {
    const base::Pose& pose = mapped->pose;
    text += std::to_string(mapped->ping.t_transmit_us);
    for (const std::int64_t position_um : pose.position_um) {
      append_metres(&text, position_um);
    }
    append_angle(&text, pose.attitude.roll_bam32, false);
    append_angle(&text, pose.attitude.pitch_bam32, false);
    append_angle(&text, pose.attitude.heading_bam32, true);
    append_angle(&text, mapped->ping.azimuth_bam32, false);
    append_angle(&text, mapped->ping.elevation_bam32, false);
    if (mapped->ping.kind == base::ReturnKind::kRange) {
      append_metres(&text, mapped->ping.range_um);
    } else {
      text += ',';
    }
    text += '\n';
  }
  return text;
}

std::optional<std::string> config_text(const char (&text)[firmware::kMaxConfigText_bytes]) {
  const char* const end = std::find(text, text + sizeof text, '\0');
  return end == text ? std::nullopt : std::optional<std::string>({text, end});
}

MapConfig flight_map_config(const firmware::VehicleConfig& config,
                            const model::LocalizationTable& table) {
  const model::ModelConfig& model = config.model;
  MapConfig map;
  map.grid.cell_mm = model.cell_mm;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    map.grid.size[axis] = model.size[axis];
    map.grid.origin_mm[axis] = model.origin_mm[axis];
    map.navigation.sigma_position_mm[axis] = static_cast<double>(model.sigma_position_mm[axis]);
    map.navigation.sigma_correlated_mm[axis] = static_cast<double>(model.sigma_correlated_mm[axis]);
  }
  map.sonar.beam = BeamKind::kCone;
  map.sonar.beam_half_angle_deg =
      std::atan(static_cast<double>(table.tan_envelope_along_q24) / 16777216.0) * kDegPerRad;
  map.sonar.sigma_pointing_deg = sigma_deg(table.pointing_variance_q30);
  map.sonar.sigma_range_mm = static_cast<double>(table.sigma_range_um) / 1000.0;
  map.sonar.detection_fraction = static_cast<double>(table.detection_fraction_q16) / 65536.0;
  map.sonar.min_range_mm = model.min_range_um / 1000;
  map.sonar.max_range_mm = model.max_range_um / 1000;
  map.sonar.sound_speed_mm_s = config.sound_speed_mm_s;
  if (model.no_return == model::NoReturnPolicy::kEmpty) {
    map.sonar.no_return = NoReturn::kEmpty;
    map.sonar.detect_range_mm = model.detect_range_um / 1000;
  }
  map.model.rule = static_cast<Rule>(model.rule);
  map.model.k_p = static_cast<double>(model.k_p_q16) / 65536.0;
  if (config.navigation.has_origin != 0) {
    map.frame.lat_deg = static_cast<double>(config.navigation.origin_latitude_e9deg) / 1e9;
    map.frame.lon_deg = static_cast<double>(config.navigation.origin_longitude_e9deg) / 1e9;
  }
  if (config.epsg != 0) {
    map.frame.epsg = config.epsg;
  }
  map.frame.vertical_datum = config_text(config.vertical_datum);
  map.survey_name = config_text(config.survey_name);
  return map;
}

}  // namespace leadline::host
