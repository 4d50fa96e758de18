#include <fstream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "firmware/config/exit_codes.hpp"
#include "firmware/config/vehicle_file.hpp"
#include "firmware/pipeline/driver_codecs.hpp"
#include "model/capacity.hpp"
#include "tests/support/host_errors.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::firmware::Driver;
using leadline::firmware::VehicleConfig;
using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::load_tables;
using leadline::host::load_vehicle_file;
using leadline::host::parse_vehicle_file;
using leadline::host::vehicle_example;
using leadline::host::vehicle_file_to_json;
using leadline::host::vehicle_file_to_toml;
using leadline::host::VehicleFile;
using leadline::test::assert_contains;

const std::string kGrid = "[grid]\ncell_mm = 1000\nsize = [64, 64, 32]\norigin_mm = [0, 0, 0]\n";
const std::string kMount = "[[mount]]\nname = \"down\"\ntable = \"beam.llt\"\n";
const std::string kPort = "[[port]]\nuri = \"serial:/dev/ttyS0:9600\"\ndriver = \"ping1d\"\n";
const std::string kLink = "[link]\nuri = \"udp:127.0.0.1:9100\"\n";
const std::string kSmallest = kGrid + kMount + kPort + kLink;

VehicleFile parse(const std::string& text) { return parse_vehicle_file(text, "v.toml", ""); }

/// The message of the HostError kUsage that the text has to raise.
std::string error_of(const std::string& text) {
  std::string message;
  ExitCode code = ExitCode::kOk;
  try {
    (void)parse(text);
  } catch (const HostError& error) {
    message = error.what();
    code = error.code();
  }
  if (code != ExitCode::kUsage) {
    fail_msg("accepted:\n%s", text.c_str());
  }
  return message;
}

TEST(the_smallest_file_gets_the_documented_defaults) {
  const VehicleFile file = parse(kSmallest);
  const VehicleConfig& config = file.config;
  assert_int_equal(config.schema_version, leadline::firmware::kVehicleConfigSchemaVersion);
  assert_int_equal(config.survey_id, 1);
  assert_int_equal(config.port_count, 1);
  assert_int_equal(config.mount_count, 1);
  assert_int_equal(config.table_count, 1);
  assert_int_equal(config.model.cell_mm, 1000);
  assert_int_equal(config.model.max_range_um, 96'000'000);  // sqrt(64^2 + 64^2 + 32^2) m
  assert_int_equal(config.sound_speed_mm_s, 1'500'000);
  assert_int_equal(config.cycle_voxel_budget, 0);  // until the tables are known
  assert_int_equal(config.ports[0].max_returns, 1);
  assert_int_equal(config.ports[0].quality_weight_percent, 0);
  assert_int_equal(config.cycle_tile_budget, 16);
  assert_int_equal(config.extract_interval_us, 0);
  assert_int_equal(config.ports[0].driver, Driver::kPing1d);
  assert_int_equal(config.ports[0].mount, 0);
  assert_int_equal(config.ports[0].ping_interval_us, 100'000);
  assert_int_equal(config.ports[0].max_range_um, 96'000'000);
  assert_int_equal(config.ports[0].profile, 0);
  assert_int_equal(config.navigation.has_origin, 0);
  assert_int_equal(config.navigation.gravity_um_s2, 9'806'650);
  assert_int_equal(config.navigation.water_density_g_m3, 1'029'000);
  assert_int_equal(config.navigation.max_wait_us, 500'000);
  assert_int_equal(config.link.rate_bytes_s, 125'000);
  assert_int_equal(config.link.mtu_bytes, 1200);
  assert_int_equal(config.link.status_interval_us, 1'000'000);
  assert_int_equal(config.link.hello_interval_us, 30'000'000);
  assert_int_equal(config.link.max_tile_age_us, 1'500'000);
  assert_int_equal(config.link.coarse_wait_us, 5'000'000);
  assert_int_equal(file.cycle_us, 20'000);
  assert_string_equal(file.log.path.c_str(), "");
  assert_int_equal(file.port_uris[0].baud, 9600);
}

TEST(the_water_is_read) {
  const std::string points =
      "[[sound_speed]]\ndepth_m = 0\nspeed_m_s = 1490.5\n"
      "[[sound_speed]]\ndepth_m = 20.25\nspeed_m_s = 1480\n";
  const VehicleFile file = parse(kSmallest + points);
  const auto& water = file.config.water;
  assert_int_equal(water.speed_known, 0);
  assert_int_equal(water.point_count, 2);
  assert_int_equal(water.points[0].speed_mm_s, 1'490'500);
  assert_int_equal(water.points[1].depth_mm, 20'250);
  const VehicleFile again = parse(vehicle_file_to_toml(file));
  assert_int_equal(again.config.water.point_count, 2);
  assert_int_equal(again.config.water.points[1].depth_mm, 20'250);
  assert_int_equal(again.config.water.speed_known, 0);
  assert_contains(vehicle_file_to_json(file), "\"speed_m_s\": 1490.5");

  const VehicleFile known = parse("[sonar]\nsound_speed_mm_s = 1500000\n" + kSmallest);
  assert_int_equal(known.config.water.speed_known, 1);
  assert_int_equal(parse(vehicle_file_to_toml(known)).config.water.speed_known, 1);
  const VehicleFile guessed =
      parse("[sonar]\nsound_speed_mm_s = 1480000\nsound_speed_known = false\n" + kSmallest);
  assert_int_equal(guessed.config.water.speed_known, 0);
  assert_int_equal(guessed.config.sound_speed_mm_s, 1'480'000);

  assert_contains(error_of(kSmallest + points + "[[sound_speed]]\ndepth_m = 20\nspeed_m_s = 1\n"),
                  "depth_m = 20: has to be below the point before it");
  assert_contains(error_of(kSmallest + "[[sound_speed]]\ndepth_m = 1\n"), "speed_m_s is missing");
  assert_contains(error_of(kSmallest + "[[sound_speed]]\ndepth_m = 1\nspeed_m_s = 1700.1\n"),
                  "speed_m_s = 1700.1");
  std::string many = kSmallest;
  for (int i = 0; i < 33; ++i) {
    many += "[[sound_speed]]\ndepth_m = " + std::to_string(i) + "\nspeed_m_s = 1500\n";
  }
  assert_contains(error_of(many), "33 of them, at most 32");
}

TEST(a_tide_is_a_height_or_a_file) {
  const std::string navigation = kSmallest + "[navigation]\n";
  const VehicleFile high = parse(navigation + "tide_m = -1.25\n");
  assert_int_equal(high.config.water.tide_count, 1);
  assert_int_equal(high.config.water.tide[0].height_mm, -1250);
  assert_int_equal(parse(vehicle_file_to_toml(high)).config.water.tide[0].height_mm, -1250);
  const VehicleFile from_file =
      parse_vehicle_file(navigation + "tide_file = \"pier.csv\"\n", "v.toml", "/survey");
  assert_string_equal(from_file.tide_path.c_str(), "/survey/pier.csv");
  assert_int_equal(from_file.config.water.tide_count, 0);
  assert_string_equal(parse(vehicle_file_to_toml(from_file)).tide_path.c_str(), "/survey/pier.csv");
  assert_int_equal(parse(kSmallest).config.water.tide_count, 0);
  assert_contains(error_of(navigation + "tide_m = 0\ntide_file = \"pier.csv\"\n"),
                  "give one of them");
  assert_contains(error_of(navigation + "tide_m = 101\n"), "tide_m = 101");
}

TEST(an_autopilot_is_told_where_the_port_says_so) {
  const std::string port = "[[port]]\nuri = \"udp:@:14550\"\ndriver = \"mavlink\"\n";
  const auto sends = [](const VehicleFile& file) {
    return (file.config.ports[1].switches & leadline::firmware::kPortSend) != 0;
  };
  assert_false(sends(parse(kSmallest + port)));
  const VehicleFile file = parse(kSmallest + port + "send = true\n");
  assert_true(sends(file));
  assert_true(sends(parse(vehicle_file_to_toml(file))));
  assert_contains(
      error_of(kSmallest + "[[port]]\nuri = \"udp:@:1\"\ndriver = \"nmea\"\nsend = true\n"),
      "driver \"nmea\" has no such key");
}

TEST(gravity_is_that_of_the_latitude) {
  const auto gravity = [](const std::string& more) {
    return parse(kSmallest + more).config.navigation.gravity_um_s2;
  };
  // NIMA TR8350.2: at the equator, at the poles; 45 degrees by its formula.
  assert_int_equal(gravity("[frame]\nlat = 0\nlon = 7\n"), 9'780'325);
  assert_int_equal(gravity("[frame]\nlat = -90\nlon = 7\n"), 9'832'185);
  assert_int_equal(gravity("[frame]\nlat = 45\nlon = 7\n"), 9'806'198);
  assert_int_equal(gravity("[frame]\nlat = 45\nlon = 7\n[navigation]\ngravity_m_s2 = 9.81\n"),
                   9'810'000);
  assert_int_equal(gravity(""), 9'806'650);
}

TEST(every_key_is_read) {
  const VehicleFile file = parse_vehicle_file(
      "schema_version = 1\n[survey]\nid = 9007199254740991\nname = \"basin\"\n" + kGrid +
          "[sonar]\nmin_range_mm = 700\nmax_range_mm = 40000\nno_return = \"empty\"\n"
          "detect_range_mm = 30000\nsound_speed_mm_s = 1480000\n"
          "[navigation]\nsigma_position_mm = [1, 2, 3.4]\nsigma_correlated_mm = [4, 5, 6]\n"
          "magnetic_variation_deg = -90\nsurface_pressure_pa = 100000\n"
          "water_density_kg_m3 = 1000.5\ngravity_m_s2 = 9.8\nsigma_fix_mm = 900\n"
          "sigma_depth_mm = 30\nsigma_attitude_deg = 1\nsigma_heading_deg = 3\n"
          "acceleration_mm_s2 = 300\nangular_acceleration_deg_s2 = 20\nmax_gap_ms = 800\n"
          "max_wait_ms = 0.5\n[model]\nrule = \"weighted_mean\"\nk_p = 1\n"
          "[frame]\nlat = 59.9\nlon = 350\nepsg = 32632\nvertical_datum = \"MSL\"\n"
          "[cycle]\nperiod_ms = 12.5\nvoxel_budget = 500000\ntile_budget = 7\n"
          "extract_interval_s = 1.5\n"
          "ping_voxel_budget = 900000\n"
          "[[mount]]\nname = \"a\"\ntable = \"beam.llt\"\nlever_arm_mm = [1, -2, 3]\n"
          "[[mount]]\nname = \"b\"\ntable = \"beam.llt\"\nboresight_deg = [10, -90, 180]\n"
          "[[port]]\nuri = \"udp:192.168.2.2:9090\"\ndriver = \"ping1d\"\nmount = \"a\"\n"
          "interval_ms = 50\nprofile = true\nmin_range_mm = 900\nmax_range_mm = 20000\n"
          "[[port]]\nuri = \"tcp:h:1\"\ndriver = \"ping360\"\nmount = \"b\"\nlatency_ms = -1.5\n"
          "scan_first_grad = 350\nscan_last_grad = 50\nscan_step_grad = 10\n"
          "[[port]]\nuri = \"file:nmea.txt\"\ndriver = \"nmea\"\nlatency_ms = 15\n"
          "[link]\nuri = \"serial:/dev/ttyS1:9600\"\nbaud = 9600\nmtu_bytes = 128\n"
          "status_interval_s = 0.5\nhello_interval_s = 60\nmax_tile_age_s = 0.25\n"
          "coarse_wait_s = 0\n"
          "[log]\npath = \"log.lll\"\nmax_bytes = 1000000\n",
      "v.toml", "/survey");
  const VehicleConfig& config = file.config;
  assert_true(config.survey_id == 9'007'199'254'740'991U);
  assert_string_equal(config.survey_name, "basin");
  assert_string_equal(config.vertical_datum, "MSL");
  assert_int_equal(config.model.min_range_um, 700'000);
  assert_int_equal(config.model.detect_range_um, 30'000'000);
  assert_int_equal(config.model.no_return, leadline::model::NoReturnPolicy::kEmpty);
  assert_int_equal(config.model.rule, leadline::model::Rule::kWeightedMean);
  assert_int_equal(config.model.sigma_position_mm[2], 3);
  assert_int_equal(config.model.sigma_correlated_mm[1], 5);
  assert_int_equal(config.model.work_budget_voxels, 900'000);
  assert_int_equal(config.sound_speed_mm_s, 1'480'000);
  assert_int_equal(config.cycle_voxel_budget, 500'000);
  assert_int_equal(config.cycle_tile_budget, 7);
  assert_int_equal(config.extract_interval_us, 1'500'000);
  assert_int_equal(file.cycle_us, 12'500);
  assert_int_equal(config.epsg, 32632);
  const auto& navigation = config.navigation;
  assert_int_equal(navigation.magnetic_variation_bam32, -1'073'741'824);
  assert_int_equal(navigation.surface_pressure_pa, 100'000);
  assert_int_equal(navigation.water_density_g_m3, 1'000'500);
  assert_int_equal(navigation.gravity_um_s2, 9'800'000);
  assert_int_equal(navigation.sigma_fix_mm, 900);
  assert_int_equal(navigation.sigma_depth_mm, 30);
  assert_int_equal(navigation.sigma_attitude_urad, 17'453);
  assert_int_equal(navigation.sigma_heading_urad, 52'360);
  assert_int_equal(navigation.acceleration_mm_s2, 300);
  assert_int_equal(navigation.angular_acceleration_urad_s2, 349'066);
  assert_int_equal(navigation.max_gap_us, 800'000);
  assert_int_equal(navigation.max_wait_us, 500);
  assert_int_equal(navigation.has_origin, 1);
  assert_true(navigation.origin_latitude_e9deg == 59'900'000'000);
  assert_true(navigation.origin_longitude_e9deg == -10'000'000'000);
  assert_int_equal(config.mount_count, 2);
  assert_int_equal(config.table_count, 1);
  assert_string_equal(file.table_paths[0].c_str(), "/survey/beam.llt");
  assert_int_equal(config.mounts[0].lever_arm_mm[1], -2);
  assert_int_equal(config.mounts[1].boresight.roll_bam32, 119'304'647);
  assert_int_equal(config.mounts[1].boresight.pitch_bam32, 0xC0000000U);
  assert_int_equal(config.mounts[1].boresight.heading_bam32, 0x80000000U);
  assert_int_equal(config.port_count, 3);
  assert_int_equal(config.ports[0].ping_interval_us, 50'000);
  assert_int_equal(config.ports[0].profile, 1);
  assert_int_equal(config.ports[0].min_range_um, 900'000);
  assert_int_equal(config.ports[0].max_range_um, 20'000'000);
  assert_int_equal(config.ports[1].driver, Driver::kPing360);
  assert_int_equal(config.ports[1].mount, 1);
  assert_int_equal(config.ports[1].latency_us, -1500);
  assert_int_equal(config.ports[1].ping_interval_us, 0);
  assert_int_equal(config.ports[1].profile, 1);
  assert_int_equal(config.ports[1].scan_first_grad, 350);
  assert_int_equal(config.ports[1].scan_last_grad, 50);
  assert_int_equal(config.ports[1].scan_step_grad, 10);
  assert_int_equal(config.ports[1].max_range_um, 40'000'000);
  assert_int_equal(config.ports[2].driver, Driver::kNmea);
  assert_int_equal(config.ports[2].latency_us, 15'000);
  assert_int_equal(config.ports[2].mount, leadline::firmware::kNoMount);
  assert_int_equal(config.link.rate_bytes_s, 960);
  assert_int_equal(config.link.mtu_bytes, 128);
  assert_int_equal(config.link.status_interval_us, 500'000);
  assert_int_equal(config.link.hello_interval_us, 60'000'000);
  assert_int_equal(config.link.max_tile_age_us, 250'000);
  assert_int_equal(config.link.coarse_wait_us, 0);
  assert_string_equal(file.log.path.c_str(), "/survey/log.lll");
  assert_int_equal(file.log.max_bytes, 1'000'000);
}

// What every driver resolves to reads back to the same, and nothing is left to guess.
TEST(every_driver_is_configured_by_its_name_alone) {
  for (const auto& info : leadline::firmware::kDrivers) {
    if (!leadline::firmware::driver_enabled(info.driver)) {
      continue;
    }
    const std::string port =
        "[[port]]\nuri = \"serial:/dev/ttyS0:9600\"\ndriver = \"" + std::string(info.name) + "\"\n";
    const VehicleFile file = parse(kGrid + kMount + kLink + port);
    assert_int_equal(file.config.ports[0].driver, info.driver);
    assert_int_equal(file.config.ports[0].byte_time_ns, 1'041'666);
    const std::string resolved = vehicle_file_to_toml(file);
    assert_string_equal(vehicle_file_to_toml(parse(resolved)).c_str(), resolved.c_str());
  }
}

TEST(options_of_drivers_reach_the_vehicle) {
  using leadline::firmware::IntensityScale;
  const VehicleFile file = parse(
      kGrid + kMount + kLink +
      "[[port]]\nuri = \"udp:h:1\"\ndriver = \"ping360\"\nclockwise = false\ngain = 2\n"
      "frequency_khz = 800\naddress = 7\nintensity = \"amplitude\"\n"
      "[[port]]\nuri = \"udp:h:2\"\ndriver = \"nmea\"\nuse_variation = true\nprdid_true = true\n"
      "gauge_pressure = true\nrequire_checksum = false\nbyte_time_ns = 5\noptional = true\n"
      "[[port]]\nuri = \"udp:h:3\"\ndriver = \"keller\"\nbus = \"keller\"\ninterval_ms = 12.5\n");
  const auto* ports = file.config.ports;
  const leadline::firmware::DeviceSetup setup{1'500'000};
  const auto head = ping360_config(ports[0], setup);
  assert_false(head.clockwise);
  assert_int_equal(head.gain_setting, 2);
  assert_int_equal(head.frequency_khz, 800);
  assert_int_equal(head.device_id, 7);
  assert_int_equal(head.byte_time_ns, 0);
  assert_int_equal(ports[0].intensity_scale, IntensityScale::kAmplitude);
  const auto sensor = nmea_config(ports[1], setup);
  assert_true(sensor.use_variation && sensor.prdid_true && sensor.gauge_pressure);
  assert_false(sensor.require_checksum);
  assert_int_equal(sensor.byte_time_ns, 5);
  assert_true(file.port_optional[1]);
  assert_false(file.port_optional[0]);
  const auto pressure = keller_config(ports[2], setup);
  assert_int_equal(pressure.bus, leadline::hal::KellerBus::kKellerBus);
  assert_int_equal(pressure.poll_interval_us, 12'500);
  assert_int_equal(pressure.address, 1);
}

TEST(what_a_sensor_s_samples_go_through_is_asked_for) {
  using leadline::firmware::kPortDeviceClock;
  using leadline::firmware::kPortWatchStuck;
  const VehicleFile file =
      parse(kGrid + kMount + kLink +
            "[[port]]\nuri = \"udp:h:1\"\ndriver = \"xsens\"\nuse_device_clock = true\n"
            "watch_stuck = true\n[[port]]\nuri = \"udp:h:2\"\ndriver = \"keller\"\n");
  assert_int_equal(file.config.ports[0].switches, kPortDeviceClock | kPortWatchStuck);
  assert_int_equal(file.config.ports[1].switches, 0);
  const std::string resolved = vehicle_file_to_toml(file);
  assert_string_equal(vehicle_file_to_toml(parse(resolved)).c_str(), resolved.c_str());
}

TEST(numbers_come_back_as_they_were_written) {
  const VehicleFile file = parse(kSmallest +
                                 "[navigation]\nsigma_attitude_deg = 0.15\n"
                                 "magnetic_variation_deg = -7.3\n");
  const std::string text = vehicle_file_to_toml(file);
  assert_contains(text, "sigma_attitude_deg = 0.15\n");
  assert_contains(text, "magnetic_variation_deg = -7.3\n");
  assert_contains(text, "sigma_heading_deg = 2\n");
}

/// The example with every comment that shows a key turned into that key.
std::string complete_example() {
  const std::string text = vehicle_example();
  std::string all;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t end = text.find('\n', at);
    std::string line = text.substr(at, end - at);
    const bool key = line.rfind("# ", 0) == 0 && line.find(" = ") != std::string::npos;
    const bool table = line.rfind("# [", 0) == 0;
    const bool other_form = line.rfind("# baud", 0) == 0;  // beside rate_bytes_s
    all += (key || table) && !other_form ? line.substr(2) : line;
    all += "\n";
    at = end + 1;
  }
  return all;
}

TEST(the_example_is_good_and_shows_every_key) {
  const std::string text = vehicle_example();
  const VehicleFile file = parse(text);
  assert_int_equal(file.config.port_count, 4);
  assert_int_equal(file.config.ports[1].mount, 1);
  std::ifstream stream(leadline::test::source_directory() + "/firmware/vehicle.example.toml");
  const std::string on_disk((std::istreambuf_iterator<char>(stream)),
                            std::istreambuf_iterator<char>());
  assert_true(on_disk == text);
  // With every comment that shows a key turned into that key it is good still: the defaults and limits
  // that it names are those of the code.
  const VehicleFile complete = parse(complete_example());
  assert_int_equal(complete.frame.epsg.value(), 32632);
  // Defaults shown are defaults taken: without the keys that have none the two are the same.
  VehicleFile same = complete;
  same.frame = file.frame;
  same.config.water = file.config.water;
  same.config.cycle_voxel_budget = file.config.cycle_voxel_budget;
  same.ranges.detect_range_mm = file.ranges.detect_range_mm;
  same.store = file.store;
  same.commands = file.commands;
  assert_string_equal(vehicle_file_to_toml(same).c_str(), vehicle_file_to_toml(file).c_str());
  // And nothing is missing: what is not in the example is named by nobody.
  const std::string resolved = vehicle_file_to_toml(complete);
  std::size_t at = 0;
  while (at < resolved.size()) {
    const std::size_t end = resolved.find('\n', at);
    const std::string line = resolved.substr(at, end - at);
    const std::size_t equals = line.find(" = ");
    if (equals != std::string::npos) {
      assert_contains(text, line.substr(0, equals + 3));
    }
    at = end + 1;
  }
}

/// Every driver that is built in, by name, with a file of all the keys that its port has.
std::vector<std::pair<std::string, std::string>> files_of_drivers() {
  std::vector<std::pair<std::string, std::string>> files;
  for (const leadline::firmware::DriverInfo& info : leadline::firmware::kDrivers) {
    if (leadline::firmware::driver_enabled(info.driver)) {
      const std::string head = kGrid + kMount + kLink;
      const std::string resolved = vehicle_file_to_toml(
          parse(head + "[[port]]\nuri = \"udp:h:1\"\ndriver = \"" + info.name + "\"\n"));
      const std::size_t port = resolved.find("[[port]]");
      files.emplace_back(info.name,
                         head + resolved.substr(port, resolved.find("\n[link]", port) - port + 1));
    }
  }
  return files;
}

TEST(the_example_names_the_keys_of_every_driver) {
  const std::string example = vehicle_example();
  for (const auto& [name, file] : files_of_drivers()) {
    assert_contains(example, name);
    std::istringstream lines(file.substr(file.find("[[port]]")));
    for (std::string line; std::getline(lines, line);) {
      const std::size_t equals = line.find(" = ");
      if (equals != std::string::npos) {
        assert_contains(example, line.substr(0, equals));
      }
    }
  }
}

/// `count` mounts more, each with a table of its own.
std::string other_mounts(int count) {
  std::string text;
  for (int i = 1; i <= count; ++i) {
    const std::string number = std::to_string(i);
    text += "[[mount]]\nname = \"m" + number + "\"\ntable = \"other" + number + ".llt\"\n";
  }
  return text;
}

TEST(every_key_that_is_wrong_is_named_with_line_and_value) {
  struct Case {
    std::string text;
    const char* message;
  };
  const std::string sonar = kGrid + "[sonar]\n";
  const std::string navigation = kSmallest + "[navigation]\n";
  const std::string cycle = kSmallest + "[cycle]\n";
  const std::string port = kGrid + kMount + kLink + kPort;
  const std::string scanner =
      kGrid + kMount + kLink + "[[port]]\nuri = \"udp:h:1\"\ndriver = \"ping360\"\n";
  const std::string nmea =
      kGrid + kMount + kLink + "[[port]]\nuri = \"udp:h:1\"\ndriver = \"nmea\"\n";
  const std::string rest = kPort + kLink;
  const std::vector<Case> cases = {
      {"schema_version = 2\n" + kSmallest, "v.toml:1: schema_version = 2: this program reads"},
      {kSmallest + "[survey]\nid = -1\n", "[survey] id = -1: has to be 0 to 9007199254740991"},
      {kSmallest + "[survey]\nname = 5\n", "[survey] name = 5: has to be a text of at most 64"},
      {kMount + rest, "the table [grid] with cell_mm, size and origin_mm is missing"},
      {sonar + "min_range_mm = -1\n" + kMount + rest, "[sonar] min_range_mm = -1: has to be"},
      {sonar + "beam_half_angle_deg = 3\n" + kMount + rest,
       "v.toml:6: [sonar] beam_half_angle_deg: unknown key"},
      {sonar + "sound_speed_mm_s = 343000\n" + kMount + rest,
       "sound_speed_mm_s = 343000: has to be 1300000 to 1700000"},
      {navigation + "sigma_position_mm = 3\n", "has to be an array of three"},
      {navigation + "magnetic_variation_deg = 181\n", "magnetic_variation_deg = 181: has to be"},
      {navigation + "surface_pressure_pa = 200001\n", "surface_pressure_pa = 200001: has to be"},
      {navigation + "water_density_kg_m3 = 1.029\n", "water_density_kg_m3 = 1.029: has to be"},
      {navigation + "gravity_m_s2 = 981\n", "gravity_m_s2 = 981: has to be 9 to 10"},
      {navigation + "sigma_fix_mm = 0\n", "sigma_fix_mm = 0: has to be 1 to 1000000"},
      {navigation + "sigma_depth_mm = \"x\"\n", "sigma_depth_mm = \"x\": has to be a whole number"},
      {navigation + "sigma_attitude_deg = 0\n", "sigma_attitude_deg = 0: has to be over 0 to 45"},
      {navigation + "sigma_heading_deg = nan\n", "sigma_heading_deg = nan: has to be"},
      {navigation + "acceleration_mm_s2 = 0\n", "acceleration_mm_s2 = 0: has to be"},
      {navigation + "angular_acceleration_deg_s2 = -1\n", "angular_acceleration_deg_s2 = -1"},
      {navigation + "max_gap_ms = 0\n", "max_gap_ms = 0: has to be 1 to 60000"},
      {navigation + "max_wait_ms = 10001\n", "max_wait_ms = 10001: has to be 0 to 10000"},
      {kSmallest + "[model]\nrule = \"x\"\n", "[model] rule = \"x\": has to be one of"},
      {kSmallest + "[frame]\nlat = 1\n", "lat and lon have to be given together"},
      {cycle + "period_ms = 0\n", "[cycle] period_ms = 0: has to be 1 to 1000"},
      {cycle + "voxel_budget = -1\n", "[cycle] voxel_budget = -1: has to be"},
      {cycle + "tile_budget = 0\n", "[cycle] tile_budget = 0: has to be 1 to 4096"},
      {cycle + "extract_interval_s = 61\n", "[cycle] extract_interval_s = 61: has to be 0 to 60"},
      {cycle + "ping_voxel_budget = 1.5\n", "ping_voxel_budget = 1.5: has to be a whole number"},
      {kGrid + rest, "a table [[mount]] is missing"},
      {kGrid + "[mount]\nname = \"a\"\n" + rest, "v.toml:5: mount: has to be a table: [[mount]]"},
      {kGrid + "[[mount]]\ntable = \"t\"\n" + rest, "v.toml:5: [[mount]] name is missing"},
      {kGrid + "[[mount]]\nname = \"a\"\n" + rest, "[[port]] its mount \"a\" has no table"},
      {kGrid + kMount + kMount + rest,
       "v.toml:9: [[mount]] name = \"down\": every mount has a name of its own"},
      {kGrid + "[[mount]]\nname = \"\"\ntable = \"t\"\n" + rest, "has a name of its own"},
      {kGrid + kMount + "lever_arm_mm = [0, 0]\n" + rest,
       "has to be an array of three: [forward, right, down]"},
      {kGrid + kMount + "lever_arm_mm = [0, 0, 100001]\n" + rest, "lever_arm_mm[2] = 100001"},
      {kGrid + kMount + "boresight_deg = [361, 0, 0]\n" + rest, "boresight_deg[0] = 361"},
      {kGrid + kMount + other_mounts(4) + rest,
       "other4.llt\": at most 4 tables, and this would be one more"},
      {kGrid + kMount + kLink, "a table [[port]] is missing"},
      {kGrid + kMount + kLink + "[[port]]\ndriver = \"nmea\"\n",
       "v.toml:10: [[port]] uri is missing"},
      {kGrid + kMount + kLink + "[[port]]\nuri = \"com3\"\ndriver = \"nmea\"\n",
       "v.toml:11: [[port]] uri = \"com3\": has to begin with serial:"},
      {kGrid + kMount + kLink + "[[port]]\nuri = \"udp:h:1\"\n", "[[port]] driver is missing"},
      {kGrid + kMount + kLink + "[[port]]\nuri = \"udp:h:1\"\ndriver = \"ping\"\n",
       "driver = \"ping\": has to be one of \"ping1d\", \"ping360\", \"nmea\""},
      {kSmallest + kPort,
       "v.toml:14: [[port]] uri = \"serial:/dev/ttyS0:9600\": port 0 is on this line"},
      {kGrid + kMount + kPort + "[link]\nuri = \"serial:/dev/ttyS0\"\n",
       "[link] uri = \"serial:/dev/ttyS0\""},
      {"[survey]\nname = \"a\\u001bb\"\n" + kSmallest,
       "name = \"a\\x1bb\": has to be a text of at most 64"},
      {port + "mount = \"dwon\"\n", "there is no [[mount]] of that name; did you mean \"down\"?"},
      {port + "latency_ms = 10001\n", "[[port]] latency_ms = 10001: has to be -1000 to 10000"},
      {port + "interval_ms = -1\n", "[[port]] interval_ms = -1: has to be 0 to 60000"},
      {port + "min_range_mm = 2000000\n",
       "min_range_mm = 2000000 has to be below max_range_mm = 96000"},
      {port + "max_range_mm = 0\n", "max_range_mm = 0: has to be"},
      {port + "profile = 1\n", "profile = 1: has to be true or false"},
      {port + "scan_step_grad = 1\n", "driver \"ping1d\" has no such key"},
      {scanner + "scan_first_grad = 400\n", "scan_first_grad = 400: has to be 0 to 399"},
      {scanner + "scan_last_grad = -1\n", "scan_last_grad = -1: has to be 0 to 399"},
      {scanner + "scan_step_grad = 0\n", "scan_step_grad = 0: has to be 1 to 10"},
      {scanner + "profile = false\n", "driver \"ping360\" has no such key"},
      {nmea + "interval_ms = 5\n", "driver \"nmea\" has no such key"},
      {kGrid + kMount + kPort, "the table [link] with uri is missing"},
      {kGrid + kMount + kPort + "[link]\n", "[link] uri is missing"},
      {kSmallest + "rate_bytes_s = 9\n", "rate_bytes_s = 9: has to be 10 to 125000000"},
      {kSmallest + "baud = 50\n", "baud = 50: has to be 100 to"},
      {kSmallest + "baud = 9600\nrate_bytes_s = 960\n", "give one of them"},
      {kSmallest + "mtu_bytes = 127\n", "mtu_bytes = 127: has to be 128 to 1400"},
      {kSmallest + "status_interval_s = 0\n", "status_interval_s = 0: has to be over 0 to 3600"},
      {kSmallest + "max_tile_age_s = 61\n", "max_tile_age_s = 61: has to be 0 to 60"},
      {kSmallest + "coarse_wait_s = 3601\n", "coarse_wait_s = 3601: has to be 0 to 3600"},
      {kSmallest + "hello_interval_s = 3601\n", "hello_interval_s = 3601: has to be over 0"},
      {kSmallest + "[log]\n", "[log] path is missing"},
      {kSmallest + "[log]\npath = \"\"\n", "[log] path = \"\": has to be the name of a file"},
      {kSmallest + "[log]\npath = \"x\"\nmax_bytes = 999999\n", "at least 1000000"},
      {kSmallest + "[prot]\n", "prot: unknown key; did you mean \"port\"?"},
      {kSmallest + "lever_arm_mm = 3\n",
       "[link] lever_arm_mm: unknown key; it belongs to [[mount]]"},
      {"[grid]\ncell_mm = 1000\nsize = [8, 8, 2000]\norigin_mm = [0, 0, 0]\n" + kMount + rest,
       ":3: [grid] size = [8, 8, 2000]: 128000 voxels, and over the capacity of 1024 cells on axis "
       "2"},
      {"[grid]\ncell_mm = 1\nsize = [8, 8, 8]\norigin_mm = [0, 0, 0]\n[sonar]\nmax_range_mm = "
       "9000\n" +
           kMount + rest,
       ":6: [sonar] max_range_mm = 9000: has to be at most 8000 cells = 8000 mm"},
  };
  for (const Case& bad : cases) {
    assert_contains(error_of(bad.text), bad.message);
  }
}

/// A line `key = value` of a file, what is before and what behind it.
struct KeyLine {
  std::string before, section, key, value, behind;
  int number;  ///< from 1
};

std::vector<KeyLine> key_lines(const std::string& text) {
  std::vector<KeyLine> lines;
  std::string section;
  int number = 0;
  for (std::size_t at = 0; at < text.size(); at = text.find('\n', at) + 1) {
    const std::string line = text.substr(at, text.find('\n', at) - at);
    ++number;
    if (line[0] == '[') {
      section = line.substr(0, line.rfind(']') + 1) + " ";
    }
    const std::size_t equals = line.find(" = ");
    if (line[0] == '#' || line[0] == ' ' || equals == std::string::npos) {
      continue;
    }
    const std::string value = line.substr(equals + 3, line.find(" #", equals) - equals - 3);
    lines.push_back({text.substr(0, at), section, line.substr(0, equals),
                     value.substr(0, value.find_last_not_of(' ') + 1),
                     text.substr(at + line.size()), number});
  }
  return lines;
}

/// A wrong value, and how a message begins with it.
struct Wrong {
  std::string value, shown;
};

/// What cannot be in the place of this value.
std::vector<Wrong> wrong_values(const std::string& value) {
  if (value[0] == '[') {
    return {{"3", "3: "}, {"\"x\"", "\"x\": "}, {"[1, 2]", "[ 1, 2 ]: "}};
  }
  if (value == "true" || value == "false") {
    return {{"1", "1: "}, {"\"true\"", "\"true\": "}, {"nan", "nan: "}};
  }
  if (value[0] == '"') {
    return {{"5", "5: "},
            {"nan", "nan: "},
            {"false", "false: "},
            {"[\"a\"]", "[ 'a' ]: "},
            {"\"a\\u0007b\"", "\"a\\x07b\": "},
            {"\"" + std::string(5000, 'x') + "\"", "\"xxxxxxxx"}};
  }
  return {{"\"x\"", "\"x\": "}, {"true", "true: "},    {"[1, 2]", "[ 1, 2 ]: "}, {"nan", "nan: "},
          {"-inf", "-inf: "},   {"1e300", "1e+300: "}, {"-1e300", "-1e+300: "}};
}

void assert_refused(const KeyLine& line, const std::string& replacement, int number,
                    const std::string& message) {
  const std::string place = "v.toml:" + std::to_string(number) + ": ";
  const std::string error = error_of(line.before + replacement + line.behind);
  if (error.find(place + message) == std::string::npos) {
    fail_msg("%s\nis told as: %s\nwithout: %s%s", replacement.c_str(), error.c_str(), place.c_str(),
             message.c_str());
  }
}

void break_every_key(const std::string& text) {
  (void)parse(text);
  for (const KeyLine& line : key_lines(text)) {
    const std::string key = line.section + line.key;
    for (const Wrong& wrong : wrong_values(line.value)) {
      assert_refused(line, line.key + " = " + wrong.value, line.number, key + " = " + wrong.shown);
    }
    for (const char* const element : {"\"x\"", "nan", "1e300", "-1e300"}) {
      if (line.value[0] == '[') {
        assert_refused(line, line.key + " = [1, " + element + ", 1]", line.number, key + "[1] = ");
      }
    }
    assert_refused(line, line.key + "_ = " + line.value, line.number, key + "_: unknown key");
    const std::string whole = line.key + " = " + line.value;
    assert_refused(line, whole + "\n" + whole, line.number + 1, "not valid TOML: ");
  }
}

TEST(every_key_of_the_example_broken_in_turn_is_named_with_line_and_value) {
  const std::string all = complete_example();
  assert_int_equal(key_lines(all).size(), 97);
  break_every_key(all);
  break_every_key(kSmallest + "baud = 9600\n");
  break_every_key(kSmallest + "[navigation]\ntide_file = \"tide.csv\"\n");
}

TEST(every_key_of_every_driver_broken_in_turn_is_named_with_line_and_value) {
  for (const auto& [name, file] : files_of_drivers()) {
    break_every_key(file);
  }
}

TEST(a_window_that_memory_does_not_hold_is_named_with_what_it_holds) {
  const std::string deepest =
      "[grid]\ncell_mm = 1000\nsize = [1024, 16, 1024]\norigin_mm = [0, 0, 0]\n";
  const std::string store = "[store]\npath = \"map.llp\"\nwindow_tiles = 4000\n";
  assert_contains(error_of(deepest + kMount + kPort + kLink + store),
                  "v.toml:15: [store] window_tiles = 4000: memory holds " +
                      std::to_string(leadline::model::kVoxelCapacity / 262'144 - 1) +
                      " tiles of 262144 voxels");
}

TEST(two_mounts_and_a_head_that_names_none) {
  const std::string second = "[[mount]]\nname = \"b\"\ntable = \"beam.llt\"\n";
  assert_contains(error_of(kGrid + kMount + second + kPort + kLink),
                  "v.toml:11: [[port]] mount is missing: which of them carries this head");
}

TEST(more_ports_or_mounts_than_there_is_room_for) {
  std::string text = kGrid + kLink;
  std::string mounts = kMount;
  for (int i = 0; i < 8; ++i) {
    mounts += "[[mount]]\nname = \"m" + std::to_string(i) + "\"\ntable = \"beam.llt\"\n";
  }
  assert_contains(error_of(text + mounts + kPort), "[[mount]]: 9 of them, at most 8");
  std::string ports;
  for (int i = 0; i < 9; ++i) {
    ports += kPort;
  }
  assert_contains(error_of(text + kMount + ports), "[[port]]: 9 of them, at most 8");
}

TEST(the_resolved_configuration_reads_back_the_same) {
  for (const std::string& text : {kSmallest, std::string(vehicle_example())}) {
    const std::string resolved = vehicle_file_to_toml(parse(text));
    assert_string_equal(vehicle_file_to_toml(parse(resolved)).c_str(), resolved.c_str());
  }
  // Angles, which are binary inside, too.
  leadline::test::Random random;
  for (int i = 0; i < 200; ++i) {
    const std::string angle = std::to_string(random.uniform() * 360 - 180);
    const std::string text = kGrid + kMount + "boresight_deg = [" + angle + ", 0, " + angle +
                             "]\n" + kPort + kLink +
                             "[navigation]\nmagnetic_variation_deg = " + angle +
                             "\nsigma_heading_deg = " + std::to_string(1 + i * 0.37) + "\n";
    const VehicleFile file = parse(text);
    const VehicleFile again = parse(vehicle_file_to_toml(file));
    assert_int_equal(file.config.mounts[0].boresight.roll_bam32,
                     again.config.mounts[0].boresight.roll_bam32);
    assert_int_equal(file.config.navigation.magnetic_variation_bam32,
                     again.config.navigation.magnetic_variation_bam32);
    assert_int_equal(file.config.navigation.sigma_heading_urad,
                     again.config.navigation.sigma_heading_urad);
  }
}

TEST(json_holds_the_same_values) {
  const std::string json = vehicle_file_to_json(parse(vehicle_example()));
  for (const char* const part :
       {"{\"schema_version\": 1, \"survey\": {\"id\": 1, \"name\": \"harbour basin\"}, \"grid\": {",
        "\"mount\": [{\"name\": \"down\", ", "}, {\"name\": \"scanner\"", "}], \"port\": [{",
        "\"scan_first_grad\": 120", "}], \"link\": {\"uri\": \"udp:192.168.2.1:9100\"",
        "\"log\": {\"path\": \"survey.lll\", \"max_bytes\": 0}}"}) {
    assert_contains(json, part);
  }
}

TEST(files_are_loaded_from_where_they_lie) {
  const std::string directory = leadline::test::scratch_directory();
  std::ofstream(directory + "/v.toml") << kSmallest;
  VehicleFile file = load_vehicle_file(directory + "/v.toml");
  assert_string_equal(file.table_paths[0].c_str(), (directory + "/beam.llt").c_str());
  std::string message;
  ExitCode code = ExitCode::kOk;
  try {
    (void)load_tables(&file);
  } catch (const HostError& error) {
    message = error.what();
    code = error.code();
  }
  assert_int_equal(code, ExitCode::kInput);
  assert_contains(message, "beam.llt: cannot be read: No such file");
}

}  // namespace
