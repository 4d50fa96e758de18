// A small survey in process: emulated devices, the vehicle, its log, its link; then the log, whole and
// damaged, through the replay.
#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "firmware/config/vehicle_file.hpp"
#include "host_tools/compare.hpp"
#include "host_tools/emulate/simulate_flight.hpp"
#include "host_tools/emulate/vehicle_config.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/ping_csv.hpp"
#include "host_tools/survey_map.hpp"
#include "host_tools/topside/flight_log.hpp"
#include "host_tools/topside/host_vehicle.hpp"
#include "host_tools/topside/replay.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::compare_rasters;
using leadline::host::ExitCode;
using leadline::host::Fleet;
using leadline::host::FlightCycle;
using leadline::host::FlightLog;
using leadline::host::FlightSinks;
using leadline::host::FlightSummary;
using leadline::host::HostError;
using leadline::host::HostVehicle;
using leadline::host::Mission;
using leadline::host::MissionOptions;
using leadline::host::Raster;
using leadline::host::Receiver;
using leadline::host::replay_flight;
using leadline::host::ReplayResult;
using leadline::host::resolve_mission;
using leadline::host::Soundings;
using leadline::host::VehicleFile;
using leadline::test::Random;

using Tables = std::vector<std::vector<std::uint8_t>>;

struct Flown {
  std::string log;
  FlightSummary summary;
  std::uint64_t topside_hash = 0;
  std::size_t soundings = 0;
  std::string csv;
  Raster elevation;
  Raster truth;
  Raster touched;
};

Flown fly(const std::vector<std::string>& more = {}) {
  MissionOptions options;
  options.settings = {"north_count=40", "east_count=40", "line_spacing_m=2.5",
                      "start_s=2",      "settle_s=2",    "fix_drift_m=0"};
  options.settings.insert(options.settings.end(), more.begin(), more.end());
  const Mission mission = resolve_mission(options);
  Fleet fleet(mission);
  leadline::host::MissionLinks links;
  for (const std::string& name : fleet_ports(mission)) {
    links.port_uris.push_back("serial:" + name + ":115200");
  }
  links.link_uri = "udp:127.0.0.1:9100";
  const VehicleFile file = leadline::host::parse_vehicle_file(
      mission_vehicle_toml(mission, fleet.ground(), links), "vehicle.toml", "");
  const Tables tables = table_bytes(mission_tables(mission));
  const HostVehicle vehicle(file.config, tables, "vehicle.toml");
  Flown flown;
  Receiver receiver;
  FlightSinks sinks;
  sinks.log = [&](const std::uint8_t* data, std::size_t size) {
    flown.log.append(reinterpret_cast<const char*>(data), size);
  };
  sinks.downlink = [&](const std::uint8_t* data, std::size_t size) { receiver.feed(data, size); };
  Soundings soundings;
  flown.summary = fly_in_process(&fleet, &*vehicle, tables, file.cycle_us, sinks, &soundings);
  flown.topside_hash = receiver.store()->cells_hash();
  flown.soundings = soundings.count();
  flown.csv = soundings.csv();
  flown.elevation = receiver.store()->elevation();
  flown.truth = truth_raster(mission, fleet.ground());
  flown.touched = touched_raster(mission, fleet.ground(), fleet.touched());
  return flown;
}

const Flown& flight() {
  static const Flown kFlight = fly();
  return kFlight;
}

std::string stored(const std::string& bytes) {
  static int number = 0;
  static const std::string kFolder = leadline::test::scratch_directory();
  number += 1;
  const std::string path = kFolder + "/" + std::to_string(number) + ".lll";
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

ReplayResult replay(const std::string& bytes, Soundings* soundings = nullptr) {
  FlightLog log(stored(bytes));
  const HostVehicle vehicle(log.config(), log.tables(), "log");
  return replay_flight(&log, &*vehicle, soundings);
}

std::string complaint(const std::string& bytes) {
  try {
    const FlightLog log(stored(bytes));
  } catch (const HostError& error) {
    assert_int_equal(static_cast<int>(error.code()), static_cast<int>(ExitCode::kInput));
    return error.what();
  }
  return "";
}

TEST(the_map_that_arrives_is_the_vehicles_and_near_the_truth) {
  const Flown& flown = flight();
  assert_true(flown.summary.drained);
  assert_true(flown.topside_hash == flown.summary.end.cells_hash);
  const auto comparison = compare_rasters(flown.elevation, flown.truth, &flown.touched, nullptr);
  assert_true(comparison.coverage > 0.95);
  assert_true(comparison.rmse_m < 0.25);
  assert_true(std::fabs(comparison.bias_m) < 0.08);
  assert_int_equal(flown.summary.end.pings_in, flown.summary.end.pings_fused +
                                                   flown.summary.end.pings_shed +
                                                   flown.summary.end.pings_rejected);
  assert_true(flown.summary.end.pings_fused > 1000);
}

TEST(the_log_replays_to_the_same_bits) {
  Soundings soundings;
  const ReplayResult result = replay(flight().log, &soundings);
  assert_true(result.then.has_value());
  assert_true(result.same());
  assert_true(result.log.complete());
  assert_int_equal(result.cycles, flight().summary.cycles);
  assert_int_equal(soundings.count(), flight().soundings);
  assert_true(soundings.csv() == flight().csv);
}

TEST(the_same_mission_gives_the_same_log) { assert_true(fly().log == flight().log); }

TEST(devices_that_stutter_cost_pings_and_nothing_else) {
  const Flown flown = fly({"lost_byte=0.001", "flipped_bit=0.001", "repeated_byte=0.0005"});
  assert_true(flown.topside_hash == flown.summary.end.cells_hash);
  // A damaged answer costs the timeout of its request too.
  assert_true(flown.summary.end.pings_fused < flight().summary.end.pings_fused);
  assert_true(flown.summary.end.pings_fused > flight().summary.end.pings_fused / 5);
  const auto comparison = compare_rasters(flown.elevation, flown.truth, &flown.touched, nullptr);
  assert_true(comparison.rmse_m < 0.35);
  assert_true(replay(flown.log).same());
}

TEST(profiles_are_detected_on_the_vehicle) {
  const Flown flown = fly({"profile=true", "ping_interval_s=0.1"});
  assert_true(flown.topside_hash == flown.summary.end.cells_hash);
  const auto comparison = compare_rasters(flown.elevation, flown.truth, &flown.touched, nullptr);
  assert_true(comparison.coverage > 0.9);
  assert_true(comparison.rmse_m < 0.4);
}

TEST(a_scanner_beside_the_altimeters_has_a_table_of_its_own) {
  const Flown flown = fly({"ping360=true"});
  assert_true(flown.topside_hash == flown.summary.end.cells_hash);
  assert_true(flown.summary.end.pings_in > flight().summary.end.pings_in);
  const auto comparison = compare_rasters(flown.elevation, flown.truth, &flown.touched, nullptr);
  assert_true(comparison.coverage > 0.95);
  assert_true(comparison.rmse_m < 0.3);
  assert_true(replay(flown.log).same());
}

TEST(soundings_read_back_as_pings) {
  leadline::host::PingCsvOptions options;
  options.strict = true;
  const std::string path = stored(flight().csv);
  leadline::host::PingCsvReader reader(path, options);
  leadline::host::PingRow row{};
  std::size_t rows = 0;
  while (reader.next(&row)) {
    rows += 1;
  }
  assert_int_equal(rows, flight().soundings);
}

TEST(a_log_that_was_cut_replays_as_far_as_it_goes) {
  const std::string& log = flight().log;
  Random random;
  std::uint64_t cycles_before = 0;
  for (int part = 2; part <= 9; ++part) {
    const std::size_t size = log.size() * static_cast<std::size_t>(part) / 10 +
                             static_cast<std::size_t>(random.between(0, 200));
    const ReplayResult result = replay(log.substr(0, size));
    assert_false(result.then.has_value());
    assert_false(result.same());
    assert_true(result.cycles > cycles_before);
    assert_int_equal(result.log.missing_cycles, 0);
    cycles_before = result.cycles;
  }
}

TEST(a_damaged_byte_costs_one_record_and_is_reported) {
  const std::string& log = flight().log;
  Random random;
  const std::size_t first_cycle = log.size() / 4;
  for (int round = 0; round < 5; ++round) {
    std::string damaged = log;
    const auto at = static_cast<std::size_t>(random.between(
        static_cast<std::int64_t>(first_cycle), static_cast<std::int64_t>(log.size()) - 200));
    damaged[at] = static_cast<char>(damaged[at] ^ random.between(1, 255));
    const ReplayResult result = replay(damaged);
    assert_true(result.then.has_value());
    // A broken frame may be of the link: then the replay is the same and the gap is told all the same.
    assert_true(result.log.damaged_places >= 1);
    assert_true(result.log.missing_cycles + result.log.broken_cycles <= 2);
    assert_true(result.cycles + 1 >= flight().summary.cycles);
    assert_false(result.log.complete());
  }
}

TEST(what_cannot_replay_says_why) {
  const std::string& log = flight().log;
  assert_true(complaint("").find("no log") != std::string::npos);
  assert_true(complaint("north,east\n1,2\n").find("no log") != std::string::npos);
  assert_true(complaint(log.substr(0, 40)).find("no log") != std::string::npos);
  // The same byte of both copies of the preamble: never taken for good, never a crash.
  const std::size_t copy = log.find(log.substr(0, 60), 60);
  assert_true(copy != std::string::npos);
  for (std::size_t at = 2; at < 2000; at += 97) {
    std::string damaged = log;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x11);
    assert_string_equal(complaint(damaged).c_str(), "");
    damaged[at + copy] = damaged[at];
    assert_false(complaint(damaged).empty());
  }
  try {
    const FlightLog missing("/nowhere.lll");
    fail_msg("opened");
  } catch (const HostError& error) {
    assert_int_equal(static_cast<int>(error.code()), static_cast<int>(ExitCode::kInput));
  }
}

}  // namespace
