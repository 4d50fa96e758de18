#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <sstream>

#include "hal/heads/kongsberg.hpp"
#include "hal/wire.hpp"
#include "model/base/fixed.hpp"
#include "tests/support/device_bytes.hpp"

namespace {

using leadline::base::NavSample;
using leadline::base::Ping;
using leadline::hal::KongsbergCodec;
using leadline::hal::KongsbergConfig;
using leadline::hal::rejected;
using leadline::test::Bytes;
using leadline::test::records_of;
using leadline::test::without;
using leadline::test::operator+;

constexpr double kDegPerBam = 360.0 / 4294967296.0;

double degrees(leadline::base::Bam32 angle) {
  return kDegPerBam * static_cast<double>(static_cast<std::int32_t>(angle));
}

/// Appends little-endian numbers; what is written in place counts from the datagram's first byte.
class Datagram {
 public:
  Datagram& u8(unsigned value) {
    bytes_.push_back(static_cast<std::uint8_t>(value));
    return *this;
  }
  Datagram& u16(unsigned value) { return u8(value & 0xFFU).u8((value >> 8U) & 0xFFU); }
  Datagram& i16(int value) { return u16(static_cast<unsigned>(value) & 0xFFFFU); }
  Datagram& u32(std::uint32_t value) { return u16(value & 0xFFFFU).u16(value >> 16U); }
  Datagram& f32(float value) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    return u32(bits);
  }
  Datagram& f64(double value) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    return u32(static_cast<std::uint32_t>(bits)).u32(static_cast<std::uint32_t>(bits >> 32U));
  }
  Datagram& zeros(std::size_t count) {
    bytes_.insert(bytes_.end(), count, 0);
    return *this;
  }
  [[nodiscard]] std::size_t size() const { return bytes_.size(); }

  /// Closes one of the older kind: length in front, ETX and sum behind.
  [[nodiscard]] Bytes all() {
    u8(3);
    unsigned sum = 0;
    for (std::size_t i = 1; i + 1 < bytes_.size(); ++i) {
      sum += bytes_[i];
    }
    u16(sum & 0xFFFFU);
    Bytes out(4);
    leadline::hal::write_u32_le(out.data(), static_cast<std::uint32_t>(bytes_.size()));
    return out + bytes_;
  }
  /// Closes one of the newer kind: length in front and behind.
  [[nodiscard]] Bytes kmall() {
    Bytes length(4);
    leadline::hal::write_u32_le(length.data(), static_cast<std::uint32_t>(bytes_.size() + 8));
    return length + bytes_ + length;
  }

 private:
  Bytes bytes_;
};

/// 2014-02-13, 10:00:00.250.
Datagram all_header(char type, unsigned counter = 7, unsigned serial = 102) {
  Datagram datagram;
  datagram.u8(2).u8(static_cast<unsigned>(type)).u16(2045).u32(20140213).u32(36'000'250);
  datagram.u16(counter).u16(serial);
  return datagram;
}
constexpr std::int64_t kAllTime_us = 1'392'285'600'250'000;

struct RawBeam {
  int angle_cdeg;
  unsigned sector;
  unsigned detection;
  float two_way_s;
  int cleaning;
};

Bytes raw78(const std::vector<RawBeam>& beams, unsigned counter = 7, unsigned serial = 102,
            unsigned speed_dm_s = 15'000) {
  Datagram to = all_header('N', counter, serial);
  to.u16(speed_dm_s).u16(2).u16(static_cast<unsigned>(beams.size())).u16(0).f32(30'000.0F).u32(0);
  for (const int tilt_cdeg : {0, -300}) {
    to.i16(tilt_cdeg).u16(0).f32(1e-4F).f32(tilt_cdeg == 0 ? 0.0F : 0.002F).zeros(12);
  }
  for (const RawBeam& beam : beams) {
    to.i16(beam.angle_cdeg).u8(beam.sector).u8(beam.detection).u16(10).u8(20).u8(0);
    to.f32(beam.two_way_s).i16(-200).u8(static_cast<unsigned>(beam.cleaning) & 0xFFU).u8(0);
  }
  to.u8(0);
  return to.all();
}

Bytes attitude_all() {
  Datagram to = all_header('A');
  to.u16(2);
  to.u16(0).u16(0).i16(-82).i16(91).i16(25).u16(1436);
  to.u16(10).u16(0).i16(150).i16(-200).i16(-30).u16(35'999);
  to.u8(0);
  return to.all();
}

Bytes position_all(int latitude_2e7 = -768'023'570, unsigned quality_cm = 150) {
  Datagram to = all_header('P');
  to.u32(static_cast<std::uint32_t>(latitude_2e7)).u32(1'424'837'858);
  to.u16(quality_cm).u16(0).u16(0).u16(0).u8(1).u8(0).zeros(2);
  return to.all();
}

Bytes profile_all() {
  Datagram to = all_header('U');
  to.u32(20140213).u32(0).u16(3).u16(100);
  to.u32(0).u32(15'000).u32(10).u32(15'100).u32(99).u32(14'900).u8(0);
  return to.all();
}

Datagram kmall_header(const char* name) {
  Datagram datagram;
  for (std::size_t i = 0; i < 4; ++i) {
    datagram.u8(static_cast<unsigned>(name[i]));
  }
  datagram.u8(1).u8(40).u16(2042).u32(1'747'459'116).u32(920'000'000);
  return datagram;
}
constexpr std::int64_t kKmallTime_us = 1'747'459'116'920'000;

struct MrzBeam {
  unsigned type;
  unsigned method;
  float angle_deg;
  float two_way_s;
};

Bytes mrz(const std::vector<MrzBeam>& beams, unsigned parts = 1, float speed = 1469.5F) {
  Datagram to = kmall_header("#MRZ");
  to.u16(parts).u16(1);
  to.u16(12).u16(4669).zeros(5).u8(1).zeros(2);
  to.u16(144).zeros(90).u16(2).u16(36).f32(10.0F).f32(speed).zeros(40);
  for (const float tilt_deg : {0.0F, 2.0F}) {
    to.zeros(4).f32(tilt_deg == 0.0F ? 0.0F : 0.001F).f32(tilt_deg).zeros(24);
  }
  to.u16(32).u16(static_cast<unsigned>(beams.size())).u16(0).u16(120).zeros(20).u16(1).u16(4);
  to.zeros(4);
  for (std::size_t i = 0; i < beams.size(); ++i) {
    const MrzBeam& beam = beams[i];
    to.u16(static_cast<unsigned>(i)).u8(static_cast<unsigned>(i % 2)).u8(beam.type);
    to.u8(beam.method).zeros(67).f32(beam.angle_deg).f32(0.0F).f32(beam.two_way_s).zeros(36);
  }
  return to.kmall();
}

Bytes skm(float roll_deg = -1.5F) {
  Datagram to = kmall_header("#SKM");
  to.u16(12).zeros(4).u16(2).u16(132).u16(0x7F);
  for (unsigned i = 0; i < 2; ++i) {
    to.zeros(8).u32(1'747'459'116).u32(500'000'000 + i * 10'000'000).zeros(20).f32(43.7F);
    to.f32(roll_deg).f32(0.75F).f32(186.5F).f32(0.25F).zeros(132 - 56);
  }
  return to.kmall();
}

Bytes spo(double latitude_deg = 51.2396, double longitude_deg = 2.922) {
  Datagram to = kmall_header("#SPO");
  to.u16(8).zeros(6).u32(1'747'459'116).u32(200'000'000).f32(0.07F);
  to.f64(latitude_deg).f64(longitude_deg).zeros(16);
  return to.kmall();
}

Bytes svp() {
  Datagram to = kmall_header("#SVP");
  to.u16(28).u16(3).zeros(24);
  for (const float depth_m : {0.0F, 12.5F, 12'000.0F}) {
    to.f32(depth_m).f32(1505.9F).zeros(12);
  }
  return to.kmall();
}

const std::vector<RawBeam> kThreeBeams = {
    {6000, 0, 0, 0.02F, 0}, {0, 0, 1, 0.01F, 0}, {-4500, 1, 1, 0.015F, 0}};

std::vector<NavSample> samples_of(KongsbergCodec& codec, const Bytes& bytes,
                                  std::int64_t t_us = 0) {
  std::vector<NavSample> samples;
  Ping ping{};
  NavSample sample{};
  for (const std::uint8_t byte : bytes) {
    while (codec.feed(byte, t_us, ping) && codec.next(ping)) {
    }
    while (codec.take_sample(sample)) {
      samples.push_back(sample);
    }
  }
  return samples;
}

}  // namespace

TEST(raw_ranges_and_angles_78) {
  KongsbergConfig config;
  config.mount = 4;
  KongsbergCodec codec(config);
  const auto pings = records_of<Ping>(codec, raw78(kThreeBeams));
  assert_int_equal(pings.size(), 3);
  // 60 degrees to port.
  assert_near(degrees(pings[0].elevation_bam32 - 0x80000000U) + 180.0, 150.0, 5e-5);
  assert_near(degrees(pings[0].azimuth_bam32), 90.0, 1e-6);
  assert_near(pings[0].range_um, 15'000'000, 2);
  assert_int_equal(pings[0].t_transmit_us, kAllTime_us);
  assert_near(pings[0].t_receive_us - kAllTime_us, 20'000, 1);
  assert_int_equal(pings[0].mount, 4);
  assert_int_equal(pings[0].quality, 170);
  assert_int_equal(pings[0].sound_speed_mm_s, 1'500'000);
  assert_int_equal(pings[1].elevation_bam32, leadline::base::kBam32QuarterTurn);
  assert_int_equal(pings[1].quality, 255);
  // 45 degrees to starboard, tilted 3 degrees back, 2 ms later.
  const double starboard = std::sin(45.0 * 0.017453292519943295);
  const double forward = -std::sin(3.0 * 0.017453292519943295);
  const double azimuth = std::atan2(starboard, forward) / 0.017453292519943295;
  const double elevation = std::acos(std::hypot(starboard, forward)) / 0.017453292519943295;
  assert_near(degrees(pings[2].azimuth_bam32), azimuth, 2e-5);
  assert_near(degrees(pings[2].elevation_bam32), elevation, 2e-5);
  assert_int_equal(pings[2].t_transmit_us, kAllTime_us + 2'000);
  assert_int_equal(codec.beam().ping_number, 7);
  assert_int_equal(codec.beam().serial, 102);
  assert_int_equal(codec.beam().beam, 2);
  assert_near(codec.beam().two_way_ns, 15'000'000, 2);
}

TEST(the_footprint_stays_fore_and_aft) {
  // Where the beam's along axis points: up the elevation and sideways, turned by the rotation.
  KongsbergCodec codec{KongsbergConfig{}};
  for (const Ping& ping : records_of<Ping>(codec, raw78(kThreeBeams))) {
    const double az = degrees(ping.azimuth_bam32) * 0.017453292519943295;
    const double el = degrees(ping.elevation_bam32) * 0.017453292519943295;
    const double rot = degrees(ping.rotation_bam32) * 0.017453292519943295;
    const double forward =
        -std::cos(rot) * std::sin(el) * std::cos(az) - std::sin(rot) * std::sin(az);
    const double sideways =
        -std::cos(rot) * std::sin(el) * std::sin(az) + std::sin(rot) * std::cos(az);
    assert_true(std::fabs(forward) > 0.99);
    assert_true(std::fabs(sideways) < 0.08);
  }
}

TEST(beams_that_do_not_count) {
  KongsbergCodec codec{KongsbergConfig{}};
  const Bytes bytes = raw78({{100, 0, 0x81, 0.01F, 0},  // no valid detection
                             {100, 0, 1, 0.01F, -3},    // flagged out
                             {100, 2, 1, 0.01F, 0},     // no such sector
                             {100, 0, 1, 0.0F, 0},      // no time
                             {100, 0, 1, NAN, 0},       //
                             {100, 0, 1, 40.0F, 0},     // longer than any range
                             {-8990, 1, 1, 0.01F, 0},   // no direction has both angles
                             {100, 0, 1, 0.01F, 0}});
  assert_int_equal(records_of<Ping>(codec, bytes).size(), 1);
  assert_int_equal(codec.counters().no_data, 2);
  assert_int_equal(codec.counters().bad_values, 5);
}

TEST(the_second_receiver_of_a_dual_head) {
  KongsbergConfig config;
  config.second_serial = 2031;
  KongsbergCodec codec(config);
  const auto pings =
      records_of<Ping>(codec, raw78(kThreeBeams, 1, 2004) + raw78(kThreeBeams, 1, 2031));
  assert_int_equal(pings.size(), 6);
  assert_int_equal(pings[0].mount, 0);
  assert_int_equal(pings[5].mount, 1);
}

TEST(arrival_instead_of_the_device_s_clock) {
  KongsbergConfig config;
  config.device_clock = false;
  KongsbergCodec codec(config);
  const auto pings = records_of<Ping>(codec, raw78(kThreeBeams), 5'000'000);
  assert_near(pings[0].t_transmit_us, 5'000'000 - 20'000, 1);
  const auto samples = samples_of(codec, attitude_all(), 6'000'000);
  assert_int_equal(samples[1].t_us, 6'000'000);
  KongsbergConfig shifted;
  shifted.clock_offset_us = -kAllTime_us;
  KongsbergCodec moved(shifted);
  assert_int_equal(records_of<Ping>(moved, raw78(kThreeBeams))[0].t_transmit_us, 0);
}

TEST(attitude_position_and_profile_of_all) {
  KongsbergCodec codec{KongsbergConfig{}};
  const auto samples = samples_of(codec, attitude_all() + position_all() + profile_all());
  assert_int_equal(samples.size(), 3);
  assert_int_equal(samples[0].t_us, kAllTime_us);
  assert_int_equal(samples[1].t_us, kAllTime_us + 10'000);
  assert_near(degrees(samples[0].attitude.roll_bam32), -0.82, 1e-6);
  assert_near(degrees(samples[0].attitude.pitch_bam32), 0.91, 1e-6);
  assert_near(degrees(samples[0].attitude.heading_bam32), 14.36, 1e-6);
  assert_near(degrees(samples[1].attitude.heading_bam32), -0.01, 1e-6);
  assert_int_equal(samples[0].heave_um, 250'000);
  assert_int_equal(samples[1].heave_um, -300'000);
  assert_int_equal(samples[2].latitude_e9deg, -38'401'178'500);
  assert_int_equal(samples[2].longitude_e9deg, 142'483'785'800);
  assert_int_equal(samples[2].sigma_position_mm, 1500);
  assert_int_equal(codec.profile_count(), 3);
  assert_int_equal(codec.profile()[2].depth_um, 99'000'000);
  assert_int_equal(codec.profile()[2].speed_mm_s, 1'490'000);
  NavSample none{};
  assert_false(codec.take_sample(none));
  assert_int_equal(none.fields, 0);
}

TEST(a_ping_of_kmall) {
  KongsbergCodec codec{KongsbergConfig{}};
  const auto pings = records_of<Ping>(codec, mrz({{0, 2, 30.0F, 0.01F},
                                                  {0, 1, -20.0F, 0.02F},
                                                  {1, 1, 0.0F, 0.02F},
                                                  {2, 1, 0.0F, 0.02F},
                                                  {0, 1, 91.0F, 0.02F}}));
  assert_int_equal(pings.size(), 2);
  assert_int_equal(codec.counters().no_data, 2);
  assert_int_equal(codec.counters().bad_values, 1);
  assert_int_equal(pings[0].t_transmit_us, kKmallTime_us);
  assert_int_equal(pings[1].t_transmit_us, kKmallTime_us + 1'000);
  assert_int_equal(pings[0].mount, 1);
  assert_int_equal(pings[0].quality, 255);
  assert_int_equal(pings[1].quality, 170);
  assert_near(pings[0].range_um, 7'347'500, 2);
  assert_near(degrees(pings[0].elevation_bam32 - 0x80000000U) + 180.0, 120.0, 5e-5);
  assert_true(degrees(pings[1].azimuth_bam32) > 0 && degrees(pings[1].azimuth_bam32) < 90);
  assert_int_equal(codec.beam().ping_number, 4669);
  assert_int_equal(codec.beam().beam, 1);
}

TEST(samples_and_profile_of_kmall) {
  KongsbergCodec codec{KongsbergConfig{}};
  const auto samples = samples_of(codec, skm() + spo() + svp());
  assert_int_equal(samples.size(), 3);
  assert_int_equal(samples[1].t_us, 1'747'459'116'510'000);
  assert_near(degrees(samples[0].attitude.roll_bam32), -1.5, 1e-7);
  assert_near(degrees(samples[0].attitude.pitch_bam32), 0.75, 1e-7);
  assert_near(degrees(samples[0].attitude.heading_bam32) + 360.0, 186.5, 1e-7);
  assert_int_equal(samples[0].heave_um, 250'000);
  assert_int_equal(samples[2].t_us, 1'747'459'116'200'000);
  assert_near(samples[2].latitude_e9deg, 51'239'600'000.0, 1);
  assert_near(samples[2].longitude_e9deg, 2'922'000'000.0, 1);
  assert_int_equal(samples[2].sigma_position_mm, 70);
  assert_int_equal(codec.profile_count(), 3);
  assert_int_equal(codec.profile()[1].depth_um, 12'500'000);
  assert_int_equal(codec.profile()[1].speed_mm_s, 1'505'900);
}

TEST(places_that_are_none) {
  for (const double latitude : {91.0, 200.0, 1e300, static_cast<double>(NAN)}) {
    KongsbergCodec codec{KongsbergConfig{}};
    assert_int_equal(samples_of(codec, spo(latitude)).size(), 0);
    assert_int_equal(codec.counters().bad_values, 1);
  }
  KongsbergCodec codec{KongsbergConfig{}};
  assert_near(samples_of(codec, spo(-1e-300, -179.5))[0].longitude_e9deg, -179'500'000'000.0, 1);
  assert_int_equal(samples_of(codec, position_all(2'000'000'000)).size(), 0);
  assert_int_equal(samples_of(codec, position_all(0, 0xFFFF))[0].sigma_position_mm, 0);
  assert_int_equal(samples_of(codec, skm(NAN)).size(), 0);
}

TEST(values_that_no_head_sends) {
  KongsbergCodec codec{KongsbergConfig{}};
  assert_int_equal(records_of<Ping>(codec, raw78(kThreeBeams, 1, 1, 12'000)).size(), 0);
  assert_int_equal(records_of<Ping>(codec, mrz({{0, 1, 0.0F, 0.01F}}, 1, NAN)).size(), 0);
  assert_int_equal(codec.counters().bad_values, 2);
  assert_int_equal(records_of<Ping>(codec, mrz({{0, 1, 0.0F, 0.01F}}, 2)).size(), 0);
  assert_int_equal(codec.counters().ignored, 1);
}

TEST(datagrams_shorter_than_their_counts) {
  KongsbergCodec codec{KongsbergConfig{}};
  std::uint32_t bad = 0;
  for (const char type : {'N', 'A', 'P', 'U'}) {
    (void)samples_of(codec, all_header(type).u16(15'000).u16(60'000).all());
    assert_int_equal(codec.counters().bad_values, ++bad);
    (void)samples_of(
        codec,
        all_header(type).u16(15'000).u16(60'000).zeros(2).u16(9).u32(0x10000).zeros(16).all());
    bad += type == 'P' ? 0 : 1;
    assert_int_equal(codec.counters().bad_values, bad);
  }
  for (const char* const name : {"#MRZ", "#SKM", "#SPO", "#SVP"}) {
    (void)samples_of(codec, kmall_header(name).u16(1).u16(0).kmall());
    assert_int_equal(codec.counters().bad_values, ++bad);
    (void)samples_of(codec, kmall_header(name)
                                .u16(1)
                                .u16(0xFFFF)
                                .u16(0xFFFF)
                                .u16(0xFFFF)
                                .u16(0xFFFF)
                                .zeros(200)
                                .kmall());
    assert_true(codec.counters().bad_values >= bad);
    bad = codec.counters().bad_values;
  }
  (void)samples_of(codec, all_header('Y').zeros(10).all() + kmall_header("#XYZ").kmall());
  assert_int_equal(codec.counters().ignored, 2);
}

TEST(any_lost_byte_costs_its_datagram_only) {
  const Bytes follower = raw78(kThreeBeams, 99);
  for (const Bytes& first : {raw78(kThreeBeams, 1), mrz({{0, 1, 0.0F, 0.01F}}), skm()}) {
    for (std::size_t i = 0; i < first.size(); ++i) {
      KongsbergCodec codec{KongsbergConfig{}};
      // A lost byte may make a length that reaches far: enough follows to get past it.
      const auto pings = records_of<Ping>(codec, without(first, i) + follower + Bytes(82'000));
      assert_true(pings.size() >= 3);
      assert_int_equal(codec.beam().ping_number, 99);
    }
  }
}

TEST(a_restart_forgets_half_a_datagram) {
  KongsbergCodec codec{KongsbergConfig{}};
  const Bytes bytes = raw78(kThreeBeams);
  Ping ping{};
  for (std::size_t i = 0; i < 60; ++i) {
    assert_false(codec.feed(bytes[i], 0, ping));
  }
  codec.restart();
  assert_int_equal(codec.counters().skipped_bytes, 60);
  assert_int_equal(records_of<Ping>(codec, bytes).size(), 3);
}

namespace {

Bytes read_bytes(const std::string& relative) {
  std::ifstream file(leadline::test::require_data("multibeam_kongsberg_snippets/" + relative),
                     std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

}  // namespace

TEST(a_real_recording_of_the_older_kind) {
  const std::string name = "all_a_y_m1333931979274893952";
  const Bytes bytes = read_bytes("raw/" + name + ".all");
  std::ifstream csv(
      leadline::test::require_data("multibeam_kongsberg_snippets/derived/" + name + "_beams.csv"));
  std::string line;
  std::getline(csv, line);
  KongsbergCodec codec{KongsbergConfig{}};
  Ping ping{};
  std::size_t compared = 0;
  std::vector<double> slant_errors;
  for (const std::uint8_t byte : bytes) {
    bool more = codec.feed(byte, 0, ping);
    while (more) {
      unsigned number = 0;
      unsigned serial = 0;
      unsigned beam = 0;
      double t_s = 0;
      double heading = 0;
      double tx_depth = 0;
      double speed = 0;
      double angle = 0;
      double tilt = 0;
      double two_way = 0;
      double depth = 0;
      double across = 0;
      double along = 0;
      do {
        assert_true(static_cast<bool>(std::getline(csv, line)));
        assert_int_equal(
            std::sscanf(line.c_str(), "%u,%u,%lf,%lf,%lf,%lf,%u,%lf,%lf,%lf,%lf,%lf,%lf", &number,
                        &serial, &t_s, &heading, &tx_depth, &speed, &beam, &angle, &tilt, &two_way,
                        &depth, &across, &along),
            13);
      } while (beam != codec.beam().beam || number != codec.beam().ping_number);
      assert_near(ping.sound_speed_mm_s, speed * 1000, 1);
      assert_near(1e-9 * static_cast<double>(codec.beam().two_way_ns), two_way, 0.6e-7);
      const double az = degrees(ping.azimuth_bam32) * 0.017453292519943295;
      const double el = degrees(ping.elevation_bam32) * 0.017453292519943295;
      assert_near(std::cos(el) * std::sin(az), -std::sin(angle * 0.017453292519943295), 1e-6);
      assert_near(std::cos(el) * std::cos(az), std::sin(tilt * 0.017453292519943295), 1e-6);
      slant_errors.push_back(std::fabs(1e-6 * static_cast<double>(ping.range_um) -
                                       std::sqrt(depth * depth + across * across + along * along)));
      ++compared;
      more = codec.next(ping);
    }
  }
  assert_int_equal(rejected(codec.counters()), 0);
  assert_true(compared > 13'000);
  std::sort(slant_errors.begin(), slant_errors.end());
  print_message("%zu beams; slant against the maker's soundings: median %.3f m\n", compared,
                slant_errors[slant_errors.size() / 2]);
  assert_true(slant_errors[slant_errors.size() / 2] < 0.03);
}

TEST(samples_of_real_recordings) {
  const std::string name = "belgica_0077_20221109_123655_Belgica";
  KongsbergCodec codec{KongsbergConfig{}};
  const auto samples = samples_of(codec, read_bytes("raw/" + name + ".all"));
  std::ifstream csv(leadline::test::require_data("multibeam_kongsberg_snippets/derived/" + name +
                                                 "_attitude.csv"));
  std::string line;
  std::getline(csv, line);
  std::size_t attitudes = 0;
  std::size_t positions = 0;
  for (const NavSample& sample : samples) {
    if (sample.kind != leadline::base::NavKind::kAttitude) {
      ++positions;
      continue;
    }
    double t_s = 0;
    double roll = 0;
    double pitch = 0;
    double heave = 0;
    double heading = 0;
    assert_true(static_cast<bool>(std::getline(csv, line)));
    assert_int_equal(
        std::sscanf(line.c_str(), "%lf,%lf,%lf,%lf,%lf", &t_s, &roll, &pitch, &heave, &heading), 5);
    assert_near(1e-6 * static_cast<double>(sample.t_us), t_s, 1e-3);
    assert_near(degrees(sample.attitude.roll_bam32), roll, 1e-6);
    assert_near(degrees(sample.attitude.pitch_bam32), pitch, 1e-6);
    assert_near(1e-6 * static_cast<double>(sample.heave_um), heave, 1e-9);
    ++attitudes;
  }
  assert_false(static_cast<bool>(std::getline(csv, line)));
  assert_true(attitudes > 700);
  assert_int_equal(positions, 8);
  assert_true(codec.profile_count() > 5);
}

TEST(real_recordings_of_the_newer_kind) {
  struct Case {
    const char* name;
    std::size_t pings;
    std::size_t attitudes;
  };
  const Case cases[] = {{"raw/kmall_OS01_m1927233285749584930.kmall", 6, 204},
                        {"raw/kmall_OS03_m4033476991022010987.kmall", 5, 102}};
  for (const Case& one : cases) {
    KongsbergCodec codec{KongsbergConfig{}};
    std::size_t beams = 0;
    std::size_t attitudes = 0;
    std::size_t positions = 0;
    Ping ping{};
    NavSample sample{};
    for (const std::uint8_t byte : read_bytes(one.name)) {
      for (bool more = codec.feed(byte, 0, ping); more; more = codec.next(ping)) {
        ++beams;
        assert_true(ping.range_um > 1'000'000 && ping.range_um < 20'000'000);
      }
      while (codec.take_sample(sample)) {
        attitudes += sample.kind == leadline::base::NavKind::kAttitude ? 1 : 0;
        positions += sample.kind == leadline::base::NavKind::kPosition ? 1 : 0;
      }
    }
    assert_int_equal(rejected(codec.counters()), 0);
    assert_int_equal(attitudes, one.attitudes);
    assert_true(positions >= 2);
    assert_true(beams > one.pings * 300);
    assert_int_equal(codec.profile_count(), 12);
  }
}
