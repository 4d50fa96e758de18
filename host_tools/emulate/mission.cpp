#include "host_tools/emulate/mission.hpp"

#include <cmath>
#include <stdexcept>
#include <utility>

#include "host_tools/options.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

using Settings = SettingTable<Mission>;

void require(bool ok, const char* field, double value, const char* range) {
  if (!ok) {
    usage_error(std::string(field) + "=" + number_text(value) + ": must be " + range);
  }
}

HeadSpec altimeter(const char* name, double starboard_m, double roll_deg) {
  HeadSpec head;
  head.name = name;
  head.lever_arm_m = {0.15, starboard_m, 0.1};
  // Rolling the head's frame to starboard down turns its down axis to port.
  head.boresight.roll_deg = roll_deg;
  return head;
}

// A vertical profiler: the scanning plane across the track, angle 200 straight down.
HeadSpec profiler() {
  HeadSpec head;
  head.name = "scan";
  head.kind = HeadKind::kPing360;
  head.lever_arm_m = {-0.2, 0.0, 0.15};
  head.boresight.pitch_deg = -90.0;
  head.beam_half_angle_deg = 12.5;
  head.across_half_angle_deg = 1.0;
  head.min_range_m = 0.75;
  head.interval_s = 0.0;
  return head;
}

// Applies a setting to all altimeters alike.
template <typename Member>
void head_decimal(Settings* settings, const char* key, const char* help, Member member) {
  settings->add(
      {{key, help},
       [key, member](const Settings& table, Mission* mission, const std::string& text) {
         const double value = table.parse_decimal(key, text);
         for (HeadSpec& head : mission->heads) {
           if (head.kind == HeadKind::kPing1d) {
             head.*member = value;
           }
         }
       },
       [member](const Mission& mission) { return number_text(mission.heads.front().*member); }});
}

void add_ground(Settings* settings) {
  settings->count(
      "north_count", "cells of the grid, north",
      [](auto& m) -> auto& { return m.ground.north_count; });
  settings->count(
      "east_count", "the same, east", [](auto& m) -> auto& { return m.ground.east_count; });
  settings->decimal(
      "cell_m", "edge of a cell", [](auto& m) -> auto& { return m.ground.cell_m; });
  settings->count(
      "margin_cells", "ground beyond the grid on every side",
      [](auto& m) -> auto& { return m.margin_cells; });
  settings->decimal(
      "shallowest_depth_m", "depth of the terrain's highest point",
      [](auto& m) -> auto& { return m.ground.shallowest_depth_m; });
  settings->decimal(
      "relief_cells", "height of the terrain in cells; 0 (raster) = the raster's own",
      [](auto& m) -> auto& { return m.ground.relief_cells; });
  settings->decimal(
      "slope_deg", "plane: its slope", [](auto& m) -> auto& { return m.ground.slope_deg; });
}

void add_swing(Settings* settings, const std::string& name, Swing MotionPlan::*swing) {
  settings->decimal(
      name + "_deg", name + ": amplitude of the hull's motion", [swing](auto& m) -> auto& {
        return (m.motion.*swing).amplitude_deg;
      });
  settings->decimal(
      name + "_period_s",
      name + ": its period", [swing](auto& m) -> auto& { return (m.motion.*swing).period_s; });
}

void add_motion(Settings* settings) {
  const auto decimal = [settings](const char* key, const char* help, double MotionPlan::*member) {
    settings->decimal(
        key, help, [member](auto& m) -> auto& { return m.motion.*member; });
  };
  decimal("line_spacing_m", "between survey lines", &MotionPlan::line_spacing_m);
  decimal("run_out_m", "beyond the end of a line before the turn", &MotionPlan::run_out_m);
  decimal("altitude_m", "above the mean of the ground around", &MotionPlan::altitude_m);
  decimal("altitude_smoothing_m", "reach of that mean, ahead and astern",
          &MotionPlan::altitude_smoothing_m);
  decimal("speed_m_s", "through the water, on a line", &MotionPlan::speed_m_s);
  decimal("turn_speed_m_s", "through the water, in a turn", &MotionPlan::turn_speed_m_s);
  decimal("turn_rate_deg_s", "largest rate of turn", &MotionPlan::turn_rate_deg_s);
  decimal("current_north_m_s", "steady current", &MotionPlan::current_north_m_s);
  decimal("current_east_m_s", "the same, east", &MotionPlan::current_east_m_s);
  decimal("current_swing_m_s", "part of the current that turns", &MotionPlan::current_swing_m_s);
  add_swing(settings, "roll", &MotionPlan::roll);
  add_swing(settings, "pitch", &MotionPlan::pitch);
  add_swing(settings, "yaw", &MotionPlan::yaw);
}

void add_heads(Settings* settings) {
  settings->add({{"tilt_deg", "of the port and the starboard altimeter from straight down"},
                 [](const Settings& table, Mission* mission, const std::string& text) {
                   const double tilt_deg = table.parse_decimal("tilt_deg", text);
                   for (HeadSpec& head : mission->heads) {
                     const double side = head.boresight.roll_deg;
                     if (head.kind == HeadKind::kPing1d && side != 0.0) {
                       head.boresight.roll_deg = std::copysign(tilt_deg, side);
                     }
                   }
                 },
                 [](const Mission& mission) {
                   return number_text(std::fabs(mission.heads.back().boresight.roll_deg));
                 }});
  head_decimal(settings, "beam_half_angle_deg", "where an altimeter's cone has its edge",
               &HeadSpec::beam_half_angle_deg);
  head_decimal(settings, "ping_interval_s", "between pings of an altimeter", &HeadSpec::interval_s);
  head_decimal(settings, "min_range_m", "of an altimeter", &HeadSpec::min_range_m);
  head_decimal(settings, "max_range_m", "of an altimeter", &HeadSpec::max_range_m);
  settings->add(
      {{"ping360", "true: a Ping360 beside the altimeters, as a profiler across the track"},
       [](const Settings& table, Mission* mission, const std::string& text) {
         if (text != "true" && text != "false") {
           table.bad_value("ping360", text, "is neither true nor false");
         }
         const bool has = mission->heads.back().kind == HeadKind::kPing360;
         if (text == "true" && !has) {
           mission->heads.push_back(profiler());
         } else if (text == "false" && has) {
           mission->heads.pop_back();
         }
       },
       [](const Mission& mission) {
         const bool has = mission.heads.back().kind == HeadKind::kPing360;
         return std::string(has ? "true" : "false");
       }});
  settings->flag(
      "one_nmea_line", "true: attitude, fix and pressure share one line",
      [](auto& m) -> auto& { return m.one_nmea_line; });
  settings->flag(
      "profile", "true: heads send whole echoes and the vehicle detects",
      [](auto& m) -> auto& { return m.profile; });
  settings->count(
      "max_returns", "of a profile that the vehicle maps, 1 .. 3",
      [](auto& m) -> auto& { return m.max_returns; });
  settings->count(
      "quality_weight_percent", "how much a ping's evidence goes with its quality, 0 .. 100",
      [](auto& m) -> auto& { return m.quality_weight_percent; });
  settings->decimal(
      "sound_speed_m_s", "of the water", [](auto& m) -> auto& { return m.sound_speed_m_s; });
  settings->decimal(
      "sigma_range_m", "range error, one sigma",
      [](auto& m) -> auto& { return m.errors.sigma_range_m; });
  settings->decimal(
      "outlier_fraction", "echoes of something short of the ground, 0 .. 1",
      [](auto& m) -> auto& { return m.errors.outlier_fraction; });
  settings->decimal(
      "fish_fraction", "fish before the ground, which is heard behind them, 0 .. 1",
      [](auto& m) -> auto& { return m.errors.fish_fraction; });
  settings->decimal(
      "dropout_fraction", "echoes not heard, 0 .. 1",
      [](auto& m) -> auto& { return m.errors.dropout_fraction; });
  settings->decimal(
      "misalignment_deg", "of every head, constant",
      [](auto& m) -> auto& { return m.errors.misalignment_deg; });
}

void add_navigation(Settings* settings) {
  const auto decimal = [settings](const char* key, const char* help,
                                  double NavigationSpec::*member) {
    settings->decimal(
        key, help, [member](auto& m) -> auto& { return m.navigation.*member; });
  };
  decimal("attitude_rate_hz", "sentences of attitude per second",
          &NavigationSpec::attitude_rate_hz);
  decimal("fix_rate_hz", "position fixes per second; 0 = none", &NavigationSpec::fix_rate_hz);
  decimal("pressure_rate_hz", "pressure readings per second", &NavigationSpec::pressure_rate_hz);
  decimal("sigma_attitude_deg", "roll and pitch error", &NavigationSpec::sigma_attitude_deg);
  decimal("sigma_heading_deg", "heading error", &NavigationSpec::sigma_heading_deg);
  decimal("heading_drift_deg", "slow heading error", &NavigationSpec::heading_drift_deg);
  decimal("sigma_fix_m", "error of a fix per axis", &NavigationSpec::sigma_fix_m);
  decimal("fix_drift_m", "slow error of fixes per axis", &NavigationSpec::fix_drift_m);
  decimal("drift_time_s", "correlation time of slow errors", &NavigationSpec::drift_time_s);
  decimal("sigma_pressure_pa", "pressure error; 100 Pa are a centimetre",
          &NavigationSpec::sigma_pressure_pa);
}

void add_faults(Settings* settings) {
  const auto decimal = [settings](const char* key, const char* help, double WireFaults::*member) {
    settings->decimal(
        key, help, [member](auto& m) -> auto& { return m.faults.*member; });
  };
  decimal("lost_byte", "chance of a device byte to be lost", &WireFaults::lost_byte);
  decimal("flipped_bit", "chance of a device byte to have a bit flipped", &WireFaults::flipped_bit);
  decimal("repeated_byte", "chance of a device byte to come twice", &WireFaults::repeated_byte);
  settings->decimal(
      "start_s", "devices run this long before the vehicle sets out",
      [](auto& m) -> auto& { return m.start_s; });
  settings->decimal(
      "settle_s", "heads off at the end, while the link catches up",
      [](auto& m) -> auto& { return m.settle_s; });
  settings->add({{"link_rate_bytes_s", "of the downlink, stated in vehicle.toml"},
                 [](const Settings& table, Mission* mission, const std::string& text) {
                   mission->link_rate_bytes_s =
                       table.parse_count<std::uint32_t>("link_rate_bytes_s", text);
                 },
                 [](const Mission& mission) { return std::to_string(mission.link_rate_bytes_s); }});
  settings->decimal(
      "link_max_tile_age_s", "changes wait so long for others, stated in vehicle.toml",
      [](auto& m) -> auto& { return m.link_max_tile_age_s; });
  settings->decimal(
      "link_coarse_wait_s", "coarse cells go first where tiles would wait longer; 0 = never",
      [](auto& m) -> auto& { return m.link_coarse_wait_s; });
  settings->decimal(
      "extract_interval_s", "depths in passes so far apart, as for a Cortex-M7: 1.5; 0 = none",
      [](auto& m) -> auto& { return m.extract_interval_s; });
}

const Settings& settings_table() {
  static const Settings kSettings = [] {
    Settings settings("--set");
    add_ground(&settings);
    add_motion(&settings);
    add_heads(&settings);
    add_navigation(&settings);
    add_faults(&settings);
    return settings;
  }();
  return kSettings;
}

void check_share(const char* field, double value) {
  require(value >= 0.0 && value <= 1.0, field, value, "0 .. 1");
}

void check_sigma(const char* field, double value) {
  require(value >= 0.0 && value <= 1e5, field, value, "0 .. 100000");
}

void check(const Mission& mission) {
  for (const HeadSpec& head : mission.heads) {
    require(head.beam_half_angle_deg > 0.0 && head.beam_half_angle_deg <= 45.0,
            "beam_half_angle_deg", head.beam_half_angle_deg, "over 0, at most 45");
    require(head.interval_s >= 0.0 && head.interval_s <= 10.0, "ping_interval_s", head.interval_s,
            "0 .. 10");
    require(head.min_range_m >= 0.0 && head.min_range_m < head.max_range_m, "min_range_m",
            head.min_range_m, "from 0, below max_range_m");
    require(head.max_range_m <= 100.0, "max_range_m", head.max_range_m, "at most 100");
    require(std::fabs(head.boresight.roll_deg) <= 80.0, "tilt_deg", head.boresight.roll_deg,
            "-80 .. 80");
  }
  const HeadErrors& errors = mission.errors;
  check_sigma("sigma_range_m", errors.sigma_range_m);
  check_share("outlier_fraction", errors.outlier_fraction);
  check_share("dropout_fraction", errors.dropout_fraction);
  check_share("fish_fraction", errors.fish_fraction);
  require(errors.misalignment_deg >= 0.0 && errors.misalignment_deg <= 10.0, "misalignment_deg",
          errors.misalignment_deg, "0 .. 10");
  require(mission.max_returns >= 1 && mission.max_returns <= 3, "max_returns",
          static_cast<double>(mission.max_returns), "1 .. 3");
  require(mission.quality_weight_percent <= 100, "quality_weight_percent",
          static_cast<double>(mission.quality_weight_percent), "0 .. 100");
  const NavigationSpec& nav = mission.navigation;
  require(nav.attitude_rate_hz >= 1.0 && nav.attitude_rate_hz <= 100.0, "attitude_rate_hz",
          nav.attitude_rate_hz, "1 .. 100");
  require(nav.fix_rate_hz >= 0.0 && nav.fix_rate_hz <= 50.0, "fix_rate_hz", nav.fix_rate_hz,
          "0 .. 50");
  require(nav.pressure_rate_hz >= 0.0 && nav.pressure_rate_hz <= 50.0, "pressure_rate_hz",
          nav.pressure_rate_hz, "0 .. 50");
  require(nav.drift_time_s > 0.0 && nav.drift_time_s <= 1e7, "drift_time_s", nav.drift_time_s,
          "over 0, at most 1e7");
  check_sigma("sigma_attitude_deg", nav.sigma_attitude_deg);
  check_sigma("sigma_heading_deg", nav.sigma_heading_deg);
  check_sigma("heading_drift_deg", nav.heading_drift_deg);
  check_sigma("sigma_fix_m", nav.sigma_fix_m);
  check_sigma("fix_drift_m", nav.fix_drift_m);
  check_sigma("sigma_pressure_pa", nav.sigma_pressure_pa);
  check_share("lost_byte", mission.faults.lost_byte);
  check_share("flipped_bit", mission.faults.flipped_bit);
  check_share("repeated_byte", mission.faults.repeated_byte);
  require(mission.sound_speed_m_s >= 1300.0 && mission.sound_speed_m_s <= 1700.0, "sound_speed_m_s",
          mission.sound_speed_m_s, "1300 .. 1700");
  require(mission.start_s >= 0.0 && mission.start_s <= 3600.0, "start_s", mission.start_s,
          "0 .. 3600");
  require(mission.extract_interval_s >= 0.0 && mission.extract_interval_s <= 60.0,
          "extract_interval_s", mission.extract_interval_s, "0 .. 60");
  require(mission.settle_s >= 0.0 && mission.settle_s <= 3600.0, "settle_s", mission.settle_s,
          "0 .. 3600");
  require(mission.ground.north_count >= 8 && mission.ground.north_count <= 8192, "north_count",
          static_cast<double>(mission.ground.north_count), "8 .. 8192");
  require(mission.ground.east_count >= 8 && mission.ground.east_count <= 8192, "east_count",
          static_cast<double>(mission.ground.east_count), "8 .. 8192");
  require(mission.margin_cells <= 1024, "margin_cells", static_cast<double>(mission.margin_cells),
          "at most 1024");
  require(mission.ground.cell_m > 0.0 && mission.ground.cell_m <= 1000.0, "cell_m",
          mission.ground.cell_m, "over 0, at most 1000");
}

}  // namespace

Mission default_mission() {
  Mission mission;
  mission.ground = preset_scenario("demo");
  mission.heads = {altimeter("down", 0.0, 0.0), altimeter("port", -0.2, 15.0),
                   altimeter("starboard", 0.2, -15.0)};
  return mission;
}

const std::vector<SettingInfo>& mission_settings() {
  static const std::vector<SettingInfo> kInfos = settings_table().infos();
  return kInfos;
}

Mission resolve_mission(const MissionOptions& options) {
  Mission mission = default_mission();
  mission.seed = options.seed;
  mission.ground.scene.seed = options.seed;
  if (options.terrain == "plane") {
    mission.ground.terrain = TerrainKind::kPlane;
  } else if (!options.terrain.empty() && options.terrain != "procedural") {
    mission.ground.terrain = TerrainKind::kRaster;
    mission.ground.raster_path = options.terrain;
  }
  for (const std::string& setting : options.settings) {
    settings_table().apply(&mission, setting);
  }
  check(mission);
  MotionPlan& motion = mission.motion;
  motion.south_m = 0.0;
  motion.west_m = 0.0;
  motion.north_m = static_cast<double>(mission.ground.north_count) * mission.ground.cell_m;
  motion.east_m = static_cast<double>(mission.ground.east_count) * mission.ground.cell_m;
  return mission;
}

Terrain build_ground(const Mission& mission) {
  Scenario whole = mission.ground;
  whole.north_count += 2 * mission.margin_cells;
  whole.east_count += 2 * mission.margin_cells;
  const Terrain terrain = build_terrain(whole);
  const double margin_m = static_cast<double>(mission.margin_cells) * terrain.cell_m();
  return Terrain(terrain.north_count(), terrain.east_count(), terrain.cell_m(), -margin_m,
                 -margin_m, terrain.depths_m());
}

namespace {

template <typename Value>
Raster grid_raster(const Mission& mission, const Terrain& ground, Value value) {
  const std::size_t rows = mission.ground.north_count;
  const std::size_t columns = mission.ground.east_count;
  Raster raster =
      make_raster(static_cast<int>(columns), static_cast<int>(rows), 0.0, 0.0, ground.cell_m());
  for (std::size_t n = 0; n < rows; ++n) {
    for (std::size_t e = 0; e < columns; ++e) {
      raster.at(static_cast<int>(rows - 1 - n), static_cast<int>(e)) =
          value(n + mission.margin_cells, e + mission.margin_cells);
    }
  }
  return raster;
}

}  // namespace

Raster truth_raster(const Mission& mission, const Terrain& ground) {
  return grid_raster(mission, ground, [&ground](std::size_t n, std::size_t e) {
    return -ground.depth_at_cell_m(n, e);
  });
}

Raster touched_raster(const Mission& mission, const Terrain& ground, const TouchedMask& touched) {
  return grid_raster(mission, ground, [&](std::size_t n, std::size_t e) {
    return static_cast<double>(touched[n * ground.east_count() + e]);
  });
}

}  // namespace leadline::host
