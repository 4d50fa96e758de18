#include <functional>

#include "hal/attitude/vectornav.hpp"
#include "hal/emu/vectornav_sensor.hpp"
#include "hal/emu/wire_bytes.hpp"
#include "tests/support/nav_streams.hpp"

namespace {

using leadline::base::NavSample;
using leadline::emu::ByteOrder;
using leadline::emu::ByteWriter;
using leadline::emu::Motion;
using leadline::emu::vectornav_binary;
using leadline::emu::VectorNavSeal;
using leadline::hal::VectorNavCodec;
using leadline::hal::VectorNavConfig;
using leadline::test::Bytes;
using leadline::test::degrees;
using leadline::test::from_hex;
using leadline::test::from_text;
using leadline::test::samples_of;
using leadline::test::operator+;
using namespace leadline::base;  // NOLINT: the bits' names

constexpr double kBam = 1e-7;

NavSample only(const Bytes& bytes, const VectorNavConfig& config = {}) {
  return leadline::test::only_sample<VectorNavCodec>(config, bytes);
}

leadline::hal::CodecCounters counters_of(const Bytes& bytes, const VectorNavConfig& config = {}) {
  VectorNavCodec codec(config);
  samples_of(codec, bytes);
  return codec.counters();
}

Motion some_motion() {
  Motion motion;
  motion.roll_deg = -12.5;
  motion.pitch_deg = 7.25;
  motion.heading_deg = 301.5;
  motion.rate_rad_s = {0.125, -0.25, 0.5};
  motion.time_s = 1234.567891;
  return motion;
}

const Bytes kYmr = from_text(
    "$VNYMR,-004.328,+001.357,+178.257,+00.2219,-00.0720,+00.4652,+00.226,-00.321,+10.043,"
    "-00.001188,+00.001866,-00.007661*6C\r\n");
const Bytes kBinary =
    from_hex("fa 01 09 00 cb 04 fb 71 1f 01 00 00 fa 7e 8a c0 2d b2 ad 3f cb 41 32 43 d0 95");

}  // namespace

// REAL, from the makers' library's tests.
TEST(real_text) {
  const NavSample sample = only(kYmr);
  assert_int_equal(sample.fields, kNavRollPitch | kNavHeadingMagnetic | kNavRates);
  assert_true(sample.kind == NavKind::kAttitude);
  assert_near(degrees(sample.attitude.heading_bam32), -4.328, kBam);
  assert_near(degrees(sample.attitude.pitch_bam32), 1.357, kBam);
  assert_near(degrees(sample.attitude.roll_bam32), 178.257, kBam);
  assert_int_equal(sample.rate_urad_s[0], -1188);
  assert_int_equal(sample.rate_urad_s[1], 1866);
  assert_int_equal(sample.rate_urad_s[2], -7661);

  const NavSample second = only(from_text(
      "$VNYMR,+100.949,-007.330,+000.715,-00.0049,-00.2449,+00.5397,-01.258,-00.100,-09.701,"
      "-00.000018,+00.001122,-00.000551*69\r\n"));
  assert_near(degrees(second.attitude.heading_bam32), 100.949, kBam);
  assert_near(degrees(second.attitude.pitch_bam32), -7.33, kBam);
  assert_near(degrees(second.attitude.roll_bam32), 0.715, kBam);
  assert_int_equal(second.rate_urad_s[0], -18);
}

TEST(real_register_is_ignored) {
  const auto counters = counters_of(from_text("$VNRRG,01,VN-200T-CR*31\r\n"));
  assert_int_equal(counters.frames, 1);
  assert_int_equal(counters.ignored, 1);
  assert_int_equal(counters_of(from_text("$VNERR,03*72\r\n")).nacks, 1);
  // Who reads a file wants it.
  VectorNavConfig config;
  config.every_report = true;
  const NavSample sample = only(from_text("$VNRRG,01,VN-200T-CR*31\r\n"), config);
  assert_true(sample.kind == NavKind::kOther);
  assert_int_equal(sample.fields, 0);
}

// MADE: TimeStartup 1234567890123 ns, YPR (-4.328, 1.357, 178.257).
TEST(made_binary) {
  const NavSample sample = only(kBinary);
  assert_int_equal(sample.fields, kNavRollPitch | kNavHeadingMagnetic);
  assert_int_equal(sample.t_device_us, 1'234'567'890);
  assert_near(degrees(sample.attitude.heading_bam32), -4.328, 3e-7);  // single precision
  assert_near(degrees(sample.attitude.pitch_bam32), 1.357, 3e-7);
  assert_near(degrees(sample.attitude.roll_bam32), 178.257, 1e-5);
  ByteWriter fields(ByteOrder::kLittle);
  fields.u64(1234567890123).f32(-4.328).f32(1.357).f32(178.257);
  assert_true(vectornav_binary({0x01, 0x09, 0x00}, fields.bytes()) == kBinary);
}

TEST(true_heading_is_an_option) {
  VectorNavConfig config;
  config.true_heading = true;
  assert_int_equal(only(kBinary, config).fields, kNavRollPitch | kNavHeading);
  assert_int_equal(only(kYmr, config).fields, kNavRollPitch | kNavHeading | kNavRates);
}

TEST(three_seals) {
  const Motion motion = some_motion();
  for (const auto seal : {VectorNavSeal::kXor, VectorNavSeal::kCrc}) {
    const NavSample sample = only(leadline::emu::vectornav_ymr(motion, seal));
    assert_near(degrees(sample.attitude.roll_bam32), -12.5, kBam);
  }
  const Bytes unchecked = leadline::emu::vectornav_ymr(motion, VectorNavSeal::kUnchecked);
  assert_int_equal(counters_of(unchecked).bad_checksum, 1);
  VectorNavConfig config;
  config.accept_unchecked = true;
  assert_near(degrees(only(unchecked, config).attitude.pitch_bam32), 7.25, kBam);
  assert_int_equal(counters_of(from_text("$VNYMR,1*6\r\n"), config).bad_checksum, 1);
  assert_int_equal(counters_of(from_text("$VNYMR,1\r\n"), config).bad_checksum, 1);
}

// The quaternion turns body axes into NED: about the bow by a positive angle puts starboard down.
TEST(quaternion_and_angles_agree) {
  leadline::test::Random random(5);
  for (int i = 0; i < 300; ++i) {
    Motion motion = some_motion();
    motion.roll_deg = static_cast<double>(random.between(-1790, 1790)) / 10;
    motion.pitch_deg = static_cast<double>(random.between(-850, 850)) / 10;
    motion.heading_deg = static_cast<double>(random.between(0, 3599)) / 10;
    const NavSample angles = only(leadline::emu::vectornav_common(motion));
    const NavSample turned = only(leadline::emu::vectornav_quaternion(motion));
    assert_int_equal(turned.fields, angles.fields);
    assert_near(degrees(turned.attitude.roll_bam32 - angles.attitude.roll_bam32), 0, 3e-4);
    assert_near(degrees(turned.attitude.pitch_bam32 - angles.attitude.pitch_bam32), 0, 3e-4);
    assert_near(degrees(turned.attitude.heading_bam32 - angles.attitude.heading_bam32), 0, 3e-4);
    assert_int_equal(turned.t_device_us, 1'234'567'891);
    assert_int_equal(turned.rate_urad_s[2], 500'000);
  }
}

// A quaternion by hand: w = x = sqrt(1/2), a quarter turn about the bow, starboard straight down.
TEST(quaternion_by_hand) {
  ByteWriter fields(ByteOrder::kLittle);
  fields.f32(std::sqrt(0.5)).f32(0).f32(0).f32(std::sqrt(0.5));
  const NavSample sample = only(vectornav_binary({0x10, 0x04, 0x00}, fields.bytes()));
  assert_near(degrees(sample.attitude.roll_bam32), 90, 1e-5);
  assert_near(degrees(sample.attitude.pitch_bam32), 0, 1e-5);
}

TEST(groups_in_order) {
  // Common: rate; IMU: temperature; attitude: YPR and YprU; INS: status, position, velocity NED, sigmas.
  ByteWriter fields(ByteOrder::kLittle);
  fields.f32(1).f32(2).f32(3);
  fields.f32(21.5);
  fields.f32(10).f32(20).f32(30).f32(0.5).f32(0.25).f32(1.5);
  fields.u16(0x0006).f64(48.5).f64(-123.25).f64(12.0).f32(1.5).f32(-2.5).f32(0.5).f32(0.75).f32(
      0.05);
  const Bytes frame =
      vectornav_binary({0x35, 0x20, 0x00, 0x10, 0x00, 0x02, 0x01, 0x13, 0x06}, fields.bytes());
  VectorNavCodec codec(VectorNavConfig{});
  const auto samples = samples_of(codec, frame);
  assert_int_equal(samples.size(), 2);
  assert_true(samples[0].kind == NavKind::kAttitude);
  assert_int_equal(samples[0].fields, kNavRollPitch | kNavHeadingMagnetic | kNavRates);
  assert_near(degrees(samples[0].attitude.roll_bam32), 30, kBam);
  assert_int_equal(samples[0].rate_urad_s[1], 2'000'000);
  assert_int_equal(samples[0].sigma_attitude_urad[2], 8727);  // yaw 0.5 degrees
  assert_int_equal(samples[0].sigma_attitude_urad[0], 26180);
  assert_true(samples[1].kind == NavKind::kPosition);
  assert_int_equal(samples[1].fields, kNavGeodetic | kNavVelocityWorld);
  assert_int_equal(samples[1].latitude_e9deg, 48'500'000'000);
  assert_int_equal(samples[1].longitude_e9deg, -123'250'000'000);
  assert_int_equal(samples[1].velocity_um_s[1], -2'500'000);
  assert_int_equal(samples[1].sigma_position_mm, 750);
  assert_int_equal(samples[1].sigma_velocity_um_s, 50'000);
}

TEST(ins_that_does_not_track_knows_nothing) {
  ByteWriter fields(ByteOrder::kLittle);
  fields.u16(0x0001).f64(48.5).f64(-123.25).f64(12.0);
  const NavSample sample = only(vectornav_binary({0x20, 0x03, 0x00}, fields.bytes()));
  assert_true(sample.kind == NavKind::kPosition);
  assert_int_equal(sample.fields, 0);
  assert_int_equal(sample.latitude_e9deg, 0);
}

TEST(rates_alone) {
  ByteWriter fields(ByteOrder::kLittle);
  fields.f32(0.5).f32(-0.5).f32(0.25);
  const NavSample sample = only(vectornav_binary({0x04, 0x00, 0x04}, fields.bytes()));
  assert_true(sample.kind == NavKind::kRates);
  assert_int_equal(sample.fields, kNavRates);
  assert_int_equal(sample.rate_urad_s[1], -500'000);
}

TEST(values_that_no_sensor_sends) {
  const auto bad = [](const std::function<void(ByteWriter&)>& fill, const Bytes& header) {
    ByteWriter fields(ByteOrder::kLittle);
    fill(fields);
    return counters_of(vectornav_binary(header, fields.bytes())).bad_values;
  };
  const double nan = std::nan("");
  assert_int_equal(bad([&](ByteWriter& w) { w.f32(nan).f32(0).f32(0); }, {1, 0x08, 0}), 1);
  assert_int_equal(bad([&](ByteWriter& w) { w.f32(0).f32(90.5).f32(0); }, {1, 0x08, 0}), 1);
  assert_int_equal(bad([&](ByteWriter& w) { w.f32(0).f32(0).f32(0).f32(0); }, {1, 0x10, 0}), 1);
  assert_int_equal(bad([&](ByteWriter& w) { w.f32(1e5).f32(0).f32(0); }, {1, 0x20, 0}), 1);
  assert_int_equal(bad([&](ByteWriter& w) { w.f64(91).f64(0).f64(0); }, {1, 0x40, 0}), 1);
  assert_int_equal(bad([&](ByteWriter& w) { w.f32(nan).f32(0).f32(0); }, {1, 0x80, 0}), 1);
  const auto text = [](const std::string& body) {
    return counters_of(leadline::emu::vectornav_text(body, VectorNavSeal::kXor)).bad_values;
  };
  assert_int_equal(text("VNYMR,1,2,3,4,5,6,7,8,9,10,11"), 1);
  assert_int_equal(text("VNYMR,1,95,3,4,5,6,7,8,9,0,0,0"), 1);
  assert_int_equal(text("VNYMR,1,2,x,4,5,6,7,8,9,0,0,0"), 1);
}

TEST(frames_of_unknown_length) {
  assert_int_equal(counters_of(from_hex("fa 00 00")).unknown_id, 1);
  assert_int_equal(counters_of(from_hex("fa 80 00")).unknown_id, 1);
  assert_int_equal(counters_of(from_hex("fa 01 00 00")).bad_length, 1);  // no field at all
  assert_int_equal(counters_of(from_hex("fa 01 00 80")).bad_length, 1);  // a bit without a meaning
  // Only the temperature: none of ours.
  ByteWriter fields(ByteOrder::kLittle);
  fields.f32(20);
  assert_int_equal(counters_of(vectornav_binary({4, 0x10, 0}, fields.bytes())).ignored, 1);
}

TEST(damage_costs_one_frame) {
  for (const Bytes& frame : {kYmr, kBinary, leadline::emu::vectornav_quaternion(some_motion())}) {
    leadline::test::check_damage_costs_one_frame<VectorNavCodec>(VectorNavConfig{}, frame);
    leadline::test::check_noise<VectorNavCodec>(VectorNavConfig{}, frame);
  }
  leadline::test::check_damage_is_noticed<VectorNavCodec>(VectorNavConfig{}, kBinary);
}

TEST(text_and_binary_mixed) {
  VectorNavCodec codec(VectorNavConfig{});
  assert_int_equal(samples_of(codec, kYmr + kBinary + kYmr + kBinary + kBinary).size(), 5);
  assert_int_equal(codec.counters().skipped_bytes, 0);
}

TEST(restart_forgets) {
  VectorNavCodec codec(VectorNavConfig{});
  samples_of(codec, Bytes(kBinary.begin(), kBinary.begin() + 12));
  codec.restart();
  assert_int_equal(samples_of(codec, kBinary).size(), 1);
  assert_int_equal(codec.counters().skipped_bytes, 12);
}
