#include "host_tools/emulate/vehicle_config.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/emulate/fleet.hpp"
#include "host_tools/emulate/instruments.hpp"
#include "host_tools/settings.hpp"
#include "host_tools/sim/exact_math.hpp"

namespace leadline::host {
namespace {

// Bytes that a device sends behind a measurement: what its line needs for them is latency too.
constexpr int kPing1dDistance_bytes = 34;
constexpr int kPing1dProfile_bytes = 236;
constexpr int kPing360_bytes = 1224;
constexpr int kPashr_bytes = 74;
constexpr int kGga_bytes = 78;
constexpr int kPrvat_bytes = 36;

// The Ping360's sector: 60 degrees to each side of straight down; its frequency of 750 kHz.
constexpr double kScanSector_deg = 60.0;
constexpr double kScanWavelength_mm = 2.0;

double transfer_ms(int bytes) {
  return static_cast<double>(bytes) * static_cast<double>(kFleetByteTime_ns) * 1e-6;
}

std::string millimetres(double value_m) { return number_text(std::floor(value_m * 1e3 + 0.5)); }

std::string tenths(double value) { return number_text(std::floor(value * 10.0 + 0.5) / 10.0); }

std::string quoted(const std::string& text) { return "\"" + text + "\""; }

double head_latency_ms(const Mission& mission, const HeadSpec& head) {
  if (head.kind == HeadKind::kPing360) {
    return transfer_ms(kPing360_bytes);
  }
  const bool streams = head.interval_s == 0.0;
  const double frame_ms =
      transfer_ms(mission.profile || streams ? kPing1dProfile_bytes : kPing1dDistance_bytes);
  // Polled, it answers with its latest measurement, which is half an interval old on average.
  return frame_ms + (streams ? 0.0 : 500.0 * head.interval_s);
}

std::string grid_text(const Mission& mission, const Terrain& ground) {
  const double cell_m = ground.cell_m();
  const double margin = static_cast<double>(mission.down_margin_cells);
  const double top = std::floor(ground.shallowest_m() / cell_m) - margin;
  const double bottom = std::ceil(ground.deepest_m() / cell_m) + margin;
  return "[grid]\ncell_mm = " + millimetres(cell_m) + "\nsize = [" +
         std::to_string(mission.ground.north_count) + ", " +
         std::to_string(mission.ground.east_count) + ", " + number_text(bottom - top) +
         "]\norigin_mm = [0, 0, " + millimetres(top * cell_m) + "]\n";
}

std::string navigation_text(const Mission& mission) {
  const NavigationSpec& nav = mission.navigation;
  // What is left of a fix's noise after filtering, and the slow part that no filter finds.
  const double position_m = 0.5 * nav.sigma_fix_m;
  const double depth_m = 0.5 * nav.sigma_pressure_pa / (kWaterDensity_kg_m3 * kGravity_m_s2);
  std::string text = "[navigation]\n";
  text += "sigma_position_mm = [" + millimetres(position_m) + ", " + millimetres(position_m) +
          ", " + millimetres(std::max(depth_m, 0.005)) + "]\n";
  text += "sigma_correlated_mm = [" + millimetres(nav.fix_drift_m) + ", " +
          millimetres(nav.fix_drift_m) + ", 0]\n";
  text += "surface_pressure_pa = " + number_text(kSurfacePressure_pa) + "\n";
  text += "water_density_kg_m3 = " + number_text(kWaterDensity_kg_m3) + "\n";
  text += "gravity_m_s2 = " + number_text(kGravity_m_s2) + "\n";
  text += "sigma_fix_mm = " + number_text(std::max(1.0, std::floor(nav.sigma_fix_m * 1e3 + 0.5))) +
          "\n";
  text += "sigma_depth_mm = " + number_text(std::max(1.0, std::floor(2e3 * depth_m + 0.5))) + "\n";
  text += "sigma_attitude_deg = " + number_text(std::max(0.01, nav.sigma_attitude_deg)) + "\n";
  text += "sigma_heading_deg = " + number_text(std::max(0.01, nav.sigma_heading_deg)) + "\n";
  return text;
}

std::string mount_text(const HeadSpec& head) {
  const Vec3& arm = head.lever_arm_m;
  const Attitude& sight = head.boresight;
  return "[[mount]]\nname = " + quoted(head.name) + "\nlever_arm_mm = [" + millimetres(arm.x) +
         ", " + millimetres(arm.y) + ", " + millimetres(arm.z) + "]\nboresight_deg = [" +
         number_text(sight.roll_deg) + ", " + number_text(sight.pitch_deg) + ", " +
         number_text(sight.heading_deg) + "]\ntable = " + quoted(table_name(head.kind)) + "\n";
}

std::string returns_text(const Mission& mission) {
  return "max_returns = " + std::to_string(mission.max_returns) +
         "\nquality_weight_percent = " + std::to_string(mission.quality_weight_percent) + "\n";
}

std::string head_port_text(const Mission& mission, const HeadSpec& head, const std::string& uri) {
  std::string text =
      "[[port]]\nuri = " + quoted(uri) + "\nmount = " + quoted(head.name) +
      "\nlatency_ms = " + tenths(head_latency_ms(mission, head)) +
      // Vehicle and emulator start in any order. The whole transfer stands in the latency; what
      // emulated heads send is energy.
      "\noptional = true\nbyte_time_ns = 0\nintensity = \"energy\"\nmin_range_mm = " +
      millimetres(head.min_range_m) + "\nmax_range_mm = " + millimetres(head.max_range_m) +
      "\ninterval_ms = " + number_text(std::floor(head.interval_s * 1e3 + 0.5)) + "\n";
  if (head.kind == HeadKind::kPing1d) {
    text += "driver = \"ping1d\"\n";
    text += mission.profile ? "profile = true\n" : "";
    return text + returns_text(mission);
  }
  // A sector of 120 degrees about straight down.
  return text +
         "driver = \"ping360\"\nscan_first_grad = 134\nscan_last_grad = 266\nscan_step_grad = 2\n" +
         returns_text(mission);
}

std::string nmea_port_text(const std::string& uri, std::int64_t latency_us, int bytes) {
  return "[[port]]\nuri = " + quoted(uri) +
         "\ndriver = \"nmea\"\noptional = true\nbyte_time_ns = 0\nlatency_ms = " +
         tenths(static_cast<double>(latency_us) * 1e-3 + transfer_ms(bytes)) + "\n";
}

}  // namespace

const char* table_name(HeadKind kind) { return kind == HeadKind::kPing1d ? "beam.llt" : "fan.llt"; }

SonarConfig mission_sonar(const Mission& mission, HeadKind kind) {
  const NavigationSpec& nav = mission.navigation;
  SonarConfig sonar;
  double widest_tilt_deg = 0.0;
  double max_range_m = 0.0;
  double min_range_m = mission.heads.front().min_range_m;
  for (const HeadSpec& each : mission.heads) {
    max_range_m = std::max(max_range_m, each.max_range_m);
    min_range_m = std::min(min_range_m, each.min_range_m);
    if (each.kind != kind) {
      continue;
    }
    widest_tilt_deg = std::max(widest_tilt_deg, std::fabs(each.boresight.roll_deg));
    sonar.beam_half_angle_deg = each.beam_half_angle_deg;
    if (kind == HeadKind::kPing360) {
      widest_tilt_deg = kScanSector_deg;
      // The rectangle whose pattern has its first zeros at the edges of the fan.
      const auto aperture_mm = [](double edge_deg) {
        return kScanWavelength_mm / exact::sin(edge_deg * exact::kRadPerDeg);
      };
      sonar.beam = BeamKind::kAperture;
      sonar.frequency_hz = 1.5e6 / kScanWavelength_mm;
      sonar.aperture_along_mm = aperture_mm(each.beam_half_angle_deg);
      sonar.aperture_across_mm = aperture_mm(each.across_half_angle_deg);
    }
  }
  // Heading turns a tilted beam about the vertical.
  const double heading_deg = std::sqrt(nav.sigma_heading_deg * nav.sigma_heading_deg +
                                       nav.heading_drift_deg * nav.heading_drift_deg) *
                             exact::sin(widest_tilt_deg * exact::kRadPerDeg);
  const double mounting_deg = mission.errors.misalignment_deg;
  sonar.sigma_pointing_deg =
      std::sqrt(nav.sigma_attitude_deg * nav.sigma_attitude_deg + mounting_deg * mounting_deg +
                0.5 * heading_deg * heading_deg);
  sonar.sigma_range_mm = mission.errors.sigma_range_m * 1e3;
  sonar.min_range_mm = std::llround(min_range_m * 1e3);
  sonar.max_range_mm = std::llround(max_range_m * 1e3);
  sonar.sound_speed_mm_s = std::llround(mission.sound_speed_m_s * 1e3);
  return sonar;
}

std::vector<MissionTable> mission_tables(const Mission& mission) {
  std::vector<MissionTable> tables;
  for (const HeadSpec& head : mission.heads) {
    const std::string name = table_name(head.kind);
    if (tables.empty() || tables.back().name != name) {
      tables.push_back(
          {name, generate_table(beam_description(mission_sonar(mission, head.kind))).table});
    }
  }
  return tables;
}

std::string mission_vehicle_toml(const Mission& mission, const Terrain& ground,
                                 const MissionLinks& links) {
  const SonarConfig sonar = mission_sonar(mission, mission.heads.front().kind);
  std::string text =
      "# Written by leadline for its emulated vehicle. firmware/vehicle.example.toml explains "
      "every "
      "key.\n\n";
  text += "[survey]\nid = " + std::to_string(mission.seed % 9007199254740991U) +
          "\nname = \"emulated\"\n\n";
  text += grid_text(mission, ground) + "\n";
  text += "[sonar]\nmin_range_mm = " + std::to_string(sonar.min_range_mm) +
          "\nmax_range_mm = " + std::to_string(sonar.max_range_mm) +
          "\nsound_speed_mm_s = " + std::to_string(sonar.sound_speed_mm_s) + "\n\n";
  text += navigation_text(mission) + "\n";
  text += "[frame]\nlat = " + number_text(mission.navigation.latitude_deg) +
          "\nlon = " + number_text(mission.navigation.longitude_deg) +
          "\nvertical_datum = \"sea surface\"\n\n";
  // Depths of the tiles that changed most, fifty a second: a survey line changes fewer.
  text += "[cycle]\ntile_budget = 1\n";
  if (mission.extract_interval_s > 0.0) {
    text += "extract_interval_s = " + number_text(mission.extract_interval_s) + "\n";
  }
  text += "\n";
  for (const HeadSpec& head : mission.heads) {
    text += mount_text(head) + "\n";
  }
  std::size_t port = 0;
  for (const HeadSpec& head : mission.heads) {
    text += head_port_text(mission, head, links.port_uris[port]) + "\n";
    ++port;
  }
  text += nmea_port_text(links.port_uris[port], kAttitudeLatency_us, kPashr_bytes) + "\n";
  if (!mission.one_nmea_line) {
    text += nmea_port_text(links.port_uris[port + 1], kFixLatency_us, kGga_bytes) + "\n";
    text += nmea_port_text(links.port_uris[port + 2], kPressureLatency_us, kPrvat_bytes) + "\n";
  }
  text += "[link]\nuri = " + quoted(links.link_uri) +
          "\nrate_bytes_s = " + std::to_string(mission.link_rate_bytes_s) +
          "\nmax_tile_age_s = " + number_text(mission.link_max_tile_age_s) +
          "\ncoarse_wait_s = " + number_text(mission.link_coarse_wait_s) + "\n";
  if (!links.log_path.empty()) {
    text += "\n[log]\npath = " + quoted(links.log_path) + "\n";
  }
  return text;
}

}  // namespace leadline::host
