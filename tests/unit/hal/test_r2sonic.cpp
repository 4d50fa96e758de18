#include <cmath>
#include <fstream>
#include <iterator>
#include <sstream>

#include "hal/emu/emulated_r2sonic.hpp"
#include "hal/heads/r2sonic.hpp"
#include "tests/support/device_bytes.hpp"

namespace {

using leadline::base::Ping;
using leadline::base::ReturnKind;
using leadline::emu::R2SonicPacket;
using leadline::emu::write_r2sonic_packet;
using leadline::hal::R2SonicBeam;
using leadline::hal::R2SonicCodec;
using leadline::hal::R2SonicConfig;
using leadline::hal::rejected;
using leadline::test::Bytes;
using leadline::test::records_of;
using leadline::test::without;
using leadline::test::operator+;

constexpr double kRadPerBam = 6.283185307179586 / 4294967296.0;

R2SonicPacket small_packet(std::uint32_t ping_number = 7) {
  R2SonicPacket packet;
  packet.seconds = 1'436'399'535;
  packet.nanoseconds = 920'431'109;
  packet.ping_number = ping_number;
  packet.sound_speed_m_s = 1514.962F;
  packet.range_scale_s = 4e-6F;
  packet.ranges = {5000, 4000, 3000, 4000, 5000};
  packet.flags = {11, 7, 4, 9, 8};
  packet.intensities = {100, 200, 300, 400, 500};
  return packet;
}

std::vector<Ping> pings_of(const Bytes& bytes, const R2SonicConfig& config = {}) {
  R2SonicCodec codec(config);
  return records_of<Ping>(codec, bytes);
}

}  // namespace

TEST(beams_of_an_equi_angular_packet) {
  R2SonicConfig config;
  config.mount = 3;
  const auto pings = pings_of(write_r2sonic_packet(small_packet()), config);
  assert_int_equal(pings.size(), 5);
  const double angles[] = {-1.0, -0.5, 0.0, 0.5, 1.0};
  const double counts[] = {5000, 4000, 3000, 4000, 5000};
  const int qualities[] = {255, 255, 85, 170, 85};
  for (std::size_t i = 0; i < 5; ++i) {
    const Ping& ping = pings[i];
    assert_true(ping.kind == ReturnKind::kRange);
    assert_int_equal(ping.mount, 3);
    assert_int_equal(ping.t_transmit_us, 1'436'399'535'920'431);
    assert_int_equal(ping.t_receive_us - ping.t_transmit_us, std::lround(counts[i] * 4.0 - 0.49));
    assert_int_equal(ping.sound_speed_mm_s, 1'514'962);
    assert_near(ping.range_um, counts[i] * 4e-6 * 1514.962 / 2 * 1e6, 2.0);
    const double elevation = kRadPerBam * ping.elevation_bam32;
    assert_near(elevation, 1.5707963267948966 - angles[i], 2e-7);
    assert_int_equal(ping.azimuth_bam32, leadline::base::kBam32QuarterTurn);
    assert_int_equal(ping.rotation_bam32, leadline::base::kBam32QuarterTurn);
    assert_int_equal(ping.quality, qualities[i]);
  }
}

TEST(what_a_ping_leaves_out) {
  R2SonicCodec codec{R2SonicConfig{}};
  assert_int_equal(records_of<Ping>(codec, write_r2sonic_packet(small_packet())).size(), 5);
  const R2SonicBeam& beam = codec.beam();
  assert_int_equal(beam.ping_number, 7);
  assert_int_equal(beam.beam, 4);
  assert_int_equal(beam.intensity, 500);
  assert_int_equal(beam.flags, 8);
  assert_int_equal(beam.two_way_ns, 20'000'000);
  assert_near(kRadPerBam * beam.angle_bam32, 1.0, 2e-7);
}

TEST(steps_of_an_equidistant_packet_add_up) {
  R2SonicPacket packet = small_packet();
  packet.equidistant = true;
  packet.first_angle_rad = -1.0F;
  packet.step_scale_rad = 2e-6F;
  packet.steps = {0, 40'000, 50'000, 60'000, 65'535};
  for (const bool inclusive : {true, false}) {
    R2SonicConfig config;
    config.a2_inclusive = inclusive;
    const auto pings = pings_of(write_r2sonic_packet(packet), config);
    assert_int_equal(pings.size(), 5);
    double sum = 0.0;
    for (std::size_t i = 0; i < 5; ++i) {
      const double before = sum;
      sum += packet.steps[i];
      const double angle = -1.0 + 1.99999999495e-6 * (inclusive ? sum : before);
      assert_near(kRadPerBam * pings[i].elevation_bam32, 1.5707963267948966 - angle, 1e-7);
    }
  }
}

TEST(a_beam_that_found_nothing_makes_no_record) {
  R2SonicPacket packet = small_packet();
  packet.ranges[1] = 0;
  packet.flags[3] = 3;  // passed tests, but no detection
  R2SonicCodec codec{R2SonicConfig{}};
  assert_int_equal(records_of<Ping>(codec, write_r2sonic_packet(packet)).size(), 3);
  assert_int_equal(codec.counters().no_data, 2);
  assert_int_equal(codec.counters().records, 3);
  assert_int_equal(rejected(codec.counters()), 0);
}

TEST(without_flags_and_intensities) {
  R2SonicPacket packet = small_packet();
  packet.flags.clear();
  packet.intensities.clear();
  const auto pings = pings_of(write_r2sonic_packet(packet));
  assert_int_equal(pings.size(), 5);
  assert_int_equal(pings[0].quality, 255);
}

TEST(times_of_arrival_where_the_clock_is_not_set) {
  R2SonicConfig config;
  config.device_clock = false;
  R2SonicCodec codec(config);
  const auto pings = records_of<Ping>(codec, write_r2sonic_packet(small_packet()), 1'000'000);
  // The longest beam takes 20 ms there and back.
  assert_int_equal(pings[0].t_transmit_us, 980'000);
  assert_int_equal(pings[0].t_receive_us, 1'000'000);
  R2SonicConfig shifted;
  shifted.clock_offset_us = -1'436'399'535'000'000;
  assert_int_equal(pings_of(write_r2sonic_packet(small_packet()), shifted)[0].t_transmit_us,
                   920'431);
}

TEST(any_lost_byte_costs_its_packet_only) {
  const Bytes packet = write_r2sonic_packet(small_packet(1));
  const Bytes second = write_r2sonic_packet(small_packet(2));
  for (std::size_t i = 0; i < packet.size(); ++i) {
    R2SonicCodec codec{R2SonicConfig{}};
    const auto pings = records_of<Ping>(codec, without(packet, i) + second + second);
    assert_true(pings.size() >= 10);
    assert_int_equal(codec.beam().ping_number, 2);
    assert_int_equal(pings[pings.size() - 6].range_um, pings.back().range_um);
  }
}

TEST(a_cut_packet_is_not_filled_up_from_the_next) {
  const Bytes packet = write_r2sonic_packet(small_packet());
  for (const std::size_t cut : {std::size_t{20}, std::size_t{130}, packet.size() - 8}) {
    R2SonicCodec codec{R2SonicConfig{}};
    const Bytes head(packet.begin(), packet.begin() + static_cast<std::ptrdiff_t>(cut));
    assert_int_equal(records_of<Ping>(codec, head + packet + packet).size(), 10);
    assert_int_equal(rejected(codec.counters()), 1);
  }
}

TEST(values_that_no_head_sends) {
  struct Case {
    const char* what;
    std::uint32_t seconds_ns;
    float sound_speed;
    float scale;
    float first;
    float last;
  };
  const Case cases[] = {
      {"nanoseconds", 1'000'000'000, 1500.0F, 1e-6F, -1.0F, 1.0F},
      {"slow", 0, 1200.0F, 1e-6F, -1.0F, 1.0F},
      {"not a number", 0, NAN, 1e-6F, -1.0F, 1.0F},
      {"scale", 0, 1500.0F, -1e-6F, -1.0F, 1.0F},
      {"scale inf", 0, 1500.0F, INFINITY, -1.0F, 1.0F},
      {"first", 0, 1500.0F, 1e-6F, -1.7F, 1.0F},
      {"last", 0, 1500.0F, 1e-6F, -1.0F, 1e20F},
  };
  for (const Case& bad : cases) {
    R2SonicPacket packet = small_packet();
    packet.nanoseconds = bad.seconds_ns;
    packet.sound_speed_m_s = bad.sound_speed;
    packet.range_scale_s = bad.scale;
    packet.first_angle_rad = bad.first;
    packet.last_angle_rad = bad.last;
    R2SonicCodec codec{R2SonicConfig{}};
    const Bytes good = write_r2sonic_packet(small_packet());
    assert_int_equal(records_of<Ping>(codec, write_r2sonic_packet(packet) + good).size(), 5);
    assert_int_equal(codec.counters().bad_values, 1);
  }
}

TEST(sections_shorter_than_their_points) {
  R2SonicPacket packet = small_packet();
  Bytes bytes = write_r2sonic_packet(packet);
  bytes[126] = 2;  // 512 + 5 points
  R2SonicCodec codec{R2SonicConfig{}};
  assert_int_equal(records_of<Ping>(codec, bytes).size(), 0);
  assert_int_equal(codec.counters().bad_length, 1);
}

TEST(a_restart_forgets_half_a_packet) {
  const Bytes packet = write_r2sonic_packet(small_packet());
  R2SonicCodec codec{R2SonicConfig{}};
  Ping ping{};
  for (std::size_t i = 0; i < 100; ++i) {
    assert_false(codec.feed(packet[i], 0, ping));
  }
  codec.restart();
  assert_false(codec.next(ping));
  assert_int_equal(codec.counters().skipped_bytes, 100);
  assert_int_equal(records_of<Ping>(codec, packet).size(), 5);
}

TEST(an_emulated_head_over_a_flat_bottom) {
  leadline::emu::EmulatedR2SonicSettings settings;
  settings.two_way_s = [](std::int64_t, double angle_rad) {
    return 2.0 * 10.0 / std::cos(angle_rad) / 1500.0;
  };
  leadline::emu::EmulatedR2Sonic head(settings);
  Bytes bytes;
  head.advance(1'000'000, bytes);
  R2SonicCodec codec{R2SonicConfig{}};
  const auto pings = records_of<Ping>(codec, bytes);
  assert_int_equal(pings.size(), 21 * 256);
  for (const Ping& ping : pings) {
    assert_near(
        1e-6 * static_cast<double>(ping.range_um) * std::sin(kRadPerBam * ping.elevation_bam32),
        10.0, 5e-4);
  }
  assert_int_equal(pings.back().t_transmit_us - pings.front().t_transmit_us, 1'000'000);
}

namespace {

/// The bathymetry packets of an XTF file: those of type 65, 256 bytes behind the packet's start.
Bytes packets_of_xtf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const Bytes xtf{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  Bytes packets;
  std::size_t at = 1024;
  while (at + 14 < xtf.size()) {
    const std::size_t size = xtf[at + 10] | (xtf[at + 11] << 8U) | (xtf[at + 12] << 16U);
    if (xtf[at + 2] == 65) {
      packets.insert(packets.end(), xtf.begin() + static_cast<std::ptrdiff_t>(at + 256),
                     xtf.begin() + static_cast<std::ptrdiff_t>(at + size));
    }
    at += size;
  }
  return packets;
}

}  // namespace

TEST(a_real_recording_beam_by_beam) {
  const std::string folder = "multibeam_r2sonic2026_sfbay/";
  const Bytes bytes =
      packets_of_xtf(leadline::test::require_data(folder + "raw/first550pings.xtf"));
  std::ifstream csv(leadline::test::require_data(folder + "derived/beams_dev.csv"));
  std::string line;
  std::getline(csv, line);

  R2SonicCodec codec{R2SonicConfig{}};
  Ping ping{};
  std::size_t compared = 0;
  std::size_t silent = 0;
  for (const std::uint8_t byte : bytes) {
    bool more = codec.feed(byte, 0, ping);
    while (more) {
      unsigned number = 0;
      unsigned beam = 0;
      unsigned quality = 0;
      unsigned intensity = 0;
      double time_s = 0;
      double angle_rad = 0;
      do {  // rows of beams that found nothing
        assert_true(static_cast<bool>(std::getline(csv, line)));
        assert_int_equal(std::sscanf(line.c_str(), "%u,%u,%lf,%lf,%u,%u", &number, &beam, &time_s,
                                     &angle_rad, &quality, &intensity),
                         6);
        silent += beam != codec.beam().beam ? 1 : 0;
      } while (beam != codec.beam().beam);
      assert_int_equal(codec.beam().ping_number, number);
      assert_int_equal(codec.beam().flags, quality);
      assert_int_equal(codec.beam().intensity, intensity);
      assert_near(1e-9 * static_cast<double>(codec.beam().two_way_ns), time_s, 0.6e-7);
      assert_near(kRadPerBam * codec.beam().angle_bam32, angle_rad, 0.6e-5);
      ++compared;
      more = codec.next(ping);
    }
  }
  assert_int_equal(codec.counters().frames, 550);
  assert_int_equal(rejected(codec.counters()), 0);
  assert_int_equal(compared + codec.counters().no_data, 550 * 256);
  assert_true(silent <= codec.counters().no_data);
  assert_true(compared > 140'000);
}
