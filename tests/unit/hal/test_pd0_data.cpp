// Real PD0 files against tables made by another decoder (see the data's PROVENANCE.md).
#include <array>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <sstream>

#include "hal/angles.hpp"
#include "hal/attitude/pd0.hpp"
#include "tests/support/nav_streams.hpp"

namespace {

using leadline::base::NavKind;
using leadline::base::NavSample;
using leadline::hal::kPd0BadVelocity;
using leadline::hal::Pd0Codec;
using leadline::hal::Pd0Config;
using leadline::hal::Pd0Ensemble;
using leadline::hal::Pd0Frame;

using Row = std::vector<std::string>;

std::vector<Row> read_csv(const std::string& path) {
  std::ifstream file(path);
  std::vector<Row> rows;
  std::string line;
  std::getline(file, line);  // names
  while (std::getline(file, line)) {
    Row row;
    std::stringstream text(line);
    std::string cell;
    while (std::getline(text, cell, ',')) {
      row.push_back(cell);
    }
    row.resize(17);
    rows.push_back(row);
  }
  return rows;
}

void check_row(const Row& row, const Pd0Ensemble& ensemble) {
  const auto number = [&row](std::size_t column) { return std::stod(row[column]); };
  assert_int_equal(ensemble.number, std::stoul(row[0]));
  assert_near(static_cast<double>(ensemble.utc_us) / 1e6, number(1), 0.0051);
  assert_near(ensemble.heading_cdeg / 100.0, number(2), 1e-6);
  assert_near(ensemble.pitch_cdeg / 100.0, number(3), 1e-6);
  assert_near(ensemble.roll_cdeg / 100.0, number(4), 1e-6);
  assert_near(ensemble.depth_dm / 10.0, number(5), 1e-6);
  assert_near(ensemble.sound_speed_m_s, number(6), 1e-6);
  for (std::size_t beam = 0; beam < 4; ++beam) {
    const std::string& range = row[7 + beam];
    const std::string& velocity = row[11 + beam];
    assert_near(ensemble.range_cm[beam] / 100.0, range.empty() ? 0.0 : std::stod(range), 1e-6);
    assert_near(ensemble.velocity_mm_s[beam],
                velocity.empty() ? kPd0BadVelocity : std::stod(velocity), 1e-6);
  }
}

struct Totals {
  std::size_t velocities = 0;
  std::size_t valid = 0;
  std::size_t attitudes = 0;
};

Totals check_file(const std::string& raw, const std::string& table, Pd0Frame frame) {
  const std::string folder = "adcp_dvl_pd0/";
  const std::string path = leadline::test::require_data(folder + "raw/" + raw);
  const auto rows = read_csv(leadline::test::require_data(folder + "derived/" + table));
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> bytes((std::istreambuf_iterator<char>(file)), {});
  Pd0Codec codec(Pd0Config{});
  Totals totals;
  NavSample sample{};
  for (const char byte : bytes) {
    bool more = codec.feed(static_cast<std::uint8_t>(byte), 0, sample);
    for (; more; more = codec.next(sample)) {
      if (sample.kind == NavKind::kAttitude) {
        ++totals.attitudes;
        const Row& row = rows[totals.velocities - 1];
        assert_near(leadline::test::turn(sample.attitude.heading_bam32), std::stod(row[2]), 1e-6);
        assert_near(leadline::test::degrees(sample.attitude.roll_bam32), std::stod(row[4]), 1e-6);
      }
      if (sample.kind != NavKind::kVelocity) {
        continue;
      }
      assert_true(totals.velocities < rows.size());
      check_row(rows[totals.velocities], codec.ensemble());
      assert_true(codec.ensemble().frame == frame);
      ++totals.velocities;
      totals.valid += sample.fields != 0 ? 1 : 0;
    }
  }
  assert_int_equal(totals.velocities, rows.size());
  assert_int_equal(totals.attitudes, rows.size());
  assert_int_equal(leadline::hal::rejected(codec.counters()), 0);
  std::printf("%s: %zu ensembles, %zu velocities\n", raw.c_str(), totals.velocities, totals.valid);
  return totals;
}

}  // namespace

TEST(river_pro_in_beam_coordinates) {
  const Totals totals =
      check_file("RiverPro_test01.PD0", "RiverPro_test01_PD0_bt.csv", Pd0Frame::kBeam);
  assert_int_equal(totals.velocities, 273);
  assert_int_equal(totals.valid, 270);
}

TEST(win_river_in_ship_coordinates) {
  const Totals totals =
      check_file("winriver02_transect.PD0", "winriver02_transect_PD0_bt.csv", Pd0Frame::kShip);
  assert_int_equal(totals.velocities, 831);
  assert_true(totals.valid >= 563);  // more than four-beam solutions
}

TEST(work_horse_in_earth_coordinates_without_bottom_track) {
  const Totals totals = check_file("vmdas01_wh.ENX", "vmdas01_wh_ENX_bt.csv", Pd0Frame::kEarth);
  assert_int_equal(totals.velocities, 3713);
  assert_int_equal(totals.valid, 0);
}

TEST(moored_adcp_in_beam_coordinates) {
  const Totals totals = check_file("RDI_test01.000", "RDI_test01_000_bt.csv", Pd0Frame::kBeam);
  assert_int_equal(totals.velocities, 22);
}

namespace {

/// North and east in metres from the first to the last fix of the GGA sentences in the file.
std::array<double, 2> gnss_track_m(const std::string& bytes) {
  std::array<double, 2> first_deg{};
  std::array<double, 2> last_deg{};
  bool any = false;
  for (std::size_t at = bytes.find("$GPGGA,"); at != std::string::npos;
       at = bytes.find("$GPGGA,", at + 1)) {
    int north_deg = 0;
    int west_deg = 0;
    double north_min = 0;
    double west_min = 0;
    const std::string sentence = bytes.substr(at, 60);
    if (std::sscanf(sentence.c_str(), "$GPGGA,%*f,%2d%lf,N,%3d%lf,W,5", &north_deg, &north_min,
                    &west_deg, &west_min) != 4) {
      continue;
    }
    last_deg = {north_deg + north_min / 60, -(west_deg + west_min / 60)};
    first_deg = any ? first_deg : last_deg;
    any = true;
  }
  const double north_m = (last_deg[0] - first_deg[0]) * 111'320;
  const double narrower = std::cos(last_deg[0] * 3.14159265358979 / 180);
  return {north_m, (last_deg[1] - first_deg[1]) * 111'320 * narrower};
}

}  // namespace

// The sign of bottom track: dead reckoning goes where GNSS went, not the other way. The compass is magnetic (21
// degrees east of true there) and a quarter of the ensembles has no bottom, so only about.
TEST(dead_reckoning_goes_where_gnss_went) {
  const std::string path = leadline::test::require_data("adcp_dvl_pd0/raw/winriver02_transect.PD0");
  std::ifstream file(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  const std::array<double, 2> gnss_m = gnss_track_m(bytes);
  Pd0Codec codec(Pd0Config{});
  std::array<double, 2> reckoned_m{};
  std::array<double, 3> body_m_s{};
  bool known = false;
  std::int64_t last_us = 0;
  NavSample sample{};
  for (const char byte : bytes) {
    bool more = codec.feed(static_cast<std::uint8_t>(byte), 0, sample);
    for (; more; more = codec.next(sample)) {
      if (sample.kind == NavKind::kVelocity) {
        known = sample.fields != 0;
        for (std::size_t i = 0; i < 3; ++i) {
          body_m_s[i] = static_cast<double>(sample.velocity_um_s[i]) / 1e6;
        }
      }
      if (sample.kind != NavKind::kAttitude) {
        continue;
      }
      const auto rotation = leadline::hal::rotation_of(sample.attitude);
      const double dt_s = static_cast<double>(sample.utc_us - last_us) / 1e6;
      for (std::size_t row = 0; known && dt_s > 0 && dt_s < 5 && row < 2; ++row) {
        for (std::size_t i = 0; i < 3; ++i) {
          reckoned_m[row] += dt_s * body_m_s[i] * rotation[row][i] / 1073741824.0;
        }
      }
      last_us = sample.utc_us;
    }
  }
  std::printf("GNSS %.1f m north, %.1f m east; reckoned %.1f, %.1f\n", gnss_m[0], gnss_m[1],
              reckoned_m[0], reckoned_m[1]);
  const double turned_rad =
      std::atan2(reckoned_m[1], reckoned_m[0]) - std::atan2(gnss_m[1], gnss_m[0]);
  assert_near(std::remainder(turned_rad, 6.283185307) * 57.29578, 0, 30);
}
