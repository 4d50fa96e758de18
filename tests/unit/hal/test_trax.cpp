#include "hal/attitude/trax.hpp"
#include "hal/emu/trax_sensor.hpp"
#include "hal/emu/wire_bytes.hpp"
#include "tests/support/nav_streams.hpp"

namespace {

using leadline::base::NavSample;
using leadline::emu::ByteOrder;
using leadline::emu::ByteWriter;
using leadline::emu::EmulatedTrax;
using leadline::emu::Motion;
using leadline::emu::trax_data;
using leadline::emu::trax_frame;
using leadline::hal::TraxCodec;
using leadline::hal::TraxConfig;
using leadline::test::Bytes;
using leadline::test::degrees;
using leadline::test::from_hex;
using leadline::test::samples_of;
using leadline::test::turn;
using leadline::test::operator+;
using namespace leadline::base;  // NOLINT: the bits' names

NavSample only(const Bytes& bytes, const TraxConfig& config = {}) {
  return leadline::test::only_sample<TraxCodec>(config, bytes);
}

leadline::hal::CodecCounters counters_of(const Bytes& bytes) {
  TraxCodec codec(TraxConfig{});
  samples_of(codec, bytes);
  return codec.counters();
}

Motion some_motion(std::int64_t t_us = 0) {
  Motion motion;
  motion.heading_deg = 275.5 + static_cast<double>(t_us) / 1e6;
  motion.pitch_deg = 12.25;
  motion.roll_deg = -33.5;
  motion.rate_rad_s = {0.5, -0.25, 0.125};
  return motion;
}

/// A codec and a device on one line, millisecond by millisecond.
struct Line {
  TraxCodec codec;
  EmulatedTrax device;
  std::int64_t now_us = 0;
  std::vector<NavSample> samples{};
  std::vector<Bytes> sent{};

  explicit Line(const TraxConfig& config)
      : codec(config), device({3'000, 260'417, 200'000}, some_motion) {}

  void run(std::int64_t until_us) {
    for (; now_us <= until_us; now_us += 1'000) {
      leadline::emu::Bytes out;
      device.advance(now_us, out);
      for (const NavSample& sample : samples_of(codec, out, now_us)) {
        samples.push_back(sample);
      }
      std::array<std::uint8_t, TraxCodec::kMaxRequest_bytes> bytes{};
      const std::size_t size = codec.request(now_us, bytes.data(), bytes.size());
      if (size > 0) {
        sent.emplace_back(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size));
        device.take(now_us, bytes.data(), size);
      }
    }
  }
};

}  // namespace

// devices.md 5.5, MADE.
TEST(made_frames) {
  assert_true(trax_frame(1, {}) == from_hex("00 05 01 ef d4"));
  assert_true(trax_frame(3, {3, 5, 24, 25}) == from_hex("00 09 03 03 05 18 19 df de"));
  assert_true(trax_frame(4, {}) == from_hex("00 05 04 bf 71"));
  assert_true(trax_frame(21, {}) == from_hex("00 05 15 bd 61"));
  assert_true(trax_frame(22, {}) == from_hex("00 05 16 8d 02"));
  for (const char* hex : {"00 05 01 ef d4", "00 09 03 03 05 18 19 df de", "00 05 16 8d 02"}) {
    assert_int_equal(counters_of(from_hex(hex)).ignored, 1);
  }
}

// The REAL request of another host: 0x17 bytes of GetDataResp begin with 00 17 05.
TEST(measurement) {
  const NavSample sample = only(trax_data(some_motion(), {5, 24, 25}));
  assert_true(sample.kind == NavKind::kAttitude);
  assert_int_equal(sample.fields, kNavRollPitch | kNavHeadingMagnetic);
  assert_int_equal(sample.quality, 255);
  assert_near(turn(sample.attitude.heading_bam32), 275.5, 1e-7);
  assert_near(degrees(sample.attitude.pitch_bam32), 12.25, 1e-7);
  assert_near(degrees(sample.attitude.roll_bam32), -33.5, 1e-7);
  TraxConfig config;
  config.true_heading = true;
  assert_int_equal(only(trax_data(some_motion(), {5}), config).fields, kNavHeading);
}

TEST(components_in_any_order) {
  const NavSample sample = only(trax_data(some_motion(), {7, 76, 25, 75, 8, 24, 74}));
  assert_int_equal(sample.fields, kNavRollPitch | kNavRates);
  assert_int_equal(sample.rate_urad_s[0], 500'000);
  assert_int_equal(sample.rate_urad_s[1], -250'000);
  assert_int_equal(sample.rate_urad_s[2], 125'000);
}

TEST(half_an_attitude_is_none) {
  const NavSample sample = only(trax_data(some_motion(), {24, 74}));
  assert_int_equal(sample.fields, 0);
  assert_int_equal(sample.attitude.pitch_bam32, 0);
  assert_int_equal(sample.rate_urad_s[0], 0);
}

TEST(distorted_heading) {
  const Bytes frame = trax_data(some_motion(), {5, 24, 25, 8}, true);
  assert_int_equal(only(frame).fields, kNavRollPitch);
  assert_int_equal(only(frame).attitude.heading_bam32, 0);
  TraxConfig config;
  config.keep_distorted = true;
  assert_int_equal(only(frame, config).fields, kNavRollPitch | kNavHeadingMagnetic);
  assert_int_equal(only(frame, config).quality, 127);
}

TEST(values_that_no_device_sends) {
  const auto bad = [](const Bytes& payload) {
    return counters_of(trax_frame(5, payload)).bad_values;
  };
  const auto single = [](unsigned id, double value) {
    ByteWriter payload(ByteOrder::kBig);
    payload.u8(1).u8(id).f32(value);
    return payload.bytes();
  };
  assert_int_equal(bad(single(5, 361)), 1);
  assert_int_equal(bad(single(5, std::nan(""))), 1);
  assert_int_equal(bad(single(24, 91)), 1);
  assert_int_equal(bad(single(25, -181)), 1);
  assert_int_equal(bad(single(75, 1e6)), 1);
  assert_int_equal(bad(single(200, 1)), 1);  // no such component
  assert_int_equal(bad({}), 1);
  assert_int_equal(bad({2, 8, 0}), 1);     // one is missing
  assert_int_equal(bad({1, 8, 0, 0}), 1);  // one byte too many
  assert_int_equal(bad({1, 5, 0, 0}), 1);
  // A quaternion and states that are of no interest.
  ByteWriter payload(ByteOrder::kBig);
  payload.u8(3).u8(77).f32(0).f32(0).f32(0).f32(1).u8(79).u8(1).u8(9).u8(1);
  assert_int_equal(only(trax_frame(5, payload.bytes())).fields, 0);
}

TEST(start_up_and_continuous_output) {
  TraxConfig config;
  config.interval_us = 100'000;
  Line line(config);
  line.device.reboot(0);
  line.run(5'000'000);
  // Stop, three times the name, components, interval, start.
  assert_true(line.sent[0] == from_hex("00 05 16 8d 02"));
  for (int i = 1; i <= 3; ++i) {
    assert_true(line.sent[static_cast<std::size_t>(i)] == from_hex("00 05 01 ef d4"));
  }
  const auto count = line.sent.size();
  assert_true(line.sent[count - 3] == from_hex("00 09 03 03 05 18 19 df de"));
  // SetAcqParams: continuous, no flush, 0, 0.1 s as a single rounded down.
  const Bytes interval = line.sent[count - 2];
  assert_true(Bytes(interval.begin(), interval.end() - 2) ==
              from_hex("00 0f 18 00 00 00 00 00 00 3d cc cc cc"));
  assert_true(line.sent[count - 1] == from_hex("00 05 15 bd 61"));
  assert_true(line.samples.size() >= 40 && line.samples.size() <= 50);
  assert_int_equal(line.samples.back().fields, kNavRollPitch | kNavHeadingMagnetic);
}

TEST(polled) {
  TraxConfig config;
  config.poll = true;
  config.with_rates = true;
  config.with_distortion = true;
  config.interval_us = 200'000;
  Line line(config);
  line.run(5'000'000);
  assert_true(line.device.components() == std::vector<unsigned>({5, 24, 25, 8, 74, 75, 76}));
  assert_true(line.samples.size() >= 20 && line.samples.size() <= 25);
  assert_int_equal(line.samples.back().fields, kNavRollPitch | kNavHeadingMagnetic | kNavRates);
  assert_int_equal(line.codec.counters().timeouts, 0);
  line.device.set_silent(true);
  line.run(6'400'000);
  assert_int_equal(line.codec.counters().timeouts, 2);
}

TEST(starts_again_after_a_reboot) {
  for (const bool poll : {false, true}) {
    TraxConfig config;
    config.poll = poll;
    Line line(config);
    line.run(2'000'000);
    assert_true(!line.samples.empty());
    line.device.reboot(line.now_us);
    line.run(10'000'000);
    assert_true(line.codec.counters().restarts >= 1);
    assert_true(line.now_us - line.samples.back().t_us < 300'000);
  }
}

TEST(a_device_that_does_not_answer_is_asked_again) {
  TraxConfig config;
  Line line(config);
  line.device.set_silent(true);
  line.run(3'000'000);
  assert_int_equal(line.samples.size(), 0);
  assert_true(line.codec.counters().timeouts >= 4);
  line.device.set_silent(false);
  line.run(5'000'000);
  assert_true(line.samples.size() > 10);
}

TEST(a_lost_answer_to_the_interval_starts_over) {
  TraxConfig config;
  TraxCodec codec(config);
  std::array<std::uint8_t, TraxCodec::kMaxRequest_bytes> out{};
  std::int64_t now_us = 0;
  std::vector<unsigned> ids;
  for (; now_us < 1'500'000; now_us += 10'000) {
    if (codec.request(now_us, out.data(), out.size()) == 0) {
      continue;
    }
    ids.push_back(out[2]);
    if (out[2] == 1) {
      samples_of(codec, trax_frame(2, {'T', 'R', 'A', 'X'}), now_us);
    }
  }
  const std::vector<unsigned> once{22, 1, 1, 1, 3, 24};
  assert_true(ids.size() >= 12);
  for (std::size_t i = 0; i < ids.size(); ++i) {
    assert_int_equal(ids[i], once[i % once.size()]);
  }
  assert_true(codec.counters().timeouts >= 1);
}

TEST(no_room_and_time_that_goes_back) {
  TraxConfig config;
  config.poll = true;
  Line line(config);
  std::array<std::uint8_t, TraxCodec::kMaxRequest_bytes> out{};
  assert_int_equal(line.codec.request(0, out.data(), out.size() - 1), 0);
  line.run(1'000'000);
  const std::size_t before = line.samples.size();
  assert_true(before > 0);
  // The codec's clock goes back by an hour: the next poll does not wait for it.
  assert_true(line.codec.request(-3'600'000'000, out.data(), out.size()) > 0);
}

TEST(restart_sets_up_again) {
  Line line(TraxConfig{});
  line.run(1'000'000);
  line.codec.restart();
  line.sent.clear();
  line.run(1'010'000);
  assert_true(!line.sent.empty());
  assert_true(line.sent[0] == from_hex("00 05 16 8d 02"));
  assert_int_equal(line.codec.counters().restarts, 0);
}

TEST(damage_costs_one_frame) {
  const Bytes frame = trax_data(some_motion(), {5, 24, 25});
  leadline::test::check_damage_costs_one_frame<TraxCodec>(TraxConfig{}, frame);
  leadline::test::check_damage_is_noticed<TraxCodec>(TraxConfig{}, frame);
  leadline::test::check_noise<TraxCodec>(TraxConfig{}, frame);
}
