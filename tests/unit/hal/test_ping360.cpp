#include <fstream>
#include <iterator>

#include "hal/heads/ping360.hpp"
#include "hal/wire.hpp"
#include "model/base/fixed.hpp"
#include "tests/support/device_bytes.hpp"

namespace {

using leadline::base::Ping;
using leadline::base::ReturnKind;
using leadline::hal::ping360_settings;
using leadline::hal::Ping360Codec;
using leadline::hal::Ping360Config;
using leadline::hal::Ping360Settings;
using leadline::hal::write_ping_frame;
using leadline::hal::write_u16_le;
using leadline::test::Bytes;
using leadline::test::from_hex;
using leadline::test::Random;
using leadline::test::random_bytes;
using leadline::test::records_of;
using leadline::test::without;
using leadline::test::operator+;

struct Shot {
  unsigned angle = 200;
  unsigned period = 88;
  unsigned frequency = 750;
  unsigned pulse = 32;
  unsigned gain = 0;
  unsigned mode = 1;
};

Bytes frame_of(unsigned id, const Bytes& payload, unsigned source = 2) {
  Bytes out(payload.size() + leadline::hal::kPingOverhead_bytes);
  assert_int_equal(
      write_ping_frame(static_cast<std::uint16_t>(id), static_cast<std::uint8_t>(source), 0,
                       payload.data(), payload.size(), out.data(), out.size()),
      out.size());
  return out;
}

Bytes data_frame(const Shot& shot, const Bytes& samples, int claimed = -1, bool automatic = false,
                 unsigned source = 2) {
  const std::size_t tail = automatic ? 16 : 10;
  Bytes payload(tail + 4);
  payload[0] = static_cast<std::uint8_t>(shot.mode);
  payload[1] = static_cast<std::uint8_t>(shot.gain);
  write_u16_le(payload.data() + 2, static_cast<std::uint16_t>(shot.angle));
  write_u16_le(payload.data() + 4, static_cast<std::uint16_t>(shot.pulse));
  write_u16_le(payload.data() + 6, static_cast<std::uint16_t>(shot.period));
  write_u16_le(payload.data() + 8, static_cast<std::uint16_t>(shot.frequency));
  const auto count = static_cast<std::uint16_t>(samples.size());
  write_u16_le(payload.data() + tail, claimed < 0 ? count : static_cast<std::uint16_t>(claimed));
  write_u16_le(payload.data() + tail + 2, count);
  return frame_of(automatic ? 2301 : 2300, payload + samples, source);
}

Ping360Config wide() {
  Ping360Config config;
  config.min_range_um = 0;
  config.max_range_um = 1'000'000'000;
  return config;
}

Ping only(Ping360Codec& codec, const Bytes& bytes, std::int64_t t_us = 0) {
  const auto pings = records_of<Ping>(codec, bytes, t_us);
  assert_int_equal(pings.size(), 1);
  return pings[0];
}

}  // namespace

TEST(a_beam) {
  Ping360Config config = wide();
  config.mount = 5;
  Ping360Codec codec(config);
  Bytes samples(1200);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i] = static_cast<std::uint8_t>(i);
  }
  Ping ping{};
  const Bytes frame = data_frame({300}, samples);
  bool done = false;
  for (const std::uint8_t byte : frame) {
    done = codec.feed(byte, 500'000, ping);
  }
  assert_true(done);
  assert_int_equal(ping.kind, ReturnKind::kProfile);
  assert_int_equal(ping.mount, 5);
  assert_int_equal(ping.quality, 255);
  assert_int_equal(ping.azimuth_bam32, leadline::base::kBam32QuarterTurn);
  assert_int_equal(ping.elevation_bam32, 0);
  assert_int_equal(ping.profile.bin_um, 1650);  // 88 * 25 ns * 1500 m/s / 2
  assert_int_equal(ping.profile.first_bin_um, 825);
  assert_int_equal(ping.profile.bin_count, 1200);
  for (int i = 0; i < 1200; ++i) {
    assert_int_equal(ping.profile.intensity[i], i & 0xFF);
  }
  assert_int_equal(ping.t_transmit_us, 500'000 - 2640);  // 1200 * 2.2 us
  assert_int_equal(ping.t_receive_us, 500'000);
  assert_false(codec.next(ping));
  assert_int_equal(codec.counters().records, 1);
}

TEST(a_beam_of_an_automatic_scan) {
  Ping360Codec codec(wide());
  const Ping ping = only(codec, data_frame({100}, Bytes(1200, 3), -1, true));
  assert_int_equal(ping.azimuth_bam32, 3U * leadline::base::kBam32QuarterTurn);
  assert_int_equal(ping.profile.bin_count, 1200);
}

TEST(every_angle_both_senses) {
  for (unsigned angle = 0; angle < 400; ++angle) {
    Ping360Config config = wide();
    Ping360Codec clockwise(config);
    config.clockwise = false;
    Ping360Codec counter(config);
    const Bytes frame = data_frame({angle}, Bytes(200));
    const double turn = (static_cast<double>(angle) - 200.0) / 400.0;
    const auto azimuth = static_cast<std::int32_t>(only(clockwise, frame).azimuth_bam32);
    const auto mirrored = only(counter, frame).azimuth_bam32;
    assert_near(std::remainder(azimuth / 4294967296.0 - turn, 1.0), 0.0, 2e-10);
    assert_int_equal(static_cast<std::uint32_t>(azimuth) + mirrored, 0);
  }
  Ping360Config config = wide();
  config.forward_grad = -100;  // 300
  Ping360Codec turned(config);
  assert_int_equal(only(turned, data_frame({300}, Bytes(200))).azimuth_bam32, 0);
}

TEST(bins_outside_the_range_are_left_out) {
  Ping360Config config;
  config.min_range_um = 750'000;
  config.max_range_um = 1'500'000;
  Ping360Codec codec(config);
  Bytes samples(1200);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i] = static_cast<std::uint8_t>(i % 251);
  }
  Ping ping{};
  bool done = false;
  for (const std::uint8_t byte : data_frame({}, samples)) {
    done = codec.feed(byte, 0, ping);
  }
  assert_true(done);
  // Centres 825 + 1650 i micrometres: 455 is at 751575, 908 at 1499025.
  assert_int_equal(ping.profile.first_bin_um, 751'575);
  assert_int_equal(ping.profile.bin_count, 908 - 455 + 1);
  assert_int_equal(ping.profile.intensity[0], 455 % 251);
  assert_int_equal(ping.profile.intensity[453], 908 % 251);
  // The transmission was not later for it.
  assert_int_equal(ping.t_transmit_us, -2640);
  // A frame that ends in front of the nearest range has nothing to say.
  assert_int_equal(records_of<Ping>(codec, data_frame({200, 80}, Bytes(200))).size(), 0);
  assert_int_equal(codec.counters().bad_values, 1);
}

TEST(impossible_values_are_dropped) {
  Ping360Codec codec(wide());
  const Bytes samples(200, 1);
  const auto drop = [&codec](const Bytes& bytes) {
    const auto before = codec.counters().bad_values;
    assert_int_equal(records_of<Ping>(codec, bytes).size(), 0);
    assert_int_equal(codec.counters().bad_values, before + 1);
  };
  drop(data_frame({400}, samples));
  drop(data_frame({0xFFFF}, samples));
  drop(data_frame({200, 79}, samples));
  drop(data_frame({200, 40'001}, samples));
  drop(data_frame({200, 80, 499}, samples));
  drop(data_frame({200, 80, 1001}, samples));
  drop(data_frame({200, 80, 750, 32, 3}, samples));
  drop(data_frame({200, 80, 750, 32, 0, 2}, samples));
  drop(data_frame({}, samples, 199));
  drop(data_frame({}, samples, 1201));
  assert_int_equal(only(codec, data_frame({200, 80, 750, 32, 0, 0}, samples)).mount, 0);
  // Turned without transmitting: fine, but no ping.
  assert_int_equal(records_of<Ping>(codec, data_frame({}, {}, 1024)).size(), 0);
  assert_int_equal(codec.counters().bad_values, 10);
  const Ping longest = only(codec, data_frame({399, 40'000, 1000, 1000, 2}, Bytes(1200, 255)));
  assert_int_equal(longest.profile.bin_um, 750'000);
  assert_int_equal(longest.profile.intensity[1199], 255);
}

TEST(another_device_s_frames_are_left) {
  Ping360Config config = wide();
  config.device_id = 9;
  Ping360Codec codec(config);
  assert_int_equal(records_of<Ping>(codec, data_frame({}, Bytes(200))).size(), 0);
  assert_int_equal(records_of<Ping>(codec, data_frame({}, Bytes(200), -1, false, 9)).size(), 1);
  assert_int_equal(codec.counters().wrong_device, 1);
}

TEST(damage_costs_one_frame) {
  Bytes samples(240);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    samples[i] = static_cast<std::uint8_t>(17 * i);
  }
  samples[20] = 'B';
  samples[21] = 'R';
  const Bytes frame = data_frame({}, samples);
  for (std::size_t position = 0; position < frame.size(); ++position) {
    Ping360Codec codec(wide());
    assert_int_equal(records_of<Ping>(codec, without(frame, position) + frame + frame).size(), 2);
  }
}

TEST(settings_of_a_range) {
  const auto check = [](std::int64_t range_um, int speed_mm_s, int samples, unsigned pulse,
                        unsigned period, unsigned count) {
    const Ping360Settings settings = ping360_settings(range_um, speed_mm_s, samples);
    assert_int_equal(settings.transmit_duration_us, pulse);
    assert_int_equal(settings.sample_period_ticks, period);
    assert_int_equal(settings.number_of_samples, count);
  };
  // devices.md 1.3: 2 m, 1200 samples -> period 88; the pulse 8000 R / c = 10.7 us.
  check(2'000'000, 1'500'000, 1200, 11, 88, 1200);
  check(50'000'000, 1'500'000, 1200, 267, 2222, 1200);
  check(1'000'000, 1'500'000, 1200, 5, 80, 666);  // the shortest period: fewer samples
  check(100'000, 1'500'000, 1200, 5, 80, 200);    // and the fewest samples
  check(20'000'000'000, 1'500'000, 1200, 500, 40'000, 1200);
  check(5'000'000, 1'500'000, 200, 84, 1333, 200);  // 2.5 sample periods
  check(-1, 0, 0, 5, 80, 200);
}

TEST(settings_never_leave_the_limits) {
  Random random(4);
  for (int i = 0; i < 100'000; ++i) {
    const std::int64_t range_um = random.between(300'000, 800'000'000);
    const auto speed = static_cast<std::int32_t>(random.between(1'300'000, 1'700'000));
    const auto most = static_cast<std::int32_t>(random.between(200, 1200));
    const Ping360Settings s = ping360_settings(range_um, speed, most);
    assert_in_range(s.sample_period_ticks, 80, 40'000);
    assert_in_range(s.number_of_samples, 200, most);
    assert_in_range(s.transmit_duration_us, 5, 500);
    // What is heard reaches out to the range, but for the rounding of a tick or of a sample.
    const double reach = s.sample_period_ticks * 25e-9 * s.number_of_samples * speed * 1e3 / 2;
    const auto range = static_cast<double>(range_um);
    if (s.number_of_samples > 200 && s.sample_period_ticks < 40'000) {
      assert_true(reach <= range);
      assert_true(reach > range * (1.0 - 1.0 / 80.0) - 1500);
    }
  }
}

TEST(real_frames_of_a_tank) {
  const std::string path =
      leadline::test::require_data("ping360_sector_junayed/derived/frames.bin");
  std::ifstream file(path, std::ios::binary);
  const Bytes bytes{std::istreambuf_iterator<char>(file), {}};
  Ping360Codec codec(wide());
  const auto pings = records_of<Ping>(codec, bytes);
  assert_int_equal(pings.size(), 101);
  assert_int_equal(codec.counters().skipped_bytes, 0);
  for (std::size_t i = 0; i < pings.size(); ++i) {
    assert_int_equal(pings[i].profile.bin_count, 1200);
    const auto turned = static_cast<std::int32_t>(pings[i].azimuth_bam32);
    // 150 .. 250 gradians: 45 degrees to either side.
    assert_true(std::abs(static_cast<std::int64_t>(turned)) <= (std::int64_t{1} << 29U) + 1);
    const double far_m =
        (static_cast<double>(pings[i].profile.first_bin_um) + 1199.0 * pings[i].profile.bin_um) /
        1e6;
    assert_near(far_m, 2.0, 0.05);
  }
  // One byte lost anywhere costs at most the frame that it was in.
  Random random(5);
  for (int round = 0; round < 20; ++round) {
    const auto at = static_cast<std::size_t>(random.between(0, static_cast<int>(bytes.size()) - 1));
    Ping360Codec damaged(wide());
    assert_true(records_of<Ping>(damaged, without(bytes, at)).size() >= 100 ||
                at >= bytes.size() - 2 * 1224);
  }
}
