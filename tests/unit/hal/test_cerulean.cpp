#include <cmath>
#include <cstring>

#include "hal/emu/emulated_cerulean.hpp"
#include "hal/heads/cerulean.hpp"
#include "hal/heads/float_fields.hpp"
#include "hal/heads/ping_protocol.hpp"
#include "tests/support/head_line.hpp"

namespace {

using leadline::base::NavKind;
using leadline::base::NavSample;
using leadline::base::Ping;
using leadline::base::ReturnKind;
using leadline::base::TimeUs;
using leadline::emu::CeruleanEcho;
using leadline::emu::CeruleanModel;
using leadline::emu::CeruleanShot;
using leadline::emu::EmulatedCerulean;
using leadline::emu::EmulatedCeruleanConfig;
using leadline::emu::PayloadWriter;
using leadline::emu::ping_frame;
using leadline::hal::CeruleanCodec;
using leadline::hal::CeruleanConfig;
using leadline::hal::CeruleanHead;
using leadline::hal::CeruleanPoints;
using leadline::test::Bytes;
using leadline::test::degrees;
using leadline::test::from_hex;
using leadline::test::HeadLine;
using leadline::test::Random;
using leadline::test::random_bytes;
using leadline::test::records_of;
using leadline::test::samples_of;
using leadline::test::operator+;

std::uint32_t bits_of(double value) {
  const auto narrow = static_cast<float>(value);
  std::uint32_t bits = 0;
  std::memcpy(&bits, &narrow, sizeof bits);
  return bits;
}

struct AtofPoint {
  double angle_rad;
  double two_way_s;
};

Bytes atof(const std::vector<AtofPoint>& points, double speed = 1500, double listening = 0.02,
           std::uint32_t number = 7, int claimed = -1) {
  PayloadWriter out;
  out.u32(1000).u32(0).u32(0).u32(bits_of(listening)).u32(bits_of(speed)).u32(number);
  out.u32(240'000).u32(bits_of(0.0001)).u32(0);
  out.u16(claimed < 0 ? static_cast<unsigned>(points.size()) : static_cast<unsigned>(claimed));
  out.u16(0);
  for (const auto& point : points) {
    out.u32(bits_of(point.angle_rad)).u32(bits_of(point.two_way_s)).u32(0).u32(0);
  }
  return ping_frame(3012, 1, 0, out.payload());
}

struct OsPoint {
  double angle_rad;
  double two_way_s;
  double power;
  unsigned kind;
};

Bytes os3d(const std::vector<OsPoint>& points, unsigned version = 1, unsigned device = 0) {
  PayloadWriter out;
  out.u32(1).u32(bits_of(1480)).u16(static_cast<unsigned>(points.size())).u16(0).u32(0);
  out.u32(0).u32(0).u32(1234).u8(version).u8(device).u8(0).u8(0);
  out.u32(bits_of(3)).u32(bits_of(-2)).u32(bits_of(-5)).bytes(Bytes(36, 0));
  for (const auto& point : points) {
    out.u32(bits_of(point.angle_rad)).u32(bits_of(point.two_way_s)).u32(bits_of(point.power));
    out.u8(point.kind).u8(0).u8(0).u8(0);
  }
  return ping_frame(3104, 1, 0, out.payload());
}

Bytes yz(const std::vector<std::pair<double, double>>& points, std::uint32_t number) {
  PayloadWriter out;
  out.u32(1000).u32(number).u32(bits_of(1500)).bytes(Bytes(64, 0));
  out.u32(bits_of(-1000)).u32(bits_of(-1000)).u32(0).u32(0).u32(bits_of(20)).u16(0);
  out.u16(static_cast<unsigned>(points.size()));
  for (const auto& point : points) {
    out.u32(bits_of(point.first)).u32(bits_of(point.second));
  }
  return ping_frame(3011, 1, 0, out.payload());
}

Bytes attitude(double forward, double port, double up, std::uint64_t utc_ms = 0,
               bool channel = false) {
  PayloadWriter out;
  out.u32(bits_of(forward)).u32(bits_of(port)).u32(bits_of(up)).bytes(Bytes(12, 0));
  out.u32(static_cast<std::uint32_t>(utc_ms)).u32(static_cast<std::uint32_t>(utc_ms >> 32U));
  out.u32(5000);
  if (channel) {
    out.u8(0);
  }
  return ping_frame(504, 1, 0, out.payload());
}

Bytes mono_profile(const std::vector<unsigned>& results, double low_db = 10, double high_db = 90,
                   unsigned channel = 0, unsigned speed_dm_s = 15'000) {
  PayloadWriter out;
  out.u32(3).u32(1000).u32(10'000).u32(99).u32(450'000).u16(3);
  out.u16(static_cast<unsigned>(results.size())).u16(speed_dm_s).u8(channel).u8(0);
  out.u32(bits_of(0.0001)).u32(bits_of(1)).u32(bits_of(high_db)).u32(bits_of(low_db));
  out.u32(0).u32(0);
  for (const unsigned value : results) {
    out.u16(value);
  }
  return ping_frame(2198, 1, 0, out.payload());
}

Bytes distance2(std::uint32_t distance_mm, unsigned confidence) {
  PayloadWriter out;
  out.u32(distance_mm).u32(distance_mm).u16(0).u8(confidence).u8(confidence).u32(0);
  return ping_frame(1223, 1, 0, out.payload());
}

/// (right, down) in metres of a fan's record.
std::pair<double, double> point_of(const Ping& ping) {
  assert_int_equal(ping.azimuth_bam32, leadline::base::kBam32QuarterTurn);
  const double elevation = degrees(ping.elevation_bam32) * 3.14159265358979 / 180;
  const double range_m = static_cast<double>(ping.range_um) * 1e-6;
  return {range_m * std::cos(elevation), range_m * std::sin(elevation)};
}

std::vector<Ping> pings_of(const Bytes& bytes, const CeruleanConfig& config = {}) {
  CeruleanCodec codec(config);
  return records_of<Ping>(codec, bytes, 1'000'000);
}

void check_rejected(const Bytes& bytes) {
  CeruleanCodec codec({});
  assert_int_equal(records_of<Ping>(codec, bytes).size(), 0);
  assert_int_equal(leadline::hal::rejected(codec.counters()), 1);
}

}  // namespace

TEST(points_of_a_surveyor) {
  CeruleanConfig config;
  config.mount = 4;
  CeruleanCodec codec(config);
  const auto pings =
      records_of<Ping>(codec, atof({{0.5, 0.0133333333}, {-0.25, 0.01}, {0, 0}}), 1'000'000);
  assert_int_equal(pings.size(), 2);  // the third has no time: nothing was detected
  assert_int_equal(pings[0].kind, ReturnKind::kRange);
  assert_int_equal(pings[0].mount, 4);
  assert_int_equal(pings[0].quality, 255);
  assert_int_equal(pings[0].sound_speed_mm_s, 1'500'000);
  assert_in_range(pings[0].range_um, 9'999'999, 10'000'001);
  assert_in_range(pings[1].range_um, 7'499'999, 7'500'001);
  // Positive to port.
  assert_near(point_of(pings[0]).first, -10 * std::sin(0.5), 1e-5);
  assert_near(point_of(pings[0]).second, 10 * std::cos(0.5), 1e-5);
  assert_near(point_of(pings[1]).first, 7.5 * std::sin(0.25), 1e-5);
  assert_int_equal(pings[0].t_transmit_us, 1'000'000 - 20'000);
  assert_in_range(pings[1].t_receive_us, 1'000'000 - 20'000 + 9'999, 1'000'000 - 20'000 + 10'000);
  assert_int_equal(codec.counters().records, 2);
  config.atof_positive_to_port = false;
  assert_near(point_of(pings_of(atof({{0.5, 0.01}}), config)[0]).first, 7.5 * std::sin(0.5), 1e-5);
}

TEST(points_left_undrained_are_not_lost) {
  CeruleanCodec codec({});
  const Bytes bytes = atof({{0, 0.01}, {0.1, 0.01}, {0.2, 0.01}}) + atof({{0.3, 0.01}});
  std::size_t count = 0;
  Ping ping{};
  for (const std::uint8_t byte : bytes) {
    count += codec.feed(byte, 0, ping) ? 1U : 0U;
  }
  while (codec.next(ping)) {
    ++count;
  }
  assert_int_equal(count, 4);
}

TEST(yz_points_until_there_are_others) {
  CeruleanCodec codec({});
  auto pings = records_of<Ping>(codec, yz({{3, -4}, {-6, -8}}, 1));
  assert_int_equal(pings.size(), 2);
  assert_near(point_of(pings[0]).first, -3, 1e-5);
  assert_near(point_of(pings[0]).second, 4, 1e-5);
  assert_near(point_of(pings[1]).first, 6, 1e-5);
  assert_in_range(pings[1].range_um, 9'999'998, 10'000'002);
  // The same ping as angles and times, and from then on no yz points.
  assert_int_equal(records_of<Ping>(codec, atof({{0.1, 0.01}}, 1500, 0.02, 1)).size(), 0);
  assert_int_equal(records_of<Ping>(codec, yz({{3, -4}}, 2)).size(), 0);
  assert_int_equal(records_of<Ping>(codec, atof({{0.1, 0.01}}, 1500, 0.02, 2)).size(), 1);
  assert_int_equal(codec.counters().repeats, 2);
}

TEST(points_of_an_omniscan) {
  const Bytes bytes = os3d({{0.2, 0.01, 4, 0},
                            {0.2, 0.01, -1, 1},
                            {0.2, 0.01, -4, 2},
                            {-0.2, 0.01, -4, 0},
                            {0.2, 0.01, -9, 0}},
                           1, 1);
  CeruleanConfig config;
  config.mount = 2;
  auto pings = pings_of(bytes, config);
  assert_int_equal(pings.size(), 4);
  assert_int_equal(pings[0].mount, 3);
  assert_int_equal(pings[0].sound_speed_mm_s, 1'480'000);
  assert_near(point_of(pings[0]).first, 7.4 * std::sin(0.2), 1e-5);  // to starboard
  assert_int_equal(pings[0].quality, 255);
  assert_int_equal(pings[1].quality, 170);
  assert_int_equal(pings[2].quality, 85);
  assert_int_equal(pings[3].quality, 40);
  config.points = CeruleanPoints::kAll;
  assert_int_equal(pings_of(bytes, config).size(), 5);
  config.points = CeruleanPoints::kBottom;
  pings = pings_of(bytes, config);
  assert_int_equal(pings.size(), 1);
  assert_int_equal(pings[0].quality, 170);
  // The listening time is known from the end of the ping before.
  PayloadWriter end;
  end.u32(0).u32(0).u32(bits_of(14.8)).bytes(Bytes(68, 0));
  pings = pings_of(ping_frame(3010, 1, 0, end.payload()) + bytes);
  assert_in_range(pings[0].t_transmit_us, 1'000'000 - 20'001, 1'000'000 - 19'999);
}

TEST(a_profile_in_decibels) {
  CeruleanConfig config;
  config.mount = 1;
  CeruleanCodec codec(config);
  // 80 dB in 65535 parts: 0 dB, -20 dB, -6.0206 dB, -80 dB of the loudest.
  const Bytes bytes = mono_profile({65'535, 49'151, 60'603, 0}, 10, 90, 1);
  Ping ping{};
  bool done = false;
  for (const std::uint8_t byte : bytes) {
    done = codec.feed(byte, 1'000'000, ping);
  }
  assert_true(done);
  assert_int_equal(ping.kind, ReturnKind::kProfile);
  assert_int_equal(ping.mount, 2);
  assert_int_equal(ping.sound_speed_mm_s, 1'500'000);
  assert_int_equal(ping.profile.bin_count, 4);
  assert_int_equal(ping.profile.bin_um, 2'500'000);
  assert_int_equal(ping.profile.first_bin_um, 1'000'000 + 1'250'000);
  assert_int_equal(ping.elevation_bam32, leadline::base::kBam32QuarterTurn);
  assert_int_equal(ping.profile.intensity[0], 65'535);
  assert_in_range(ping.profile.intensity[1], 6552, 6556);
  assert_in_range(ping.profile.intensity[2], 32'763, 32'773);
  assert_in_range(ping.profile.intensity[3], 6, 7);
  assert_in_range(ping.t_transmit_us, 1'000'000 - 14'667,
                  1'000'000 - 14'665);  // 11 m there and back
  assert_int_equal(ping.t_receive_us, 1'000'000);
}

TEST(amplitudes_against_floating_point) {
  CeruleanConfig config;
  config.full_scale_mdb = 95'000;
  std::vector<unsigned> results;
  for (unsigned value = 0; value < 65'536; value += 17) {
    results.push_back(value);
  }
  CeruleanCodec codec(config);
  Ping ping{};
  for (const std::uint8_t byte : mono_profile(results, -10, 100)) {
    static_cast<void>(codec.feed(byte, 0, ping));
  }
  assert_int_equal(ping.profile.bin_count, results.size());
  for (std::size_t i = 0; i < results.size(); ++i) {
    const double power_db = -10 + 110.0 * results[i] / 65'535;
    const double amplitude = std::min(65'535.0, 65'535 * std::pow(10, (power_db - 95) / 20));
    assert_near(ping.profile.intensity[i], amplitude, 0.6 + amplitude * 1e-4);
  }
}

TEST(ranges_of_an_s500) {
  CeruleanConfig config;
  config.min_confidence_percent = 50;
  const auto pings = pings_of(
      distance2(12'345, 80) + distance2(12'345, 49) + distance2(0, 100) + distance2(0, 0), config);
  assert_int_equal(pings.size(), 4);
  assert_int_equal(pings[0].kind, ReturnKind::kRange);
  assert_int_equal(pings[0].range_um, 12'345'000);
  assert_int_equal(pings[0].quality, 204);
  assert_int_equal(pings[0].t_transmit_us, 1'000'000 - 16'460);
  assert_int_equal(pings[0].t_receive_us, 1'000'000);
  for (std::size_t i = 1; i < 4; ++i) {
    assert_int_equal(pings[i].kind, ReturnKind::kNoReturn);
    assert_int_equal(pings[i].range_um, 0);
  }
}

TEST(attitude_of_the_head) {
  CeruleanCodec codec({});
  const double roll = 0.2;
  const double pitch = 0.1;
  // World's up in forward, port, up axes of a body with this pitch (bow up) and roll (starboard down).
  const Bytes frame = attitude(std::sin(pitch), std::cos(pitch) * std::sin(roll),
                               std::cos(pitch) * std::cos(roll), 1'700'000'000'123);
  assert_int_equal(records_of<Ping>(codec, frame, 77).size(), 0);
  auto samples = samples_of(codec);
  assert_int_equal(samples.size(), 1);
  assert_int_equal(samples[0].kind, NavKind::kAttitude);
  assert_int_equal(samples[0].fields, leadline::base::kNavRollPitch | leadline::base::kNavUtc);
  assert_near(degrees(samples[0].attitude.roll_bam32), roll * 180 / 3.14159265358979, 1e-5);
  assert_near(degrees(samples[0].attitude.pitch_bam32), pitch * 180 / 3.14159265358979, 1e-5);
  assert_int_equal(samples[0].utc_us, 1'700'000'000'123'000);
  assert_int_equal(samples[0].t_device_us, 5'000'000);
  assert_int_equal(samples[0].t_us, 77);
  CeruleanConfig config;
  config.bow_up_is_positive_x = false;
  CeruleanCodec other(config);
  records_of<Ping>(other, frame);
  samples = samples_of(other);
  assert_near(degrees(samples[0].attitude.pitch_bam32), -pitch * 180 / 3.14159265358979, 1e-5);
}

TEST(samples_without_a_value) {
  CeruleanCodec codec({});
  // 37 bytes, no direction, time since power-up only; then a water sensor that is not there.
  records_of<Ping>(codec, attitude(0, 0, 0, 5000, true));
  PayloadWriter water;
  water.u32(bits_of(-1000)).u32(bits_of(-1000));
  records_of<Ping>(codec, ping_frame(118, 1, 0, water.payload()));
  PayloadWriter warm;
  warm.u32(bits_of(12.5)).u32(bits_of(2));
  records_of<Ping>(codec, ping_frame(118, 1, 0, warm.payload()));
  PayloadWriter noise;
  noise.u32(0x7FC00000U).u32(0x7FC00000U);
  records_of<Ping>(codec, ping_frame(118, 1, 0, noise.payload()));
  const auto samples = samples_of(codec);
  assert_int_equal(samples.size(), 4);
  assert_int_equal(samples[0].fields, 0);
  assert_int_equal(samples[0].utc_us, 0);
  assert_int_equal(samples[1].kind, NavKind::kWater);
  assert_int_equal(samples[1].fields, 0);
  assert_int_equal(samples[2].fields, leadline::base::kNavTemperature);
  assert_int_equal(samples[2].temperature_mdegc, 12'500);
  assert_int_equal(samples[3].fields, 0);
  assert_int_equal(codec.counters().no_data, 2);
}

TEST(samples_nobody_takes_make_room) {
  CeruleanCodec codec({});
  for (int i = 0; i < 20; ++i) {
    records_of<Ping>(codec, attitude(0, 0, 1), i);
  }
  const auto samples = samples_of(codec);
  assert_int_equal(samples.size(), leadline::hal::NavQueue::kCapacity);
  assert_int_equal(samples.back().t_us, 19);
}

TEST(impossible_values_are_dropped) {
  const double nan = std::nan("");
  check_rejected(atof({{nan, 0.01}}));
  check_rejected(atof({{0, nan}}));
  check_rejected(atof({{0.1, 0.01}, {1.6, 0.01}}));  // behind the face
  check_rejected(atof({{0.1, -0.01}}));
  check_rejected(atof({{0.1, 0.03}}));  // after listening_sec
  check_rejected(atof({{0.1, 0.01}}, 1200));
  check_rejected(atof({{0.1, 0.01}}, nan));
  check_rejected(atof({{0.1, 0.01}}, 1500, 0));
  check_rejected(atof({{0.1, 0.01}}, 1500, 0.02, 1, 2));  // a count that does not fit the length
  check_rejected(os3d({{0.1, 0.01, 1, 3}}));
  check_rejected(os3d({{0.1, 0.01, nan, 0}}));
  check_rejected(os3d({{0.1, 0.01, 1, 0}}, 0));
  check_rejected(os3d({{0.1, 0.01, 1, 0}}, 1, 8));
  check_rejected(yz({{3, 4}}, 1));  // above the head
  check_rejected(yz({{nan, -4}}, 1));
  check_rejected(mono_profile({}));
  check_rejected(mono_profile({1}, 20, 10));
  check_rejected(mono_profile({1}, nan, 10));
  check_rejected(mono_profile({1}, 10, 90, 8));
  check_rejected(mono_profile({1}, 10, 90, 0, 12'000));
  check_rejected(distance2(1'000'001, 50));
  check_rejected(distance2(1000, 101));
  check_rejected(attitude(nan, 0, 1));
}

TEST(frames_that_are_no_measurements) {
  CeruleanCodec codec({});
  Bytes json = ping_frame(10, 0, 0, leadline::test::from_text("{\"session\":\"BR\"}"));
  assert_int_equal(records_of<Ping>(codec, json + atof({{0, 0.01}})).size(), 1);
  assert_int_equal(codec.counters().ignored, 1);
  // A valid sum over an id or a length that no head has.
  assert_int_equal(records_of<Ping>(codec, ping_frame(3013, 1, 0, Bytes(40))).size(), 0);
  assert_int_equal(codec.counters().unknown_id, 1);
  assert_int_equal(records_of<Ping>(codec, ping_frame(504, 1, 0, Bytes(38))).size(), 0);
  assert_int_equal(codec.counters().bad_length, 1);
  CeruleanConfig config;
  config.device_id = 9;
  CeruleanCodec other(config);
  assert_int_equal(records_of<Ping>(other, atof({{0, 0.01}})).size(), 0);
  assert_int_equal(other.counters().wrong_device, 1);
}

TEST(damage_costs_one_frame) {
  // 'B' 'R' inside: an angle of these bytes.
  Bytes inside = atof({{0.1, 0.01}, {0.2, 0.011}});
  leadline::test::check_damage_costs_one_frame([] { return CeruleanCodec({}); }, inside, 2);
  leadline::test::check_damage_costs_one_frame([] { return CeruleanCodec({}); },
                                               distance2(0x5242, 50), 1);
  Random random(7);
  CeruleanCodec codec({});
  for (int i = 0; i < 200; ++i) {
    records_of<Ping>(codec, random_bytes(random, 100));
    records_of<Ping>(codec, atof({{0.1, 0.01}}));
  }
  assert_true(codec.counters().records >= 195);
}

TEST(the_start_command_is_the_documented_one) {
  CeruleanConfig config;
  config.head = CeruleanHead::kSurveyor;
  CeruleanCodec codec(config);
  std::uint8_t out[CeruleanCodec::kMaxRequest_bytes];
  assert_int_equal(codec.request(0, out, sizeof out - 1), 0);
  const std::size_t size = codec.request(0, out, sizeof out);
  const Bytes expected = from_hex(
      "42 52 24 00 cf 0b 00 00 00 00 00 00 00 00 00 00 00 80 bb 44 ff ff 64 00 00 00 00 01 00 00 "
      "01 01 "
      "80 a9 03 00 90 01 00 00 00 00 c0 3f 32 08");
  assert_int_equal(size, expected.size());
  assert_memory_equal(out, expected.data(), size);
  assert_int_equal(codec.request(1, out, sizeof out), 0);
  // A codec that listens says nothing, whatever it hears.
  CeruleanCodec listener({});
  listener.set_utc_offset(0, 1);
  records_of<Ping>(listener, ping_frame(14, 1, 0, {}));
  assert_int_equal(listener.request(0, out, sizeof out), 0);
}

TEST(singles_of_thousandths) {
  using leadline::hal::f32_bits_of_milli;
  Random random(3);
  for (int i = 0; i < 20'000; ++i) {
    const std::int64_t value =
        random.between(-(std::int64_t{1} << 36), std::int64_t{1} << 36) >> random.between(0, 36);
    const auto exact = static_cast<float>(static_cast<double>(value) / 1000.0);
    std::uint32_t bits = 0;
    std::memcpy(&bits, &exact, sizeof bits);
    assert_int_equal(f32_bits_of_milli(value), bits);
  }
}

namespace {

CeruleanEcho flat_bottom(const CeruleanShot& shot) {
  CeruleanEcho echo;
  for (int i = -40; i <= 40; ++i) {
    const double angle = i * 0.02;
    echo.points.push_back({angle, 2 * 8.0 / std::cos(angle) / shot.sound_speed_m_s, 25, 0});
  }
  echo.distance_m = 8;
  echo.confidence_percent = 90;
  for (int i = 0; i < shot.bins; ++i) {
    const double range = shot.start_m + (shot.end_m - shot.start_m) * (i + 0.5) / shot.bins;
    echo.power_db.push_back(std::abs(range - 8) < 0.05 ? 90 : 30);
  }
  echo.up = {0.0, 0.1, 0.994987};
  return echo;
}

constexpr TimeUs kSecond_us = 1'000'000;

CeruleanConfig head_config(CeruleanHead head) {
  CeruleanConfig config;
  config.head = head;
  config.max_range_um = 20'000'000;
  config.sound_speed_mm_s = 1'470'000;
  return config;
}

EmulatedCeruleanConfig device_config(CeruleanModel model) {
  EmulatedCeruleanConfig config;
  config.model = model;
  return config;
}

}  // namespace

TEST(a_surveyor_is_started_told_the_time_and_stopped) {
  CeruleanCodec codec(head_config(CeruleanHead::kSurveyor));
  EmulatedCerulean device(device_config(CeruleanModel::kSurveyor), flat_bottom);
  HeadLine<CeruleanCodec> line(codec, device);
  std::size_t count = 0;
  line.run_until(kSecond_us, [&count](const Ping& ping) {
    const auto point = point_of(ping);
    assert_near(point.second, 8, 1e-3);
    assert_true(point.first > -9 && point.first < 9);
    assert_int_equal(ping.sound_speed_mm_s, 1'470'000);
    ++count;
  });
  assert_int_equal(count, 10 * 81);  // yz and atof of each ping, once
  assert_int_equal(device.utc_ms(), 0);
  // Asked and not known: not answered.
  codec.set_utc_offset(1'700'000'000'000'000, 5);
  assert_int_equal(line.count_until(2 * kSecond_us), 10 * 81);
  assert_in_range(device.utc_ms(), 1'700'000'001'000, 1'700'000'001'200);
  const auto samples = samples_of(codec);
  assert_int_equal(samples.back().kind, NavKind::kAttitude);
  assert_near(degrees(samples.back().attitude.roll_bam32), 5.739, 0.01);
  assert_in_range(samples.back().utc_us / 1000, 1'700'000'001'800, 1'700'000'002'000);
  codec.stop();
  line.count_until(3 * kSecond_us);
  assert_false(device.pinging());
  assert_int_equal(line.count_until(10 * kSecond_us), 0);
  codec.restart();
  assert_true(line.count_until(11 * kSecond_us) >= 9 * 81);
}

TEST(an_omniscan_3d) {
  CeruleanCodec codec(head_config(CeruleanHead::kOmniscan3d));
  EmulatedCerulean device(device_config(CeruleanModel::kOmniscan3d), flat_bottom);
  HeadLine<CeruleanCodec> line(codec, device);
  std::size_t count = 0;
  line.run_until(kSecond_us, [&](const Ping& ping) {
    assert_near(point_of(ping).second, 8, 1e-3);
    assert_int_equal(ping.quality, 170);
    // Listened to 20 m, arrived within the millisecond.
    assert_true(line.now_us() - ping.t_transmit_us < 27'211 + 1000);
    ++count;
  });
  assert_int_equal(count, 10 * 81);
}

TEST(an_omniscan_450_and_an_s500) {
  CeruleanCodec side(head_config(CeruleanHead::kOmniscan450));
  EmulatedCerulean scanner(device_config(CeruleanModel::kOmniscan450), flat_bottom);
  HeadLine<CeruleanCodec> first(side, scanner);
  const auto check = [](const Ping& ping) {
    assert_int_equal(ping.kind, ReturnKind::kProfile);
    assert_int_equal(ping.sound_speed_mm_s, 1'470'000);
    for (int i = 0; i < ping.profile.bin_count; ++i) {
      const double range =
          static_cast<double>(ping.profile.first_bin_um + i * std::int64_t{ping.profile.bin_um});
      assert_int_equal(ping.profile.intensity[i] > 1000, std::abs(range - 8e6) < 0.05e6);
    }
  };
  first.run_until(kSecond_us, check);
  assert_int_equal(scanner.shots(), 10);
  assert_int_equal(side.counters().records, 10);

  CeruleanConfig config = head_config(CeruleanHead::kS500);
  CeruleanCodec sounder(config);
  EmulatedCerulean s500(device_config(CeruleanModel::kS500), flat_bottom);
  HeadLine<CeruleanCodec> second(sounder, s500);
  second.run_until(kSecond_us, check);
  assert_int_equal(sounder.counters().records, 10);
  config.profile = false;
  CeruleanCodec altimeter(config);
  EmulatedCerulean other(device_config(CeruleanModel::kS500), flat_bottom);
  HeadLine<CeruleanCodec> third(altimeter, other);
  third.run_until(kSecond_us, [](const Ping& ping) {
    assert_int_equal(ping.kind, ReturnKind::kRange);
    assert_int_equal(ping.range_um, 8'000'000);
  });
  assert_int_equal(altimeter.counters().records, 10);
}

TEST(a_head_that_falls_silent_or_reboots_is_started_again) {
  CeruleanCodec codec(head_config(CeruleanHead::kSurveyor));
  EmulatedCerulean device(device_config(CeruleanModel::kSurveyor), flat_bottom);
  HeadLine<CeruleanCodec> line(codec, device);
  assert_int_equal(line.count_until(kSecond_us), 10 * 81);
  device.reboot(line.now_us(), 500'000);
  assert_int_equal(line.count_until(3 * kSecond_us), 0);
  assert_true(line.count_until(6 * kSecond_us) >= 19 * 81);
  assert_int_equal(codec.counters().timeouts, 1);
  device.set_silent(true);
  assert_int_equal(line.count_until(12 * kSecond_us), 0);
  device.set_silent(false);
  assert_true(line.count_until(15 * kSecond_us) > 0);
}

TEST(a_bad_line) {
  leadline::emu::FaultConfig down;
  down.drop_ppm = 300;
  down.corrupt_ppm = 300;
  CeruleanCodec codec(head_config(CeruleanHead::kSurveyor));
  EmulatedCerulean device(device_config(CeruleanModel::kSurveyor), flat_bottom);
  HeadLine<CeruleanCodec> line(codec, device, down);
  std::size_t count = 0;
  line.run_until(20 * kSecond_us, [&count](const Ping& ping) {
    assert_near(point_of(ping).second, 8, 1e-3);
    ++count;
  });
  assert_true(count > 40 * 81 && count < 200 * 81);
  assert_true(leadline::hal::rejected(codec.counters()) > 20);
}

TEST(refused_parameters_are_counted) {
  CeruleanCodec codec(head_config(CeruleanHead::kSurveyor));
  EmulatedCerulean device(device_config(CeruleanModel::kS500), flat_bottom);
  HeadLine<CeruleanCodec> line(codec, device);
  assert_int_equal(line.count_until(10 * kSecond_us), 0);
  assert_true(codec.counters().nacks >= 2);
  assert_true(codec.counters().timeouts >= 2);
}
