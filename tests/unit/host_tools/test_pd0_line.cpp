// A Doppler log's recording as a survey: its beams are the sonar, its own velocity, compass and the recorder's GGA the
// navigation.
#include <cmath>
#include <fstream>
#include <string>

#include "hal/emu/nmea_talker.hpp"
#include "hal/emu/pd0_dvl.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/import/survey.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::emu::Bytes;
using leadline::emu::Motion;
using leadline::emu::Pd0Setup;
using leadline::host::HostError;
using leadline::host::SurveyCounts;
using leadline::host::SurveyGeometry;
using leadline::host::SurveyLine;
using leadline::host::SurveyRow;
using leadline::host::VerticalSource;

constexpr double kAltitude_m = 10;
constexpr double kSpeed_m_s = 0.5;
constexpr int kEnsembles = 60;  // one a second

/// Level, straight ahead. With `gnss` each ensemble is followed by where the vehicle is, without a sum.
std::string recording(const Pd0Setup& setup, double heading_deg, bool gnss) {
  std::string bytes;
  for (int i = 0; i < kEnsembles; ++i) {
    Motion motion;
    motion.heading_deg = heading_deg;
    motion.velocity_m_s = {kSpeed_m_s, 0, 0};
    motion.altitude_m = kAltitude_m;
    motion.time_s = 1000 + i;
    if (gnss) {
      char text[96];
      const double east_deg = kSpeed_m_s * i / 111'319.5;
      std::snprintf(text, sizeof text, "$GPGGA,%06d,0000.00000,N,010%09.6f,E,4,9,1,,M,,M,,\r\n",
                    1000 + i, 60 * east_deg);
      bytes += text;
      bytes += "$GPVTG,090.000,T,070.000,M,0.9,N,1.7,K,D\r\n";
    }
    const Bytes ensemble = leadline::emu::pd0_ensemble(motion, setup, static_cast<unsigned>(i + 1));
    bytes.append(ensemble.begin(), ensemble.end());
  }
  return bytes;
}

std::vector<SurveyRow> rows_of(const std::string& bytes, std::string* notice) {
  const std::string path = leadline::test::scratch_directory() + "/line.PD0";
  std::ofstream(path, std::ios::binary) << bytes;
  const SurveyLine line = leadline::host::read_survey_line(path, notice);
  leadline::estimator::LocalPlane plane;
  assert_true(plane.configure({0, line.positions.front().longitude_e9deg}) ==
              leadline::base::Status::kOk);
  SurveyGeometry geometry;
  geometry.vertical = VerticalSource::kNone;
  std::vector<SurveyRow> rows;
  SurveyCounts counts;
  leadline::host::build_rows(line, plane, geometry, &rows, &counts);
  assert_true(counts.rows + 8 >= counts.beams);
  return rows;
}

TEST(beams_lie_where_they_look_and_the_track_is_the_log_s_own) {
  for (const bool convex : {true, false}) {
    for (const double alignment_deg : {0.0, 45.0}) {
      Pd0Setup setup;
      setup.convex = convex;
      setup.alignment_deg = alignment_deg;
      std::string notice;
      const auto rows = rows_of(recording(setup, 90, false), &notice);
      assert_true(notice.find("60 ensembles; the track is dead reckoned") == 0);
      const double out_m = kAltitude_m * std::tan(20 / 57.29577951308232);
      for (const SurveyRow& row : rows) {
        assert_near(row.end.depth_m, kAltitude_m, 0.02);
        // From the head, along and across the way: beam 3 looks ahead of an instrument that is not turned.
        const double ahead_m = row.end.east_m - row.head_m.y;
        const double right_m = -(row.end.north_m - row.head_m.x);
        const double turn_rad = alignment_deg / 57.29577951308232;
        const double axis_m = ahead_m * std::cos(turn_rad) + right_m * std::sin(turn_rad);
        const double side_m = right_m * std::cos(turn_rad) - ahead_m * std::sin(turn_rad);
        const double sign = convex ? 1 : -1;
        const double axes[][2] = {{0, -1}, {0, 1}, {1, 0}, {-1, 0}};
        const auto& looks = axes[row.beam_number - 1];
        assert_near(axis_m, sign * looks[0] * out_m, 0.05);
        assert_near(side_m, sign * looks[1] * out_m, 0.05);
      }
      const double way_m = rows.back().head_m.y - rows.front().head_m.y;
      assert_near(way_m, kSpeed_m_s * (kEnsembles - 2), 0.6);
    }
  }
}

TEST(fixes_place_it_and_both_courses_turn_the_compass) {
  std::string notice;
  // The compass is 20 degrees less than true: without the turn the reckoned way and the fixes would part.
  const auto rows = rows_of(recording(Pd0Setup{}, 70, true), &notice);
  assert_true(notice.find("compass turned by 20.0 degrees, 60 fixes in them") != std::string::npos);
  for (const SurveyRow& row : rows) {
    assert_near(row.attitude.heading_deg, 90, 0.1);
    assert_near(row.head_m.x, 0, 1.0);
  }
  assert_near(rows.back().head_m.y - rows.front().head_m.y, kSpeed_m_s * (kEnsembles - 2), 1.5);
}

TEST(what_is_no_survey_is_refused) {
  const auto error_of = [](const std::string& bytes) {
    std::string notice;
    try {
      static_cast<void>(rows_of(bytes, &notice));
    } catch (const HostError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  assert_true(error_of("not a recording").find("line.PD0: no PD0 ensemble") != std::string::npos);
  Pd0Setup water;
  water.bottom_track = false;
  assert_true(error_of(recording(water, 0, false)).find("among 60") != std::string::npos);
}

}  // namespace
