#include <cmath>

#include "hal/emu/emulated_imagenex.hpp"
#include "hal/heads/imagenex.hpp"
#include "tests/support/head_line.hpp"

namespace {

using leadline::base::Ping;
using leadline::base::ReturnKind;
using leadline::base::TimeUs;
using leadline::emu::EmulatedImagenex;
using leadline::emu::EmulatedImagenexConfig;
using leadline::emu::ImagenexEcho;
using leadline::emu::ImagenexHead;
using leadline::emu::ImagenexShot;
using leadline::hal::ImagenexCodec;
using leadline::hal::ImagenexConfig;
using leadline::hal::ImagenexModel;
using leadline::test::Bytes;
using leadline::test::degrees;
using leadline::test::from_hex;
using leadline::test::HeadLine;
using leadline::test::records_of;
using leadline::test::samples_of;
using leadline::test::operator+;

constexpr TimeUs kSecond_us = 1'000'000;

struct Reply {
  char kind = 'M';
  unsigned id = 0x11;
  unsigned status = 0x40;
  unsigned position = 0;
  unsigned range = 10;
  unsigned found = 0;
  int count = -1;
  std::size_t header = 12;
};

Bytes reply_of(const Reply& reply, const Bytes& points) {
  const auto count =
      static_cast<unsigned>(reply.count < 0 ? static_cast<int>(points.size()) : reply.count);
  const auto low = [](unsigned value) { return static_cast<std::uint8_t>(value & 0x7FU); };
  const auto high = [](unsigned value) { return static_cast<std::uint8_t>((value >> 7U) & 0x7FU); };
  Bytes out{'I',
            static_cast<std::uint8_t>(reply.kind),
            'X',
            static_cast<std::uint8_t>(reply.id),
            static_cast<std::uint8_t>(reply.status),
            low(reply.position),
            high(reply.position),
            static_cast<std::uint8_t>(reply.range),
            low(reply.found),
            high(reply.found),
            low(count),
            high(count)};
  out.resize(reply.header, 0);
  out = out + points;
  out.push_back(0xFC);
  return out;
}

Ping only(const Bytes& bytes, const ImagenexConfig& config = {}) {
  ImagenexCodec codec(config);
  const auto pings = records_of<Ping>(codec, bytes, kSecond_us);
  assert_int_equal(pings.size(), 1);
  assert_int_equal(leadline::hal::rejected(codec.counters()), 0);
  return pings[0];
}

void check_rejected(const Bytes& bytes, const ImagenexConfig& config = {}) {
  ImagenexCodec codec(config);
  assert_int_equal(records_of<Ping>(codec, bytes).size(), 0);
  assert_int_equal(leadline::hal::rejected(codec.counters()), 1);
}

ImagenexConfig model(ImagenexModel which, bool profile = true) {
  ImagenexConfig config;
  config.model = which;
  config.profile = profile;
  return config;
}

}  // namespace

TEST(ranges_of_an_852) {
  // 1234 is packed as 0x52, 0x09: centimetres, 12.34 m of 20.
  const Bytes bytes = reply_of({'P', 0x11, 0x40, 0, 20, 1234}, {});
  assert_int_equal(bytes.size(), 13);
  assert_int_equal(bytes[8], 0x52);
  assert_int_equal(bytes[9], 0x09);
  const Ping ping = only(bytes);
  assert_int_equal(ping.kind, ReturnKind::kRange);
  assert_int_equal(ping.range_um, 12'340'000);
  assert_int_equal(ping.quality, 255);
  assert_int_equal(ping.elevation_bam32, leadline::base::kBam32QuarterTurn);
  assert_int_equal(ping.sound_speed_mm_s, 1'500'000);
  assert_int_equal(ping.t_transmit_us, kSecond_us - 26'666);
  assert_int_equal(ping.t_receive_us, kSecond_us - 26'666 + 16'453);
}

TEST(nothing_found_and_too_near) {
  const Ping none = only(reply_of({'P', 0x11, 0x40, 0, 20, 0}, {}));
  assert_int_equal(none.kind, ReturnKind::kNoReturn);
  assert_int_equal(none.quality, 255);
  assert_int_equal(none.range_um, 0);
  const Ping near = only(reply_of({'P', 0x11, 0x40, 0, 20, 49}, {}));
  assert_int_equal(near.kind, ReturnKind::kNoReturn);
  assert_int_equal(near.quality, 0);
}

TEST(points_of_an_852) {
  for (const std::size_t count : {252U, 500U}) {
    Bytes points(count);
    for (std::size_t i = 0; i < count; ++i) {
      points[i] = static_cast<std::uint8_t>(i);  // 0xFC and 0xFD among them
    }
    const Bytes bytes = reply_of({count == 252 ? 'M' : 'G', 0x15, 0x40, 0, 10, 333}, points);
    assert_int_equal(bytes.size(), count + 13);
    ImagenexCodec codec({});
    Ping ping{};
    bool done = false;
    for (const std::uint8_t byte : bytes) {
      done = codec.feed(byte, 0, ping);
    }
    assert_true(done);
    assert_int_equal(ping.kind, ReturnKind::kProfile);
    assert_int_equal(ping.profile.bin_count, count);
    assert_int_equal(ping.profile.bin_um, count == 252 ? 39'683 : 20'000);
    assert_int_equal(ping.profile.first_bin_um, count == 252 ? 19'841 : 10'000);
    for (std::size_t i = 0; i < count; ++i) {
      assert_int_equal(ping.profile.intensity[i], i & 0xFFU);
    }
    // The same reply for one who wants ranges.
    const Ping range = only(bytes, model(ImagenexModel::kAuto, false));
    assert_int_equal(range.kind, ReturnKind::kRange);
    assert_int_equal(range.range_um, 3'330'000);
  }
}

TEST(positions_and_units_of_the_scanning_heads) {
  // 881A: 0.3 deg from 600, and 2 mm below 5 m.
  Ping ping = only(reply_of({'P', 0x10, 0x40, 900 | 0x2000, 4, 1000}, {}));
  assert_near(degrees(ping.azimuth_bam32), 90, 1e-6);
  assert_int_equal(ping.elevation_bam32, 0);
  assert_int_equal(ping.range_um, 2'000'000);
  ping = only(reply_of({'P', 0x10, 0x40, 0, 5, 100}, {}));
  assert_near(std::abs(degrees(ping.azimuth_bam32)), 180, 1e-6);
  assert_int_equal(ping.range_um, 1'000'000);
  ImagenexConfig config = model(ImagenexModel::kScanner852);
  config.clockwise = false;
  config.forward_cdeg = 1'000;
  ping = only(reply_of({'P', 0x10, 0x40, 1600, 5, 100}, {}), config);
  assert_near(degrees(ping.azimuth_bam32), -20, 1e-6);  // 0.15 deg from 1400: 30, less 10
  // 831L: centimetres of a long header, recognized by its count or its length.
  ping = only(reply_of({'M', 0, 0x80, 500, 60, 123, 250, 32}, Bytes(250, 9)),
              model(ImagenexModel::kAuto, false));
  assert_near(degrees(ping.azimuth_bam32), -30, 1e-6);
  assert_int_equal(ping.range_um, 1'230'000);
  ping = only(reply_of({'P', 0, 0x80, 600, 8, 70, 0, 32}, {}));
  assert_int_equal(ping.range_um, 700'000);
}

TEST(attitude_of_an_831l) {
  Bytes bytes = reply_of({'P', 0, 0x80, 600, 10, 70, 0, 32}, {});
  // -2.5 deg is -100, in 14 bits; with "new".
  bytes[16] = 0x9C;
  bytes[17] = 0xBF;
  bytes[18] = 0x28;
  bytes[19] = 0x80;
  ImagenexConfig config = model(ImagenexModel::k831l);
  config.pitch_positive = false;
  ImagenexCodec codec(config);
  assert_int_equal(records_of<Ping>(codec, bytes, 5).size(), 1);
  bytes[17] = 0xFF;  // and with "error"
  assert_int_equal(records_of<Ping>(codec, bytes, 6).size(), 1);
  const auto samples = samples_of(codec);
  assert_int_equal(samples.size(), 2);
  assert_int_equal(samples[0].fields, leadline::base::kNavRollPitch);
  assert_near(degrees(samples[0].attitude.roll_bam32), -2.5, 1e-6);
  assert_near(degrees(samples[0].attitude.pitch_bam32), -1.0, 1e-6);
  assert_int_equal(samples[1].kind, leadline::base::NavKind::kAttitude);
  assert_int_equal(samples[1].fields, 0);
  assert_int_equal(codec.counters().no_data, 1);
}

TEST(impossible_replies_are_dropped) {
  const Bytes points(252, 1);
  check_rejected(reply_of({'M', 0x11, 0x40, 0, 10, 100, 251}, points));  // another count
  check_rejected(reply_of({'M', 0x11, 0x40, 0, 7, 100}, points));        // no such range
  check_rejected(reply_of({'P', 0x11, 0x40, 0, 10, 1101}, {}));          // beyond it
  check_rejected(reply_of({'M', 0x10, 0x40, 1201, 10, 100}, points));    // no such position
  check_rejected(reply_of({'P', 0x10, 0x40, 2801, 10, 100}, {}), model(ImagenexModel::kScanner852));
  Bytes eight_bits = reply_of({'M', 0x11, 0x40, 0, 10, 100}, points);
  eight_bits[9] = 0x80;
  check_rejected(eight_bits);
  Bytes no_end = reply_of({'M', 0x11, 0x40, 0, 10, 100}, points);
  no_end.back() = 0xFB;
  check_rejected(no_end);
  ImagenexConfig config;
  config.head_id = 0x12;
  ImagenexCodec codec(config);
  assert_int_equal(records_of<Ping>(codec, reply_of({'M', 0x11}, points)).size(), 0);
  assert_int_equal(codec.counters().wrong_device, 1);
}

TEST(status_of_an_852_is_counted) {
  ImagenexCodec codec({});
  assert_int_equal(records_of<Ping>(codec, reply_of({'P', 0x11, 0x00}, {})).size(), 1);
  assert_int_equal(records_of<Ping>(codec, reply_of({'P', 0x11, 0xC0}, {})).size(), 1);
  assert_int_equal(records_of<Ping>(codec, reply_of({'P', 0x11, 0x40}, {})).size(), 1);
  assert_int_equal(codec.counters().refused_settings, 2);
}

TEST(damage_costs_one_frame) {
  Bytes points(252);
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i] = static_cast<std::uint8_t>(13 * i);
  }
  points[30] = 'I';
  points[31] = 'M';
  points[32] = 'X';
  leadline::test::check_damage_costs_one_frame([] { return ImagenexCodec({}); },
                                               reply_of({'P', 0x11, 0x40, 0, 20, 700}, {}), 1);
  // Without a checksum a lost point is known by the terminator only: the frame behind it must be intact.
  const Bytes frame = reply_of({'M', 0x11, 0x40, 0, 10, 100}, points);
  for (std::size_t position = 0; position < frame.size(); ++position) {
    ImagenexCodec codec({});
    const Bytes hurt = leadline::test::without(frame, position);
    assert_int_equal(records_of<Ping>(codec, hurt + frame + frame).size(), 2);
  }
}

TEST(the_switch_command_is_the_documented_one) {
  ImagenexConfig config = model(ImagenexModel::kSounder852);
  ImagenexCodec codec(config);
  std::uint8_t out[ImagenexCodec::kMaxRequest_bytes];
  assert_int_equal(codec.request(0, out, sizeof out - 1), 0);
  assert_int_equal(codec.request(0, out, sizeof out), 27);
  const Bytes expected =
      from_hex("fe 44 11 0a 00 00 43 00 0e 00 14 00 00 00 64 05 00 00 00 32 00 00 00 00 01 00 fd");
  assert_memory_equal(out, expected.data(), expected.size());
  assert_int_equal(codec.request(100'000, out, sizeof out), 0);
  assert_int_equal(codec.request(400'000, out, sizeof out), 27);
  assert_int_equal(codec.counters().timeouts, 1);
  ImagenexCodec listener({});
  assert_int_equal(listener.request(0, out, sizeof out), 0);
}

TEST(no_command_carries_its_end_inside) {
  for (const auto which : {ImagenexModel::kSounder852, ImagenexModel::kScanner852,
                           ImagenexModel::k881a, ImagenexModel::k831l}) {
    for (int value = 0; value < 256; ++value) {
      ImagenexConfig config = model(which);
      config.head_id = static_cast<std::uint8_t>(value);
      config.pulse_us = static_cast<std::uint8_t>(value);
      config.min_range_um = value * std::int64_t{100'000};
      config.sector_deg = value * 3;
      config.train_deg = value * 3 - 180;
      ImagenexCodec codec(config);
      std::uint8_t out[27];
      assert_int_equal(codec.request(0, out, sizeof out), 27);
      for (int i = 0; i < 26; ++i) {
        assert_int_not_equal(out[i], 0xFD);
      }
      assert_int_equal(out[26], 0xFD);
    }
  }
}

namespace {

ImagenexEcho wall(const ImagenexShot& shot) {
  ImagenexEcho echo;
  // A wall 3 m ahead.
  const double range = 3 / std::cos(shot.angle_deg * 3.14159265358979 / 180);
  echo.found_m = range > 0 && range < shot.range_m ? range : 0;
  echo.intensity.assign(static_cast<std::size_t>(shot.points), 3);
  if (echo.found_m > 0 && shot.points > 0) {
    echo.intensity[static_cast<std::size_t>(range / shot.range_m * shot.points)] = 200;
  }
  echo.roll_deg = 1.5;
  return echo;
}

EmulatedImagenexConfig device(ImagenexHead head) { return {head, 0}; }

void check_wall(const Ping& ping, double tolerance_m) {
  const double angle = degrees(ping.azimuth_bam32) * 3.14159265358979 / 180;
  const double expected = 3 / std::cos(ping.elevation_bam32 == 0 ? angle : 0);
  if (ping.kind == ReturnKind::kRange) {
    assert_near(static_cast<double>(ping.range_um) * 1e-6, expected, tolerance_m);
    return;
  }
  assert_int_equal(ping.kind, ReturnKind::kProfile);
  for (int i = 0; i < ping.profile.bin_count; ++i) {
    if (ping.profile.intensity[i] == 200) {
      const double range =
          static_cast<double>(ping.profile.first_bin_um + i * std::int64_t{ping.profile.bin_um});
      assert_near(range * 1e-6, expected, tolerance_m);
    }
  }
}

}  // namespace

TEST(conversations) {
  struct Case {
    ImagenexModel model;
    ImagenexHead head;
    std::int64_t range_um;
  };
  for (const Case& c : {Case{ImagenexModel::kSounder852, ImagenexHead::kSounder852, 10'000'000},
                        Case{ImagenexModel::kScanner852, ImagenexHead::kScanner852, 10'000'000},
                        Case{ImagenexModel::k881a, ImagenexHead::k881a, 10'000'000},
                        Case{ImagenexModel::k831l, ImagenexHead::k831l, 6'000'000}}) {
    for (const bool profile : {true, false}) {
      ImagenexConfig config = model(c.model, profile);
      config.max_range_um = c.range_um;
      config.sector_deg = 90;
      config.step_ddeg = 30;
      config.poll_interval_us = 50'000;
      ImagenexCodec codec(config);
      EmulatedImagenex head(device(c.head), wall);
      HeadLine<ImagenexCodec> line(codec, head);
      double least = 0;
      double most = 0;
      line.run_until(5 * kSecond_us, [&](const Ping& ping) {
        check_wall(ping, profile ? 0.03 : 0.006);
        least = std::min(least, degrees(ping.azimuth_bam32));
        most = std::max(most, degrees(ping.azimuth_bam32));
      });
      assert_int_equal(codec.counters().records, 100);
      assert_int_equal(head.refused(), 0);
      if (c.model == ImagenexModel::k831l) {
        const auto samples = samples_of(codec);
        assert_near(degrees(samples.back().attitude.roll_bam32), 1.5, 1e-6);
      } else if (c.model != ImagenexModel::kSounder852) {
        assert_true(least < -30 && most > 30);
      }
    }
  }
}

TEST(a_silent_head_is_asked_again) {
  ImagenexCodec codec(model(ImagenexModel::k881a));
  EmulatedImagenex head(device(ImagenexHead::k881a), wall);
  HeadLine<ImagenexCodec> line(codec, head);
  assert_true(line.count_until(kSecond_us) > 20);
  head.set_silent(true);
  assert_int_equal(line.count_until(3 * kSecond_us), 0);
  assert_in_range(codec.counters().timeouts, 5, 7);
  head.set_silent(false);
  assert_true(line.count_until(4 * kSecond_us) > 20);
  codec.restart();
  assert_true(line.count_until(5 * kSecond_us) > 20);
}

TEST(a_bad_line) {
  leadline::emu::FaultConfig down;
  down.drop_ppm = 500;
  down.truncate_ppm = 200;
  leadline::emu::FaultConfig up;
  up.drop_ppm = 2'000;
  ImagenexCodec codec(model(ImagenexModel::kSounder852));
  EmulatedImagenex head(device(ImagenexHead::kSounder852), wall);
  HeadLine<ImagenexCodec> line(codec, head, down, up);
  assert_true(line.count_until(20 * kSecond_us) > 50);
  assert_true(codec.counters().timeouts > 10);
  assert_true(head.refused() > 2);
}
