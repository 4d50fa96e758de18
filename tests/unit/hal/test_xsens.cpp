#include "hal/attitude/xsens.hpp"
#include "hal/emu/wire_bytes.hpp"
#include "hal/emu/xsens_sensor.hpp"
#include "tests/support/nav_streams.hpp"

namespace {

using leadline::base::NavSample;
using leadline::emu::ByteOrder;
using leadline::emu::ByteWriter;
using leadline::emu::Motion;
using leadline::emu::xsens_message;
using leadline::emu::xsens_mtdata2;
using leadline::emu::XsensNumber;
using leadline::emu::XsensOrientation;
using leadline::emu::XsensWorld;
using leadline::hal::XsensCodec;
using leadline::hal::XsensConfig;
using leadline::test::Bytes;
using leadline::test::degrees;
using leadline::test::from_hex;
using leadline::test::samples_of;
using leadline::test::operator+;
using namespace leadline::base;  // NOLINT: the bits' names

NavSample only(const Bytes& bytes, const XsensConfig& config = {}) {
  return leadline::test::only_sample<XsensCodec>(config, bytes);
}

leadline::hal::CodecCounters counters_of(const Bytes& bytes) {
  XsensCodec codec(XsensConfig{});
  samples_of(codec, bytes);
  return codec.counters();
}

/// An MTData2 of one packet of singles.
Bytes packet(unsigned id, const std::vector<double>& values) {
  ByteWriter data(ByteOrder::kBig);
  data.u16(id).u8(4 * values.size());
  for (const double value : values) {
    data.f32(value);
  }
  return xsens_message(0x36, data.bytes());
}

void check_angles(const NavSample& sample, double roll, double pitch, double heading,
                  double slack) {
  assert_near(std::remainder(degrees(sample.attitude.roll_bam32) - roll, 360), 0, slack);
  assert_near(std::remainder(degrees(sample.attitude.pitch_bam32) - pitch, 360), 0, slack);
  assert_near(std::remainder(degrees(sample.attitude.heading_bam32) - heading, 360), 0, slack);
}

constexpr double kSlack = 1e-4;  // the sine table and the matrix in between, degrees

}  // namespace

// devices.md 5.4: the commands, and the MADE SetOutputConfiguration, are frames; none is a measurement.
TEST(made_messages) {
  for (const char* hex : {"fa ff 30 00 d1", "fa ff 10 00 f1",
                          "fa ff c0 10 10 20 00 00 10 60 00 64 20 30 00 64 80 20 00 64 75"}) {
    const auto counters = counters_of(from_hex(hex));
    assert_int_equal(counters.frames, 1);
    assert_int_equal(counters.ignored, 1);
    assert_int_equal(counters.skipped_bytes, 0);
  }
  assert_true(xsens_message(0x30, {}) == from_hex("fa ff 30 00 d1"));
  assert_true(xsens_message(0xC0, from_hex("10 20 00 00 10 60 00 64 20 30 00 64 80 20 00 64")) ==
              from_hex("fa ff c0 10 10 20 00 00 10 60 00 64 20 30 00 64 80 20 00 64 75"));
  assert_int_equal(counters_of(xsens_message(0x42, {0x28})).nacks, 1);
}

// The housing is x forward, y left, z up. In east-north-up yaw 0 is a bow to the east, yaw grows to the
// north; pitch about the left axis puts the bow down; roll about the bow puts starboard down.
TEST(east_north_up_by_hand) {
  check_angles(only(packet(0x2030, {0, 0, 0})), 0, 0, 90, kSlack);
  check_angles(only(packet(0x2030, {0, 0, 90})), 0, 0, 0, kSlack);
  check_angles(only(packet(0x2030, {0, 0, -90})), 0, 0, 180, kSlack);
  check_angles(only(packet(0x2030, {10, 0, 0})), 10, 0, 90, kSlack);
  check_angles(only(packet(0x2030, {0, 20, 0})), 0, -20, 90, kSlack);
  check_angles(only(packet(0x2030, {10, -20, 30})), 10, 20, 60, kSlack);
}

TEST(north_west_up_by_hand) {
  check_angles(only(packet(0x2038, {0, 0, 0})), 0, 0, 0, kSlack);
  check_angles(only(packet(0x2038, {0, 0, 90})), 0, 0, 270, kSlack);
  check_angles(only(packet(0x2038, {10, -20, 30})), 10, 20, 330, kSlack);
}

// A level housing in north-east-down is upside down to it: roll 180. With the axes turned on the device
// the angles are ours.
TEST(north_east_down_by_hand) {
  check_angles(only(packet(0x2034, {180, 0, 0})), 0, 0, 0, kSlack);
  check_angles(only(packet(0x2034, {180, 0, 90})), 0, 0, 90, kSlack);
  XsensConfig config;
  config.body_frd = true;
  check_angles(only(packet(0x2034, {10, 20, 30}), config), 10, 20, 30, kSlack);
}

// A quarter turn about up: w = z = sqrt(1/2).
TEST(quaternion_by_hand) {
  const double h = std::sqrt(0.5);
  check_angles(only(packet(0x2010, {h, 0, 0, h})), 0, 0, 0, 1e-5);
  check_angles(only(packet(0x2010, {1, 0, 0, 0})), 0, 0, 90, 1e-5);
}

// Sent by columns: the bow to the north, left to the west, up.
TEST(matrix_by_hand) {
  check_angles(only(packet(0x2020, {0, 1, 0, -1, 0, 0, 0, 0, 1})), 0, 0, 0, 1e-5);
}

TEST(rates_follow_the_axes) {
  const NavSample sample = only(packet(0x8020, {0.5, 0.25, -0.125}));
  assert_true(sample.kind == NavKind::kRates);
  assert_int_equal(sample.fields, kNavRates);
  assert_int_equal(sample.rate_urad_s[0], 500'000);
  assert_int_equal(sample.rate_urad_s[1], -250'000);  // about right
  assert_int_equal(sample.rate_urad_s[2], 125'000);   // about down
  XsensConfig config;
  config.body_frd = true;
  assert_int_equal(only(packet(0x8020, {0.5, 0.25, -0.125}), config).rate_urad_s[1], 250'000);
}

// Any world, orientation and number format carries the same motion.
TEST(all_formats_agree) {
  leadline::test::Random random(6);
  for (int i = 0; i < 60; ++i) {
    Motion motion;
    motion.roll_deg = static_cast<double>(random.between(-1700, 1700)) / 10;
    motion.pitch_deg = static_cast<double>(random.between(-850, 850)) / 10;
    motion.heading_deg = static_cast<double>(random.between(0, 3599)) / 10;
    motion.rate_rad_s = {0.5, -0.25, 0.125};
    motion.time_s = 12.3456;
    for (const auto world : {XsensWorld::kEnu, XsensWorld::kNed, XsensWorld::kNwu}) {
      for (const auto orientation :
           {XsensOrientation::kQuaternion, XsensOrientation::kMatrix, XsensOrientation::kEuler}) {
        for (const auto number : {XsensNumber::kSingle, XsensNumber::kFixed20,
                                  XsensNumber::kFixed32, XsensNumber::kDouble}) {
          const NavSample sample = only(xsens_mtdata2(motion, orientation, world, number));
          assert_int_equal(sample.fields, kNavRollPitch | kNavHeadingMagnetic | kNavRates);
          check_angles(sample, motion.roll_deg, motion.pitch_deg, motion.heading_deg, 2e-3);
          assert_int_equal(sample.rate_urad_s[0], 500'000);
          assert_int_equal(sample.rate_urad_s[1], -250'000);
          assert_int_equal(sample.rate_urad_s[2], 125'000);
          assert_int_equal(sample.t_device_us, 12'345'600);
        }
      }
    }
  }
}

TEST(status_that_is_not_valid) {
  const Bytes frame = xsens_mtdata2(Motion{}, XsensOrientation::kEuler, XsensWorld::kEnu,
                                    XsensNumber::kSingle, false);
  const NavSample sample = only(frame);
  assert_true(sample.kind == NavKind::kAttitude);
  assert_int_equal(sample.fields, kNavRates);
  assert_int_equal(counters_of(frame).no_data, 1);
  XsensConfig config;
  config.check_status = false;
  config.true_heading = true;
  assert_int_equal(only(frame, config).fields, kNavRollPitch | kNavHeading | kNavRates);
  ByteWriter data(ByteOrder::kBig);
  data.u16(0xE010).u8(1).u8(1).u16(0x2030).u8(12).f32(0).f32(0).f32(0);
  assert_int_equal(only(xsens_message(0x36, data.bytes())).fields, 0);
}

TEST(temperature_and_pressure) {
  assert_int_equal(only(packet(0x0810, {21.5})).temperature_mdegc, 21'500);
  ByteWriter data(ByteOrder::kBig);
  data.u16(0x3010).u8(4).u32(101'500);
  const Bytes pressure = xsens_message(0x36, data.bytes());
  assert_int_equal(counters_of(pressure).ignored, 1);
  XsensConfig config;
  config.use_pressure = true;
  const NavSample sample = only(pressure, config);
  assert_true(sample.kind == NavKind::kPressure);
  assert_int_equal(sample.pressure_pa, 101'500);
}

TEST(extended_length) {
  ByteWriter data(ByteOrder::kBig);
  data.u16(0x7010).u8(250).zeros(250);  // a packet of no interest
  data.u16(0x2030).u8(12).f32(0).f32(0).f32(0);
  check_angles(only(xsens_message(0x36, data.bytes())), 0, 0, 90, kSlack);
}

TEST(values_that_no_sensor_sends) {
  assert_int_equal(counters_of(packet(0x2030, {std::nan(""), 0, 0})).bad_values, 1);
  assert_int_equal(counters_of(packet(0x2030, {0, 0})).bad_values, 1);
  assert_int_equal(counters_of(packet(0x2010, {0, 0, 0, 0})).bad_values, 1);
  assert_int_equal(counters_of(packet(0x2020, {0, 0, 0, 0, 0, 0, 0, 0, 0})).bad_values, 1);
  assert_int_equal(counters_of(packet(0x203C, {0, 0, 0})).bad_values, 1);  // no such world
  assert_int_equal(counters_of(packet(0x8020, {1e9, 0, 0})).bad_values, 1);
  assert_int_equal(counters_of(packet(0x0810, {1e9})).bad_values, 1);
  assert_int_equal(counters_of(xsens_message(0x36, {0x20, 0x30, 12, 0})).bad_values, 1);
  assert_int_equal(counters_of(xsens_message(0x36, {0x20})).bad_values, 1);
  assert_int_equal(counters_of(xsens_message(0x36, {0x10, 0x60, 1, 0})).bad_values, 1);
  assert_int_equal(counters_of(xsens_message(0x36, {})).ignored, 1);
  assert_int_equal(counters_of(from_hex("fa ff 36 ff ff ff")).bad_length, 1);
  assert_int_equal(counters_of(from_hex("fa 40 36 00")).frames, 0);  // no such bus address
}

TEST(damage_costs_one_message) {
  Motion motion;
  motion.roll_deg = 5;
  const Bytes frame = xsens_mtdata2(motion, XsensOrientation::kQuaternion);
  leadline::test::check_damage_costs_one_frame<XsensCodec>(XsensConfig{}, frame);
  leadline::test::check_damage_is_noticed<XsensCodec>(XsensConfig{}, frame);
  leadline::test::check_noise<XsensCodec>(XsensConfig{}, frame);
}

TEST(restart_forgets) {
  const Bytes frame = packet(0x2030, {0, 0, 0});
  XsensCodec codec(XsensConfig{});
  samples_of(codec, Bytes(frame.begin(), frame.begin() + 9));
  codec.restart();
  assert_int_equal(samples_of(codec, frame + frame).size(), 2);
  assert_int_equal(codec.counters().skipped_bytes, 9);
}
