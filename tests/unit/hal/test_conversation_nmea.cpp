// The NMEA codec listens to an emulated talker.
#include "hal/attitude/nmea.hpp"
#include "hal/emu/faulty_stream.hpp"
#include "hal/emu/nmea_talker.hpp"
#include "tests/support/device_bytes.hpp"
#include "tests/support/ping_line.hpp"

namespace {

using leadline::base::NavSample;
using leadline::base::TimeUs;
using leadline::emu::FaultConfig;
using leadline::emu::FaultyStream;
using leadline::emu::NmeaKind;
using leadline::emu::NmeaTalker;
using leadline::emu::NmeaTalkerConfig;
using leadline::emu::NmeaTruth;
using leadline::hal::NmeaCodec;
using leadline::test::Bytes;

constexpr TimeUs kSecond_us = 1'000'000;

TEST(nmea_talker_is_understood) {
  NmeaTruth truth;
  truth.roll_deg = -3.25;
  truth.pitch_deg = 7.5;
  truth.heading_deg = 359.999;
  truth.magnetic_heading_deg = 1.5;
  truth.sigma_roll_deg = 0.1;
  truth.sigma_heading_deg = 0.5;
  truth.latitude_deg = -35.123456789;
  truth.longitude_deg = 150.987654321;
  truth.pressure_pa = 250'000;
  truth.depth_m = 12.345;
  truth.altitude_m = 4.567;
  truth.time_of_day_s = 3661.25;
  NmeaTalkerConfig config;
  const NmeaKind kinds[] = {NmeaKind::kHdg,        NmeaKind::kHdm,   NmeaKind::kHdt,
                            NmeaKind::kPashr,      NmeaKind::kPrdid, NmeaKind::kPrvatPressure,
                            NmeaKind::kPrvatDepth, NmeaKind::kDbt,   NmeaKind::kDpt,
                            NmeaKind::kGga};
  TimeUs first_us = 0;
  for (const NmeaKind kind : kinds) {
    config.schedule.push_back({kind, 100'000, first_us});
    first_us += 10'000;
  }
  config.latency_us = 2000;
  config.byte_time_ns = 86'806;
  NmeaTalker talker(config, [&truth](TimeUs) { return truth; });
  NmeaCodec codec({});
  std::vector<NavSample> samples;
  NavSample sample{};
  while (talker.next_event_us() < 95'000) {
    const TimeUs t_us = talker.next_event_us();
    Bytes bytes;
    talker.advance(t_us, bytes);
    for (const std::uint8_t byte : bytes) {
      if (codec.feed(byte, t_us, sample)) {
        samples.push_back(sample);
      }
    }
  }
  Bytes rest;
  talker.advance(99'999, rest);
  for (const std::uint8_t byte : rest) {
    if (codec.feed(byte, 99'999, sample)) {
      samples.push_back(sample);
    }
  }
  assert_int_equal(samples.size(), 10);
  const auto degrees = [](std::uint32_t bam32) {
    return static_cast<std::int32_t>(bam32) * 360.0 / 4294967296.0;
  };
  assert_near(degrees(samples[0].attitude.heading_bam32), 1.5, 1e-6);
  assert_near(degrees(samples[1].attitude.heading_bam32), 1.5, 1e-6);
  assert_near(degrees(samples[2].attitude.heading_bam32), -0.001, 1e-6);
  assert_near(degrees(samples[3].attitude.roll_bam32), -3.25, 1e-6);
  assert_near(degrees(samples[3].attitude.pitch_bam32), 7.5, 1e-6);
  assert_int_equal(samples[3].sigma_attitude_urad[0], 1745);
  assert_int_equal(samples[3].utc_us, 3'661'250'000);
  assert_near(degrees(samples[4].attitude.roll_bam32), -3.25, 1e-6);
  assert_int_equal(samples[5].pressure_pa, 250'000);
  assert_int_equal(samples[5].altitude_um, 4'567'000);
  assert_int_equal(samples[6].depth_um, 12'345'000);
  assert_int_equal(samples[7].altitude_um, 4'567'000);
  assert_int_equal(samples[8].altitude_um, 4'567'000);
  assert_near(static_cast<double>(samples[9].latitude_e9deg), -35.123456789e9, 1.0);
  assert_near(static_cast<double>(samples[9].longitude_e9deg), 150.987654321e9, 1.0);
  assert_int_equal(samples[9].quality, 255);
  assert_int_equal(codec.counters().records, 10);
  talker.set_silent(true);
  Bytes silence;
  talker.advance(kSecond_us, silence);
  assert_int_equal(silence.size(), 0);
}

TEST(nmea_without_a_fix) {
  NmeaTruth truth;
  truth.fix_quality = 0;
  NmeaCodec codec({});
  NavSample sample{};
  for (const char c : leadline::emu::nmea_sentence(NmeaKind::kGga, truth)) {
    if (codec.feed(static_cast<std::uint8_t>(c), 0, sample)) {
      assert_int_equal(sample.fields, 0);  // a position that is not known
    }
  }
  assert_int_equal(codec.counters().no_data, 1);
}

TEST(nmea_over_a_bad_line) {
  NmeaTalkerConfig config;
  config.schedule.push_back({NmeaKind::kPashr, 20'000, 0});
  config.schedule.push_back({NmeaKind::kPrvatPressure, 100'000, 0});
  NmeaTalker talker(config, [](TimeUs t_us) {
    NmeaTruth truth;
    truth.heading_deg = static_cast<double>(t_us) / 1e6;
    return truth;
  });
  FaultConfig bad;
  bad.drop_ppm = 1000;
  bad.corrupt_ppm = 1000;
  bad.repeat_ppm = 1000;
  FaultyStream line(bad);
  NmeaCodec codec({});
  NavSample sample{};
  std::size_t wrong = 0;
  for (TimeUs t_us = 0; t_us < 200 * kSecond_us; t_us += 10'000) {
    Bytes sent;
    talker.advance(t_us, sent);
    Bytes arrived;
    line.pass(t_us, sent, arrived);
    for (const std::uint8_t byte : arrived) {
      if (codec.feed(byte, t_us, sample) && (sample.fields & leadline::base::kNavHeading) != 0) {
        const double heading = sample.attitude.heading_bam32 * 360.0 / 4294967296.0;
        wrong += std::fabs(heading - static_cast<double>(t_us) / 1e6) > 0.001 ? 1 : 0;
      }
    }
  }
  const auto& c = codec.counters();
  assert_true(c.records > 9000 && c.bad_checksum > 500);
  assert_true(wrong <= 2);  // an XOR of eight bits lets a few double errors pass
}

}  // namespace
