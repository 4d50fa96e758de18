#include <cmath>

#include "hal/emu/emulated_deltat.hpp"
#include "hal/heads/deltat83p.hpp"
#include "hal/wire.hpp"
#include "tests/support/head_line.hpp"

namespace {

using leadline::base::NavKind;
using leadline::base::Ping;
using leadline::base::ReturnKind;
using leadline::emu::DeltatEcho;
using leadline::emu::DeltatShot;
using leadline::emu::EmulatedDeltat;
using leadline::emu::EmulatedDeltatConfig;
using leadline::hal::Deltat83pCodec;
using leadline::hal::Deltat83pConfig;
using leadline::hal::read_u16_be;
using leadline::hal::write_u16_be;
using leadline::test::Bytes;
using leadline::test::degrees;
using leadline::test::records_of;
using leadline::test::samples_of;
using leadline::test::operator+;

constexpr std::int64_t kSecond_us = 1'000'000;

/// The bottom 8 m under a head; nothing on beam 3.
DeltatEcho bottom(const DeltatShot& shot) {
  DeltatEcho echo;
  for (int i = 0; i < shot.beams; ++i) {
    const double angle = (shot.start_deg + i * shot.increment_deg) * 3.14159265358979 / 180;
    const double range = 8 / std::cos(angle);
    echo.range_m.push_back(i == 3 || range > shot.range_m ? 0 : range);
  }
  echo.pitch_deg = -3.2;
  echo.roll_deg = 4.5;
  echo.heading_deg = 271.3;
  return echo;
}

/// Packets as a head sends them, all bytes at once.
Bytes packets(const EmulatedDeltatConfig& config, const EmulatedDeltat::Measure& measure = bottom,
              int count = 1) {
  EmulatedDeltat head(config, measure);
  Bytes out;
  head.advance(config.interval_us * (count - 1) + 90'000, out);
  return out;
}

Bytes packet() { return packets({}); }

void check_rejected(const Bytes& bytes) {
  Deltat83pCodec codec({});
  assert_int_equal(records_of<Ping>(codec, bytes).size(), 0);
  assert_int_equal(leadline::hal::rejected(codec.counters()), 1);
  // And what follows is read.
  assert_int_equal(records_of<Ping>(codec, packet()).size(), 120);
}

Bytes with_u16(Bytes bytes, std::size_t at, unsigned value) {
  write_u16_be(bytes.data() + at, static_cast<std::uint16_t>(value));
  return bytes;
}

}  // namespace

TEST(beams_of_a_packet) {
  Deltat83pConfig config;
  config.mount = 3;
  Deltat83pCodec codec(config);
  const auto pings = records_of<Ping>(codec, packet(), kSecond_us);
  assert_int_equal(pings.size(), 120);
  for (std::size_t i = 0; i < pings.size(); ++i) {
    const Ping& ping = pings[i];
    const double angle_deg = -59.5 + static_cast<double>(i);
    assert_int_equal(ping.azimuth_bam32, leadline::base::kBam32QuarterTurn);
    assert_near(90 - degrees(ping.elevation_bam32), angle_deg, 1e-6);
    assert_int_equal(ping.mount, 3);
    assert_int_equal(ping.sound_speed_mm_s, 1'500'000);
    assert_int_equal(ping.t_transmit_us, kSecond_us - 26'666);
    if (i == 3) {
      assert_int_equal(ping.kind, ReturnKind::kNoReturn);
      assert_int_equal(ping.range_um, 0);
      assert_int_equal(ping.t_receive_us, kSecond_us);
      continue;
    }
    assert_int_equal(ping.kind, ReturnKind::kRange);
    // Counts of 40 mm.
    assert_near(static_cast<double>(ping.range_um) * 1e-6,
                8 / std::cos(angle_deg * 3.14159265358979 / 180), 0.0201);
    assert_int_equal(ping.range_um % 40'000, 0);
  }
  assert_int_equal(codec.counters().records, 120);
  Deltat83pConfig mirrored;
  mirrored.positive_to_starboard = false;
  Deltat83pCodec other(mirrored);
  assert_near(90 - degrees(records_of<Ping>(other, packet())[0].elevation_bam32), 59.5, 1e-6);
}

TEST(intensities_and_latency) {
  EmulatedDeltatConfig config;
  config.data_latency_us = 33'300;
  config.beams = 480;
  const auto loud = [](const DeltatShot& shot) {
    DeltatEcho echo = bottom(shot);
    echo.intensity.assign(static_cast<std::size_t>(shot.beams), 0x8383);
    return echo;
  };
  const Bytes bytes = packets(config, loud);
  assert_int_equal(bytes.size(), 256 + 4 * 480);
  Deltat83pCodec codec({});
  const auto pings = records_of<Ping>(codec, bytes, kSecond_us);
  assert_int_equal(pings.size(), 480);
  assert_int_equal(pings[0].t_transmit_us, kSecond_us - 33'300);
  // A ping latency shortens the way from the ping to the packet.
  Bytes late = with_u16(bytes, 118, 33);
  late[123] = 1;
  assert_int_equal(records_of<Ping>(codec, late, kSecond_us)[0].t_transmit_us, kSecond_us - 30'000);
  assert_int_equal(codec.option_flags(), 1);
}

TEST(attitude_by_its_valid_bits) {
  Deltat83pCodec codec({});
  const Bytes bytes = packet();
  records_of<Ping>(codec, bytes, kSecond_us);
  auto samples = samples_of(codec);
  assert_int_equal(samples.size(), 2);
  assert_int_equal(samples[0].kind, NavKind::kAttitude);
  assert_int_equal(samples[0].fields,
                   leadline::base::kNavRollPitch | leadline::base::kNavHeadingMagnetic);
  assert_near(degrees(samples[0].attitude.roll_bam32), 4.5, 1e-6);
  assert_near(degrees(samples[0].attitude.pitch_bam32), -3.2, 1e-6);
  assert_near(degrees(samples[0].attitude.heading_bam32), 271.3 - 360, 1e-6);
  assert_int_equal(samples[0].t_us, kSecond_us - 26'666);
  assert_int_equal(samples[0].t_device_us, 1'795'305'600'000'000);  // 2026-11-22 00:00:00
  assert_int_equal(samples[1].kind, NavKind::kPosition);
  assert_int_equal(samples[1].fields, 0);
  // Without the bit of one of the two there is no tilt; without any, nothing.
  records_of<Ping>(codec, with_u16(bytes, 64, 868));
  assert_int_equal(samples_of(codec)[0].fields, leadline::base::kNavHeadingMagnetic);
  const auto blind = [](const DeltatShot& shot) {
    DeltatEcho echo = bottom(shot);
    echo.has_attitude = false;
    return echo;
  };
  records_of<Ping>(codec, packets({}, blind));
  samples = samples_of(codec);
  assert_int_equal(samples[0].fields, 0);
  assert_int_equal(samples[0].quality, 0);
  Deltat83pConfig config;
  config.roll_positive = false;
  config.pitch_positive = false;
  config.heading_is_true = true;
  Deltat83pCodec other(config);
  records_of<Ping>(other, bytes);
  samples = samples_of(other);
  assert_near(degrees(samples[0].attitude.roll_bam32), -4.5, 1e-6);
  assert_near(degrees(samples[0].attitude.pitch_bam32), 3.2, 1e-6);
  assert_int_equal(samples[0].fields, leadline::base::kNavRollPitch | leadline::base::kNavHeading);
}

TEST(position_of_the_ship) {
  const auto at = [](const char* latitude, const char* longitude) {
    Deltat83pCodec codec({});
    records_of<Ping>(codec, packets({}, [&](const DeltatShot& shot) {
                       DeltatEcho echo = bottom(shot);
                       echo.latitude = latitude;
                       echo.longitude = longitude;
                       return echo;
                     }));
    const auto samples = samples_of(codec);
    return samples.size() == 2 ? samples[1] : leadline::base::NavSample{};
  };
  auto sample = at(" 49.16.12345 N", "123.06.54321 W");
  assert_int_equal(sample.fields, leadline::base::kNavGeodetic);
  assert_int_equal(sample.latitude_e9deg, 49'268'724'167);
  assert_int_equal(sample.longitude_e9deg, -123'109'053'500);
  sample = at(" 05.30.00000 S", "  7.30.00000 E");
  assert_int_equal(sample.latitude_e9deg, -5'500'000'000);
  assert_int_equal(sample.longitude_e9deg, 7'500'000'000);
  assert_int_equal(at(" 49.61.12345 N", "123.06.54321 W").fields, 0);
  assert_int_equal(at(" 49.16.12345 X", "123.06.54321 W").fields, 0);
  assert_int_equal(at("              ", "              ").fields, 0);
}

TEST(impossible_packets_are_dropped) {
  const Bytes bytes = packet();
  check_rejected(with_u16(bytes, 4, 498));  // a length that does not fit the beams
  check_rejected(with_u16(bytes, 70, 0));
  check_rejected(with_u16(bytes, 70, 481));
  check_rejected(with_u16(bytes, 74, 181));            // sector
  check_rejected(with_u16(bytes, 76, 30'000));         // start angle: up
  check_rejected(with_u16(bytes, 79, 0));              // range
  check_rejected(with_u16(bytes, 81, 3'000));          // frequency
  check_rejected(with_u16(bytes, 83, 0xFFFF));         // sound speed
  check_rejected(with_u16(bytes, 85, 0));              // resolution
  check_rejected(with_u16(bytes, 64, 0xFFFF));         // pitch
  check_rejected(with_u16(bytes, 68, 0x8000 | 3601));  // heading
  check_rejected(with_u16(bytes, 256, 551));           // 22.04 m where it listened to 20
  Bytes other = bytes;
  other[10] = '/';
  check_rejected(other);
  other = bytes;
  other[11] = 'X';
  check_rejected(other);
  other = bytes;
  other[2] = 'B';  // raw data
  check_rejected(other);
}

TEST(the_farthest_range_is_believed) {
  Deltat83pCodec codec({});
  const auto pings = records_of<Ping>(codec, with_u16(packet(), 256, 550));
  assert_int_equal(pings[0].range_um, 22'000'000);
}

TEST(damage_costs_one_frame) {
  EmulatedDeltatConfig config;
  config.beams = 20;
  config.sector_deg = 40;
  const Bytes frame = packets(config);
  for (std::size_t position = 0; position < frame.size(); ++position) {
    // A packet without a checksum may survive the loss of a byte of its ranges; those behind it must.
    Deltat83pCodec codec({});
    const auto pings =
        records_of<Ping>(codec, leadline::test::without(frame, position) + frame + frame);
    assert_true(pings.size() == 40 || pings.size() == 60);
    Deltat83pCodec other({});
    const Bytes cut(frame.begin(), frame.begin() + static_cast<std::ptrdiff_t>(position));
    assert_true(records_of<Ping>(other, cut + frame + frame).size() >= 20);
  }
}

TEST(a_stream) {
  EmulatedDeltatConfig config;
  Deltat83pCodec codec({});
  const Bytes bytes = packets(config, bottom, 50);
  std::size_t count = 0;
  Ping ping{};
  for (const std::uint8_t byte : bytes) {
    count += codec.feed(byte, 0, ping) ? 1U : 0U;  // left undrained: nothing is lost
  }
  while (codec.next(ping)) {
    ++count;
  }
  assert_int_equal(count, 50 * 120);
  assert_int_equal(samples_of(codec).back().t_device_us, 1'795'305'600'000'000 + 4'900'000);
  codec.restart();
  assert_int_equal(records_of<Ping>(codec, packet()).size(), 120);
}
