#include "hal/attitude/tss1.hpp"
#include "hal/emu/talker.hpp"
#include "hal/emu/tss1_sensor.hpp"
#include "tests/support/nav_streams.hpp"

namespace {

using leadline::base::NavSample;
using leadline::hal::Tss1Codec;
using leadline::hal::Tss1Config;
using leadline::test::Bytes;
using leadline::test::degrees;
using leadline::test::from_text;
using leadline::test::samples_of;
using namespace leadline::base;  // NOLINT: the bits' names

constexpr double kBam = 2e-5;  // the sine table's error, in degrees

NavSample only(const std::string& line, const Tss1Config& config = {}) {
  return leadline::test::only_sample<Tss1Codec>(config, from_text(line + "\r\n"));
}

std::size_t count(const std::string& text, leadline::hal::CodecCounters* counters = nullptr) {
  Tss1Codec codec(Tss1Config{});
  const std::size_t records = samples_of(codec, from_text(text)).size();
  if (counters != nullptr) {
    *counters = codec.counters();
  }
  return records;
}

}  // namespace

// docs.novatel.com, REAL: heave -3 cm (up positive), status F, roll -3.25, pitch +3.19 degrees.
TEST(real_line) {
  const NavSample sample = only(":00FFCA -0003F-0325  0319");
  assert_int_equal(sample.fields, kNavRollPitch | kNavHeave);
  assert_true(sample.kind == NavKind::kAttitude);
  assert_int_equal(sample.quality, 255);
  assert_int_equal(sample.heave_um, 30'000);  // down positive here
  assert_near(degrees(sample.attitude.pitch_bam32), 3.19, kBam);
  // sin(roll_tss) = sin(roll) cos(pitch): -3.25 over cos 3.19 is -3.25504.
  assert_near(degrees(sample.attitude.roll_bam32), -3.255045, kBam);
  Tss1Config config;
  config.euler_roll = true;
  assert_near(degrees(only(":00FFCA -0003F-0325  0319", config).attitude.roll_bam32), -3.25, kBam);
}

// Port side up is starboard down; bow up is positive in both; up is minus down.
TEST(signs) {
  const NavSample sample = only(":000000  0012U 0200 -0500");
  assert_true(degrees(sample.attitude.roll_bam32) > 1.9);
  assert_near(degrees(sample.attitude.pitch_bam32), -5.0, kBam);
  assert_int_equal(sample.heave_um, -120'000);
}

// Bow up 60 degrees and Euler roll 40 degrees: the athwartships axis points 0.5 sin 40 down,
// asin(0.321394) = 18.7470 degrees.
TEST(large_angles) {
  const NavSample sample = only(":000000  0000F 1875  6000");
  assert_near(degrees(sample.attitude.roll_bam32), 40.0, 0.02);
  assert_int_equal(count(":000000  0000F 6000  6000\r\n"), 0);  // no attitude has both
  assert_near(degrees(only(":000000  0000F 3000  6000").attitude.roll_bam32), 90.0, 0.05);
  assert_int_equal(count(":000000  0000F 9001  0000\r\n"), 0);
  assert_int_equal(count(":000000  0000F 0000 -9001\r\n"), 0);
}

TEST(unsettled_has_no_heave) {
  for (const char status : {'u', 'g', 'h', 'f'}) {
    const NavSample sample = only(std::string(":000000  0100") + status + " 0100  0100");
    assert_int_equal(sample.fields, kNavRollPitch);
    assert_int_equal(sample.quality, Tss1Codec::kUnsettledQuality);
    assert_int_equal(sample.heave_um, 0);
  }
  for (const char status : {'U', 'G', 'H', 'F'}) {
    assert_int_equal(only(std::string(":000000  0100") + status + " 0100  0100").quality, 255);
  }
}

// devices.md 8, trap 7: a collapsed double space is a damaged line.
TEST(columns_are_fixed) {
  leadline::hal::CodecCounters counters{};
  assert_int_equal(count(":00FFCA -0003F-0325 0319\r\n", &counters), 0);
  assert_int_equal(counters.bad_length, 1);
  assert_int_equal(count(":00FFCA -0003X-0325  0319\r\n"), 0);
  assert_int_equal(count(":00FFGA -0003F-0325  0319\r\n"), 0);
  assert_int_equal(count(":00FFCA +0003F-0325  0319\r\n"), 0);
  assert_int_equal(count(":00FFCA -0003F-0325  0319\n\n"), 0);
}

TEST(emulated_lines_come_back) {
  leadline::test::Random random(4);
  for (int i = 0; i < 500; ++i) {
    leadline::emu::Motion motion;
    motion.roll_deg = static_cast<double>(random.between(-6000, 6000)) / 100;
    motion.pitch_deg = static_cast<double>(random.between(-6000, 6000)) / 100;
    motion.heave_m = static_cast<double>(random.between(-999, 999)) / 100;
    const NavSample sample =
        leadline::test::only_sample<Tss1Codec>(Tss1Config{}, leadline::emu::tss1_line(motion));
    // Half a hundredth on the wire, up to four times that in the Euler angle.
    assert_near(degrees(sample.attitude.roll_bam32), motion.roll_deg, 0.021);
    assert_near(degrees(sample.attitude.pitch_bam32), motion.pitch_deg, 0.0051);
    assert_near(sample.heave_um, -motion.heave_m * 1e6, 0.5);
  }
}

TEST(damage_costs_one_line) {
  leadline::emu::Motion motion;
  motion.roll_deg = -12.34;
  motion.pitch_deg = 5.67;
  const Bytes line = leadline::emu::tss1_line(motion);
  leadline::test::check_damage_costs_one_frame<Tss1Codec>(Tss1Config{}, line);
  leadline::test::check_noise<Tss1Codec>(Tss1Config{}, line);
}

TEST(time_is_the_first_byte) {
  Tss1Config config;
  config.byte_time_ns = 1'041'667;  // 9600 baud
  const auto bytes = from_text(":000000  0000F 0000  0000\r\n");
  Tss1Codec codec(config);
  const auto samples = samples_of(codec, bytes, 1'000'000);
  assert_int_equal(samples.size(), 1);
  assert_int_equal(samples[0].t_us, 1'000'000 - 28'125);
}

TEST(talks_at_its_rate) {
  leadline::emu::Talker talker({2'000, 86'806}, {{[](std::int64_t t_us) {
                                                    leadline::emu::Motion motion;
                                                    motion.pitch_deg =
                                                        static_cast<double>(t_us) / 1e5;
                                                    return leadline::emu::tss1_line(motion);
                                                  },
                                                  100'000, 0}});
  leadline::emu::Bytes out;
  Tss1Codec codec(Tss1Config{});
  std::vector<NavSample> samples;
  while (talker.next_event_us() < 1'000'000) {
    const std::int64_t now_us = talker.next_event_us();
    out.clear();
    talker.take(now_us, nullptr, 0);
    talker.advance(now_us, out);
    for (const NavSample& sample : samples_of(codec, out, now_us)) {
      samples.push_back(sample);
    }
  }
  assert_int_equal(samples.size(), 10);
  assert_near(degrees(samples[9].attitude.pitch_bam32), 9.0, 1e-3);
  assert_near(samples[9].t_us, 900'000 + 2'000 + 27 * 86.806, 30);
  talker.set_silent(true);
  out.clear();
  talker.advance(5'000'000, out);
  assert_int_equal(out.size(), 0);
}

TEST(restart_forgets_half_a_line) {
  Tss1Codec codec(Tss1Config{});
  const Bytes line = from_text(":000000  0000F 0000  0000\r\n");
  samples_of(codec, Bytes(line.begin(), line.begin() + 10));
  codec.restart();
  assert_int_equal(samples_of(codec, Bytes(line.begin() + 10, line.end())).size(), 0);
  assert_int_equal(samples_of(codec, line).size(), 1);
}
