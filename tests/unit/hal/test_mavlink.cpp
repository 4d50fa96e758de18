#include "hal/attitude/mavlink.hpp"
#include "hal/attitude/mavlink_out.hpp"
#include "hal/checksums.hpp"
#include "hal/emu/mavlink_autopilot.hpp"
#include "hal/emu/wire_bytes.hpp"
#include "tests/support/nav_streams.hpp"

namespace {

using leadline::base::NavKind;
using leadline::base::NavSample;
using leadline::emu::ByteOrder;
using leadline::emu::ByteWriter;
using leadline::emu::mavlink_frame;
using leadline::emu::MavlinkPeer;
using leadline::emu::MavlinkVersion;
using leadline::emu::Motion;
using leadline::hal::MavlinkCodec;
using leadline::hal::MavlinkConfig;
using leadline::hal::MavlinkSender;
using leadline::test::Bytes;
using leadline::test::degrees;
using leadline::test::from_hex;
using leadline::test::only_sample;
using leadline::test::samples_of;
using leadline::test::turn;
using leadline::test::operator+;

constexpr double kDegrees = 57.29577951308232;
constexpr double kAngle = 1e-5;

// devices.md 6, MADE.
const char* const kAttitude =
    "fd 10 00 00 00 01 01 1e 00 00 40 e2 01 00 cd cc cc 3d cd cc 4c bd 00 00 c0 3f 82 51";
const char* const kDistance =
    "fd 0e 00 00 00 01 01 84 00 00 40 e2 01 00 14 00 88 13 ea 00 01 00 19 ff 4b 16";
const char* const kPressure2 =
    "fd 0e 00 00 00 01 01 89 00 00 40 e2 01 00 00 f0 f9 44 00 00 00 00 3a 07 21 26";

NavSample only(const Bytes& bytes, const MavlinkConfig& config = {}) {
  return only_sample<MavlinkCodec>(config, bytes, 1'000'000);
}

Motion motion() {
  Motion motion;
  motion.roll_deg = -12.5;
  motion.pitch_deg = 33.25;
  motion.heading_deg = 289.75;
  motion.rate_rad_s = {0.125, -0.25, 0.5};
  motion.velocity_m_s = {1.25, -0.5, 0.25};
  motion.position_m = {10.5, -20.25, 3.125};
  motion.altitude_m = 2.34;
  motion.depth_m = 3.5;
  motion.temperature_degc = 12.34;
  motion.time_s = 123.456;
  return motion;
}

MavlinkPeer peer(MavlinkVersion version) {
  MavlinkPeer peer;
  peer.version = version;
  return peer;
}

constexpr MavlinkVersion kVersions[] = {MavlinkVersion::k1, MavlinkVersion::k2,
                                        MavlinkVersion::k2Signed};

}  // namespace

TEST(made_attitude_with_its_zeros_cut_off) {
  const NavSample sample = only(from_hex(kAttitude));
  assert_int_equal(sample.kind, NavKind::kAttitude);
  assert_int_equal(sample.fields, leadline::base::kNavRollPitch | leadline::base::kNavHeading |
                                      leadline::base::kNavRates);
  assert_near(degrees(sample.attitude.roll_bam32), 0.1 * kDegrees, kAngle);
  assert_near(degrees(sample.attitude.pitch_bam32), -0.05 * kDegrees, kAngle);
  assert_near(degrees(sample.attitude.heading_bam32), 1.5 * kDegrees, kAngle);
  assert_int_equal(sample.rate_urad_s[2], 0);
  assert_int_equal(sample.t_device_us, 123'456'000);
  assert_int_equal(sample.t_us, 1'000'000);
}

TEST(made_distance_and_pressure) {
  const NavSample distance = only(from_hex(kDistance));
  assert_int_equal(distance.kind, NavKind::kAltitude);
  assert_int_equal(distance.altitude_um, 2'340'000);
  const NavSample pressure = only(from_hex(kPressure2));
  assert_int_equal(pressure.kind, NavKind::kPressure);
  assert_int_equal(pressure.pressure_pa, 199'950);
  assert_int_equal(pressure.temperature_mdegc, 18'500);
}

TEST(every_message_comes_back_in_every_version) {
  for (const MavlinkVersion version : kVersions) {
    const MavlinkPeer from = peer(version);
    const Motion sent = motion();
    for (const Bytes& bytes : {leadline::emu::mavlink_attitude(from, sent),
                               leadline::emu::mavlink_attitude_quaternion(from, sent)}) {
      const NavSample sample = only(bytes);
      assert_int_equal(sample.kind, NavKind::kAttitude);
      assert_near(degrees(sample.attitude.roll_bam32), sent.roll_deg, kAngle);
      assert_near(degrees(sample.attitude.pitch_bam32), sent.pitch_deg, kAngle);
      assert_near(turn(sample.attitude.heading_bam32), sent.heading_deg, kAngle);
      assert_int_equal(sample.rate_urad_s[0], 125'000);
      assert_int_equal(sample.rate_urad_s[1], -250'000);
      assert_int_equal(sample.rate_urad_s[2], 500'000);
    }
    for (const std::uint32_t id : {29U, 137U, 143U}) {
      const NavSample sample = only(leadline::emu::mavlink_pressure(from, id, sent, 1234.56));
      assert_int_equal(sample.pressure_pa, 123'456);
      assert_int_equal(sample.temperature_mdegc, 12'340);
    }
    const NavSample local = only(leadline::emu::mavlink_local_position(from, sent));
    assert_int_equal(local.kind, NavKind::kPosition);
    assert_int_equal(local.fields,
                     leadline::base::kNavPositionLocal | leadline::base::kNavVelocityWorld);
    assert_int_equal(local.position_um[1], -20'250'000);
    assert_int_equal(local.velocity_um_s[0], 1'250'000);
    const NavSample global =
        only(leadline::emu::mavlink_global_position(from, sent, 48.3861421, -124.6305728));
    assert_int_equal(global.latitude_e9deg, 48'386'142'100);
    assert_int_equal(global.longitude_e9deg, -124'630'572'800);
    assert_int_equal(global.velocity_um_s[1], -500'000);
    const NavSample vision = only(leadline::emu::mavlink_vision_position(from, sent, 0.25));
    assert_int_equal(vision.fields, leadline::base::kNavPositionLocal);
    assert_int_equal(vision.position_um[2], 3'125'000);
    assert_int_equal(vision.sigma_position_mm, 250);
    assert_int_equal(vision.sigma_vertical_mm, 250);
    assert_int_equal(only(leadline::emu::mavlink_distance(from, sent)).altitude_um, 2'340'000);
    assert_int_equal(only(leadline::emu::mavlink_rangefinder(from, sent)).altitude_um, 2'340'000);
    const NavSample time =
        only(leadline::emu::mavlink_system_time(from, sent, 1'683'220'541'055'000));
    assert_int_equal(time.kind, NavKind::kTime);
    assert_int_equal(time.utc_us, 1'683'220'541'055'000);
  }
}

TEST(odometry_is_a_velocity_of_the_body_and_a_place_where_its_frames_say_so) {
  using leadline::emu::mavlink_odometry;
  for (const MavlinkVersion version : {MavlinkVersion::k2, MavlinkVersion::k2Signed}) {
    const NavSample both = only(mavlink_odometry(peer(version), motion(), 0.5, 0.02));
    assert_int_equal(both.kind, NavKind::kVelocity);
    assert_int_equal(both.fields,
                     leadline::base::kNavVelocityBody | leadline::base::kNavPositionLocal);
    assert_int_equal(both.velocity_um_s[1], -500'000);
    assert_int_equal(both.position_um[1], -20'250'000);
    assert_int_equal(both.sigma_velocity_um_s, 20'000);
    assert_int_equal(both.sigma_position_mm, 500);
    assert_int_equal(both.sigma_vertical_mm, 500);
    assert_int_equal(both.t_device_us, 123'456'000);
    assert_int_equal(both.quality, 255);
  }
  const auto of = [](int quality, unsigned frame, unsigned child, double sigma = 1) {
    return only(mavlink_odometry({}, motion(), sigma, sigma, quality, frame, child));
  };
  assert_int_equal(of(-1, 1, 12).fields, 0);
  assert_int_equal(of(50, 1, 12).quality, 127);
  assert_int_equal(of(0, 20, 12).fields, leadline::base::kNavVelocityBody);  // no north
  assert_int_equal(of(0, 1, 1).fields,
                   leadline::base::kNavVelocityWorld | leadline::base::kNavPositionLocal);
  assert_int_equal(of(0, 21, 8).fields, 0);  // forward, left, up; a deprecated frame
  const NavSample unstated = of(0, 1, 12, std::nan(""));
  assert_int_equal(unstated.sigma_velocity_um_s, 0);
  assert_int_equal(unstated.sigma_position_mm, 0);
  Motion lost = motion();
  lost.velocity_m_s[2] = std::nan("");
  assert_int_equal(only(mavlink_odometry({}, lost, 1, 1)).fields,
                   leadline::base::kNavPositionLocal);
}

TEST(damage_costs_one_frame) {
  for (const MavlinkVersion version : kVersions) {
    const Bytes frame = leadline::emu::mavlink_attitude(peer(version), motion());
    leadline::test::check_damage_costs_one_frame<MavlinkCodec>(MavlinkConfig{}, frame);
    leadline::test::check_noise<MavlinkCodec>(MavlinkConfig{}, frame);
  }
  leadline::test::check_damage_is_noticed<MavlinkCodec>(
      MavlinkConfig{}, leadline::emu::mavlink_attitude(peer(MavlinkVersion::k2), motion()));
}

TEST(a_signature_makes_no_bad_frame_good) {
  // Each way to get a wrong frame past its CRC by flags: none works.
  Bytes frame = leadline::emu::mavlink_attitude(peer(MavlinkVersion::k2Signed), motion());
  frame[14] ^= 1U;
  MavlinkCodec codec(MavlinkConfig{});
  assert_int_equal(samples_of(codec, frame).size(), 0);
  assert_true(codec.counters().bad_checksum >= 1);
  for (unsigned flags = 0; flags < 256; ++flags) {
    Bytes flagged = leadline::emu::mavlink_attitude(peer(MavlinkVersion::k2), motion());
    flagged[2] = static_cast<std::uint8_t>(flags);
    MavlinkCodec fresh(MavlinkConfig{});
    const std::size_t records = samples_of(fresh, flagged + Bytes(13, 0)).size();
    assert_int_equal(records, flags == 0 ? 1 : 0);
  }
  // Its 13 bytes belong to the frame: nothing in them is taken for a start.
  Bytes hidden = leadline::emu::mavlink_attitude(peer(MavlinkVersion::k2Signed), motion());
  hidden[hidden.size() - 13] = 0xFD;
  MavlinkCodec whole(MavlinkConfig{});
  assert_int_equal(samples_of(whole, hidden + hidden).size(), 2);
  assert_int_equal(whole.counters().skipped_bytes, 0);
}

TEST(no_flag_that_is_not_known_is_accepted_even_with_a_good_crc) {
  for (const std::uint8_t flags : {std::uint8_t{2}, std::uint8_t{3}, std::uint8_t{0x80}}) {
    Bytes frame = leadline::emu::mavlink_attitude(peer(MavlinkVersion::k2), motion());
    frame[2] = flags;
    frame.resize(frame.size() - 2);
    Bytes summed(frame.begin() + 1, frame.end());
    summed.push_back(39);
    const std::uint16_t crc = leadline::hal::crc16_mcrf4xx(summed.data(), summed.size());
    frame = frame + Bytes{static_cast<std::uint8_t>(crc), static_cast<std::uint8_t>(crc >> 8U)};
    MavlinkCodec codec(MavlinkConfig{});
    assert_int_equal(samples_of(codec, frame).size(), 0);
    assert_int_equal(codec.counters().bad_values, 1);
  }
}

TEST(what_is_no_number_is_left_out) {
  const auto attitude = [](const ByteWriter& payload) {
    return only(mavlink_frame({}, 30, 39, payload.bytes()));
  };
  const double nan = std::nan("");
  ByteWriter no_roll(ByteOrder::kLittle);
  no_roll.u32(1).f32(nan).f32(0.1).f32(0.2).f32(0).f32(nan).f32(0);
  assert_int_equal(attitude(no_roll).fields, leadline::base::kNavHeading);
  ByteWriter nothing(ByteOrder::kLittle);
  nothing.u32(1).f32(1e9).f32(0.1).f32(INFINITY).f32(0).f32(0).f32(1e6);
  assert_int_equal(attitude(nothing).fields, 0);
  ByteWriter quaternion(ByteOrder::kLittle);
  quaternion.u32(1).f32(0.5).f32(0).f32(0).f32(0).f32(nan).f32(0).f32(0);
  assert_int_equal(only(mavlink_frame({}, 31, 246, quaternion.bytes())).fields, 0);
  for (const double hpa : {nan, -1.0, 0.0, 1e9, static_cast<double>(INFINITY)}) {
    const NavSample sample = only(leadline::emu::mavlink_pressure({}, 137, motion(), hpa));
    assert_int_equal(sample.fields, 0);
    assert_int_equal(sample.kind, NavKind::kPressure);
  }
  Motion hot = motion();
  hot.temperature_degc = 300;
  assert_int_equal(only(leadline::emu::mavlink_pressure({}, 137, hot, 1000)).fields,
                   leadline::base::kNavPressure);
  Motion lost = motion();
  lost.position_m[2] = nan;
  lost.velocity_m_s[0] = nan;
  assert_int_equal(only(leadline::emu::mavlink_local_position({}, lost)).fields, 0);
  assert_int_equal(only(leadline::emu::mavlink_vision_position({}, lost, 1)).fields, 0);
  lost.position_m[2] = 30'000;
  assert_int_equal(only(leadline::emu::mavlink_local_position({}, lost)).fields, 0);
  assert_int_equal(
      only(leadline::emu::mavlink_vision_position({}, motion(), nan)).sigma_position_mm, 0);
  lost.altitude_m = nan;
  assert_int_equal(only(leadline::emu::mavlink_rangefinder({}, lost)).fields, 0);
  assert_int_equal(only(leadline::emu::mavlink_global_position({}, motion(), 0, 0)).fields, 0);
  assert_int_equal(only(leadline::emu::mavlink_global_position({}, motion(), 91, 0)).fields, 0);
  assert_int_equal(only(leadline::emu::mavlink_system_time({}, motion(), 0)).fields, 0);
}

TEST(distances_keep_to_the_sensor_s_own_limits) {
  const auto distance = [](unsigned cm, unsigned max_cm, unsigned orientation, unsigned quality) {
    ByteWriter payload(ByteOrder::kLittle);
    payload.u32(1).u16(20).u16(max_cm).u16(cm).u8(1).u8(0).u8(orientation).u8(255);
    payload.f32(0).f32(0).zeros(16).u8(quality);
    return mavlink_frame({}, 132, 85, payload.bytes());
  };
  assert_int_equal(only(distance(500, 1000, 25, 0)).altitude_um, 5'000'000);
  assert_int_equal(only(distance(500, 1000, 25, 50)).quality, 127);
  assert_int_equal(only(distance(500, 0, 25, 0)).altitude_um, 5'000'000);
  assert_int_equal(only(distance(19, 1000, 25, 0)).fields, 0);
  assert_int_equal(only(distance(1001, 1000, 25, 0)).fields, 0);
  assert_int_equal(only(distance(0xFFFF, 0, 25, 0)).fields, 0);
  assert_int_equal(only(distance(500, 1000, 25, 1)).fields, 0);
  MavlinkCodec codec(MavlinkConfig{});
  assert_int_equal(samples_of(codec, distance(500, 1000, 0, 0)).size(), 0);  // forwards
  assert_int_equal(codec.counters().ignored, 1);
}

TEST(configuration_chooses) {
  MavlinkConfig config;
  config.take = leadline::hal::kTakeArduSub;
  config.heading_true = false;
  config.byte_time_ns = 86'806;
  MavlinkCodec codec(config);
  assert_int_equal(
      samples_of(codec, leadline::emu::mavlink_pressure({}, 29, motion(), 1000)).size(), 0);
  assert_int_equal(codec.counters().ignored, 1);
  const NavSample sample = only(leadline::emu::mavlink_attitude({}, motion()), config);
  assert_true((sample.fields & leadline::base::kNavHeadingMagnetic) != 0);
  assert_int_equal(sample.t_us, 1'000'000 - 40 * 86'806 / 1000);
  config.system = 7;
  MavlinkCodec other(config);
  assert_int_equal(samples_of(other, leadline::emu::mavlink_attitude({}, motion())).size(), 0);
  assert_int_equal(other.counters().wrong_device, 1);
  config.system = 1;
  config.component = 9;
  MavlinkCodec part(config);
  assert_int_equal(samples_of(part, leadline::emu::mavlink_attitude({}, motion())).size(), 0);
  assert_int_equal(part.counters().wrong_device, 1);
}

TEST(frames_that_cannot_be_checked_are_not_believed) {
  MavlinkCodec codec(MavlinkConfig{});
  assert_int_equal(samples_of(codec, mavlink_frame({}, 9999, 1, Bytes(20, 1))).size(), 0);
  assert_int_equal(codec.counters().unknown_id, 1);
  assert_int_equal(codec.counters().frames, 0);
  assert_int_equal(samples_of(codec, mavlink_frame({}, 1, 124, Bytes(31, 1))).size(), 0);
  assert_int_equal(codec.counters().ignored, 1);
  assert_int_equal(samples_of(codec, from_hex("fd 10 00")).size(), 0);
  codec.restart();
  assert_int_equal(samples_of(codec, from_hex(kAttitude)).size(), 1);
}

TEST(what_is_sent_is_what_the_definitions_say) {
  MavlinkSender sender;
  sender.component = 1;
  leadline::hal::MavlinkDistance distance;
  distance.t_boot_ms = 123'456;
  distance.min_cm = 20;
  distance.max_cm = 5000;
  distance.distance_cm = 234;
  Bytes out(leadline::hal::kMaxMavlinkOut_bytes);
  out.resize(leadline::hal::write_mavlink_distance(sender, distance, out.data(), out.size()));
  assert_true(out == from_hex(kDistance));  // devices.md 6, MADE
  assert_int_equal(sender.sequence, 1);

  Bytes beat(leadline::hal::kMaxMavlinkOut_bytes);
  beat.resize(leadline::hal::write_mavlink_heartbeat(sender, beat.data(), beat.size()));
  assert_int_equal(beat.size(), 21);
  assert_int_equal(beat[4], 1);
  assert_true(beat == mavlink_frame({MavlinkVersion::k2, 1, 1, 1}, 0, 50,
                                    from_hex("00 00 00 00 12 08 00 04 03")));

  leadline::hal::MavlinkObstacles obstacles;
  obstacles.t_us = 0x0102030405060708;
  obstacles.distance_cm.fill(leadline::hal::kMavNoDistance_cm);
  obstacles.distance_cm[3] = 777;
  obstacles.min_cm = 30;
  obstacles.max_cm = 6000;
  obstacles.increment_mdeg = 2500;
  obstacles.angle_offset_mdeg = -90'125;
  Bytes map(leadline::hal::kMaxMavlinkOut_bytes);
  map.resize(leadline::hal::write_mavlink_obstacles(sender, obstacles, map.data(), map.size()));
  ByteWriter expected(ByteOrder::kLittle);
  expected.u64(obstacles.t_us);
  for (const std::uint16_t cm : obstacles.distance_cm) {
    expected.u16(cm);
  }
  expected.u16(30).u16(6000).u8(1).u8(2).f32(2.5).f32(-90.125).u8(12);
  assert_true(map == mavlink_frame({MavlinkVersion::k2, 1, 1, 2}, 330, 23, expected.bytes()));
  assert_int_equal(map.size(), leadline::hal::kMaxMavlinkOut_bytes);

  MavlinkCodec codec(MavlinkConfig{});
  assert_int_equal(samples_of(codec, out + beat + map).size(), 1);
  assert_int_equal(codec.counters().frames, 3);
}

TEST(a_buffer_that_is_too_small_gets_nothing) {
  MavlinkSender sender;
  std::uint8_t out[20];
  assert_int_equal(leadline::hal::write_mavlink_heartbeat(sender, out, sizeof out), 0);
  assert_int_equal(leadline::hal::write_mavlink_distance(sender, {}, out, sizeof out), 0);
  assert_int_equal(leadline::hal::write_mavlink_obstacles(sender, {}, out, sizeof out), 0);
  assert_int_equal(sender.sequence, 0);
}
