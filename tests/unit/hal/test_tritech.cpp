#include <cmath>

#include "hal/emu/emulated_tritech.hpp"
#include "hal/heads/tritech.hpp"
#include "hal/wire.hpp"
#include "tests/support/head_line.hpp"

namespace {

using leadline::base::Ping;
using leadline::base::ReturnKind;
using leadline::emu::EmulatedTritech;
using leadline::emu::EmulatedTritechConfig;
using leadline::emu::SeanetShot;
using leadline::hal::TritechCodec;
using leadline::hal::TritechConfig;
using leadline::hal::TritechHead;
using leadline::hal::write_u16_le;
using leadline::test::Bytes;
using leadline::test::degrees;
using leadline::test::from_hex;
using leadline::test::HeadLine;
using leadline::test::records_of;
using leadline::test::operator+;

constexpr std::int64_t kSecond_us = 1'000'000;

void set_u16(Bytes& bytes, std::size_t at, unsigned value) {
  write_u16_le(bytes.data() + at, static_cast<std::uint16_t>(value));
}

Bytes with_u16(Bytes bytes, std::size_t at, unsigned value) {
  set_u16(bytes, at, value);
  return bytes;
}

/// A frame around bytes 13 .. ; `size` in all.
Bytes frame_of(std::size_t size, unsigned type, unsigned sender = 2) {
  Bytes out(size, 0);
  char text[8];
  std::snprintf(text, sizeof text, "@%04X", static_cast<unsigned>(size - 6));
  std::copy(text, text + 5, out.begin());
  set_u16(out, 5, static_cast<unsigned>(size - 6));
  out[7] = static_cast<std::uint8_t>(sender);
  out[8] = 0xFF;
  out[9] = type == 2 ? std::uint8_t{0} : static_cast<std::uint8_t>(size - 11);
  out[10] = static_cast<std::uint8_t>(type);
  out[11] = 0x80;
  out[12] = static_cast<std::uint8_t>(sender);
  out.back() = 0x0A;
  return out;
}

Bytes image(unsigned bearing, const Bytes& data, bool wide = true, unsigned interval = 208) {
  Bytes out = frame_of(45 + data.size(), 2);
  set_u16(out, 13, static_cast<unsigned>(31 + data.size()));
  out[15] = 0x11;
  out[18] = wide ? 7 : 6;
  out[19] = 0x23;
  out[26] = 73;
  set_u16(out, 33, interval);
  set_u16(out, 37, 6399);
  out[39] = 16;
  set_u16(out, 40, bearing);
  set_u16(out, 42, static_cast<unsigned>(data.size()));
  std::copy(data.begin(), data.end(), out.begin() + 44);
  return out;
}

Bytes sweep(const std::vector<unsigned>& times_us, bool right) {
  Bytes out = frame_of(51 + 2 * times_us.size(), 2, 20);
  set_u16(out, 13, static_cast<unsigned>(37 + 2 * times_us.size()));
  out[18] = right ? 4 : 0;
  set_u16(out, 31, 3000);
  set_u16(out, 33, 3400);
  out[35] = 32;
  set_u16(out, 36, 3000);  // 0.3 s
  set_u16(out, 38, static_cast<unsigned>(times_us.size()));
  for (std::size_t i = 0; i < times_us.size(); ++i) {
    set_u16(out, 40 + 2 * i, times_us[i]);
  }
  return out;
}

void check_rejected(const Bytes& bytes) {
  TritechCodec codec({});
  assert_int_equal(records_of<Ping>(codec, bytes).size(), 0);
  assert_true(leadline::hal::rejected(codec.counters()) >= 1);
  assert_int_equal(records_of<Ping>(codec, image(3200, Bytes(20, 1))).size(), 1);
}

/// Feeds all, and leaves the last record's profile alive.
Ping last_of(TritechCodec& codec, const Bytes& bytes, std::int64_t t_us = kSecond_us) {
  Ping ping{};
  bool done = false;
  for (const std::uint8_t byte : bytes) {
    done = codec.feed(byte, t_us, ping);
  }
  assert_true(done);
  return ping;
}

}  // namespace

TEST(an_image_line) {
  TritechConfig config;
  config.mount = 6;
  TritechCodec codec(config);
  Bytes data(200);
  for (std::size_t i = 0; i < data.size(); ++i) {
    data[i] = static_cast<std::uint8_t>(i);  // 0x0A and 0x40 among them
  }
  const Ping ping = last_of(codec, image(4800, data));
  assert_int_equal(ping.kind, ReturnKind::kProfile);
  assert_int_equal(ping.mount, 6);
  assert_int_equal(ping.azimuth_bam32, leadline::base::kBam32QuarterTurn);
  assert_int_equal(ping.elevation_bam32, 0);
  assert_int_equal(ping.profile.bin_um, 99'840);  // 208 * 640 ns * 1500 m/s / 2
  assert_int_equal(ping.profile.first_bin_um, 49'920);
  assert_int_equal(ping.profile.bin_count, 200);
  for (int i = 0; i < 200; ++i) {
    assert_int_equal(ping.profile.intensity[i], i);
  }
  assert_int_equal(ping.t_transmit_us, kSecond_us - 26'624);
  assert_int_equal(ping.t_receive_us, kSecond_us);
  config.clockwise = false;
  TritechCodec other(config);
  assert_int_equal(last_of(other, image(4800, data)).azimuth_bam32,
                   3U * leadline::base::kBam32QuarterTurn);
}

TEST(four_bits) {
  TritechConfig config;
  TritechCodec codec(config);
  Ping ping = last_of(codec, image(3200, {0x12, 0x34, 0xF0}, false));
  assert_int_equal(ping.profile.bin_count, 6);
  const int high_first[] = {1, 2, 3, 4, 15, 0};
  for (int i = 0; i < 6; ++i) {
    assert_int_equal(ping.profile.intensity[i], high_first[i]);
  }
  config.high_nibble_first = false;
  TritechCodec other(config);
  ping = last_of(other, image(3200, {0x12, 0x34, 0xF0}, false));
  const int low_first[] = {2, 1, 4, 3, 0, 15};
  for (int i = 0; i < 6; ++i) {
    assert_int_equal(ping.profile.intensity[i], low_first[i]);
  }
}

TEST(sweeps_of_the_profiler_in_both_directions) {
  TritechCodec codec({});
  auto pings = records_of<Ping>(codec, sweep({4000, 0, 8000}, true), kSecond_us);
  assert_int_equal(pings.size(), 3);
  assert_int_equal(pings[0].kind, ReturnKind::kRange);
  assert_int_equal(pings[0].range_um, 3'000'000);
  assert_int_equal(pings[1].kind, ReturnKind::kNoReturn);
  assert_int_equal(pings[1].range_um, 0);
  assert_int_equal(pings[2].range_um, 6'000'000);
  // To the right it ends at the right limit: 3400, 11.25 deg.
  assert_near(degrees(pings[2].azimuth_bam32), 11.25, 1e-6);
  assert_near(degrees(pings[0].azimuth_bam32), 11.25 - 3.6, 1e-6);
  assert_int_equal(pings[0].t_transmit_us, kSecond_us - 300'000);
  assert_int_equal(pings[2].t_transmit_us, kSecond_us - 100'000);
  assert_int_equal(pings[2].t_receive_us, kSecond_us - 92'000);
  pings = records_of<Ping>(codec, sweep({4000, 0, 8000}, false));
  assert_near(degrees(pings[0].azimuth_bam32), 11.25, 1e-6);
  assert_near(degrees(pings[2].azimuth_bam32), 11.25 - 3.6, 1e-6);
}

TEST(impossible_frames_are_dropped) {
  const Bytes good = image(3200, Bytes(20, 1));
  check_rejected(with_u16(good, 5, 60));   // the two lengths differ
  check_rejected(with_u16(good, 13, 52));  // lengths of the data
  check_rejected(with_u16(good, 42, 19));
  check_rejected(with_u16(good, 33, 4));  // interval
  check_rejected(with_u16(good, 33, 1501));
  check_rejected(with_u16(good, 35, 6400));  // limits
  check_rejected(with_u16(good, 40, 6400));  // bearing
  Bytes other = good;
  other[12] = 3;  // node
  check_rejected(other);
  other = good;
  other[8] = 2;  // neither from nor to the host
  check_rejected(other);
  other = good;
  other[9] = 1;  // count
  check_rejected(other);
  other = good;
  other[10] = 3;  // no such type
  check_rejected(other);
  other = good;
  other.back() = 0x0B;
  check_rejected(other);
  other = good;
  other[26] = 211;  // gain
  check_rejected(other);
  other = good;
  other[39] = 0;  // step
  check_rejected(other);
  check_rejected(with_u16(sweep({1, 2, 3}, true), 38, 2));
  check_rejected(with_u16(sweep({1, 2, 3}, true), 33, 6400));
}

TEST(damage_costs_one_frame) {
  Bytes data(60, 0x0A);
  data[20] = '@';
  data[21] = '0';
  leadline::test::check_damage_costs_one_frame([] { return TritechCodec({}); }, image(3200, data),
                                               1);
  leadline::test::check_damage_costs_one_frame([] { return TritechCodec({}); },
                                               sweep({4000, 0, 8000, 0x0A0A}, false), 4);
}

TEST(sweeps_left_undrained_are_not_lost) {
  TritechCodec codec({});
  Ping ping{};
  std::size_t count = 0;
  for (const std::uint8_t byte : sweep({1, 2, 3}, true) + sweep({4, 5}, true)) {
    count += codec.feed(byte, 0, ping) ? 1U : 0U;
  }
  while (codec.next(ping)) {
    ++count;
  }
  assert_int_equal(count, 5);
}

TEST(commands_as_the_makers_programs_write_them) {
  TritechConfig config;
  config.head = TritechHead::kImaging;
  TritechCodec codec(config);
  std::uint8_t out[TritechCodec::kMaxRequest_bytes];
  assert_int_equal(codec.request(0, out, sizeof out - 1), 0);
  const Bytes version = from_hex("40 30 30 30 38 08 00 ff 02 03 17 80 02 0a");
  assert_int_equal(codec.request(0, out, sizeof out), version.size());
  assert_memory_equal(out, version.data(), version.size());
  assert_int_equal(codec.request(1, out, sizeof out), 0);
  // VersionData, an mtAlive that is centred without parameters, the parameters.
  Bytes answer = frame_of(25, 1);
  answer[13] = 7;
  set_u16(answer, 15, 0x1234);
  records_of<Ping>(codec, answer);
  assert_int_equal(codec.state().serial_number, 0x1234);
  assert_int_equal(codec.request(2, out, sizeof out), 0);
  Bytes alive = frame_of(22, 4);
  alive[20] = 0x5D;  // still centring
  records_of<Ping>(codec, alive);
  assert_int_equal(codec.request(3, out, sizeof out), 0);
  alive[20] = 0x4A;
  records_of<Ping>(codec, alive);
  const Bytes parameters = from_hex(
      "40 30 30 33 43 3c 00 ff 02 37 13 80 02 01 07 23 02 66 66 66 05 66 66 66 05 70 3d 0a 09 70 "
      "3d "
      "0a 09 4b 00 c8 00 00 00 ff 18 4d 28 49 49 7d 00 7d 00 19 10 d0 00 c8 00 e8 03 64 00 40 06 "
      "01 "
      "00 00 00 0a");
  assert_int_equal(codec.request(4, out, sizeof out), parameters.size());
  assert_memory_equal(out, parameters.data(), parameters.size());
  alive[20] = 0xCA;  // has them, is not ready
  records_of<Ping>(codec, alive);
  assert_false(codec.running());
  alive[20] = 0x8A;
  records_of<Ping>(codec, alive);
  assert_true(codec.running());
  // 0x03b064ca ms of the day.
  const Bytes send_data = from_hex("40 30 30 30 43 0c 00 ff 02 07 19 80 02 ca 64 b0 03 0a");
  assert_int_equal(codec.request(std::int64_t{0x03b064ca} * 1000, out, sizeof out),
                   send_data.size());
  assert_memory_equal(out, send_data.data(), send_data.size());
  // The line echoes what we say, or another program's mtSendBBUser and mtReBoot: intact frames, none of our
  // business.
  const Bytes send_bb_user = from_hex("40 30 30 30 38 08 00 ff 02 03 18 80 02 0a");
  const Bytes reboot = from_hex("40 30 30 30 38 08 00 ff 02 03 10 80 02 0a");
  const auto before = codec.counters().ignored;
  records_of<Ping>(codec, version + send_bb_user + reboot + parameters + send_data);
  assert_int_equal(codec.counters().ignored, before + 5);
  assert_int_equal(leadline::hal::rejected(codec.counters()), 0);
  // Two lines for one request.
  assert_int_equal(records_of<Ping>(codec, image(3200, Bytes(20)) + image(3216, Bytes(20))).size(),
                   2);
  assert_int_equal(codec.request(std::int64_t{0x03b064ca} * 1000 + 1, out, sizeof out), 18);
  // Power was gone.
  Bytes status = image(3200, Bytes(20));
  status[16] = 1;
  records_of<Ping>(codec, status);
  assert_false(codec.running());
  // A head at another node.
  records_of<Ping>(codec, sweep({1}, true));
  assert_int_equal(codec.counters().wrong_device, 1);
}

namespace {

Bytes wall(const SeanetShot& shot) {
  Bytes out(static_cast<std::size_t>(shot.bins), 16);
  const double range = 4 / std::cos(shot.right_deg * 3.14159265358979 / 180);
  const double bin = range * 2 / 1500 / shot.bin_s;
  if (range > 0 && bin < shot.bins) {
    out[static_cast<std::size_t>(bin)] = 240;
  }
  return out;
}

double wall_time(const SeanetShot& shot) {
  const double range = 4 / std::cos(shot.right_deg * 3.14159265358979 / 180);
  return range > 0 && range < shot.range_m ? 2 * range / 1500 : 0;
}

TritechConfig asking(TritechHead head) {
  TritechConfig config;
  config.head = head;
  config.max_range_um = 10'000'000;
  config.left = 2400;
  config.right = 4000;
  return config;
}

void check_wall(const Ping& ping) {
  const double expected = 4 / std::cos(degrees(ping.azimuth_bam32) * 3.14159265358979 / 180);
  if (ping.kind == ReturnKind::kRange) {
    assert_near(static_cast<double>(ping.range_um) * 1e-6, expected, 0.002);
    return;
  }
  assert_int_equal(ping.kind, ReturnKind::kProfile);
  for (int i = 0; i < ping.profile.bin_count; ++i) {
    const auto range =
        static_cast<double>(ping.profile.first_bin_um + i * std::int64_t{ping.profile.bin_um});
    if (ping.profile.intensity[i] == 240 || ping.profile.intensity[i] == 15) {
      assert_near(range * 1e-6, expected, 0.06);
    }
  }
}

}  // namespace

TEST(a_micron) {
  for (const bool wide : {true, false}) {
    TritechConfig config = asking(TritechHead::kImaging);
    config.eight_bits = wide;
    EmulatedTritechConfig device;
    device.frames_per_request = wide ? 1 : 2;
    TritechCodec codec(config);
    EmulatedTritech head(device, wall, wall_time);
    HeadLine<TritechCodec> line(codec, head);
    line.run_until(4 * kSecond_us, check_wall);
    assert_int_equal(codec.counters().records, 0);  // still centring
    line.run_until(10 * kSecond_us, check_wall);
    assert_true(codec.running());
    assert_true(codec.counters().records > 100);
    // With two lines a request, one that comes between them is lost, and the second line makes good for it.
    assert_true(!wide || head.refused() == 0);
    assert_int_equal(codec.counters().timeouts, 0);
  }
}

TEST(a_profiler) {
  TritechConfig config = asking(TritechHead::kProfiler);
  config.step = 32;
  EmulatedTritechConfig device;
  device.profiler = true;
  TritechCodec codec(config);
  EmulatedTritech head(device, wall, wall_time);
  HeadLine<TritechCodec> line(codec, head);
  line.run_until(12 * kSecond_us, check_wall);
  assert_true(codec.counters().records > 100);
  assert_int_equal(codec.counters().records % 51, 0);
  assert_int_equal(head.parameters().size(), 82);
}

TEST(a_head_that_reboots_or_falls_silent) {
  TritechCodec codec(asking(TritechHead::kImaging));
  EmulatedTritech head({}, wall, wall_time);
  HeadLine<TritechCodec> line(codec, head);
  assert_true(line.count_until(8 * kSecond_us) > 50);
  head.reboot(line.now_us());
  assert_int_equal(line.count_until(11 * kSecond_us), 0);
  assert_true(line.count_until(20 * kSecond_us) > 50);
  const auto restarts = codec.counters().restarts;
  assert_true(restarts >= 1);
  head.set_silent(true);
  assert_int_equal(line.count_until(30 * kSecond_us), 0);
  assert_true(codec.counters().timeouts >= 5);
  head.set_silent(false);
  assert_true(line.count_until(45 * kSecond_us) > 50);
  codec.restart();
  assert_true(line.count_until(55 * kSecond_us) > 50);
}

TEST(a_bad_line) {
  leadline::emu::FaultConfig down;
  down.drop_ppm = 300;
  down.corrupt_ppm = 200;
  TritechCodec codec(asking(TritechHead::kImaging));
  EmulatedTritech head({}, wall, wall_time);
  HeadLine<TritechCodec> line(codec, head, down);
  assert_true(line.count_until(60 * kSecond_us) > 200);
  assert_true(leadline::hal::rejected(codec.counters()) > 5);
}
