// Real captures (NMEA 2000, MAVLink, NMEA 0183) against what others decoded of them, or counted in them by
// means that share nothing with the codecs.
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <sstream>
#include <string>

#include "hal/attitude/mavlink.hpp"
#include "hal/attitude/nmea.hpp"
#include "hal/attitude/nmea2000.hpp"
#include "hal/emu/nmea2000_bus.hpp"
#include "tests/support/nav_streams.hpp"

namespace {

using leadline::base::NavKind;
using leadline::base::NavSample;
using leadline::test::Bytes;
using leadline::test::degrees;
using leadline::test::from_hex;
using leadline::test::samples_of;
using leadline::test::turn;

std::vector<std::string> lines_of(const std::string& file) {
  std::ifstream stream(leadline::test::require_data(file));
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) {
    lines.push_back(line);
  }
  return lines;
}

std::vector<std::string> cut(const std::string& line, char separator) {
  std::vector<std::string> fields;
  std::istringstream stream(line);
  for (std::string field; std::getline(stream, field, separator);) {
    fields.push_back(field);
  }
  return fields;
}

/// A message of the log as a number of CAN frames; its PGN, 0 when the line is none.
struct Logged {
  std::uint32_t pgn = 0;
  Bytes frames;
};

Logged from_candump(const std::string& line) {
  unsigned long id = 0;
  char data[40] = "";
  if (std::sscanf(line.c_str(), "(%*[0-9.]) %*s %lx#%32s", &id, data) < 1) {
    return {};
  }
  const auto pgn = leadline::hal::pgn_of(static_cast<std::uint32_t>(id));
  const auto source = static_cast<std::uint8_t>(id);
  return {pgn, leadline::emu::n2k_message(pgn, source, from_hex(data))};
}

/// time,priority,pgn,source,destination,length,bytes...; longer ones as fast packets.
Logged from_canboat(const std::string& line, unsigned sequence) {
  const auto fields = cut(line, ',');
  if (fields.size() < 7 || line[0] == '#') {
    return {};
  }
  Bytes data;
  for (std::size_t i = 6; i < fields.size(); ++i) {
    data.push_back(static_cast<std::uint8_t>(std::stoul(fields[i], nullptr, 16)));
  }
  const auto pgn = static_cast<std::uint32_t>(std::stoul(fields[2]));
  const auto source = static_cast<std::uint8_t>(std::stoul(fields[3]));
  return {pgn, leadline::emu::n2k_message(pgn, source, data, pgn == 129'029, sequence)};
}

const std::map<std::string, NavKind> kKinds = {
    {"attitude", NavKind::kAttitude}, {"heading", NavKind::kHeading}, {"rot", NavKind::kRates},
    {"heave", NavKind::kHeave},       {"depth", NavKind::kAltitude},  {"stw", NavKind::kVelocity},
    {"position", NavKind::kPosition}};

/// What the decoded table says of a kind, in its units, "" where it says nothing.
using Row = std::vector<std::string>;

void expect(const std::string& text, bool has, double value, double tolerance, const char* what) {
  if (text.empty()) {
    return;  // the other decoder left it out; ours may know better (yaw beyond half a turn)
  }
  const double expected = std::stod(text);
  // Seven digits are printed.
  const double printed = std::fabs(expected) * 1e-6;
  if (!has || std::fabs(std::remainder(value - expected, 360.0)) > tolerance + printed) {
    fail_msg("%s: %.9g instead of %s", what, value, text.c_str());
  }
}

void compare(const Row& row, const NavSample& sample) {
  constexpr double kAngle_deg = 1e-4 * 57.29577951308232;
  const auto has = [&](unsigned bits) { return (sample.fields & bits) != 0; };
  const bool heading = has(leadline::base::kNavHeading | leadline::base::kNavHeadingMagnetic);
  switch (sample.kind) {
    case NavKind::kAttitude: {
      expect(row[0], heading, turn(sample.attitude.heading_bam32), kAngle_deg, "yaw");
      const bool level = has(leadline::base::kNavRollPitch);
      expect(row[1], level, degrees(sample.attitude.pitch_bam32), kAngle_deg, "pitch");
      expect(row[2], level, degrees(sample.attitude.roll_bam32), kAngle_deg, "roll");
      break;
    }
    case NavKind::kHeading:
      expect(row[0], heading, turn(sample.attitude.heading_bam32), kAngle_deg, "heading");
      break;
    case NavKind::kRates:
      expect(row[0], has(leadline::base::kNavYawRate),
             static_cast<double>(sample.rate_urad_s[2]) * 57.29577951308232e-6, 6e-5, "rate");
      break;
    case NavKind::kHeave:
      expect(row[0], has(leadline::base::kNavHeave), static_cast<double>(-sample.heave_um) / 1e6,
             0.01, "heave");
      break;
    case NavKind::kAltitude:
      expect(row[0], has(leadline::base::kNavAltitude),
             static_cast<double>(sample.altitude_um) / 1e6, 0.01, "depth");
      break;
    case NavKind::kVelocity:
      expect(row[0], has(leadline::base::kNavVelocityWater),
             static_cast<double>(sample.velocity_um_s[0]) / 1e6, 0.01, "speed");
      break;
    default:
      expect(row[0], has(leadline::base::kNavGeodetic),
             static_cast<double>(sample.latitude_e9deg) / 1e9, 1e-7, "latitude");
      expect(row[1], has(leadline::base::kNavGeodetic),
             static_cast<double>(sample.longitude_e9deg) / 1e9, 1e-7, "longitude");
  }
}

/// Everything the codec makes of a log but the messages that the table does not have, by kind.
std::map<NavKind, std::vector<NavSample>> decode_bus(const std::vector<std::string>& lines,
                                                     bool candump, std::size_t& attitudes) {
  std::map<NavKind, std::vector<NavSample>> samples;
  leadline::hal::Nmea2000Codec codec(leadline::hal::Nmea2000Config{});
  std::int64_t t_us = 0;
  unsigned sequence = 0;
  for (const std::string& line : lines) {
    const Logged logged = candump ? from_candump(line) : from_canboat(line, sequence++ % 8);
    t_us += 1000;
    attitudes += logged.pgn == 127'257 ? 1 : 0;
    const bool tabled = logged.pgn != 129'026 && logged.pgn != 129'029 && logged.pgn != 0;
    for (const NavSample& sample : samples_of(codec, logged.frames, t_us)) {
      if (tabled) {
        samples[sample.kind].push_back(sample);
      }
    }
  }
  return samples;
}

void check_bus(const std::string& log, const std::string& table, bool candump) {
  std::size_t attitudes = 0;
  const auto samples = decode_bus(lines_of("nmea2000_canboat/" + log), candump, attitudes);
  std::map<NavKind, std::size_t> taken;
  std::size_t compared = 0;
  for (const std::string& line : lines_of("nmea2000_canboat/derived/" + table)) {
    auto fields = cut(line, ',');
    fields.resize(6);
    const auto kind = kKinds.find(fields[2]);
    if (kind == kKinds.end()) {
      continue;
    }
    const auto& ours = samples.at(kind->second);
    std::size_t& next = taken[kind->second];
    // The table leaves out what carries nothing.
    while (next < ours.size() && ours[next].fields == 0) {
      ++next;
    }
    if (next == ours.size()) {
      fail_msg("%s: no record for row %s", table.c_str(), line.c_str());
    }
    compare({fields[3], fields[4], fields[5]}, ours[next]);
    ++next;
    ++compared;
  }
  assert_true(compared > 100);
  assert_int_equal(samples.at(NavKind::kAttitude).size(), attitudes);
}

}  // namespace

TEST(candump_of_a_small_boat) {
  check_bus("raw/candumpSample3.txt", "candumpSample3.decoded.csv", true);
}

TEST(canboat_text_of_a_trawler) {
  check_bus("raw/dirona-actisense-serial.raw", "dirona-actisense-serial.decoded.csv", false);
}

TEST(the_same_trawler_as_frames) {
  check_bus("derived/dirona-actisense-serial.candump", "dirona-actisense-serial.decoded.csv", true);
}

TEST(a_figure_of_eight) {
  check_bus("raw/furuno-130842-figure8-fast.raw", "furuno-130842-figure8-fast.decoded.csv", false);
}

TEST(a_heading_sensor) { check_bus("raw/raymarine-ev1.raw", "raymarine-ev1.decoded.csv", false); }

TEST(positions_of_fast_packets_agree_with_those_of_single_frames) {
  // 129029 and 129025 of one receiver, a second apart at most: within 50 m of each other.
  leadline::hal::Nmea2000Codec codec(leadline::hal::Nmea2000Config{});
  std::int64_t t_us = 0;
  std::map<std::string, NavSample> rapid;
  std::size_t compared = 0;
  for (const std::string& line :
       lines_of("nmea2000_canboat/derived/dirona-actisense-serial.candump")) {
    const Logged logged = from_candump(line);
    const std::string source = line.substr(line.find('#') - 2, 2);
    t_us += 1000;
    for (const NavSample& sample : samples_of(codec, logged.frames, t_us)) {
      if (logged.pgn == 129'025) {
        rapid[source] = sample;
      } else if (logged.pgn == 129'029 && sample.fields != 0 && rapid.count(source) != 0) {
        assert_true(std::abs(sample.latitude_e9deg - rapid[source].latitude_e9deg) < 500'000);
        assert_true(std::abs(sample.longitude_e9deg - rapid[source].longitude_e9deg) < 500'000);
        ++compared;
      }
    }
  }
  assert_true(compared > 50);
}

TEST(an_autopilot_s_log) {
  std::ifstream stream(leadline::test::require_data("ardusub_logs/testing_small.tlog"),
                       std::ios::binary);
  const Bytes log{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  // Eight bytes of time stand before each frame: the search passes over them as over any noise.
  leadline::hal::MavlinkCodec codec(leadline::hal::MavlinkConfig{});
  std::map<NavKind, std::vector<NavSample>> ours;
  for (const NavSample& sample : samples_of(codec, log)) {
    ours[sample.kind].push_back(sample);
  }
  std::map<std::string, std::size_t> rows;
  std::map<NavKind, std::size_t> taken;
  for (const std::string& line : lines_of("ardusub_logs/testing_small_nav.csv")) {
    auto fields = cut(line, ',');
    fields.resize(8);
    const std::string& kind = fields[1];
    rows[kind] += 1;
    const auto value = [&](std::size_t i) { return std::stod(fields[1 + i]); };
    if (kind == "attitude_rpy_rad_rates") {
      const NavSample& sample = ours[NavKind::kAttitude][taken[NavKind::kAttitude]++];
      assert_near(degrees(sample.attitude.roll_bam32), value(1) * 57.29577951, 6e-5);
      assert_near(degrees(sample.attitude.pitch_bam32), value(2) * 57.29577951, 6e-5);
      assert_near(degrees(sample.attitude.heading_bam32), value(3) * 57.29577951, 6e-5);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        assert_near(static_cast<double>(sample.rate_urad_s[axis]) / 1e6, value(4 + axis), 2e-6);
      }
    } else if (kind == "pressure29_hpa" || kind == "pressure137_hpa") {
      const NavSample& sample = ours[NavKind::kPressure][taken[NavKind::kPressure]++];
      assert_near(static_cast<double>(sample.pressure_pa), value(1) * 100, 1);
      assert_near(sample.temperature_mdegc, value(3) * 1000, 6);
    } else if (kind == "local_ned" || kind.rfind("global_", 0) == 0) {
      const NavSample& sample = ours[NavKind::kPosition][taken[NavKind::kPosition]++];
      const bool local = kind == "local_ned";
      assert_true(local == ((sample.fields & leadline::base::kNavPositionLocal) != 0));
      assert_near(local ? static_cast<double>(sample.position_um[0]) / 1e6
                        : static_cast<double>(sample.latitude_e9deg) / 1e9,
                  value(1), local ? 6e-5 : 1e-7);
      assert_near(local ? static_cast<double>(sample.position_um[1]) / 1e6
                        : static_cast<double>(sample.longitude_e9deg) / 1e9,
                  value(2), local ? 6e-5 : 1e-7);
    }
  }
  assert_int_equal(rows["attitude_rpy_rad_rates"], 5245);
  assert_int_equal(ours[NavKind::kAttitude].size(), 5245);
  assert_int_equal(ours[NavKind::kPressure].size(),
                   rows["pressure29_hpa"] + rows["pressure137_hpa"]);
  assert_int_equal(ours[NavKind::kPosition].size(),
                   rows["local_ned"] + rows["global_lat_lon_alt_relalt_hdg"]);
  assert_int_equal(ours[NavKind::kTime].size(), 794);
  // Four frames of the log have a wrong CRC (its README says so); their ids are not in the table either.
  assert_int_equal(codec.counters().frames, 35'916 - 4);
}

TEST(a_yacht_s_sentences) {
  leadline::hal::NmeaCodec codec(leadline::hal::NmeaConfig{});
  std::map<std::string, std::size_t> ours;
  std::map<std::string, std::size_t> expected;
  const std::map<std::string, std::pair<std::size_t, NavKind>> kNames = {
      // Number of the field that may be empty.
      {"DBT", {3, NavKind::kAltitude}}, {"HDT", {1, NavKind::kHeading}},
      {"HDM", {1, NavKind::kHeading}},  {"GLL", {1, NavKind::kPosition}},
      {"VTG", {1, NavKind::kVelocity}}, {"VHW", {5, NavKind::kVelocity}},
      {"ZDA", {4, NavKind::kTime}}};
  std::int64_t t_us = 0;
  for (const std::string& line : lines_of("nmea_signalk/plaka_first_half.log")) {
    const std::string name = line.size() > 6 ? line.substr(3, 3) : "";
    // Whole lines only: the file ends inside of one.
    const bool whole = line.size() > 3 && line[line.find_last_not_of("\r") - 2] == '*';
    const auto known = kNames.find(name);
    if (known != kNames.end() && whole) {
      expected[name] += 1;
      expected[name + " filled"] += cut(line, ',').at(known->second.first).empty() ? 0 : 1;
    }
    for (const std::uint8_t byte : leadline::test::from_text(line + "\n")) {
      NavSample sample{};
      if (codec.feed(byte, ++t_us, sample)) {
        assert_true(known != kNames.end() && sample.kind == known->second.second);
        ours[name] += 1;
        ours[name + " filled"] += sample.fields != 0 ? 1 : 0;
      }
    }
  }
  for (const auto& [name, count] : expected) {
    if (ours[name] != count) {
      fail_msg("%s: %zu records of %zu", name.c_str(), ours[name], count);
    }
  }
  assert_int_equal(expected["HDT"], 7091);
  // This plotter leaves the date out: a time of day names no second.
  assert_int_equal(expected["ZDA"], 3545);
  assert_int_equal(expected["ZDA filled"], 0);
  assert_int_equal(codec.counters().bad_checksum + codec.counters().bad_field, 0);
}
