#include <algorithm>
#include <cmath>
#include <string>

#include "firmware/config/vehicle_file.hpp"
#include "host_tools/emulate/fleet.hpp"
#include "host_tools/emulate/mission.hpp"
#include "host_tools/emulate/vehicle_config.hpp"
#include "host_tools/exit_codes.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::build_ground;
using leadline::host::ExitCode;
using leadline::host::HeadKind;
using leadline::host::HostError;
using leadline::host::Mission;
using leadline::host::mission_settings;
using leadline::host::MissionLinks;
using leadline::host::MissionOptions;
using leadline::host::Raster;
using leadline::host::resolve_mission;
using leadline::host::SettingInfo;
using leadline::host::Terrain;
using leadline::host::TouchedMask;
using leadline::host::VehicleFile;

std::string complaint(const std::string& setting) {
  MissionOptions options;
  options.settings = {setting};
  try {
    (void)resolve_mission(options);
  } catch (const HostError& error) {
    assert_int_equal(static_cast<int>(error.code()), static_cast<int>(ExitCode::kUsage));
    return error.what();
  }
  return "";
}

bool says(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

TEST(every_setting_takes_a_value_and_refuses_nonsense) {
  for (const SettingInfo& setting : mission_settings()) {
    assert_true(!setting.help.empty());
    std::string value = "0.5";
    if (setting.key == "ping360" || setting.key == "profile" || setting.key == "one_nmea_line") {
      value = "true";
    } else if (says(setting.key, "_count") || says(setting.key, "_cells") ||
               says(setting.key, "_bytes_s") || says(setting.key, "_hz") ||
               says(setting.key, "range_m")) {
      value = "16";
    } else if (setting.key == "max_returns") {
      value = "2";
    } else if (says(setting.key, "_percent")) {
      value = "50";
    } else if (setting.key == "sound_speed_m_s") {
      value = "1480";
    } else if (says(setting.key, "_period_s")) {
      value = "9";
    } else if (says(setting.key, "current")) {
      value = "0.01";
    }
    if (setting.key == "min_range_m" || setting.key == "sigma_range_m") {
      value = "0.5";
    }
    const std::string refused = complaint(setting.key + "=" + value);
    if (!refused.empty()) {
      fail_msg("%s", refused.c_str());
    }
    assert_true(says(complaint(setting.key + "=1x"), setting.key));
    assert_true(says(complaint(setting.key + "="), setting.key));
  }
  assert_true(says(complaint("altitud_m=4"), "did you mean altitude_m"));
  assert_true(says(complaint("altitude_m"), "key=value"));
  assert_true(says(complaint("outlier_fraction=1.5"), "0 .. 1"));
  assert_true(says(complaint("attitude_rate_hz=0"), "attitude_rate_hz"));
  assert_true(says(complaint("min_range_m=30"), "min_range_m"));
}

TEST(the_grid_lies_at_zero_and_the_ground_goes_on_around_it) {
  const Mission mission = resolve_mission({});
  const Terrain ground = build_ground(mission);
  assert_int_equal(ground.north_count(), 128 + 2 * 24);
  assert_near(ground.origin_north_m(), -6.0, 0.0);
  const Raster truth = truth_raster(mission, ground);
  assert_int_equal(truth.rows, 128);
  assert_near(truth.west_m, 0.0, 0.0);
  // The south-west cell of the grid.
  assert_near(truth.at(127, 0), -ground.depth_at_cell_m(24, 24), 0.0);
  TouchedMask touched(ground.north_count() * ground.east_count(), 0);
  touched[24 * ground.east_count() + 25] = 1;
  const Raster mask = touched_raster(mission, ground, touched);
  assert_near(mask.at(127, 1), 1.0, 0.0);
  assert_int_equal(std::count(mask.values.begin(), mask.values.end(), 1.0), 1);
}

MissionLinks links_of(const Mission& mission) {
  MissionLinks links;
  for (const std::string& name : fleet_ports(mission)) {
    links.port_uris.push_back("serial:/tmp/" + name + ":115200");
  }
  links.link_uri = "udp:127.0.0.1:9100";
  links.log_path = "survey.lll";
  return links;
}

TEST(the_vehicle_reads_the_configuration_that_fits_the_mission) {
  MissionOptions options;
  options.settings = {"ping360=true", "sound_speed_m_s=1480", "ping_interval_s=0.1"};
  const Mission mission = resolve_mission(options);
  const Terrain ground = build_ground(mission);
  const std::string toml = mission_vehicle_toml(mission, ground, links_of(mission));
  const VehicleFile file = leadline::host::parse_vehicle_file(toml, "vehicle.toml", "");
  assert_int_equal(file.config.mount_count, 4);
  assert_int_equal(file.config.port_count, 7);
  assert_int_equal(file.config.model.cell_mm, 250);
  assert_int_equal(file.config.model.size[0], 128);
  assert_int_equal(file.config.sound_speed_mm_s, 1'480'000);
  // The ground fits with room above and below.
  const double top_m = static_cast<double>(file.config.model.origin_mm[2]) * 1e-3;
  assert_true(top_m <= ground.shallowest_m() - 1.0);
  assert_true(top_m + 0.25 * file.config.model.size[2] >= ground.deepest_m() + 1.0);
  // Half an interval and the bytes of the answer: 50 ms and 3 ms.
  assert_near(file.config.ports[0].latency_us, 53'000, 100);
  assert_int_equal(file.config.ports[3].ping_interval_us, 0);
  assert_int_equal(file.config.navigation.has_origin, 1);
  assert_true(file.log.path == "survey.lll");
  assert_int_equal(file.config.mounts[3].table, 1);
  assert_int_equal(mission_tables(mission).size(), 2);
  assert_true(mission_tables(mission)[1].name == "fan.llt");
  // Port-tilted: its boresight rolls to starboard down.
  assert_true(static_cast<std::int32_t>(file.config.mounts[1].boresight.roll_bam32) > 0);
  assert_true(static_cast<std::int32_t>(file.config.mounts[2].boresight.roll_bam32) < 0);
}

TEST(depths_come_in_passes_where_the_mission_is_for_a_small_processor) {
  MissionOptions options;
  for (const double interval_s : {0.0, 1.5}) {
    options.settings = {"extract_interval_s=" + std::to_string(interval_s)};
    const Mission mission = resolve_mission(options);
    const std::string toml =
        mission_vehicle_toml(mission, build_ground(mission), links_of(mission));
    const VehicleFile file = leadline::host::parse_vehicle_file(toml, "vehicle.toml", "");
    assert_near(file.config.extract_interval_us, 1e6 * interval_s, 0.0);
    assert_int_equal(file.config.cycle_tile_budget, 1);
  }
  assert_true(says(complaint("extract_interval_s=61"), "0 .. 60"));
}

TEST(heads_keep_their_sides_when_the_tilt_is_set) {
  MissionOptions options;
  options.settings = {"tilt_deg=33", "beam_half_angle_deg=4"};
  const Mission mission = resolve_mission(options);
  assert_near(mission.heads[0].boresight.roll_deg, 0.0, 0.0);
  assert_near(mission.heads[1].boresight.roll_deg, 33.0, 0.0);
  assert_near(mission.heads[2].boresight.roll_deg, -33.0, 0.0);
  assert_near(mission.heads[2].beam_half_angle_deg, 4.0, 0.0);
}

}  // namespace
