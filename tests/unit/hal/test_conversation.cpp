// Codecs and emulated devices talk to each other, well and badly.
#include <functional>
#include <memory>

#include "hal/attitude/nmea.hpp"
#include "hal/emu/emulated_ping1d.hpp"
#include "hal/emu/emulated_ping360.hpp"
#include "hal/emu/faulty_stream.hpp"
#include "hal/emu/nmea_talker.hpp"
#include "hal/heads/ping1d.hpp"
#include "hal/heads/ping360.hpp"
#include "tests/support/device_bytes.hpp"
#include "tests/support/ping_line.hpp"

namespace {

using leadline::base::NavSample;
using leadline::base::Ping;
using leadline::base::ReturnKind;
using leadline::base::TimeUs;
using leadline::emu::EmulatedDevice;
using leadline::emu::EmulatedPing1d;
using leadline::emu::EmulatedPing1dConfig;
using leadline::emu::EmulatedPing360;
using leadline::emu::EmulatedPing360Config;
using leadline::emu::FaultConfig;
using leadline::emu::FaultyStream;
using leadline::emu::NmeaKind;
using leadline::emu::NmeaTalker;
using leadline::emu::NmeaTalkerConfig;
using leadline::emu::NmeaTruth;
using leadline::emu::Ping1dEcho;
using leadline::emu::Ping1dShot;
using leadline::emu::Ping360Shot;
using leadline::hal::NmeaCodec;
using leadline::hal::Ping1dCodec;
using leadline::hal::Ping1dConfig;
using leadline::hal::Ping360Codec;
using leadline::hal::Ping360Config;
using leadline::test::Bytes;
using leadline::test::Line;
using leadline::test::Random;
using leadline::test::sinking;
using leadline::test::wall;

constexpr TimeUs kSecond_us = 1'000'000;

Ping1dConfig altimeter() {
  Ping1dConfig config;
  config.min_range_um = 500'000;
  config.max_range_um = 30'000'000;
  config.poll_interval_us = 100'000;
  return config;
}

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

}  // namespace

// --- Ping1D ---

TEST(ping1d_polled) {
  EmulatedPing1d device({}, sinking);
  Ping1dCodec codec(altimeter());
  Line<Ping1dCodec> line(codec, device);
  std::size_t count = 0;
  line.run_until(10 * kSecond_us, [&count](const Ping& ping) {
    ++count;
    assert_int_equal(ping.kind, ReturnKind::kRange);
    // The most recent measurement is at most one ping interval old: 1 mm, and 0.5 mm of rounding.
    assert_near(ping.range_um, 10'000'000.0 + static_cast<double>(ping.t_transmit_us) / 100, 1600);
  });
  assert_true(codec.running());
  assert_in_range(count, 90, 101);
  assert_false(device.mode_auto());
  assert_int_equal(device.scan_start_mm(), 500);
  assert_int_equal(device.scan_length_mm(), 29'500);
  assert_int_equal(device.sound_speed_mm_s(), 1'500'000);
  assert_int_equal(device.ping_interval_ms(), 100);
  assert_int_equal(device.gain_setting(), 3);
  assert_int_equal(codec.device().device_type, 1);
  assert_int_equal(codec.device().firmware[1], 29);
  assert_int_equal(codec.device().protocol[0], 1);
  const auto c = codec.counters();
  assert_int_equal(c.timeouts + c.restarts + c.nacks + c.refused_settings + c.bad_values, 0);
  assert_int_equal(c.skipped_bytes, 0);
}

TEST(ping1d_free_running_knows_its_time) {
  std::vector<TimeUs> shots;
  EmulatedPing1d device({}, [&shots](const Ping1dShot& shot) {
    shots.push_back(shot.t_transmit_us);
    return sinking(shot);
  });
  Ping1dConfig config = altimeter();
  config.poll_interval_us = 0;
  config.profile = true;
  Ping1dCodec codec(config);
  Line<Ping1dCodec> line(codec, device);
  std::size_t count = 0;
  line.run_until(10 * kSecond_us, [&](const Ping& ping) {
    // The newest shot whose listening is over; late by less than the line's step.
    const TimeUs t_us = shots[shots.size() - (shots.back() > ping.t_transmit_us ? 2 : 1)];
    assert_in_range(ping.t_transmit_us - t_us, 0, 999);
    if (++count < 3) {
      return;  // of the time before the settings
    }
    assert_int_equal(ping.kind, ReturnKind::kProfile);
    assert_int_equal(ping.profile.bin_count, 200);
    const double range_um = static_cast<double>(ping.profile.first_bin_um) +
                            static_cast<double>(loudest(ping)) * ping.profile.bin_um;
    assert_near(range_um, 10'000'000.0 + static_cast<double>(ping.t_transmit_us) / 100,
                ping.profile.bin_um / 2.0 + 1000);
  });
  // 30 m take 40 ms.
  assert_in_range(count, 230, 250);
  assert_int_equal(codec.counters().timeouts, 0);
}

TEST(ping1d_waits_for_the_next_where_the_device_does) {
  EmulatedPing1dConfig slow;
  slow.answers_with_next = true;
  slow.byte_time_ns = 86'806;
  slow.answer_delay_us = 3000;
  EmulatedPing1d device(slow, sinking);
  Ping1dConfig config = altimeter();
  config.byte_time_ns = 86'806;
  Ping1dCodec codec(config);
  Line<Ping1dCodec> line(codec, device);
  std::size_t count = 0;
  line.run_until(10 * kSecond_us, [&count](const Ping& ping) {
    ++count;
    // Late by the answer's delay and less than a step.
    const double distance_um = 10'000'000.0 + static_cast<double>(ping.t_transmit_us - 3000) / 100;
    assert_near(ping.range_um, distance_um, 520);
  });
  assert_true(count > 85);
  assert_int_equal(codec.counters().timeouts, 0);
}

TEST(ping1d_silence_is_survived) {
  EmulatedPing1d device({}, sinking);
  Ping1dCodec codec(altimeter());
  Line<Ping1dCodec> line(codec, device);
  assert_true(line.count_until(3 * kSecond_us) > 20);
  device.set_silent(true);
  const std::size_t sent = line.sent();
  assert_true(line.count_until(20 * kSecond_us) == 0);
  assert_false(codec.running());
  assert_true(codec.counters().timeouts > 5);
  assert_int_equal(codec.counters().restarts, 1);
  assert_true(line.sent() - sent < 17 * 3 * 30);  // about one request per time-out
  device.set_silent(false);
  assert_true(line.count_until(25 * kSecond_us) > 30);
  assert_true(codec.running());
}

TEST(ping1d_reboot_is_noticed_and_set_up_again) {
  EmulatedPing1d device({}, sinking);
  Ping1dCodec codec(altimeter());
  Line<Ping1dCodec> line(codec, device);
  assert_true(line.count_until(5 * kSecond_us) > 40);
  device.reboot(line.now_us(), 300'000);
  assert_true(device.mode_auto());
  assert_true(line.count_until(10 * kSecond_us) > 30);
  assert_false(device.mode_auto());
  assert_int_equal(device.scan_start_mm(), 500);
  assert_int_equal(codec.counters().restarts, 1);
}

TEST(ping1d_a_number_that_goes_back_is_a_reboot) {
  EmulatedPing1d device({}, sinking);
  Ping1dCodec codec(altimeter());
  Line<Ping1dCodec> line(codec, device);
  line.count_until(5 * kSecond_us);
  const auto measured = [&](std::uint32_t number) {
    leadline::emu::PayloadWriter distance;
    distance.u32(4000).u16(50).u16(100).u32(number).u32(500).u32(29'500).u32(3);
    return leadline::test::records_of<Ping>(
               codec, leadline::emu::ping_frame(1212, 1, 0, distance.payload()), line.now_us())
        .size();
  };
  assert_int_equal(measured(device.ping_number() + 1), 1);
  assert_true(codec.running());
  // The same scan, and still a measurement: but who counts from the start may have lost more.
  assert_int_equal(measured(1), 1);
  assert_false(codec.running());
  assert_int_equal(codec.counters().restarts, 1);
}

TEST(ping1d_settings_changed_behind_the_back) {
  EmulatedPing1d device({}, sinking);
  Ping1dCodec codec(altimeter());
  Line<Ping1dCodec> line(codec, device);
  line.count_until(3 * kSecond_us);
  // Another host moves the scan.
  const Bytes set = leadline::emu::ping_frame(
      1001, 0, 0, leadline::emu::PayloadWriter().u32(0).u32(5000).payload());
  device.take(line.now_us(), set.data(), set.size());
  line.count_until(6 * kSecond_us);
  assert_int_equal(device.scan_length_mm(), 29'500);
  assert_int_equal(codec.counters().restarts, 1);
}

TEST(ping1d_settings_that_do_not_hold) {
  EmulatedPing1d device({}, sinking);
  Ping1dConfig config = altimeter();
  config.max_range_um = 500'000'000;  // refused: the device reaches 200 m
  Ping1dCodec codec(config);
  Line<Ping1dCodec> line(codec, device);
  assert_true(line.count_until(8 * kSecond_us) > 10);
  assert_true(codec.running());
  assert_int_equal(codec.counters().refused_settings, 1);
  assert_int_equal(codec.counters().nacks, 3);
  assert_int_equal(codec.counters().restarts, 0);
}

TEST(ping1d_wrong_device_on_the_port) {
  EmulatedPing360 device({}, wall);
  Ping1dCodec codec(altimeter());
  Line<Ping1dCodec> line(codec, device);
  assert_int_equal(line.count_until(10 * kSecond_us), 0);
  assert_false(codec.running());
  assert_in_range(codec.counters().wrong_device, 1, 30);
  assert_int_equal(codec.device().device_type, 2);
}

TEST(ping1d_another_id_is_not_answered) {
  EmulatedPing1dConfig other;
  other.identity.device_id = 7;
  EmulatedPing1d device(other, sinking);
  Ping1dConfig config = altimeter();
  config.device_id = 1;
  Ping1dCodec codec(config);
  Line<Ping1dCodec> line(codec, device);
  assert_int_equal(line.count_until(5 * kSecond_us), 0);
  assert_int_equal(device.requests(), 0);
  config.device_id = 7;
  Ping1dCodec right(config);
  EmulatedPing1d again(other, sinking);
  Line<Ping1dCodec> good(right, again);
  assert_true(good.count_until(5 * kSecond_us) > 30);
}

TEST(ping1d_old_firmware_refuses_questions) {
  Ping1dCodec codec(altimeter());
  std::uint8_t out[Ping1dCodec::kMaxRequest_bytes];
  Ping ping{};
  assert_true(codec.request(0, out, sizeof out) > 0);
  const auto refuse = [&codec, &ping](unsigned id) {
    for (const std::uint8_t byte : leadline::emu::ping_frame(
             2, 1, 0, leadline::emu::PayloadWriter().u16(id).u8('?').payload())) {
      assert_false(codec.feed(byte, 0, ping));
    }
  };
  refuse(1401);  // of the stop in front of it: no answer to the question
  assert_int_equal(codec.request(1000, out, sizeof out), 0);
  refuse(5);
  assert_true(codec.request(2000, out, sizeof out) == 12);  // device information
  refuse(4);
  assert_true(codec.request(3000, out, sizeof out) > 12);  // the first setting
  assert_int_equal(codec.counters().nacks, 3);
}

TEST(ping1d_time_that_goes_back) {
  EmulatedPing1d device({}, sinking);
  Ping1dCodec codec(altimeter());
  Line<Ping1dCodec> line(codec, device);
  line.count_until(3 * kSecond_us);
  std::uint8_t out[Ping1dCodec::kMaxRequest_bytes];
  // One hour back, with a request under way: polling goes on in a time-out, not in an hour.
  assert_true(codec.request(line.now_us() + 200'000, out, sizeof out) > 0);
  std::size_t requests = 0;
  for (TimeUs t_us = -3600 * kSecond_us; t_us < -3590 * kSecond_us; t_us += 10'000) {
    requests += codec.request(t_us, out, sizeof out) > 0 ? 1 : 0;
  }
  assert_in_range(requests, 5, 30);  // the time-outs of a device that does not answer
}

TEST(ping1d_port_lost_and_found) {
  EmulatedPing1d device({}, sinking);
  Ping1dCodec codec(altimeter());
  FaultConfig breaks;
  breaks.disconnect_at_byte = 1000;
  Line<Ping1dCodec> line(codec, device, breaks);
  assert_true(line.count_until(10 * kSecond_us) > 10);
  assert_false(line.down().connected());
  line.down().reconnect();
  codec.restart();
  assert_true(line.count_until(15 * kSecond_us) > 30);
}

TEST(ping1d_over_a_bad_line) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    EmulatedPing1dConfig slow;
    slow.byte_time_ns = 86'806;
    EmulatedPing1d device(slow, sinking);
    Ping1dCodec codec(altimeter());
    FaultConfig bad;
    bad.seed = seed;
    bad.drop_ppm = 500;
    bad.corrupt_ppm = 500;
    bad.repeat_ppm = 500;
    bad.truncate_ppm = 300;
    bad.delay_ppm = 100;
    bad.delay_us = 300'000;
    FaultConfig up = bad;
    up.seed = seed + 100;
    Line<Ping1dCodec> line(codec, device, bad, up);
    std::size_t count = 0;
    line.run_until(120 * kSecond_us, [&count](const Ping& ping) {
      ++count;
      assert_int_equal(ping.kind, ReturnKind::kRange);
      assert_near(ping.range_um, 10'600'000.0, 620'000);
    });
    assert_true(count > 600);
    assert_true(codec.counters().timeouts > 0);
    assert_true(device.bad_requests() > 0);
    const auto c = codec.counters();
    assert_in_range(c.skipped_bytes, 1, line.down().counters().bytes_out);
  }
}

// --- Ping360 ---

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

// --- NMEA ---

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

// --- The emulators themselves ---

TEST(faulty_stream_is_repeatable_and_accounts_for_every_byte) {
  FaultConfig config;
  config.seed = 9;
  config.drop_ppm = 50'000;
  config.corrupt_ppm = 50'000;
  config.repeat_ppm = 50'000;
  config.truncate_ppm = 20'000;
  config.delay_ppm = 20'000;
  config.delay_us = 5000;
  config.disconnect_at_byte = 60'000;
  const auto run = [&config](leadline::emu::FaultCounters& counters) {
    FaultyStream stream(config);
    Random random(11);
    Bytes out;
    for (TimeUs t_us = 0; t_us < kSecond_us; t_us += 1000) {
      stream.pass(t_us, leadline::test::random_bytes(random, 70), out);
    }
    assert_false(stream.connected());
    stream.reconnect();
    assert_true(stream.connected());
    stream.pass(2 * kSecond_us, Bytes(100, 1), out);
    while (stream.next_event_us() != leadline::emu::kNever_us) {
      stream.pass(stream.next_event_us(), {}, out);
    }
    counters = stream.counters();
    return out;
  };
  leadline::emu::FaultCounters a{};
  leadline::emu::FaultCounters b{};
  const Bytes first = run(a);
  assert_true(first == run(b));
  assert_int_equal(a.bytes_in, 70'100);
  assert_int_equal(a.bytes_out, first.size());
  assert_int_equal(a.disconnects, 1);
  assert_int_equal(a.bytes_in + a.repeated,
                   a.bytes_out + a.dropped + a.truncated + a.lost_unplugged);
  assert_true(a.dropped > 100 && a.corrupted > 100 && a.repeated > 100 && a.truncated > 100 &&
              a.delays > 100 && a.lost_unplugged > 100);
}

TEST(emulators_refuse_what_the_devices_refuse) {
  const auto answer = [](EmulatedDevice& device, unsigned id, const Bytes& payload) {
    const Bytes frame = leadline::emu::ping_frame(id, 0, 0, payload);
    device.take(0, frame.data(), frame.size());
    Bytes out;
    device.advance(0, out);
    return out.empty() ? 0U : leadline::emu::payload_u16(out, 4);
  };
  using leadline::emu::PayloadWriter;
  EmulatedPing1d ping1d({}, sinking);
  assert_int_equal(answer(ping1d, 1001, PayloadWriter().u32(0).u32(5000).payload()),
                   2);  // automatic
  assert_int_equal(answer(ping1d, 1003, PayloadWriter().u8(0).payload()), 1);
  assert_int_equal(answer(ping1d, 1001, PayloadWriter().u32(0).u32(5000).payload()), 1);
  assert_int_equal(answer(ping1d, 1001, PayloadWriter().u32(0).u32(999).payload()), 2);
  assert_int_equal(answer(ping1d, 1002, PayloadWriter().u32(0).payload()), 2);
  assert_int_equal(answer(ping1d, 1005, PayloadWriter().u8(7).payload()), 2);
  assert_int_equal(answer(ping1d, 1004, PayloadWriter().u8(7).payload()), 2);  // too short
  assert_int_equal(answer(ping1d, 1400, PayloadWriter().u16(1212).payload()), 2);
  assert_int_equal(answer(ping1d, 6, PayloadWriter().u16(9999).payload()), 2);
  assert_int_equal(answer(ping1d, 6, PayloadWriter().u8(5).payload()), 2);
  assert_int_equal(answer(ping1d, 5, {}), 5);  // as old hosts ask
  assert_int_equal(answer(ping1d, 1208, {}), 1208);
  assert_int_equal(answer(ping1d, 1006, PayloadWriter().u8(0).payload()), 1);
  assert_int_equal(answer(ping1d, 1006, PayloadWriter().u8(1).payload()), 1);
  assert_int_equal(answer(ping1d, 77, Bytes(3)), 2);
  Bytes later;
  const Bytes simple = leadline::emu::ping_frame(6, 0, 0, PayloadWriter().u16(1211).payload());
  ping1d.take(50'000, simple.data(), simple.size());
  ping1d.advance(50'000, later);
  assert_int_equal(leadline::emu::payload_u16(later, 4), 1211);

  EmulatedPing360 ping360({}, wall);
  const auto beam = [](unsigned angle, unsigned samples) {
    return PayloadWriter()
        .u8(1)
        .u8(0)
        .u16(angle)
        .u16(32)
        .u16(88)
        .u16(750)
        .u16(samples)
        .u8(1)
        .u8(0)
        .payload();
  };
  assert_int_equal(answer(ping360, 2601, beam(400, 1200)), 2);
  assert_int_equal(answer(ping360, 2601, beam(0, 199)), 2);
  assert_int_equal(answer(ping360, 6, PayloadWriter().u16(2300).payload()), 2300);
  assert_int_equal(answer(ping360, 6, PayloadWriter().u16(1212).payload()), 2);
  assert_int_equal(answer(ping360, 2601, beam(100, 1200)), 0);  // on its way
  assert_int_equal(answer(ping360, 2601, beam(200, 1200)), 0);
  assert_int_equal(ping360.missed(), 1);
  assert_int_equal(answer(ping360, 2903, {}), 1);
  assert_int_equal(answer(ping360, 2602, Bytes(16)), 2);
  assert_int_equal(answer(ping360, 2600, PayloadWriter().u8(0).u8(0).payload()), 0);
  assert_int_equal(answer(ping360, 5, {}), 0);  // booting
}
