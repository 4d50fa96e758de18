// A Ping360 codec and an emulated scanning head at the two ends of a line.
#include "hal/emu/emulated_ping1d.hpp"
#include "hal/emu/emulated_ping360.hpp"
#include "hal/heads/ping1d.hpp"
#include "hal/heads/ping360.hpp"
#include "tests/support/device_bytes.hpp"
#include "tests/support/ping_line.hpp"

namespace {

using leadline::base::Ping;
using leadline::base::ReturnKind;
using leadline::base::TimeUs;
using leadline::emu::EmulatedPing1d;
using leadline::emu::EmulatedPing360;
using leadline::emu::EmulatedPing360Config;
using leadline::emu::FaultConfig;
using leadline::emu::Ping360Shot;
using leadline::hal::Ping360Codec;
using leadline::hal::Ping360Config;
using leadline::test::Bytes;
using leadline::test::Line;
using leadline::test::sinking;
using leadline::test::wall;

constexpr TimeUs kSecond_us = 1'000'000;

std::size_t loudest(const Ping& ping) {
  std::size_t best = 0;
  for (std::size_t i = 1; i < ping.profile.bin_count; ++i) {
    best = ping.profile.intensity[i] > ping.profile.intensity[best] ? i : best;
  }
  return best;
}

Ping360Config sector() {
  Ping360Config config;
  config.max_range_um = 10'000'000;
  config.scan_first_grad = 150;
  config.scan_last_grad = 250;
  config.scan_step_grad = 5;
  return config;
}

TEST(ping360_scans_by_itself) {
  TimeUs t_shot_us = 0;
  EmulatedPing360 device({}, [&t_shot_us](const Ping360Shot& shot) {
    t_shot_us = shot.t_transmit_us;
    return wall(shot);
  });
  Ping360Codec codec(sector());
  Line<Ping360Codec> line(codec, device);
  std::vector<int> angles;
  line.run_until(20 * kSecond_us, [&](const Ping& ping) {
    assert_in_range(ping.t_transmit_us - t_shot_us, 0, 999);  // the line's step
    const double azimuth = static_cast<std::int32_t>(ping.azimuth_bam32) / 4294967296.0;
    angles.push_back(static_cast<int>(std::lround(azimuth * 400)) + 200);
    const double range_m = (static_cast<double>(ping.profile.first_bin_um) +
                            static_cast<double>(loudest(ping)) * ping.profile.bin_um) /
                           1e6;
    assert_near(range_m * std::cos(azimuth * 2 * 3.14159265358979), 5.0, 0.006);
  });
  assert_true(codec.running() && device.scanning());
  assert_true(angles.size() > 100);
  // To and fro, every fifth gradian.
  for (std::size_t i = 1; i < angles.size(); ++i) {
    assert_int_equal(std::abs(angles[i] - angles[i - 1]), 5);
    assert_in_range(angles[i], 150, 250);
  }
  assert_int_equal(codec.counters().timeouts + codec.counters().restarts, 0);
  assert_int_equal(codec.counters().refused_settings, 0);
}

TEST(ping360_polled_goes_to_and_fro) {
  EmulatedPing360 device({}, wall);
  Ping360Config config = sector();
  config.poll_interval_us = 100'000;
  Ping360Codec codec(config);
  Line<Ping360Codec> line(codec, device);
  std::vector<int> angles;
  line.run_until(20 * kSecond_us, [&angles](const Ping& ping) {
    const double azimuth = static_cast<std::int32_t>(ping.azimuth_bam32) / 4294967296.0;
    angles.push_back(static_cast<int>(std::lround(azimuth * 400)) + 200);
  });
  assert_in_range(angles.size(), 120, 200);
  assert_int_equal(angles.front(), 150);
  for (std::size_t i = 1; i < angles.size(); ++i) {
    assert_int_equal(std::abs(angles[i] - angles[i - 1]), 5);
  }
  assert_int_equal(device.missed(), 0);
  assert_int_equal(codec.counters().timeouts, 0);
}

TEST(ping360_a_late_answer_leaves_the_younger_request_waiting) {
  EmulatedPing360 device({}, wall);
  Ping360Config config = sector();
  config.poll_interval_us = 20'000;
  Ping360Codec codec(config);
  TimeUs t_us = 0;
  Bytes answer;
  std::uint8_t out[Ping360Codec::kMaxRequest_bytes];
  // Until a beam is asked for and the answer is there, not yet delivered.
  for (; answer.size() < 1000; t_us += 1000) {
    for (const std::uint8_t byte : answer) {
      Ping ping{};
      static_cast<void>(codec.feed(byte, t_us, ping));
    }
    answer.clear();
    device.take(t_us, out, codec.request(t_us, out, sizeof out));
    device.advance(t_us, answer);
  }
  Bytes stale = answer;
  stale[10] = 155;  // the angle was 150
  const unsigned sum = stale[stale.size() - 2] + 256U * stale.back() + 5U;
  stale[stale.size() - 2] = static_cast<std::uint8_t>(sum);
  stale.back() = static_cast<std::uint8_t>(sum >> 8U);
  // A ping it is, but not the answer: no new request before that has come.
  assert_int_equal(leadline::test::records_of<Ping>(codec, stale, t_us).size(), 1);
  assert_int_equal(codec.request(t_us + 100'000, out, sizeof out), 0);
  assert_int_equal(leadline::test::records_of<Ping>(codec, answer, t_us + 100'000).size(), 1);
  assert_int_equal(codec.request(t_us + 120'000, out, sizeof out), 24);
}

TEST(ping360_old_firmware_is_polled_round_and_round) {
  EmulatedPing360Config old;
  old.identity.firmware = {3, 3, 0};
  EmulatedPing360 device(old, wall);
  Ping360Config config = sector();
  config.scan_first_grad = 0;
  config.scan_last_grad = 399;
  config.scan_step_grad = 7;
  Ping360Codec codec(config);
  Line<Ping360Codec> line(codec, device);
  std::vector<int> angles;
  line.run_until(30 * kSecond_us, [&angles](const Ping& ping) {
    const double azimuth = static_cast<std::int32_t>(ping.azimuth_bam32) / 4294967296.0;
    angles.push_back((static_cast<int>(std::lround(azimuth * 400)) + 600) % 400);
  });
  assert_true(angles.size() > 150);
  assert_int_equal(angles.front(), 0);
  for (std::size_t i = 1; i < angles.size(); ++i) {
    assert_int_equal(angles[i], angles[i - 1] + 7 < 400 ? angles[i - 1] + 7 : 0);
  }
  assert_int_equal(codec.counters().nacks, 0);
}

TEST(ping360_sectors_of_every_kind) {
  const struct {
    int first, last, step;
    std::vector<int> expected;
  } cases[] = {
      {390, 10, 10, {390, 0, 10, 0, 390, 0}},
      {-10, 10, 9, {390, 399, 8, 399, 390, 399}},
      {100, 100, 3, {100, 100, 100}},
      {100, 102, 5, {100, 100, 100}},
      {0, 395, 10, {0, 10, 20}},
  };
  for (const auto& one : cases) {
    EmulatedPing360 device({}, wall);
    Ping360Config config = sector();
    config.poll_interval_us = 20'000;
    config.scan_first_grad = one.first;
    config.scan_last_grad = one.last;
    config.scan_step_grad = one.step;
    Ping360Codec codec(config);
    Line<Ping360Codec> line(codec, device);
    std::vector<int> angles;
    line.run_until(10 * kSecond_us, [&angles](const Ping& ping) {
      const double azimuth = static_cast<std::int32_t>(ping.azimuth_bam32) / 4294967296.0;
      angles.push_back((static_cast<int>(std::lround(azimuth * 400)) + 600) % 400);
    });
    assert_true(angles.size() >= one.expected.size());
    angles.resize(one.expected.size());
    assert_true(angles == one.expected);
  }
}

TEST(ping360_silence_and_reboot) {
  EmulatedPing360 device({}, wall);
  Ping360Codec codec(sector());
  Line<Ping360Codec> line(codec, device);
  assert_true(line.count_until(10 * kSecond_us) > 50);
  device.set_silent(true);
  assert_int_equal(line.count_until(30 * kSecond_us), 0);
  assert_false(codec.running());
  device.set_silent(false);
  assert_true(line.count_until(50 * kSecond_us) > 100);
  device.reboot(line.now_us(), 2 * kSecond_us);
  assert_false(device.scanning());
  assert_true(line.count_until(70 * kSecond_us) > 60);
  assert_true(device.scanning());
  assert_in_range(codec.counters().restarts, 2, 3);
}

TEST(ping360_polled_silence_starts_over) {
  EmulatedPing360 device({}, wall);
  Ping360Config config = sector();
  config.poll_interval_us = 50'000;
  Ping360Codec codec(config);
  Line<Ping360Codec> line(codec, device);
  assert_true(line.count_until(10 * kSecond_us) > 50);
  device.set_silent(true);
  assert_int_equal(line.count_until(60 * kSecond_us), 0);
  assert_true(codec.counters().restarts >= 1);
  device.set_silent(false);
  assert_true(line.count_until(75 * kSecond_us) > 50);
}

TEST(ping360_keeps_its_own_settings) {
  EmulatedPing360 device({}, wall);
  Ping360Codec codec(sector());
  Line<Ping360Codec> line(codec, device);
  line.count_until(10 * kSecond_us);
  // Another host asks for a shorter range; the frames say so, and after five the codec asks again.
  leadline::emu::PayloadWriter scan;
  scan.u8(1).u8(1).u16(20).u16(100).u16(750).u16(1000).u16(150).u16(250).u8(5).u8(0);
  const Bytes frame = leadline::emu::ping_frame(2602, 0, 0, scan.payload());
  device.take(line.now_us(), frame.data(), frame.size());
  std::size_t foreign = 0;
  std::size_t own = 0;
  line.run_until(20 * kSecond_us, [&](const Ping& ping) {
    const bool short_bins = ping.profile.bin_um == 1875;
    foreign += short_bins ? 1 : 0;
    own += short_bins ? 0 : 1;
  });
  assert_in_range(foreign, 5, 7);
  assert_true(own > 50);
  assert_int_equal(codec.counters().refused_settings, 1);
}

TEST(ping360_finds_a_head_that_is_already_scanning) {
  EmulatedPing360 device({}, wall);
  {
    Ping360Codec before(sector());
    Line<Ping360Codec> line(before, device);
    line.count_until(5 * kSecond_us);
  }
  assert_true(device.scanning());
  Ping360Config config = sector();
  config.poll_interval_us = 100'000;
  Ping360Codec codec(config);
  for (TimeUs t_us = 5 * kSecond_us; t_us < 12 * kSecond_us; t_us += 1000) {
    std::uint8_t out[Ping360Codec::kMaxRequest_bytes];
    device.take(t_us, out, codec.request(t_us, out, sizeof out));
    Bytes bytes;
    device.advance(t_us, bytes);
    Ping ping{};
    for (const std::uint8_t byte : bytes) {
      static_cast<void>(codec.feed(byte, t_us, ping));
    }
  }
  assert_false(device.scanning());
  assert_true(codec.running());
  assert_true(codec.counters().records > 20);
}

TEST(ping360_wrong_device_and_refusals) {
  EmulatedPing1d altimeter_there({}, sinking);
  Ping360Codec codec(sector());
  Line<Ping360Codec> line(codec, altimeter_there);
  assert_int_equal(line.count_until(20 * kSecond_us), 0);
  assert_false(codec.running());
  assert_true(codec.counters().wrong_device > 0);
  assert_true(codec.counters().nacks > 0);  // of motor_off

  Ping360Codec old(sector());
  Ping ping{};
  std::uint8_t out[Ping360Codec::kMaxRequest_bytes];
  const auto refuse = [&old, &ping](unsigned id) {
    for (const std::uint8_t byte :
         leadline::emu::ping_frame(2, 2, 0, leadline::emu::PayloadWriter().u16(id).payload())) {
      assert_false(old.feed(byte, 0, ping));
    }
  };
  assert_int_equal(old.request(0, out, sizeof out - 1), 0);
  assert_int_equal(old.request(0, out, sizeof out), 10);
  refuse(2903);
  assert_int_equal(old.request(1000, out, sizeof out), 12);
  refuse(5);
  assert_int_equal(old.request(2000, out, sizeof out), 12);
  refuse(4);
  assert_int_equal(old.request(3000, out, sizeof out), 24);  // polls: nothing says that it can scan
  refuse(2601);
  assert_int_equal(old.request(4000, out, sizeof out), 0);  // not again before the time-out
  assert_int_equal(old.counters().nacks, 4);
  old.restart();
  assert_int_equal(old.request(5000, out, sizeof out), 10);
}

TEST(ping360_over_a_bad_line) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    for (const int interval_us : {0, 100'000}) {
      EmulatedPing360Config slow;
      slow.byte_time_ns = 10'850;  // 921600 baud
      EmulatedPing360 device(slow, wall);
      Ping360Config config = sector();
      config.poll_interval_us = interval_us;
      Ping360Codec codec(config);
      FaultConfig bad;
      bad.seed = seed;
      bad.drop_ppm = 30;
      bad.corrupt_ppm = 30;
      bad.repeat_ppm = 30;
      bad.truncate_ppm = 30;
      FaultConfig up = bad;
      up.seed = seed + 100;
      up.drop_ppm = 2000;
      Line<Ping360Codec> line(codec, device, bad, up);
      std::size_t count = 0;
      line.run_until(120 * kSecond_us, [&count](const Ping& ping) {
        ++count;
        assert_int_equal(ping.kind, ReturnKind::kProfile);
      });
      assert_true(count > 400);
      assert_true(codec.counters().skipped_bytes > 0);
      // Nothing that the head sent whole is lost to a neighbour's damage.
      const auto& faults = line.down().counters();
      assert_true(count + faults.dropped + faults.corrupted + faults.repeated + faults.truncated >
                  device.shots() - 3);
    }
  }
}

}  // namespace
