#include <cmath>
#include <cstring>
#include <fstream>

#include "hal/emu/emulated_r2sonic.hpp"
#include "hal/wire.hpp"
#include "host_tools/crosslines.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/import/calendar.hpp"
#include "host_tools/import/sontek.hpp"
#include "host_tools/import/survey.hpp"
#include "host_tools/import/survey_command.hpp"
#include "host_tools/import/xtf.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::emu::Bytes;
using leadline::host::Attitude;
using leadline::host::Crossing;
using leadline::host::HostError;
using leadline::host::SurveyGeometry;
using leadline::host::SurveyLine;
using leadline::host::SurveyRow;
using leadline::host::Vec3;
using leadline::host::XtfItem;
using leadline::host::XtfReader;

constexpr std::int64_t kStart_us = 1'436'399'535'000'000;  // 2015-07-08 23:52:15
constexpr double kDepth_m = 10.0;
constexpr double kStarboard_m = 1.5;  // of the head from the positions

Attitude motion(std::int64_t t_us) {
  const double t_s = 1e-6 * static_cast<double>(t_us - kStart_us);
  return {4.0 * std::sin(1.7 * t_s), 1.5 * std::sin(1.1 * t_s + 0.5), 90.0};
}

void put_f32(Bytes& bytes, std::size_t at, double value) {
  const auto narrow = static_cast<float>(value);
  std::uint32_t bits = 0;
  std::memcpy(&bits, &narrow, sizeof bits);
  leadline::hal::write_u32_le(bytes.data() + at, bits);
}

void put_f64(Bytes& bytes, std::size_t at, double value) {
  std::uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  leadline::hal::write_u32_le(bytes.data() + at, static_cast<std::uint32_t>(bits));
  leadline::hal::write_u32_le(bytes.data() + at + 4, static_cast<std::uint32_t>(bits >> 32U));
}

Bytes packet(std::uint8_t type, std::size_t size) {
  Bytes bytes(size);
  bytes[0] = 0xCE;
  bytes[1] = 0xFA;
  bytes[2] = type;
  leadline::hal::write_u32_le(bytes.data() + 10, static_cast<std::uint32_t>(size));
  return bytes;
}

/// 23:52 and the seconds of `t_us`, all within one minute.
void put_time(Bytes& bytes, std::size_t at, std::int64_t t_us) {
  leadline::hal::write_u16_le(bytes.data() + at, 2015);
  const std::uint8_t rest[] = {7, 8, 23, 52,
                               static_cast<std::uint8_t>(15 + (t_us - kStart_us) / 1'000'000)};
  std::memcpy(bytes.data() + at + 2, rest, sizeof rest);
}

Bytes attitude_packet(std::int64_t t_us) {
  Bytes bytes = packet(3, 64);
  const Attitude attitude = motion(t_us);
  put_f32(bytes, 30, attitude.pitch_deg);
  put_f32(bytes, 34, attitude.roll_deg);
  put_f32(bytes, 38, 0.0);
  put_f32(bytes, 50, attitude.heading_deg);
  put_time(bytes, 54, t_us);
  leadline::hal::write_u16_le(bytes.data() + 61,
                              static_cast<std::uint16_t>((t_us - kStart_us) / 1000 % 1000));
  return bytes;
}

Bytes position_packet(std::int64_t t_us) {
  Bytes bytes = packet(107, 64);
  put_time(bytes, 14, t_us);
  leadline::hal::write_u16_le(bytes.data() + 21,
                              static_cast<std::uint16_t>((t_us - kStart_us) / 100 % 10'000));
  put_f64(bytes, 23, 37.75);
  // Eastwards with 0.3 m/s.
  put_f64(bytes, 31, -122.37 + 0.3e-6 * static_cast<double>(t_us - kStart_us) / 88'100.0);
  put_f64(bytes, 39, 2.0);
  return bytes;
}

/// A flat bottom seen by a head that rolls and pitches, beside the place of the positions.
Bytes survey_xtf() {
  Bytes file(1024);
  file[0] = 123;
  file[168] = 1;
  file[256] = 3;
  put_f32(file, 256 + 48, 5.0);
  const auto append = [&file](const Bytes& bytes) {
    file.insert(file.end(), bytes.begin(), bytes.end());
  };
  leadline::emu::EmulatedR2SonicSettings settings;
  settings.beams = 64;
  settings.two_way_s = [](std::int64_t t_us, double angle_rad) {
    const Attitude attitude = motion(kStart_us + t_us);
    const double head_m = leadline::host::world_from_vehicle(attitude, {0, kStarboard_m, 0}).z;
    const double down =
        leadline::host::world_from_vehicle(attitude, {0, std::sin(angle_rad), std::cos(angle_rad)})
            .z;
    return 2.0 * (kDepth_m - head_m) / down / 1500.0;
  };
  settings.clock_offset_us = kStart_us;
  leadline::emu::EmulatedR2Sonic head(settings);
  for (std::int64_t t_us = 0; t_us < 10'000'000; t_us += 50'000) {
    append(position_packet(kStart_us + t_us));
    append(attitude_packet(kStart_us + t_us));
    Bytes ping;
    head.advance(t_us, ping);
    if (t_us >= 50'000) {
      Bytes bathymetry = packet(65, 256 + ping.size());
      put_time(bathymetry, 14, kStart_us + t_us);
      std::copy(ping.begin(), ping.end(), bathymetry.begin() + 256);
      append(bathymetry);
    }
  }
  append(packet(42, 64));
  return file;
}

std::string write_scratch(const std::string& name, const std::string& text) {
  const std::string path = leadline::test::scratch_directory() + "/" + name;
  std::ofstream(path, std::ios::binary) << text;
  return path;
}
std::string write_scratch(const std::string& name, const Bytes& bytes) {
  return write_scratch(name, std::string(bytes.begin(), bytes.end()));
}

template <typename Call>
std::string error_of(Call call) {
  try {
    call();
  } catch (const HostError& error) {
    return error.what();
  }
  return "";
}

leadline::estimator::LocalPlane plane_at_start() {
  leadline::estimator::LocalPlane plane;
  assert_true(plane.configure({37'750'000'000, -122'370'000'000}) == leadline::base::Status::kOk);
  return plane;
}

}  // namespace

TEST(dates) {
  using leadline::host::is_calendar_time;
  assert_int_equal(leadline::host::unix_us({1970, 1, 1, 0, 0, 0}), 0);
  assert_int_equal(leadline::host::unix_us({2015, 7, 8, 23, 52, 15}), kStart_us);
  assert_int_equal(leadline::host::unix_us({2000, 2, 29, 12, 0, 1}), 951'825'601'000'000);
  assert_true(is_calendar_time({2024, 2, 29, 0, 0, 0}));
  assert_false(is_calendar_time({2100, 2, 29, 0, 0, 0}));
  assert_false(is_calendar_time({2023, 4, 31, 0, 0, 0}));
  assert_false(is_calendar_time({2023, 13, 1, 0, 0, 0}));
}

TEST(packets_of_an_xtf_file) {
  Bytes bytes = survey_xtf();
  const Bytes junk = {1, 2, 0xCE, 3};
  bytes.insert(bytes.begin() + 1024 + 64, junk.begin(), junk.end());
  bytes.resize(bytes.size() - 3);
  XtfReader reader(write_scratch("line.xtf", bytes));
  XtfItem item{};
  std::size_t samples = 0;
  while (reader.next(&item)) {
    samples += item.kind == leadline::host::XtfItemKind::kSample ? 1 : 0;
  }
  assert_int_equal(reader.stats().attitudes, 200);
  assert_int_equal(reader.stats().positions, 200);
  assert_int_equal(reader.stats().heads, 199);
  assert_int_equal(samples, 400);
  assert_int_equal(reader.stats().skipped_bytes, 4);
  assert_true(reader.stats().cut);
  assert_true(reader.mounting().stated);
  assert_near(reader.mounting().starboard_m, 5.0, 0);
}

TEST(a_wrong_size_costs_its_packet_and_not_the_rest_of_the_file) {
  const Bytes intact = survey_xtf();
  const auto items = [](const Bytes& bytes) {
    XtfReader reader(leadline::host::ByteSource(bytes.data(), bytes.size()), "memory");
    XtfItem item{};
    std::size_t count = 0;
    while (reader.next(&item)) {
      ++count;
    }
    return count;
  };
  const std::size_t all = items(intact);
  assert_int_equal(all, 599);
  // The size field of the second packet: too small, too large, beyond the end.
  const std::size_t second = 1024 + 64;
  assert_int_equal(intact[second], 0xCE);
  for (const std::uint32_t size : {0U, 20U, 65U, 1001U, 50'001U, 4'000'000U, 0xFFFFFFFFU}) {
    Bytes damaged = intact;
    for (int i = 0; i < 4; ++i) {
      damaged[second + 10 + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(size >> 8 * i);
    }
    assert_true(items(damaged) + 1 >= all);
  }
}

TEST(files_that_are_none) {
  assert_true(error_of([] { XtfReader reader("/nowhere.xtf"); }).find("/nowhere.xtf") == 0);
  const std::string small = write_scratch("small.xtf", Bytes(10));
  assert_true(error_of([&] { XtfReader reader(small); }).find("10 of 1024") != std::string::npos);
  const std::string wrong = write_scratch("wrong.xtf", Bytes(2000));
  assert_true(error_of([&] { XtfReader reader(wrong); }).find("byte 0 is 0") != std::string::npos);
  std::string notice;
  assert_true(error_of([&] {
                (void)leadline::host::read_survey_line("a.dat", &notice);
              }).find("what kind") != std::string::npos);
}

TEST(a_flat_bottom_comes_out_flat_and_wrong_signs_are_told) {
  std::string notice;
  const SurveyLine line =
      leadline::host::read_survey_line(write_scratch("flat.xtf", survey_xtf()), &notice);
  assert_true(notice.find("recorder was told") != std::string::npos);
  const auto plane = plane_at_start();
  SurveyGeometry geometry;
  geometry.lever_arm_m = {0, kStarboard_m, 0};
  std::vector<SurveyRow> rows;
  leadline::host::SurveyCounts counts;
  leadline::host::build_rows(line, plane, geometry, &rows, &counts);
  assert_int_equal(counts.beams, counts.rows + counts.without_pose);
  assert_true(counts.rows > 12'000);
  for (const SurveyRow& row : rows) {
    // The emulated head stands still between its ping and the echo: 14 ms of roll are in this.
    assert_near(row.end.depth_m, kDepth_m, 0.06);
  }
  const auto check = leadline::host::check_signs({line}, plane, geometry, 0.5, 10);
  assert_true(check.can_tell && check.wrong.empty());
  SurveyGeometry flipped = geometry;
  flipped.roll_sign = -1;
  const auto wrong = leadline::host::check_signs({line}, plane, flipped, 0.5, 10);
  assert_true(!wrong.wrong.empty() && wrong.wrong.front() == "roll flipped");
  // The arm is found from nothing.
  const Vec3 arm = leadline::host::fit_lever_arm({line}, plane, SurveyGeometry{}, 0.5, 10);
  assert_near(arm.y, kStarboard_m, 0.15);
}

TEST(a_wrong_sign_ends_the_command) {
  leadline::host::SurveyOptions options;
  options.paths = {write_scratch("sign.xtf", survey_xtf())};
  options.geometry.lever_arm_m = {0, kStarboard_m, 0};
  options.out_path = leadline::test::scratch_directory() + "/pings.csv";
  options.geometry.roll_sign = -1;
  assert_true(error_of([&] { (void)leadline::host::run_survey(options); }).find("roll flipped") !=
              std::string::npos);
  assert_false(static_cast<bool>(std::ifstream(options.out_path)));
  options.accept_signs = true;
  assert_int_equal(leadline::host::run_survey(options), 0);
  options.geometry.roll_sign = 1;
  options.accept_signs = false;
  assert_int_equal(leadline::host::run_survey(options), 0);
  leadline::host::PingCsvStats stats;
  assert_true(leadline::host::read_ping_csv(options.out_path, {}, &stats).size() > 12'000);
  assert_true(stats.rejected.empty());
}

TEST(a_profile_bends_the_rays) {
  std::string notice;
  const SurveyLine line =
      leadline::host::read_survey_line(write_scratch("bent.xtf", survey_xtf()), &notice);
  const auto profile = leadline::host::read_sound_speed_profile(
      write_scratch("svp.csv", "depth_m,speed_m_s\n0,1500\n5,1500\n6,1480\n"));
  SurveyGeometry geometry;
  geometry.beams = {0, 32};
  std::vector<SurveyRow> straight;
  std::vector<SurveyRow> bent;
  leadline::host::SurveyCounts counts;
  leadline::host::build_rows(line, plane_at_start(), geometry, &straight, &counts);
  geometry.profile = &profile;
  leadline::host::build_rows(line, plane_at_start(), geometry, &bent, &counts);
  assert_int_equal(straight.size(), bent.size());
  for (std::size_t i = 0; i < bent.size(); ++i) {
    const auto end = leadline::estimator::trace_ray(
        profile,
        {std::llround(1e6 * bent[i].head_m.z),
         static_cast<leadline::base::Bam32>(
             std::acos((straight[i].end.depth_m - straight[i].head_m.z) / straight[i].range_m) /
             6.283185307179586 * 4294967296.0),
         1'500'000, std::llround(2e9 * straight[i].range_m / 1500.0)});
    assert_true(end.ok());
    assert_near(bent[i].end.depth_m - bent[i].head_m.z,
                1e-6 * static_cast<double>(end.value().down_um), 1e-4);
  }
  assert_true(error_of([] {
                (void)leadline::host::read_sound_speed_profile(
                    write_scratch("bad.csv", "1;1500\n"));
              }).find("bad.csv:1:") != std::string::npos);
  assert_true(error_of([] {
                (void)leadline::host::read_sound_speed_profile(
                    write_scratch("order.csv", "2,1500\n1,1500\n"));
              }).find("depths that increase") != std::string::npos);
}

TEST(degrees_minutes_seconds) {
  std::int64_t angle = 0;
  assert_true(leadline::host::parse_dms("52\xB0 20' 34.77\"", &angle));
  assert_int_equal(angle, 52'342'991'667);
  assert_true(leadline::host::parse_dms("-0\xB0 0' 1.8\"", &angle));
  assert_int_equal(angle, -500'000);
  for (const char* const bad : {"", "52", "52 61 0", "190 0 0", "1 2 3 4", "1 2.3.4 5"}) {
    assert_false(leadline::host::parse_dms(bad, &angle));
  }
}

TEST(a_sontek_summary) {
  const std::string header =
      "Sample #,Date/Time,Latitude (deg),Longitude (deg),Heading (deg),Pitch (deg),Roll (deg),"
      "VB Depth (m),BT Beam1 Depth (m),BT Beam2 Depth (m),BT Beam3 Depth (m),BT Beam4 Depth (m)\r";
  const std::string place = ", 52\xB0 20' 34.77\", 12\xB0 59' 42.29\",90,0.5,2.0,";
  const std::string path = write_scratch(
      "line.sum", header + "1,1/22/2025 12:21:10 PM" + place + "3.00,2.0,2.0,0.00,\r" +
                      "2,1/22/2025 12:21:10 PM" + place + "3,2,2,2,2\r" +  // the clock stands
                      "3,1/22/2025 1:21:11 PM" + place + "3,2,2,2,2\r" + "4,nonsense\r");
  std::string notice;
  const SurveyLine line = leadline::host::read_survey_line(path, &notice);
  assert_string_equal(notice.c_str(), "2 of 4 lines cannot be used");
  assert_int_equal(line.positions.size(), 2);
  assert_int_equal(line.positions[0].t_us, 1'737'548'470'000'000);
  assert_int_equal(line.positions[1].t_us, 1'737'552'071'000'000);
  assert_int_equal(line.beams.size(), 8);
  assert_near(line.beams[1].range_m * line.beams[1].direction.z, 2.0, 1e-9);
  assert_true(line.beams[1].direction.x > 0 && line.beams[1].direction.y < 0);
  const std::string other = write_scratch("other.sum", "Date/Time,Depth\r1,2\r");
  assert_true(error_of([&] {
                (void)leadline::host::read_survey_line(other, &notice);
              }).find("Latitude (deg)") != std::string::npos);
}

TEST(pairs_of_crossing_lines) {
  using leadline::host::crossings;
  const auto found = crossings({{0, 0, 10.0}, {5, 5, 10.0}}, {{0.5, 0, 9.0}, {0.2, 0, 9.5}}, 1.0);
  assert_int_equal(found.size(), 1);
  assert_near(found[0].difference_m, 0.5, 1e-12);
  assert_near(found[0].depth_m, 9.75, 1e-12);
}

TEST(orders_of_s44) {
  std::vector<Crossing> list;
  for (int i = 0; i < 100; ++i) {
    // Order 1a at 20 m: 0.564 m; Special: 0.292 m. Five of a hundred beyond the former.
    list.push_back({i < 5 ? 0.6 : (i % 2 == 0 ? 0.4 : -0.4), 20.0});
  }
  auto figures = leadline::host::statistics_of(list, 1.0);
  assert_int_equal(figures.order, 2);
  assert_near(figures.within[2], 0.95, 1e-12);
  assert_near(figures.p95_m, 0.4, 1e-12);
  figures = leadline::host::statistics_of(list, std::sqrt(2.0));
  assert_near(figures.within[1], 0.95, 1e-12);
  assert_int_equal(figures.order, 1);
  assert_int_equal(leadline::host::statistics_of({}, 1.0).count, 0);
}

TEST(soundings_against_a_map) {
  auto map = leadline::host::make_raster(2, 1, 0, 0, 1.0);
  map.at(0, 0) = -10.0;
  const auto found =
      leadline::host::against_map({{0.5, 0.5, 10.2}, {0.5, 1.5, 10.0}, {0.5, 7.0, 10.0}}, map);
  assert_int_equal(found.size(), 1);
  assert_near(found[0].difference_m, 0.2, 1e-12);
}

TEST(the_real_recording_keeps_its_promise) {
  leadline::host::SurveyOptions options;
  std::string notice;
  const SurveyLine line = leadline::host::read_survey_line(
      leadline::test::require_data("multibeam_r2sonic2026_sfbay/raw/first550pings.xtf"), &notice);
  leadline::estimator::LocalPlane plane;
  assert_true(plane.configure({37'756'849'828, -122'377'451'444}) == leadline::base::Status::kOk);
  SurveyGeometry geometry;
  geometry.max_angle_deg = 57.3;
  geometry.lever_arm_m = {0.75, 1.5, 0};
  const auto check = leadline::host::check_signs({line}, plane, geometry, 0.5, 10);
  assert_true(check.can_tell && check.wrong.empty());
  assert_true(check.trials.front().spread.median_m < 0.011);
  geometry.roll_sign = -1;
  const auto wrong = leadline::host::check_signs({line}, plane, geometry, 0.5, 10);
  assert_true(!wrong.wrong.empty() && wrong.wrong.front() == "roll flipped");
}
