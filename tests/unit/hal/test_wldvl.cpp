#include "hal/attitude/json_members.hpp"
#include "hal/attitude/wldvl.hpp"
#include "hal/emu/wl_dvl.hpp"
#include "hal/wire.hpp"
#include "tests/support/nav_streams.hpp"

namespace {

using leadline::base::NavSample;
using leadline::emu::Motion;
using leadline::emu::wldvl_line;
using leadline::emu::WlDvlState;
using leadline::hal::JsonMember;
using leadline::hal::JsonMembers;
using leadline::hal::WlDvlCodec;
using leadline::hal::WlDvlConfig;
using leadline::test::Bytes;
using leadline::test::degrees;
using leadline::test::from_text;
using leadline::test::samples_of;
using leadline::test::operator+;
using namespace leadline::base;  // NOLINT: the bits' names

NavSample only(const Bytes& bytes, const WlDvlConfig& config = {}, std::int64_t t_us = 0) {
  return leadline::test::only_sample<WlDvlCodec>(config, bytes, t_us);
}

leadline::hal::CodecCounters counters_of(const Bytes& bytes, const WlDvlConfig& config = {}) {
  WlDvlCodec codec(config);
  samples_of(codec, bytes);
  return codec.counters();
}

Motion some_motion() {
  Motion motion;
  motion.velocity_m_s = {0.5, -0.125, 0.25};
  motion.position_m = {12.5, -3.25, 1.75};
  motion.roll_deg = -4.5;
  motion.pitch_deg = 8.5;
  motion.altitude_m = 5.32;
  motion.time_s = 1'638'191'471.563017;
  return motion;
}

void check_velocity(const NavSample& sample, std::int64_t x, std::int64_t y, std::int64_t z) {
  assert_true(sample.kind == NavKind::kVelocity);
  assert_int_equal(sample.velocity_um_s[0], x);
  assert_int_equal(sample.velocity_um_s[1], y);
  assert_int_equal(sample.velocity_um_s[2], z);
}

const Bytes kWrz = from_text(
    "wrz,0.120,-0.400,2.000,y,1.30,1.855,1e-07;0;1.4;0;1.2;0;0.2;0;1e+09,7,14,123.00,1*50\r\n");

}  // namespace

// devices.md 5.8, REAL: forward, starboard, down as they come.
TEST(real_velocity) {
  const NavSample sample = only(kWrz, {}, 1'000'000);
  assert_int_equal(sample.fields, kNavVelocityBody | kNavAltitude);
  check_velocity(sample, 120'000, -400'000, 2'000'000);
  assert_int_equal(sample.altitude_um, 1'300'000);
  assert_int_equal(sample.sigma_velocity_um_s, 1'855'000);
  assert_int_equal(sample.t_device_us, 7);
  assert_int_equal(sample.t_us, 1'000'000 - 7);  // sent 14, valid at 7
}

TEST(real_lines_of_beams_are_ignored) {
  for (const char* line : {"wru,0,0.070,1.10,-40,-95*9c\r\n", "wru,1,-0.500,1.25,-62,-104*f0\r\n",
                           "wrt,14.90,15.10,14.80,-1.00*53\r\n"}) {
    const auto counters = counters_of(from_text(line));
    assert_int_equal(counters.frames, 1);
    assert_int_equal(counters.ignored, 1);
    // Who reads a file wants them all: a record without a field, and its bytes.
    WlDvlConfig config;
    config.every_report = true;
    WlDvlCodec codec(config);
    const auto samples = samples_of(codec, from_text(line));
    assert_int_equal(samples.size(), 1);
    assert_true(samples[0].kind == NavKind::kOther);
    assert_int_equal(samples[0].fields, 0);
  }
  WlDvlConfig config;
  config.every_report = true;
  for (const char* body : {"wru,0,0.070,1.10,-40", "wrt,14.90,15.10,14.80,-1.00,2"}) {
    WlDvlCodec codec(config);
    assert_int_equal(samples_of(codec, wldvl_line(body)).size(), 0);
    assert_int_equal(codec.counters().bad_values, 1);
  }
}

TEST(real_position) {
  const NavSample sample =
      only(from_text("wrp,49056.809,0.41,0.15,1.23,0.4,53.9,13.0,19.3,0*de\n"));
  assert_true(sample.kind == NavKind::kPosition);
  assert_int_equal(sample.fields, kNavPositionLocal | kNavRollPitch);
  assert_int_equal(sample.position_um[0], 410'000);
  assert_int_equal(sample.position_um[1], 150'000);
  assert_int_equal(sample.position_um[2], 1'230'000);
  assert_int_equal(sample.sigma_position_mm, 400);
  assert_near(degrees(sample.attitude.roll_bam32), 53.9, 1e-7);
  assert_near(degrees(sample.attitude.pitch_bam32), 13.0, 1e-7);
  assert_int_equal(sample.t_device_us, 49'056'809'000);
  assert_int_equal(only(wldvl_line("wrp,1,0,0,0,0.4,0,0,0,1")).fields, 0);
}

TEST(real_old_velocity) {
  const Bytes line = from_text("wrx,1075.51,0.000,0.000,0.000,2.707,-1.00,n,1*04\r\n");
  const NavSample sample = only(line);
  assert_true(sample.kind == NavKind::kVelocity);
  assert_int_equal(sample.fields, 0);
  assert_int_equal(sample.altitude_um, 0);
  // A DVL that sends both formats says everything twice.
  WlDvlCodec codec(WlDvlConfig{});
  assert_int_equal(samples_of(codec, kWrz + line + kWrz + line).size(), 2);
  assert_int_equal(codec.counters().repeats, 2);
}

// The makers' water track example has a wrong checksum (7b is right), is called wrz in its format, and wrs is
// an answer about time too.
TEST(water_track_by_the_number_of_fields) {
  const std::string body =
      ",0.120,-0.400,2.000,y,1.855,1e-07;0;1.4;0;1.2;0;0.2;0;1e+09,7,14,123.00,1";
  assert_int_equal(counters_of(from_text("wrs" + body + "*50\r\n")).bad_checksum, 1);
  for (const Bytes& line : {from_text("wrs" + body + "*7b\r\n"), wldvl_line("wrz" + body)}) {
    const NavSample sample = only(line);
    assert_int_equal(sample.fields, kNavVelocityWater);
    check_velocity(sample, 120'000, -400'000, 2'000'000);
    assert_int_equal(sample.sigma_velocity_um_s, 1'855'000);
    assert_int_equal(sample.t_us, -7);
  }
  assert_int_equal(counters_of(wldvl_line("wrs,1638360213,ntp")).ignored, 1);
}

TEST(answers) {
  assert_int_equal(counters_of(wldvl_line("wrn") + wldvl_line("wr?") + wldvl_line("wr!")).nacks, 3);
  assert_int_equal(counters_of(wldvl_line("wra") + wldvl_line("wrv,2.5.0")).ignored, 2);
  // MADE commands on the same line are none of ours.
  assert_int_equal(counters_of(from_text("wcv*fe\r\nwcc*95\r\nwcp,3*74\r\n")).frames, 0);
  for (const char* line :
       {"wcv*fe\r\n", "wcc*95\r\n", "wcp,3*74\r\n", "wcx*d4\r\n", "wcr*e2\r\n"}) {
    const std::string text = line;
    assert_true(wldvl_line(text.substr(0, text.size() - 5)) == from_text(text));
  }
  assert_true(wldvl_line("wcs,1450,,n,,,") == from_text("wcs,1450,,n,,,*c5\r\n"));
}

TEST(checksum_may_be_optional) {
  const Bytes bare = from_text("wrx,1,0.5,0,0,0.01,2.0,y,0\r\n");
  assert_int_equal(counters_of(bare).bad_checksum, 1);
  WlDvlConfig config;
  config.require_checksum = false;
  check_velocity(only(bare, config), 500'000, 0, 0);
}

TEST(invalid_velocity_is_a_record_without_fields) {
  WlDvlState state;
  state.valid = false;
  for (const Bytes& report : {leadline::emu::wldvl_velocity(some_motion(), state),
                              leadline::emu::wldvl_water(some_motion(), state),
                              leadline::emu::wldvl_old_velocity(some_motion(), state),
                              leadline::emu::wldvl_pd4(some_motion(), state),
                              leadline::emu::wldvl_json_velocity(some_motion(), state)}) {
    const NavSample sample = only(report);
    assert_int_equal(sample.fields, 0);
    check_velocity(sample, 0, 0, 0);
    assert_int_equal(counters_of(report).no_data, 1);
  }
}

// REAL, from the makers' documents: the lines of one PD6 report.
TEST(real_pd6) {
  WlDvlCodec codec(WlDvlConfig{});
  const auto samples = samples_of(
      codec,
      from_text(":SA, +0.00, +0.00,  0.00\r\n:TS,22020812061800, 0.0, +0.0,   0.0,1475.0,  0\r\n"
                ":BI,  +123,  -420, +2000,    +0,A\r\n:BS,  -420,  +123, +2000,A\r\n"
                ":BD,       +0.00,       +0.00,       +0.00,   5.32,  0.00\r\n"));
  assert_int_equal(samples.size(), 2);
  assert_int_equal(samples[0].fields, kNavVelocityBody);
  check_velocity(samples[0], 123'000, -420'000, 2'000'000);
  assert_true(samples[1].kind == NavKind::kAltitude);
  assert_int_equal(samples[1].altitude_um, 5'320'000);
  assert_int_equal(codec.counters().ignored, 3);
  assert_int_equal(codec.counters().skipped_bytes, 0);
}

TEST(pd6_columns_are_fixed) {
  for (const char* line :
       {":BI,  +123,  -420, +2000,    +0,X\r\n", ":BI,  +12,  -420, +2000,    +0,A\r\n",
        ":BI,   123,  -420, +2000,    +0,A\r\n",
        ":BD,       +0.00,       +0.00,       +0.00,  5.32,  0.00\r\n"}) {
    assert_int_equal(counters_of(from_text(line)).bad_values, 1);
  }
  const Bytes none = from_text(":BD,       +0.00,       +0.00,       +0.00,   0.00,  0.00\r\n");
  assert_int_equal(only(none).fields, 0);
  assert_int_equal(only(from_text(":BI,    +0,    +0,    +0,    +0,V\r\n")).fields, 0);
}

TEST(pd4) {
  const Bytes frame = leadline::emu::wldvl_pd4(some_motion());
  const NavSample sample = only(frame);
  assert_int_equal(sample.fields, kNavVelocityBody | kNavAltitude);
  check_velocity(sample, 500'000, -125'000, 250'000);
  assert_int_equal(sample.altitude_um, 5'320'000);
  WlDvlConfig config;
  config.pd4_ship_axes = true;
  check_velocity(only(frame, config), -125'000, 500'000, -250'000);
  config.pd4_good_status = 1;
  assert_int_equal(only(frame, config).fields, 0);
  Bytes other_size = frame;
  other_size[2] = 45;
  leadline::hal::write_u16_le(
      other_size.data() + 45,
      static_cast<std::uint16_t>(leadline::hal::read_u16_le(frame.data() + 45) - 2));
  check_velocity(only(other_size), 500'000, -125'000, 250'000);
  other_size[2] = 46;
  assert_int_equal(counters_of(other_size).bad_length, 1);
}

// From the makers' documents, in one line as the DVL sends it.
TEST(real_json_velocity) {
  const NavSample sample = only(
      from_text(
          "{\"time\":106.3935775756836,\"vx\":-3.713480691658333e-05,\"vy\":5.703703573090024e-05,"
          "\"vz\":2.4990416932269e-05,\"fom\":0.00016016385052353144,\"covariance\":"
          "[[2.4471841442164077e-08,-3.3937477272871774e-09,-1.6659699175747278e-09],"
          "[-3.3937477272871774e-09,1.4654466085062268e-08,4.0409570134514183e-10],"
          "[-1.6659699175747278e-09,4.0409570134514183e-10,1.5971971523143225e-09]],"
          "\"altitude\":0.4949815273284912,\"transducers\":[{\"id\":0,\"velocity\":"
          "0.00010825289791682735,\"distance\":0.5568000078201294,\"rssi\":-30.49,\"nsd\":-88.7,"
          "\"beam_valid\":true}],\"velocity_valid\":true,\"status\":0,\"format\":\"json_v3.1\","
          "\"type\":\"velocity\",\"time_of_validity\":1638191471563017,"
          "\"time_of_transmission\":1638191471752336}\r\n"),
      {}, 10'000'000);
  assert_int_equal(sample.fields, kNavVelocityBody | kNavAltitude);
  check_velocity(sample, -37, 57, 25);
  assert_int_equal(sample.altitude_um, 494'982);
  assert_int_equal(sample.sigma_velocity_um_s, 160);
  assert_int_equal(sample.t_device_us, 1'638'191'471'563'017);
  assert_int_equal(sample.t_us, 10'000'000 - 189'319);
}

TEST(real_json_position) {
  const NavSample sample = only(from_text(
      "{\"ts\":49056.809,\"x\":12.43563613697886467,\"y\":64.617631152402609587,\"z\":1."
      "767641898933798075,"
      "\"std\":0.001959984190762043,\"roll\":0.6173566579818726,\"pitch\":0.6173566579818726,"
      "\"yaw\":0.6173566579818726,\"type\":\"position_local\",\"status\":0,\"format\":\"json_v3."
      "1\"}\n"));
  assert_true(sample.kind == NavKind::kPosition);
  assert_int_equal(sample.fields, kNavPositionLocal | kNavRollPitch);
  assert_int_equal(sample.position_um[0], 12'435'636);
  assert_int_equal(sample.position_um[1], 64'617'631);
  assert_int_equal(sample.sigma_position_mm, 2);
  assert_near(degrees(sample.attitude.roll_bam32), 0.61735666, 2e-7);
}

TEST(json_of_other_kinds) {
  assert_int_equal(
      only(leadline::emu::wldvl_json_velocity(some_motion(), {}, "velocity_water")).fields,
      kNavVelocityWater);
  assert_int_equal(
      counters_of(from_text("{\"response_to\":\"get_config\",\"success\":true,\"result\":"
                            "{\"range_mode\":\"auto\"},\"type\":\"response\"}\n"))
          .ignored,
      1);
  WlDvlState state;
  state.valid = false;
  assert_int_equal(only(leadline::emu::wldvl_json_position(some_motion(), state)).fields, 0);
}

TEST(json_that_is_none) {
  for (const char* line :
       {"{\"type\":\"velocity\",\"vx\":1\n", "{\"type\":\"velocity\"}\n", "{\"type\"}\n",
        "{\"type\":\"velocity\",\"velocity_valid\":true,\"vx\":nan,\"vy\":0,\"vz\":0}\n",
        "{\"type\":\"velocity\",\"velocity_valid\":true,\"vx\":1e9,\"vy\":0,\"vz\":0}\n",
        "{\"type\":\"velocity\",\"velocity_valid\":1,\"vx\":0,\"vy\":0,\"vz\":0}\n",
        "{\"type\":\"position_local\",\"x\":0,\"y\":0,\"z\":0}\n", "{\"a\":1,}\n", "{\"a\":[1}\n",
        "{\"a\":1}x\n"}) {
    const auto counters = counters_of(from_text(line));
    assert_int_equal(counters.records, 0);
    assert_int_equal(counters.bad_values, 1);
  }
  assert_int_equal(counters_of(from_text("{x}\n")).frames, 0);
}

TEST(json_scanner) {
  const std::string text =
      R"({ "a" : -1.5e3 , "b\"c":"x,}\\", "d":{"e":[1,{"f":"}]"}]},"g":null, "h":[] })";
  JsonMembers members(text.data(), text.size());
  JsonMember member{};
  const auto check = [&](const char* key, const char* value, bool is_string) {
    assert_true(members.next(member));
    assert_true(std::string(member.key.text, member.key.size) == key);
    assert_true(std::string(member.value.text != nullptr ? member.value.text : "",
                            member.value.size) == value);
    assert_int_equal(member.is_string, is_string);
  };
  check("a", "-1.5e3", false);
  check("b\\\"c", "x,}\\\\", true);
  check("d", "", false);
  check("g", "null", false);
  check("h", "", false);
  assert_false(members.next(member));
  assert_true(members.good());
  for (const char* bad : {"", "x", "{", "{\"", "{\"a", "{\"a\"", "{\"a\":", "{\"a\":1",
                          "{\"a\":\"\\\"}", "{\"a\":[[}", "{\"a\":1 2}", "{}}", "{\"a\":}"}) {
    JsonMembers broken(bad, std::string(bad).size());
    while (broken.next(member)) {
    }
    assert_false(broken.good());
  }
  JsonMembers empty("{ }", 3);
  assert_false(empty.next(member));
  assert_true(empty.good());
}

// devices.md 8, trap 8: TCP cuts a report anywhere. And whatever the format, the same motion comes back.
TEST(every_format_in_one_stream) {
  const Motion motion = some_motion();
  const Bytes stream =
      leadline::emu::wldvl_old_velocity(motion) + leadline::emu::wldvl_velocity(motion) +
      leadline::emu::wldvl_pd4(motion) + leadline::emu::wldvl_json_velocity(motion) +
      leadline::emu::wldvl_position(motion) + leadline::emu::wldvl_json_position(motion) +
      leadline::emu::wldvl_pd6(motion);
  WlDvlCodec codec(WlDvlConfig{});
  const auto samples = samples_of(codec, stream);
  assert_int_equal(samples.size(), 8);
  int velocities = 0;
  for (const NavSample& sample : samples) {
    if (sample.kind == NavKind::kVelocity) {
      ++velocities;
      check_velocity(sample, 500'000, -125'000, 250'000);
    } else if (sample.kind == NavKind::kPosition) {
      assert_int_equal(sample.position_um[0], 12'500'000);
      assert_near(degrees(sample.attitude.pitch_bam32), 8.5, 1e-6);
    }
  }
  assert_int_equal(velocities, 5);
  assert_int_equal(codec.counters().skipped_bytes, 0);
  assert_int_equal(leadline::hal::rejected(codec.counters()), 0);
}

TEST(values_that_no_dvl_sends) {
  for (const char* body :
       {"wrz,x,0,0,y,1,0.1,0,1,2,3,0", "wrz,0,0,0,q,1,0.1,0,1,2,3,0",
        "wrz,0,0,500,y,1,0.1,0,1,2,3,0", "wrz,0,0,0,y,99999,0.1,0,1,2,3,0",
        "wrz,0,0,0,y,1,z,0,1,2,3,0", "wrx,1,0,0,0,0,0,y", "wrp,1,0,0,0,0,0,95,0,0",
        "wrp,1,0,0,0,-1,0,0,0,0", "wrp,1,0,0,0,0,0,0,0"}) {
    assert_int_equal(counters_of(wldvl_line(body)).bad_values, 1);
  }
  // Clocks that make no sense change no time; a figure of merit that does not fit is not stated.
  const NavSample sample = only(wldvl_line("wrz,0,0,0,y,1,1e9,0,99,2,3,0"), {}, 500);
  assert_int_equal(sample.t_us, 500);
  assert_int_equal(sample.sigma_velocity_um_s, 0);
  assert_int_equal(only(wldvl_line("wrz,0,0,0,y,1,0.1,0,,,3,0"), {}, 500).t_us, 500);
}

TEST(damage_costs_one_report) {
  const Motion motion = some_motion();
  for (const Bytes& report :
       {leadline::emu::wldvl_velocity(motion), leadline::emu::wldvl_pd4(motion),
        leadline::emu::wldvl_position(motion)}) {
    leadline::test::check_damage_costs_one_frame<WlDvlCodec>(WlDvlConfig{}, report);
    leadline::test::check_noise<WlDvlCodec>(WlDvlConfig{}, report);
  }
  const Bytes json = leadline::emu::wldvl_json_position(motion);
  leadline::test::check_damage_costs_one_frame<WlDvlCodec>(WlDvlConfig{}, json);
  leadline::test::check_damage_is_noticed<WlDvlCodec>(WlDvlConfig{},
                                                      leadline::emu::wldvl_pd4(motion));
}

TEST(lines_without_an_end) {
  WlDvlCodec codec(WlDvlConfig{});
  samples_of(codec, from_text("wr" + std::string(400, 'z')));
  assert_int_equal(codec.counters().bad_length, 1);
  samples_of(codec, from_text("{\"" + std::string(4000, 'a')));
  assert_int_equal(codec.counters().bad_length, 2);
  assert_int_equal(samples_of(codec, kWrz).size(), 1);
  codec.restart();
  assert_int_equal(samples_of(codec, kWrz).size(), 1);
}
