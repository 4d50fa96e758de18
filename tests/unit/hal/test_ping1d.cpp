#include "hal/heads/ping1d.hpp"
#include "hal/wire.hpp"
#include "tests/support/device_bytes.hpp"

namespace {

using leadline::base::Ping;
using leadline::base::ReturnKind;
using leadline::hal::Ping1dCodec;
using leadline::hal::Ping1dConfig;
using leadline::hal::write_ping_frame;
using leadline::hal::write_u16_le;
using leadline::hal::write_u32_le;
using leadline::test::Bytes;
using leadline::test::from_hex;
using leadline::test::Random;
using leadline::test::random_bytes;
using leadline::test::records_of;
using leadline::test::without;
using leadline::test::operator+;

// devices.md 1.1, REAL (ping-python) and 1.2, MADE.
const char* const kProfileVector =
    "42 52 24 00 14 05 38 2d e8 03 00 00 5d 00 3f 08 1c 2b a6 02 a0 0f 00 00 b8 88 00 00 04 00 00 "
    "00 0a 00 00 01 02 03 04 05 06 07 08 09 de 05";
const char* const kDistanceVector =
    "42 52 18 00 bc 04 01 00 29 09 00 00 64 00 73 00 09 03 00 00 00 00 00 00 88 13 00 00 03 00 00 "
    "00 20 03";

struct Measured {
  std::uint32_t distance_mm = 2000;
  unsigned confidence = 100;
  std::uint32_t number = 1;
  std::uint32_t start_mm = 0;
  std::uint32_t length_mm = 30'000;
  std::uint32_t gain = 3;
};

Bytes frame_of(unsigned id, const Bytes& payload, unsigned source = 1) {
  Bytes out(payload.size() + leadline::hal::kPingOverhead_bytes);
  assert_int_equal(
      write_ping_frame(static_cast<std::uint16_t>(id), static_cast<std::uint8_t>(source), 0,
                       payload.data(), payload.size(), out.data(), out.size()),
      out.size());
  return out;
}

Bytes fixed_part(const Measured& measured) {
  Bytes payload(24);
  write_u32_le(payload.data(), measured.distance_mm);
  write_u16_le(payload.data() + 4, static_cast<std::uint16_t>(measured.confidence));
  write_u16_le(payload.data() + 6, 100);
  write_u32_le(payload.data() + 8, measured.number);
  write_u32_le(payload.data() + 12, measured.start_mm);
  write_u32_le(payload.data() + 16, measured.length_mm);
  write_u32_le(payload.data() + 20, measured.gain);
  return payload;
}

Bytes distance_frame(const Measured& measured, unsigned source = 1) {
  return frame_of(1212, fixed_part(measured), source);
}

Bytes profile_frame(const Measured& measured, const Bytes& samples) {
  Bytes count(2);
  write_u16_le(count.data(), static_cast<std::uint16_t>(samples.size()));
  return frame_of(1300, fixed_part(measured) + count + samples);
}

Ping1dConfig wide() {
  Ping1dConfig config;
  config.min_range_um = 0;
  config.max_range_um = 100'000'000;
  return config;
}

Ping only(Ping1dCodec& codec, const Bytes& bytes, std::int64_t t_us = 0) {
  const auto pings = records_of<Ping>(codec, bytes, t_us);
  assert_int_equal(pings.size(), 1);
  return pings[0];
}

}  // namespace

// devices.md 1.1, REAL: protocol version 1.2.3, the second from source 77.
TEST(protocol_version_vectors) {
  Ping1dCodec codec(wide());
  assert_int_equal(
      records_of<Ping>(codec, from_hex("42 52 04 00 05 00 00 00 01 02 03 00 a3 00")).size(), 0);
  assert_int_equal(codec.device().protocol[0], 1);
  assert_int_equal(codec.device().protocol[1], 2);
  assert_int_equal(codec.device().protocol[2], 3);
  Ping1dConfig config = wide();
  config.device_id = 77;
  Ping1dCodec other(config);
  records_of<Ping>(other, from_hex("42 52 04 00 05 00 4d d3 01 02 03 63 26 02"));
  assert_int_equal(other.device().protocol[2], 3);
  assert_int_equal(other.counters().wrong_device, 0);
}

TEST(distance_vector) {
  Ping1dConfig config = wide();
  config.mount = 3;
  Ping1dCodec codec(config);
  const Ping ping = only(codec, from_hex(kDistanceVector), 1'000'000);
  assert_int_equal(ping.kind, ReturnKind::kRange);
  assert_int_equal(ping.range_um, 2'345'000);
  assert_int_equal(ping.quality, 255);
  assert_int_equal(ping.mount, 3);
  assert_int_equal(ping.azimuth_bam32, 0);
  assert_int_equal(ping.elevation_bam32, leadline::base::kBam32QuarterTurn);
  // Listened over 5 m there and back at 1500 m/s: 6667 us; the echo took 3127 us of them.
  assert_int_equal(ping.t_transmit_us, 1'000'000 - 6667);
  assert_int_equal(ping.t_receive_us, 1'000'000 - 6667 + 3127);
  assert_int_equal(codec.counters().records, 1);
}

TEST(profile_vector) {
  Ping1dConfig config = wide();
  config.profile = true;
  Ping1dCodec codec(config);
  Ping ping{};
  bool done = false;
  for (const std::uint8_t byte : from_hex(kProfileVector)) {
    assert_false(done);
    done = codec.feed(byte, 100'000, ping);
  }
  assert_true(done);
  assert_int_equal(ping.kind, ReturnKind::kProfile);
  assert_int_equal(ping.profile.bin_count, 10);
  for (int i = 0; i < 10; ++i) {
    assert_int_equal(ping.profile.intensity[i], i);
  }
  assert_int_equal(ping.profile.bin_um, 3'500'000);        // 35 m in ten
  assert_int_equal(ping.profile.first_bin_um, 5'750'000);  // 4 m and half a bin
  assert_int_equal(ping.t_transmit_us, 100'000 - 52'000);  // 39 m there and back
  assert_int_equal(ping.t_receive_us, 100'000);
  assert_int_equal(ping.quality, 255);
  assert_false(codec.next(ping));
}

TEST(profile_message_as_a_distance) {
  Ping1dCodec codec(wide());
  const Ping ping = only(codec, from_hex(kProfileVector));
  assert_int_equal(ping.kind, ReturnKind::kRange);
  assert_int_equal(ping.range_um, 1'000'000);
  assert_int_equal(ping.quality, 237);  // 93 %
}

TEST(sound_speed_scales_lengths_not_times) {
  Ping1dConfig config = wide();
  config.sound_speed_mm_s = 1'450'000;
  Ping1dCodec codec(config);
  const Ping ping = only(codec, distance_frame({30'000, 50, 1, 0, 30'000, 3}));
  assert_int_equal(ping.range_um, 29'000'000);
  assert_int_equal(ping.t_transmit_us, -40'000);
  assert_int_equal(ping.t_receive_us, 0);
  assert_int_equal(ping.quality, 128);

  config.profile = true;
  Ping1dCodec profiles(config);
  const Ping profile = only(profiles, profile_frame({0, 0, 2, 3000, 6000, 3}, Bytes(200, 9)));
  assert_int_equal(profile.profile.bin_um, 29'000);
  assert_int_equal(profile.profile.first_bin_um, 2'914'500);
}

TEST(the_line_s_own_time) {
  Ping1dConfig config = wide();
  config.byte_time_ns = 86'806;
  Ping1dCodec codec(config);
  const Ping ping = only(codec, distance_frame({1500, 100, 1, 0, 3000, 3}), 50'000);
  assert_int_equal(ping.t_transmit_us, 50'000 - 2951 - 4000);  // 34 bytes
}

TEST(what_is_no_return) {
  Ping1dConfig config = wide();
  config.min_range_um = 500'000;
  config.max_range_um = 20'000'000;
  Ping1dCodec codec(config);
  const auto silent = [&codec](const Measured& measured) {
    const Ping ping = only(codec, distance_frame(measured), 100'000);
    assert_int_equal(ping.kind, ReturnKind::kNoReturn);
    assert_int_equal(ping.range_um, 0);
    assert_int_equal(ping.t_receive_us, 100'000);
    assert_int_equal(ping.t_transmit_us, 60'000);
    return ping.quality;
  };
  assert_int_equal(silent({0, 100, 1}), 255);
  assert_int_equal(silent({2000, 0, 2}), 255);
  assert_int_equal(silent({20'001, 100, 3}), 255);
  assert_int_equal(silent({0xFFFFFFFFU, 100, 4}), 255);
  // Something was near: free water is not proved.
  assert_int_equal(silent({499, 100, 5}), 0);
  assert_int_equal(only(codec, distance_frame({500, 1, 6})).kind, ReturnKind::kRange);
  assert_int_equal(only(codec, distance_frame({20'000, 1, 7})).quality, 3);
}

TEST(confidence_below_the_least_is_silence) {
  Ping1dConfig config = wide();
  config.min_confidence_percent = 40;
  Ping1dCodec codec(config);
  assert_int_equal(only(codec, distance_frame({2000, 39, 1})).kind, ReturnKind::kNoReturn);
  assert_int_equal(only(codec, distance_frame({2000, 40, 2})).kind, ReturnKind::kRange);
}

TEST(impossible_values_are_dropped) {
  Ping1dCodec codec(wide());
  const auto drop = [&codec](const Bytes& bytes) {
    const auto before = codec.counters().bad_values;
    assert_int_equal(records_of<Ping>(codec, bytes).size(), 0);
    assert_int_equal(codec.counters().bad_values, before + 1);
  };
  drop(distance_frame({2000, 101, 1}));
  drop(distance_frame({2000, 0xFFFF, 1}));
  drop(distance_frame({2000, 50, 1, 0, 30'000, 7}));
  drop(distance_frame({2000, 50, 1, 20'000'001, 1000, 3}));
  drop(distance_frame({2000, 50, 1, 0, 20'000'001, 3}));
  drop(distance_frame({2000, 50, 1, 0xFFFFFFFFU, 0xFFFFFFFFU, 3}));
  assert_int_equal(only(codec, distance_frame({2000, 50, 1, 20'000'000, 20'000'000, 6})).range_um,
                   2'000'000);

  Ping1dConfig config = wide();
  config.profile = true;
  Ping1dCodec profiles(config);
  assert_int_equal(records_of<Ping>(profiles, profile_frame({1, 1, 1}, {})).size(), 0);
  assert_int_equal(records_of<Ping>(profiles, profile_frame({1, 1, 1, 0, 0}, {1})).size(), 0);
  assert_int_equal(records_of<Ping>(profiles, profile_frame({1, 1, 1, 0, 3'000'001}, {1})).size(),
                   0);
  assert_int_equal(profiles.counters().bad_values, 3);
  const Ping longest = only(profiles, profile_frame({1, 1, 1, 0, 3'000'000}, {1}));
  assert_int_equal(longest.profile.bin_um, 3'000'000'000U);
  assert_int_equal(only(profiles, profile_frame({1, 1, 2, 0, 1}, Bytes(1200))).profile.bin_count,
                   1200);
}

TEST(the_same_measurement_counts_once) {
  Ping1dCodec codec(wide());
  const Bytes frame = distance_frame({2000, 50, 7});
  assert_int_equal(records_of<Ping>(codec, frame + frame + frame).size(), 1);
  assert_int_equal(codec.counters().repeats, 2);
  assert_int_equal(records_of<Ping>(codec, distance_frame({2000, 50, 8})).size(), 1);

  Ping1dConfig config = wide();
  config.drop_repeats = false;
  Ping1dCodec all(config);
  assert_int_equal(records_of<Ping>(all, frame + frame + frame).size(), 3);
}

TEST(another_device_s_frames_are_left) {
  Ping1dConfig config = wide();
  config.device_id = 4;
  Ping1dCodec codec(config);
  assert_int_equal(records_of<Ping>(codec, distance_frame({}, 1)).size(), 0);
  assert_int_equal(records_of<Ping>(codec, distance_frame({}, 4)).size(), 1);
  assert_int_equal(codec.counters().wrong_device, 1);
}

TEST(damage_costs_one_frame) {
  for (const char* const hex : {kDistanceVector, kProfileVector}) {
    const Bytes frame = from_hex(hex);
    for (std::size_t position = 0; position < frame.size(); ++position) {
      Ping1dConfig config = wide();
      config.drop_repeats = false;
      Ping1dCodec codec(config);
      assert_int_equal(records_of<Ping>(codec, without(frame, position) + frame + frame).size(), 2);
    }
  }
}

TEST(noise_between_frames) {
  Random random(3);
  Ping1dCodec codec(wide());
  for (std::uint32_t number = 1; number <= 2000; ++number) {
    const Bytes noise = random_bytes(random, static_cast<std::size_t>(random.between(0, 40)));
    const auto distance_mm = static_cast<std::uint32_t>(random.between(1, 100'000));
    const Ping ping = only(codec, noise + distance_frame({distance_mm, 50, number}));
    assert_int_equal(ping.range_um, static_cast<std::int64_t>(distance_mm) * 1000);
  }
}

TEST(two_records_of_one_byte) {
  // A start that promises a profile holds two distances back until its sum turns out wrong.
  Ping1dCodec codec(wide());
  Bytes start = profile_frame({}, Bytes(68 - 26 + 8));
  start.resize(34);  // header, fixed part, count; then come the wrong samples
  start.resize(8 + 24 + 2);
  const Bytes held = distance_frame({1000, 50, 1}) + distance_frame({2000, 50, 2});
  const auto pings = records_of<Ping>(codec, start + held);
  assert_int_equal(pings.size(), 2);
  assert_int_equal(pings[0].range_um, 1'000'000);
  assert_int_equal(pings[1].range_um, 2'000'000);
}

TEST(configuration_is_limited) {
  Ping1dConfig config;
  config.min_range_um = -5;
  config.max_range_um = std::int64_t{1} << 62U;
  config.sound_speed_mm_s = 0;
  config.min_confidence_percent = 200;
  config.gain_setting = 99;
  config.poll_interval_us = -1;
  config.byte_time_ns = -1;
  Ping1dCodec codec(config);
  const Ping ping = only(codec, distance_frame({1'500'000, 100, 1}));
  assert_int_equal(ping.range_um, 1'300'000'000);  // scaled by the slowest water
}

TEST(too_small_a_buffer_gets_nothing) {
  Ping1dCodec codec(wide());
  std::uint8_t out[Ping1dCodec::kMaxRequest_bytes];
  assert_int_equal(codec.request(0, out, sizeof out - 1), 0);
  // Nothing was taken as sent.
  assert_int_equal(codec.request(0, out, sizeof out), 24);
  const Bytes expected = from_hex(
      "42 52 02 00 79 05 00 00 14 05 2d 01"    // stop streaming profiles
      "42 52 02 00 06 00 00 00 05 00 a1 00");  // protocol version
  assert_memory_equal(out, expected.data(), expected.size());
  assert_int_equal(codec.request(0, out, sizeof out), 0);
}
