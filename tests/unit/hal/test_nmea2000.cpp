#include "hal/attitude/nmea2000.hpp"
#include "hal/emu/nmea2000_bus.hpp"
#include "tests/support/nav_streams.hpp"

namespace {

using leadline::base::NavKind;
using leadline::base::NavSample;
using leadline::emu::n2k_message;
using leadline::emu::n2k_truth;
using leadline::emu::N2kTruth;
using leadline::hal::FastPackets;
using leadline::hal::Nmea2000Codec;
using leadline::hal::Nmea2000Config;
using leadline::test::Bytes;
using leadline::test::degrees;
using leadline::test::from_hex;
using leadline::test::only_sample;
using leadline::test::samples_of;
using leadline::test::turn;
using leadline::test::without;
using leadline::test::operator+;

constexpr std::uint8_t kSource = 0x23;
constexpr double kAngle = 0.003;  // half of 1e-4 rad, in degrees

NavSample only(std::uint32_t pgn, const std::string& hex, const Nmea2000Config& config = {}) {
  return only_sample<Nmea2000Codec>(config, n2k_message(pgn, kSource, from_hex(hex)), 5000);
}

N2kTruth truth() {
  N2kTruth truth;
  truth.motion.roll_deg = -17.2;
  truth.motion.pitch_deg = 4.9;
  truth.motion.heading_deg = 301.5;
  truth.motion.rate_rad_s = {0, 0, -0.0125};
  truth.motion.heave_m = 1.35;
  truth.motion.altitude_m = 12.34;
  truth.latitude_deg = -34.4059412;
  truth.longitude_deg = 133.5411987;
  truth.pressure_pa = 251'325;
  truth.speed_through_water_m_s = 1.53;
  truth.speed_over_ground_m_s = 2.5;
  truth.course_deg = 150;
  truth.unix_s = 1'785'733'527.25;
  return truth;
}

NavSample of_truth(std::uint32_t pgn, const Nmea2000Config& config = {}) {
  return only_sample<Nmea2000Codec>(config, n2k_truth(pgn, kSource, truth()), 5000);
}

/// Frames of 16 bytes, each at its own time.
std::vector<NavSample> on_a_bus(Nmea2000Codec& codec, const Bytes& frames, std::int64_t& t_us) {
  std::vector<NavSample> samples;
  for (std::size_t i = 0; i < frames.size(); i += 16) {
    const auto from = frames.begin() + static_cast<std::ptrdiff_t>(i);
    const auto to =
        from + static_cast<std::ptrdiff_t>(std::min<std::size_t>(16, frames.size() - i));
    t_us += 1000;
    for (const NavSample& sample : samples_of(codec, Bytes(from, to), t_us)) {
      samples.push_back(sample);
    }
  }
  return samples;
}

}  // namespace

// devices.md 7.1, REAL.
TEST(real_identifier) {
  assert_int_equal(leadline::hal::pgn_of(0x0DF50B23), 128'267);
  assert_int_equal(leadline::hal::n2k_source_of(0x0DF50B23), 0x23);
  // A format below 240 has a destination where others have the end of their PGN.
  assert_int_equal(leadline::hal::pgn_of(0x18EAFF23), 59'904);
}

TEST(real_attitude_without_a_yaw) {
  const NavSample sample = only(127'257, "00 ff 7f 1b 00 21 05 ff");
  assert_int_equal(sample.kind, NavKind::kAttitude);
  assert_int_equal(sample.fields, leadline::base::kNavRollPitch);
  assert_near(degrees(sample.attitude.pitch_bam32), 0.155, 0.0005);
  assert_near(degrees(sample.attitude.roll_bam32), 7.523, 0.0005);
  assert_int_equal(sample.attitude.heading_bam32, 0);
  assert_int_equal(sample.t_us, 5000);
  assert_int_equal(sample.quality, 255);
}

TEST(real_magnetic_heading_with_variation) {
  const std::string bytes = "89 02 7f 00 00 ba 02 fd";
  const NavSample magnetic = only(127'250, bytes);
  assert_int_equal(magnetic.kind, NavKind::kHeading);
  assert_int_equal(magnetic.fields, leadline::base::kNavHeadingMagnetic);
  assert_near(turn(magnetic.attitude.heading_bam32), 186.291, 0.0005);
  Nmea2000Config config;
  config.use_variation = true;
  const NavSample turned = only(127'250, bytes, config);
  assert_int_equal(turned.fields, leadline::base::kNavHeading);
  assert_near(turn(turned.attitude.heading_bam32), 186.291 + 3.999, 0.001);
}

TEST(real_depth) {
  const NavSample sample = only(128'267, "ed ef 01 00 00 4c ff ff");
  assert_int_equal(sample.kind, NavKind::kAltitude);
  assert_int_equal(sample.fields, leadline::base::kNavAltitude);
  assert_int_equal(sample.altitude_um, 4'950'000);
}

TEST(every_message_of_the_bus_comes_back) {
  const N2kTruth sent = truth();
  const NavSample attitude = of_truth(127'257);
  assert_near(degrees(attitude.attitude.roll_bam32), sent.motion.roll_deg, kAngle);
  assert_near(degrees(attitude.attitude.pitch_bam32), sent.motion.pitch_deg, kAngle);
  assert_near(turn(attitude.attitude.heading_bam32), sent.motion.heading_deg, kAngle);
  assert_near(turn(of_truth(127'250).attitude.heading_bam32), sent.motion.heading_deg, kAngle);
  assert_int_equal(of_truth(127'250).fields, leadline::base::kNavHeading);

  const NavSample rate = of_truth(127'251);
  assert_int_equal(rate.fields, leadline::base::kNavYawRate);
  assert_int_equal(rate.rate_urad_s[2], -12'500);
  const NavSample heave = of_truth(127'252);
  assert_int_equal(heave.kind, NavKind::kHeave);
  assert_int_equal(heave.heave_um, -1'350'000);

  const NavSample water = of_truth(128'259);
  assert_int_equal(water.fields, leadline::base::kNavVelocityWater);
  assert_int_equal(water.velocity_um_s[0], 1'530'000);
  const NavSample ground = of_truth(129'026);
  assert_int_equal(ground.fields, leadline::base::kNavVelocityWorld);
  assert_near(static_cast<double>(ground.velocity_um_s[0]), -2.5e6 * std::sqrt(0.75), 100);
  assert_near(static_cast<double>(ground.velocity_um_s[1]), 1.25e6, 100);

  const NavSample position = of_truth(129'025);
  assert_int_equal(position.latitude_e9deg, -34'405'941'200);
  assert_int_equal(position.longitude_e9deg, 133'541'198'700);
  const NavSample pressure = of_truth(130'314);
  assert_int_equal(pressure.kind, NavKind::kPressure);
  assert_int_equal(pressure.pressure_pa, 251'325);
  const NavSample time = of_truth(126'992);
  assert_int_equal(time.kind, NavKind::kTime);
  assert_int_equal(time.utc_us, 1'785'733'527'250'000);
  assert_int_equal(of_truth(128'267).altitude_um, 12'340'000);
}

TEST(a_fast_packet_is_one_position) {
  const NavSample sample = of_truth(129'029);
  assert_int_equal(sample.kind, NavKind::kPosition);
  assert_int_equal(sample.fields, leadline::base::kNavGeodetic | leadline::base::kNavUtc);
  assert_int_equal(sample.latitude_e9deg, -34'405'941'200);
  assert_int_equal(sample.longitude_e9deg, 133'541'198'700);
  assert_int_equal(sample.utc_us, 1'785'733'527'250'000);
  assert_int_equal(sample.quality, 160);
  N2kTruth none = truth();
  none.gnss_method = 0;
  const NavSample lost =
      only_sample<Nmea2000Codec>(Nmea2000Config{}, n2k_truth(129'029, kSource, none));
  assert_int_equal(lost.fields, 0);
  assert_int_equal(lost.kind, NavKind::kPosition);
}

TEST(configuration_says_what_the_bus_does_not) {
  Nmea2000Config config;
  config.yaw_true = true;
  config.heave_up = false;
  assert_int_equal(of_truth(127'257, config).fields,
                   leadline::base::kNavRollPitch | leadline::base::kNavHeading);
  assert_int_equal(of_truth(127'252, config).heave_um, 1'350'000);
  config.pressure_source = leadline::hal::kN2kPressureWater;
  assert_int_equal(of_truth(130'314, config).fields, leadline::base::kNavPressure);
  Nmea2000Codec codec(config);
  const Bytes barometer = n2k_message(130'314, kSource, from_hex("00 00 00 f0 76 0f 00 ff"));
  assert_int_equal(samples_of(codec, barometer).size(), 0);
  assert_int_equal(codec.counters().ignored, 1);
  config.source = 0x24;
  Nmea2000Codec other(config);
  assert_int_equal(samples_of(other, n2k_truth(127'257, kSource, truth())).size(), 0);
  assert_int_equal(other.counters().wrong_device, 1);
  assert_int_equal(samples_of(other, n2k_truth(127'257, 0x24, truth())).size(), 1);
}

TEST(what_is_not_available_is_a_record_without_fields) {
  const struct {
    std::uint32_t pgn;
    const char* hex;
  } cases[] = {
      {126'992, "00 f0 ff ff ff ff ff ff"}, {126'992, "00 f0 01 00 ff ff ff 7f"},
      {127'250, "00 ff ff ff 7f ff 7f fd"}, {127'250, "00 fe ff ff 7f ff 7f fd"},
      {127'250, "00 fd ff ff 7f ff 7f fd"}, {127'250, "00 00 10 ff 7f ff 7f ff"},
      {127'250, "00 71 f5 ff 7f ff 7f fc"},  // 62833: beyond the circle
      {127'251, "00 ff ff ff 7f ff ff ff"}, {127'251, "00 00 00 00 80 ff ff ff"},
      {127'252, "00 ff 7f ff ff ff ff ff"}, {127'252, "00 fe 7f ff ff ff ff ff"},
      {127'252, "00 fd 7f ff ff ff ff ff"}, {127'252, "00 00 80 ff ff ff ff ff"},
      {127'257, "ff ff 7f ff 7f ff 7f ff"}, {127'257, "ff ff 7f 10 00 ff 7f ff"},
      {127'257, "ff ff 7f ff 7f 10 00 ff"}, {127'257, "ff ff 7f 5d 3d 00 00 ff"},
      {128'259, "00 ff ff ff ff 00 ff ff"}, {128'267, "00 ff ff ff ff 00 00 ff"},
      {128'267, "00 00 00 00 00 00 00 ff"}, {128'267, "00 fd ff ff ff 00 00 ff"},
      {128'267, "00 00 00 00 70 00 00 ff"},  // 18,790 km
      {129'025, "ff ff ff 7f ff ff ff 7f"}, {129'025, "00 00 00 00 ff ff ff 7f"},
      {129'025, "00 00 00 40 00 00 00 00"}, {129'026, "00 fc ff ff 10 00 ff ff"},
      {129'026, "00 fc 00 00 ff ff ff ff"}, {129'026, "00 fd 00 00 10 00 ff ff"},
      {130'314, "00 00 01 ff ff ff 7f ff"}, {130'314, "00 00 01 00 00 00 00 ff"},
  };
  for (const auto& one : cases) {
    const NavSample sample = only(one.pgn, one.hex);
    if (sample.fields != 0) {
      fail_msg("%u %s: fields %u", one.pgn, one.hex, sample.fields);
    }
    assert_true(sample.kind != NavKind::kOther);
  }
  Nmea2000Codec codec(Nmea2000Config{});
  assert_int_equal(samples_of(codec, n2k_message(127'257, 1, from_hex(cases[13].hex))).size(), 1);
  assert_int_equal(codec.counters().no_data, 1);
  assert_int_equal(codec.counters().records, 1);
}

TEST(what_is_none_of_ours_is_passed_over) {
  Nmea2000Codec codec(Nmea2000Config{});
  assert_int_equal(samples_of(codec, n2k_message(127'505, 1, Bytes(8, 0))).size(), 0);
  Bytes eleven_bits = n2k_truth(127'257, kSource, truth());
  eleven_bits[0] = 0x21;
  eleven_bits[1] = 0x03;
  eleven_bits[2] = eleven_bits[3] = 0;
  assert_int_equal(samples_of(codec, eleven_bits).size(), 0);
  Bytes error = n2k_truth(127'257, kSource, truth());
  error[3] |= 0x20U;
  assert_int_equal(samples_of(codec, error).size(), 0);
  Bytes remote = n2k_truth(127'257, kSource, truth());
  remote[3] |= 0x40U;
  assert_int_equal(samples_of(codec, remote).size(), 0);
  assert_int_equal(codec.counters().ignored, 4);
  // Shorter than its layout.
  assert_int_equal(samples_of(codec, n2k_message(127'257, 1, Bytes(6, 0))).size(), 0);
  assert_int_equal(codec.counters().bad_length, 1);
}

TEST(a_lost_byte_costs_its_frame) {
  const Bytes frame = n2k_truth(127'257, kSource, truth());
  for (std::size_t i = 0; i < frame.size(); ++i) {
    Nmea2000Codec codec(Nmea2000Config{});
    std::size_t records = samples_of(codec, frame, 1000).size();
    records += samples_of(codec, without(frame, i), 2000).size();
    const auto after = samples_of(codec, frame, 3000);
    assert_int_equal(records + after.size(), 2);
    assert_int_equal(after.back().t_us, 3000);
    assert_true(codec.counters().skipped_bytes == 15);
  }
}

TEST(no_frame_is_made_of_what_cannot_be_one) {
  for (const std::size_t at : {std::size_t{4}, std::size_t{5}, std::size_t{6}, std::size_t{7}}) {
    Bytes frame = n2k_truth(127'257, kSource, truth());
    frame[at] = 9;
    Nmea2000Codec codec(Nmea2000Config{});
    assert_int_equal(samples_of(codec, frame, 0).size(), 0);
    assert_int_equal(samples_of(codec, n2k_truth(127'257, kSource, truth()), 1000).size(), 1);
  }
  // Data behind the length; bits that no short identifier has.
  Bytes longer = n2k_truth(127'257, kSource, truth());
  longer[4] = 5;
  Bytes wide = n2k_truth(127'257, kSource, truth());
  wide[3] &= 0x1FU;
  Nmea2000Codec codec(Nmea2000Config{});
  assert_int_equal(samples_of(codec, longer, 0).size() + samples_of(codec, wide, 1000).size(), 0);
  assert_int_equal(codec.counters().ignored, 0);
}

TEST(a_lost_frame_costs_its_fast_packet) {
  const Bytes whole = n2k_truth(129'029, kSource, truth(), 3);
  const std::size_t frames = whole.size() / 16;
  assert_int_equal(frames, 7);
  for (std::size_t lost = 0; lost < frames; ++lost) {
    Bytes holed = whole;
    const auto from = holed.begin() + static_cast<std::ptrdiff_t>(lost * 16);
    holed.erase(from, from + 16);
    Nmea2000Codec codec(Nmea2000Config{});
    std::int64_t t_us = 0;
    assert_int_equal(on_a_bus(codec, holed, t_us).size(), 0);
    assert_int_equal(on_a_bus(codec, n2k_truth(129'029, kSource, truth(), 4), t_us).size(), 1);
    // A message without its beginning is not known to be one.
    assert_int_equal(codec.counters().unfinished, lost == 0 ? 0 : 1);
  }
}

TEST(fast_packets_of_many_senders_interleave_up_to_a_limit) {
  const std::size_t senders = FastPackets::kSlots;
  std::vector<Bytes> messages;
  for (std::size_t i = 0; i <= senders; ++i) {
    messages.push_back(n2k_truth(129'029, static_cast<std::uint8_t>(i + 1), truth(), 0));
  }
  const auto interleave = [&](std::size_t count, Nmea2000Codec& codec) {
    std::size_t records = 0;
    std::int64_t t_us = 0;
    for (std::size_t at = 0; at < messages[0].size(); at += 16) {
      for (std::size_t i = 0; i < count; ++i) {
        const auto from = messages[i].begin() + static_cast<std::ptrdiff_t>(at);
        records += on_a_bus(codec, Bytes(from, from + 16), t_us).size();
      }
    }
    return records;
  };
  Nmea2000Codec enough(Nmea2000Config{});
  assert_int_equal(interleave(senders, enough), senders);
  assert_int_equal(enough.counters().unfinished, 0);
  Nmea2000Codec one_more(Nmea2000Config{});
  assert_true(interleave(senders + 1, one_more) >= senders - 1);
  assert_true(one_more.counters().unfinished >= 1);
}

TEST(a_fast_packet_does_not_wait_for_ever) {
  const Bytes whole = n2k_truth(129'029, kSource, truth());
  Nmea2000Codec codec(Nmea2000Config{});
  std::int64_t t_us = 0;
  assert_int_equal(on_a_bus(codec, Bytes(whole.begin(), whole.begin() + 48), t_us).size(), 0);
  t_us += 2'000'000;
  assert_int_equal(on_a_bus(codec, Bytes(whole.begin() + 48, whole.end()), t_us).size(), 0);
  assert_int_equal(codec.counters().unfinished, 1);
  assert_int_equal(on_a_bus(codec, Bytes(whole.begin(), whole.begin() + 16), t_us).size(), 0);
  codec.restart();
  assert_int_equal(on_a_bus(codec, Bytes(whole.begin() + 16, whole.end()), t_us).size(), 0);
  assert_int_equal(codec.counters().unfinished, 2);
}

TEST(a_fast_packet_of_an_impossible_size_is_dropped) {
  for (const char* const head : {"00 00 00 00 00 00 00 00", "00 e0 00 00 00 00 00 00", "00 20"}) {
    Nmea2000Codec codec(Nmea2000Config{});
    assert_int_equal(samples_of(codec, n2k_message(129'029, 1, from_hex(head))).size(), 0);
    assert_int_equal(codec.counters().unfinished, 1);
  }
  // Whole, but shorter than a position.
  Nmea2000Codec codec(Nmea2000Config{});
  assert_int_equal(samples_of(codec, n2k_message(129'029, 1, Bytes(20, 1), true)).size(), 0);
  assert_int_equal(codec.counters().bad_length, 1);
}
