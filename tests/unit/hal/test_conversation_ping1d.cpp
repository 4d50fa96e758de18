// A Ping1D codec and an emulated altimeter at the two ends of a line.
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
using leadline::emu::EmulatedPing1dConfig;
using leadline::emu::EmulatedPing360;
using leadline::emu::FaultConfig;
using leadline::emu::Ping1dShot;
using leadline::hal::Ping1dCodec;
using leadline::hal::Ping1dConfig;
using leadline::test::Bytes;
using leadline::test::Line;
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

}  // namespace
