#include <cmath>
#include <cstring>

#include "hal/emu/emulated_wl3d.hpp"
#include "hal/heads/snappy.hpp"
#include "hal/heads/wl3d.hpp"
#include "tests/support/head_line.hpp"

namespace {

using leadline::base::Ping;
using leadline::base::ReturnKind;
using leadline::emu::EmulatedWl3d;
using leadline::emu::EmulatedWl3dConfig;
using leadline::emu::wl3d_packet;
using leadline::emu::wl3d_range_image;
using leadline::emu::Wl3dShot;
using leadline::hal::snappy_uncompress;
using leadline::hal::Wl3dCodec;
using leadline::hal::Wl3dConfig;
using leadline::test::Bytes;
using leadline::test::degrees;
using leadline::test::from_hex;
using leadline::test::from_text;
using leadline::test::Random;
using leadline::test::random_bytes;
using leadline::test::records_of;
using leadline::test::operator+;

constexpr std::int64_t kSecond_us = 1'000'000;
constexpr double kScale_m = 0.000762939453125;

EmulatedWl3dConfig small() {
  EmulatedWl3dConfig config;
  config.width = 5;
  config.height = 3;
  return config;
}

/// 5 x 3 pixels, of which four have a distance.
std::vector<std::uint32_t> few() {
  std::vector<std::uint32_t> pixels(15, 0);
  pixels[0] = 13'107;  // 10 m
  pixels[7] = 2'621;   // the middle
  pixels[9] = 19'660;  // 15 m: three bytes
  pixels[14] = 1;
  return pixels;
}

Bytes packet(const EmulatedWl3dConfig& config, const std::vector<std::uint32_t>& pixels,
             bool compressed = true, double scale_m = kScale_m) {
  return wl3d_packet("RangeImage", wl3d_range_image(config, 4448, pixels, scale_m), compressed);
}

// The codec is too large for the stack of a test beside others: one, made anew.
Wl3dCodec& fresh(const Wl3dConfig& config = {}) {
  static Wl3dCodec codec({});
  codec = Wl3dCodec(config);
  return codec;
}

void check_dropped(const Bytes& bytes) {
  Wl3dCodec& codec = fresh();
  assert_int_equal(records_of<Ping>(codec, bytes).size(), 0);
  assert_int_equal(leadline::hal::rejected(codec.counters()), 1);
  assert_int_equal(records_of<Ping>(codec, packet(small(), few())).size(), 4);
}

Bytes uncompressed(const Bytes& block, std::size_t capacity = 1000) {
  Bytes out(capacity);
  std::size_t size = 1;
  const bool good = snappy_uncompress(block.data(), block.size(), out.data(), capacity, size);
  assert_true(good || size == 0);
  out.resize(size);
  return good ? out : from_text("not a block");
}

}  // namespace

TEST(pixels_of_an_image) {
  for (const bool compressed : {true, false}) {
    Wl3dConfig config;
    config.mount = 2;
    Wl3dCodec& codec = fresh(config);
    const auto pings = records_of<Ping>(codec, packet(small(), few(), compressed), kSecond_us);
    assert_int_equal(pings.size(), 4);
    assert_int_equal(codec.sequence_id(), 4448);
    assert_int_equal(codec.counters().records, 4);
    // Row 0, column 0: left and down.
    assert_near(degrees(pings[0].azimuth_bam32), -45, 1e-4);
    assert_near(degrees(pings[0].elevation_bam32), 20, 1e-4);
    assert_in_range(pings[0].range_um, 9'999'846, 9'999'848);  // 13107 / 1310.72
    assert_int_equal(pings[0].mount, 2);
    assert_int_equal(pings[0].kind, ReturnKind::kRange);
    assert_int_equal(pings[0].sound_speed_mm_s, 1'491'000);
    assert_int_equal(pings[0].t_transmit_us, kSecond_us - 20'120);  // 15 m there and back
    assert_int_equal(pings[0].t_receive_us, kSecond_us - 20'120 + 13'413);
    assert_near(degrees(pings[1].azimuth_bam32), 0, 1e-4);
    assert_near(degrees(pings[1].elevation_bam32), 0, 1e-4);
    assert_near(degrees(pings[2].azimuth_bam32), 45, 1e-4);
    assert_int_equal(pings[3].range_um, 763);
    assert_near(degrees(pings[3].elevation_bam32), -20, 1e-4);
  }
  Wl3dConfig turned;
  turned.columns_to_the_right = false;
  turned.rows_upwards = false;
  const auto pings = records_of<Ping>(fresh(turned), packet(small(), few()));
  assert_near(degrees(pings[0].azimuth_bam32), 45, 1e-4);
  assert_near(degrees(pings[0].elevation_bam32), -20, 1e-4);
}

TEST(other_messages_are_ignored) {
  Wl3dCodec& codec = fresh();
  assert_int_equal(records_of<Ping>(codec, wl3d_packet("ImuBatch", {8, 1}, true)).size(), 0);
  assert_int_equal(records_of<Ping>(codec, wl3d_packet("NotRangeImage", {8, 1}, true)).size(), 0);
  assert_int_equal(codec.counters().ignored, 2);
  assert_int_equal(leadline::hal::rejected(codec.counters()), 0);
}

TEST(impossible_images_are_dropped) {
  EmulatedWl3dConfig config = small();
  config.sound_speed_m_s = 340;
  check_dropped(packet(config, few()));
  config.sound_speed_m_s = std::nan("");
  check_dropped(packet(config, few()));
  config = small();
  config.range_m = 0;
  check_dropped(packet(config, few()));
  config = small();
  config.range_m = 12;  // a pixel says 15
  check_dropped(packet(config, few()));
  config = small();
  config.fov_horizontal_deg = 200;
  check_dropped(packet(config, few()));
  config = small();
  config.fov_vertical_deg = -40;
  check_dropped(packet(config, few()));
  config = small();
  config.width = 6;  // and 15 pixels
  check_dropped(packet(config, few()));
  config = small();
  config.height = 1;
  check_dropped(packet(config, few()));
  config = small();
  config.width = 16'384;
  config.height = 16'384;
  check_dropped(packet(config, few()));
  check_dropped(packet(small(), few(), true, 0));
  check_dropped(packet(small(), few(), true, 1));
  auto pixels = few();
  pixels[0] = 0x10000;
  check_dropped(packet(small(), pixels));
  // No message, and no image inside of one.
  check_dropped(wl3d_packet("RangeImage", {0x0B, 1, 2}, true));
  check_dropped(wl3d_packet("RangeImage", {}, false));
  // A field with the wrong kind of value.
  Bytes message = wl3d_range_image(small(), 1, few(), kScale_m);
  message.insert(message.end(), {0x10, 0x05});
  check_dropped(wl3d_packet("RangeImage", message, true));
  // A field that this version does not know is passed over.
  message = wl3d_range_image(small(), 1, few(), kScale_m);
  message.insert(message.end(), {0x78, 0x05, 0x7D, 1, 2, 3, 4, 0x79, 1, 2, 3, 4, 5, 6, 7, 8});
  assert_int_equal(records_of<Ping>(fresh(), wl3d_packet("RangeImage", message, true)).size(), 4);
  // Pixels in two pieces.
  message = wl3d_range_image(small(), 1, few(), kScale_m);
  message.insert(message.end(), {0x52, 0x01, 0x00});
  check_dropped(wl3d_packet("RangeImage", message, true));
}

TEST(packets_that_are_too_long_or_broken) {
  Wl3dCodec& codec = fresh();
  Bytes bytes = packet(small(), few());
  bytes[30] ^= 1U;
  assert_int_equal(records_of<Ping>(codec, bytes).size(), 0);
  assert_int_equal(codec.counters().bad_checksum, 1);
  assert_int_equal(records_of<Ping>(codec, from_hex("52 49 50 32 ff ff ff 7f")).size(), 0);
  assert_int_equal(records_of<Ping>(codec, from_hex("52 49 50 32 0b 00 00 00")).size(), 0);
  assert_int_equal(codec.counters().bad_length, 2);
  assert_int_equal(records_of<Ping>(codec, from_hex("52 49 50 33 0b 00 00 00")).size(), 0);
  // Intact, but longer inside than any image: RIP1 by its length, RIP2 by its preamble.
  const Bytes large(leadline::hal::kMaxWl3dMessage_bytes, 7);
  assert_int_equal(records_of<Ping>(codec, wl3d_packet("X", large, false)).size(), 0);
  assert_int_equal(codec.counters().bad_length, 3);
  assert_int_equal(records_of<Ping>(codec, wl3d_packet("X", large, true)).size(), 0);
  assert_int_equal(codec.counters().bad_values, 1);
  assert_int_equal(records_of<Ping>(codec, packet(small(), few())).size(), 4);
}

TEST(damage_costs_one_frame) {
  for (const bool compressed : {true, false}) {
    const Bytes frame = packet(small(), few(), compressed);
    for (std::size_t position = 0; position < frame.size(); ++position) {
      const Bytes hurt = leadline::test::without(frame, position);
      assert_int_equal(records_of<Ping>(fresh(), hurt + frame + frame).size(), 8);
    }
  }
}

TEST(snappy_blocks) {
  const Bytes abc = from_text("abc");
  // A literal; copies of each kind, one of which runs into itself.
  assert_true(uncompressed(from_hex("03 08 61 62 63")) == abc);
  assert_true(uncompressed(from_hex("07 08 61 62 63 01 03")) == from_text("abcabca"));
  assert_true(uncompressed(from_hex("05 08 61 62 63 06 01 00")) == from_text("abccc"));
  assert_true(uncompressed(from_hex("05 08 61 62 63 07 02 00 00 00")) == from_text("abcbc"));
  assert_true(uncompressed(from_hex("03 f0 02 61 62 63")) == abc);
  assert_true(uncompressed(from_hex("03 f4 02 00 61 62 63")) == abc);
  assert_true(uncompressed(from_hex("03 fc 02 00 00 00 61 62 63")) == abc);
  assert_true(uncompressed(from_hex("00")).empty());
  // What is none: no preamble, too little, too much, cut, copies from nowhere.
  for (const char* broken :
       {"", "80", "04 08 61 62 63", "02 08 61 62 63", "03 08 61 62", "07 08 61 62 63 01",
        "07 08 61 62 63 01 00", "07 08 61 62 63 01 04", "05 08 61 62 63 06 01", "03 f0",
        "03 fc ff ff ff ff 61", "ff ff ff ff ff ff ff ff ff ff 01", "e9 07 00 61"}) {
    assert_true(uncompressed(from_hex(broken)) == from_text("not a block"));
  }
  assert_true(uncompressed(from_hex("03 08 61 62 63"), 2) == from_text("not a block"));
}

TEST(a_real_block_and_back) {
  // The emulated sonar's compressor against the codec's decompressor, over images of all sorts.
  Random random(5);
  EmulatedWl3dConfig config = small();
  config.width = 40;
  config.height = 20;
  for (int round = 0; round < 50; ++round) {
    std::vector<std::uint32_t> pixels;
    std::size_t valid = 0;
    std::uint32_t value = 0;
    while (pixels.size() < 800) {
      value =
          random.between(0, 3) == 0 ? static_cast<std::uint32_t>(random.between(0, 19'000)) : value;
      pixels.push_back(random.between(0, 5) == 0 ? 0 : value);
      valid += pixels.back() > 0 ? 1U : 0U;
    }
    assert_int_equal(records_of<Ping>(fresh(), packet(config, pixels)).size(), valid);
  }
}

TEST(a_wall_and_the_floor) {
  EmulatedWl3dConfig config;
  // A wall 5 m ahead, and a floor 1 m below.
  EmulatedWl3d sonar(config, [](const Wl3dShot& shot) {
    const double yaw = shot.yaw_deg * 3.14159265358979 / 180;
    const double pitch = shot.pitch_deg * 3.14159265358979 / 180;
    const double wall = 5 / (std::cos(pitch) * std::cos(yaw));
    return pitch < 0 ? std::min(wall, 1 / -std::sin(pitch)) : wall;
  });
  Wl3dCodec& codec = fresh();
  Bytes bytes;
  sonar.advance(kSecond_us, bytes);
  // One by one: together they are more than a microcontroller has memory for.
  std::size_t count = 0;
  std::size_t on_floor = 0;
  const auto look = [&](const Ping& ping) {
    ++count;
    const double azimuth = degrees(ping.azimuth_bam32) * 3.14159265358979 / 180;
    const double elevation = degrees(ping.elevation_bam32) * 3.14159265358979 / 180;
    const double range = static_cast<double>(ping.range_um) * 1e-6;
    const double forward = range * std::cos(elevation) * std::cos(azimuth);
    const double down = range * std::sin(elevation);
    assert_true(std::abs(forward - 5) < 0.002 || std::abs(down - 1) < 0.002);
    on_floor += std::abs(down - 1) < 0.002 ? 1U : 0U;
  };
  Ping ping{};
  for (const std::uint8_t byte : bytes) {
    for (bool found = codec.feed(byte, 0, ping); found; found = codec.next(ping)) {
      look(ping);
    }
  }
  assert_int_equal(count, 5 * 256 * 64);
  assert_int_equal(codec.counters().ignored, 5);
  assert_in_range(on_floor, 5'000, 60'000);
  sonar.set_silent(true);
  bytes.clear();
  sonar.advance(2 * kSecond_us, bytes);
  assert_int_equal(bytes.size(), 0);
  assert_true(sonar.next_event_us() > 2 * kSecond_us);
}

TEST(images_left_undrained_are_not_lost) {
  Wl3dCodec& codec = fresh();
  Ping ping{};
  std::size_t count = 0;
  const Bytes frame = packet(small(), few());
  for (const std::uint8_t byte : frame + frame) {
    count += codec.feed(byte, 0, ping) ? 1U : 0U;
  }
  while (codec.next(ping)) {
    ++count;
  }
  assert_int_equal(count, 8);
  codec.restart();
  assert_int_equal(codec.counters().restarts, 1);
  assert_int_equal(records_of<Ping>(codec, frame).size(), 4);
}
