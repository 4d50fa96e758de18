#include <cmath>
#include <cstdio>

#include "hal/attitude/nmea.hpp"
#include "tests/support/device_bytes.hpp"

namespace {

using leadline::base::NavSample;
using leadline::hal::NmeaCodec;
using leadline::hal::NmeaConfig;
using leadline::test::Bytes;
using leadline::test::from_text;
using leadline::test::Random;
using leadline::test::without;
using leadline::test::operator+;

constexpr double kBamPerDegree = 4294967296.0 / 360.0;

std::vector<NavSample> feed(NmeaCodec& codec, const Bytes& bytes, std::int64_t t_us = 0) {
  std::vector<NavSample> samples;
  NavSample sample{};
  for (const std::uint8_t byte : bytes) {
    if (codec.feed(byte, t_us, sample)) {
      samples.push_back(sample);
    }
  }
  return samples;
}

NavSample only(const std::string& line, const NmeaConfig& config = {}) {
  NmeaCodec codec(config);
  const auto samples = feed(codec, from_text(line + "\r\n"));
  assert_int_equal(samples.size(), 1);
  return samples[0];
}

/// With its checksum, as the sentence would be sent.
std::string sealed(const std::string& body) {
  unsigned sum = 0;
  for (const char c : body) {
    sum ^= static_cast<unsigned char>(c);
  }
  char tail[8];
  std::snprintf(tail, sizeof tail, "*%02X", sum);
  return "$" + body + tail;
}

NavSample body(const std::string& text, const NmeaConfig& config = {}) {
  return only(sealed(text), config);
}

double degrees(std::uint32_t bam32) { return static_cast<std::int32_t>(bam32) / kBamPerDegree; }
double turn(std::uint32_t bam32) { return bam32 / kBamPerDegree; }

constexpr double kBam = 1e-7;  // half a unit, in degrees

// devices.md 5.1, REAL.
const char* const kReal[] = {
    "$HCHDG,129.5,,,8.7,E*29",
    "$IIHDM,201.5,M*24",
    "$PASHR,164100190,138.24,T,+32.56,+48.49,+00.00,3.141,3.141,35.000,1,0*17",
    "$PRDID,-4.44,2.12,154.25*56",
    "$PRVAT,00.115,M,0010.073,dBar*39",
    "$PRVAT,00.210,M,0007.497,Metres*3a",
};

}  // namespace

TEST(real_hdg) {
  const NavSample sample = only(kReal[0]);
  assert_int_equal(sample.fields, leadline::base::kNavHeadingMagnetic);
  assert_near(turn(sample.attitude.heading_bam32), 129.5, kBam);
  NmeaConfig config;
  config.use_variation = true;
  const NavSample turned = only(kReal[0], config);
  assert_int_equal(turned.fields, leadline::base::kNavHeading);
  assert_near(turn(turned.attitude.heading_bam32), 138.2, kBam);
}

TEST(real_hdm) {
  const NavSample sample = only(kReal[1]);
  assert_int_equal(sample.fields, leadline::base::kNavHeadingMagnetic);
  assert_near(turn(sample.attitude.heading_bam32), 201.5, kBam);
  assert_int_equal(sample.quality, 255);
}

TEST(real_pashr) {
  const NavSample sample = only(kReal[2]);
  assert_int_equal(sample.fields, leadline::base::kNavHeading | leadline::base::kNavRollPitch |
                                      leadline::base::kNavUtc);
  assert_near(turn(sample.attitude.heading_bam32), 138.24, kBam);
  assert_near(degrees(sample.attitude.roll_bam32), 32.56, kBam);
  assert_near(degrees(sample.attitude.pitch_bam32), 48.49, kBam);
  assert_int_equal(sample.sigma_attitude_urad[0], 54821);
  assert_int_equal(sample.sigma_attitude_urad[1], 54821);
  assert_int_equal(sample.sigma_attitude_urad[2], 610865);
  assert_int_equal(sample.utc_us, ((16 * 60 + 41) * 60 + 0) * 1'000'000LL + 190'000);
}

TEST(real_prdid) {
  const NavSample sample = only(kReal[3]);
  assert_int_equal(sample.fields,
                   leadline::base::kNavHeadingMagnetic | leadline::base::kNavRollPitch);
  assert_near(degrees(sample.attitude.pitch_bam32), -4.44, kBam);
  assert_near(degrees(sample.attitude.roll_bam32), 2.12, kBam);
  assert_near(turn(sample.attitude.heading_bam32), 154.25, kBam);
  NmeaConfig config;
  config.prdid_true = true;
  assert_int_equal(only(kReal[3], config).fields,
                   leadline::base::kNavHeading | leadline::base::kNavRollPitch);
}

TEST(real_prvat) {
  const NavSample pressure = only(kReal[4]);
  assert_int_equal(pressure.fields, leadline::base::kNavPressure | leadline::base::kNavAltitude);
  assert_int_equal(pressure.altitude_um, 115'000);
  assert_int_equal(pressure.pressure_pa, 100'730);
  NmeaConfig config;
  config.gauge_pressure = true;
  assert_int_equal(only(kReal[4], config).pressure_pa, 202'055);

  const NavSample depth = only(kReal[5]);
  assert_int_equal(depth.fields, leadline::base::kNavDepth | leadline::base::kNavAltitude);
  assert_int_equal(depth.altitude_um, 210'000);
  assert_int_equal(depth.depth_um, 7'497'000);
}

TEST(deviation_and_variation_both_sides) {
  assert_near(turn(body("HCHDG,10.0,2.5,W,,").attitude.heading_bam32), 7.5, kBam);
  assert_near(turn(body("HCHDG,359.0,2.5,E,,").attitude.heading_bam32), 1.5, kBam);
  NmeaConfig config;
  config.use_variation = true;
  assert_near(turn(body("HCHDG,1.0,,,3.0,W", config).attitude.heading_bam32), 358.0, kBam);
  assert_int_equal(body("HCHDG,1.0,,,,", config).fields, leadline::base::kNavHeadingMagnetic);
}

TEST(heading_of_true_north) {
  const NavSample sample = body("GPHDT,123.456,T");
  assert_int_equal(sample.fields, leadline::base::kNavHeading);
  assert_near(turn(sample.attitude.heading_bam32), 123.456, kBam);
  assert_int_equal(body("GPHDT,360.0,T").attitude.heading_bam32, 0);
  assert_int_equal(body("GPHDT,0,T").attitude.heading_bam32, 0);
  assert_int_equal(body("GPHDT,-90,T").attitude.heading_bam32, 0xC0000000U);
  assert_int_equal(body("GPHDT,180.,").attitude.heading_bam32, 0x80000000U);
  assert_int_equal(body("GPHDT,.25,T").attitude.heading_bam32, 2982616);  // 2982616.2
}

TEST(distances_to_the_bottom) {
  assert_int_equal(body("SDDBT,10.0,f,3.05,M,1.7,F").altitude_um, 3'050'000);  // metres first
  assert_int_equal(body("SDDBT,10.5,f,,M,,F").altitude_um, 3'200'400);
  assert_int_equal(body("SDDBT,,f,,M,2.5,F").altitude_um, 4'572'000);
  assert_int_equal(body("SDDPT,2.345678,0.5").altitude_um, 2'345'678);
}

TEST(position) {
  const NavSample sample =
      body("GPGGA,123519.25,4807.0380000,N,01131.0000001,W,4,08,0.9,545.4,M,,M,,");
  assert_int_equal(sample.fields, leadline::base::kNavGeodetic | leadline::base::kNavUtc);
  assert_true(sample.latitude_e9deg == 48'117'300'000);
  assert_true(sample.longitude_e9deg == -11'516'666'668);  // 31.0000001' / 60
  assert_int_equal(sample.quality, 255);
  assert_true(sample.utc_us == 45'319'250'000);
  assert_true(body("GPGGA,,0000.0,S,00000.0,E,1,,,,,,,,").latitude_e9deg == 0);
  assert_true(body("GPGGA,,9000.0,S,18000.0,W,6,,,,,,,,").latitude_e9deg == -90'000'000'000);
  assert_true(body("GPGGA,,9000.0,S,18000.0,W,6,,,,,,,,").longitude_e9deg == -180'000'000'000);
}

TEST(tolerates_what_sensors_do) {
  assert_int_equal(only("$PRVAT,00.115,M,0010.073,dBar*39").pressure_pa, 100'730);
  // Spaces around fields, as one manual prints them; other case; only one line end.
  assert_int_equal(body("PRVAT, 00.115,m, 0010.073, DBAR").pressure_pa, 100'730);
  NmeaCodec codec({});
  const std::string line = kReal[1];
  assert_int_equal(feed(codec, from_text(line + "\n")).size(), 1);
  assert_int_equal(feed(codec, from_text(line + "\r")).size(), 1);
  assert_int_equal(feed(codec, from_text("noise" + line + "\r\n\r\n\n")).size(), 1);
  // The line end lost: the next start ends it.
  assert_int_equal(feed(codec, from_text(line + line + "\r\n")).size(), 2);
  assert_int_equal(codec.counters().records, 5);
  assert_int_equal(codec.counters().unfinished, 0);
}

TEST(checksum_by_option) {
  NmeaCodec strict({});
  assert_int_equal(feed(strict, from_text("$IIHDM,201.5,M\r\n")).size(), 0);
  assert_int_equal(strict.counters().no_checksum, 1);
  NmeaConfig config;
  config.require_checksum = false;
  NmeaCodec lenient(config);
  assert_int_equal(feed(lenient, from_text("$IIHDM,201.5,M\r\n")).size(), 1);
  assert_int_equal(feed(lenient, from_text("$IIHDM,201.5,M*25\r\n")).size(), 0);  // wrong is wrong
  for (const char* const tail : {"*", "*2", "*2G", "*G4", "*240", "*24*24"}) {
    assert_int_equal(feed(strict, from_text("$IIHDM,201.5,M" + std::string(tail) + "\r\n")).size(),
                     0);
  }
  assert_int_equal(strict.counters().bad_checksum, 6);
}

TEST(arrival_and_transmission) {
  NmeaConfig config;
  config.byte_time_ns = 1'000'000;
  NmeaCodec codec(config);
  const std::string line = kReal[1];
  NavSample sample{};
  std::int64_t t_us = 1'000'000;
  bool done = false;
  for (const char c : line + "\r") {
    done = codec.feed(static_cast<std::uint8_t>(c), t_us, sample);
    t_us += 1000;
  }
  assert_true(done);
  // The last byte before the line end arrived at the first one's time plus size - 1.
  assert_int_equal(sample.t_us, 1'000'000 - 1000);
}

TEST(nothing_known_is_no_record) {
  const char* const lines[] = {
      "HCHDG,,,,,",
      "IIHDT,,T",
      "PASHR,120000,,T,,,,,,,0,0",
      "PRDID,,,",
      "PRVAT,,M,,dBar",
      "PRVAT,00.000,M,,",
      "PRVAT,00.000,M,0000.000,dBar",
      "SDDBT,,f,,M,,F",
      "SDDBT,0.0,f,0.0,M,0.0,F",
      "SDDPT,,",
      "GPGGA,120000,,,,,0,00,,,M,,M,,",
      "GPGGA,120000,4807.0,N,01131.0,E,7,00,,,M,,M,,",
      "GPGGA,120000,4807.0,N,01131.0,E,,00,,,M,,M,,",
      "GPVTG,,T,,M,,N,,K,N",
      "GPVTG,90,T,,M,5,N,,K,N",
      "IIVHW,,T,,M,,N,,K",
      "GPRMC,120000,V,,,,,,,221126,,,N",
      "GPRMC,120000,A,,,,,,,221126,,,N",
      "GPRMC,,,,,,,,,,,",
      "GPZDA,,,,,,",
      "GPZDA,120000.00,,,,00,00",
      "HEROT,,A",
      "HEROT,1.5,V",
      "PHTRO,,,,",
  };
  NmeaCodec codec({});
  for (const char* const line : lines) {
    const auto samples = feed(codec, from_text(sealed(line) + "\r\n"));
    assert_int_equal(samples.size(), 1);
    assert_int_equal(samples[0].fields, 0);
    assert_true(samples[0].kind != leadline::base::NavKind::kOther);
  }
  assert_int_equal(codec.counters().no_data, std::size(lines));
}

TEST(what_is_not_ours_is_left) {
  const char* const lines[] = {"PASHR,ATT,1,2", "PASHR,POS,0,1", "GPXDR,1,2",
                               "PGRME,1",       "HDT,1,T",       "",
                               "PRXXX,1",       "GPGGAX,1"};
  NmeaCodec codec({});
  for (const char* const line : lines) {
    assert_int_equal(feed(codec, from_text(sealed(line) + "\r\n")).size(), 0);
  }
  assert_int_equal(codec.counters().ignored, std::size(lines));
  assert_int_equal(feed(codec, from_text("!AIVDM,1,1,,A,x,0*24\r\n")).size(), 0);
  assert_int_equal(codec.counters().ignored, std::size(lines));
}

TEST(bad_fields_are_dropped) {
  const char* const lines[] = {
      "GPHDT,361,T",
      "GPHDT,-181,T",
      "GPHDT,12a,T",
      "GPHDT,1.2.3,T",
      "GPHDT,.,T",
      "GPHDT,+,T",
      "GPHDT,1e2,T",
      "GPHDT,nan,T",
      "GPHDT,99999999999999999999999999,T",
      "GPHDT,999999999,T",
      "GPHDT,12,M",
      "GPHDT,1 2,T",
      "HCHDG,10,1,X,,",
      "HCHDG,10,181,E,,",
      "HCHDG,10,,,1,",
      "PASHR,1,10,T,181,0,0,0,0,0,0,0",
      "PASHR,1,10,T,0,91,0,0,0,0,0,0",
      "PASHR,1,10,T,0,,0,0,0,0,0,0",
      "PASHR,1,x,T,0,0,0,0,0,0,0,0",
      "PASHR,1,10,T,0,0,0,-1,0,0,0,0",
      "PASHR,1,10,T,0,0,0,1,x,0,0,0",
      "PASHR,1,10,T,0,0,0,1,0,181,0,0",
      "PRDID,1,,3",
      "PRDID,1,2,400",
      "PRVAT,1,X,1,dBar",
      "PRVAT,-1,M,1,dBar",
      "PRVAT,1,M,1,PSI",
      "PRVAT,1,M,20001,dBar",
      "PRVAT,1,M,x,dBar",
      "PRVAT,1,M,20001,Metres",
      "PRVAT,20001,M,1,dBar",
      "SDDBT,1,X,,M,,F",
      "SDDBT,,f,70001,M,,F",
      "SDDBT,,f,,M,11000,F",
      "SDDPT,x,0",
      "GPGGA,1,4860.0,N,01131.0,E,1",
      "GPGGA,1,9000.1,N,01131.0,E,1",
      "GPGGA,1,4807.0,X,01131.0,E,1",
      "GPGGA,1,4807.0,,01131.0,E,1",
      "GPGGA,1,4807.0,N,18000.1,E,1",
      "GPGGA,1,-4807.0,N,01131.0,E,1",
      "GPGGA,1,4807.0,N,01131.0,N,1",
  };
  NmeaCodec codec({});
  std::size_t bad = 0;
  for (const char* const line : lines) {
    assert_int_equal(feed(codec, from_text(sealed(line) + "\r\n")).size(), 0);
    ++bad;
    if (codec.counters().bad_field != bad) {
      fail_msg("passed: %s", line);
    }
  }
}

TEST(times_of_day) {
  const auto time = [](const std::string& text) {
    const NavSample sample = body("PASHR," + text + ",1,T,0,0,0,0,0,0,1,0");
    return (sample.fields & leadline::base::kNavUtc) != 0 ? sample.utc_us : -1;
  };
  assert_true(time("235959.999999") == 86'399'999'999);
  assert_true(time("000000") == 0);
  assert_true(time("235960") == 86'400'000'000);
  assert_true(time("010203.5") == 3'723'500'000);
  assert_true(time("010203.12345678") == 3'723'123'456);
  assert_true(time("010203.12") == 3'723'120'000);  // nine characters with a point
  assert_true(time("240000") == -1);
  assert_true(time("006000") == -1);
  assert_true(time("000061") == -1);
  assert_true(time("12345") == -1);
  assert_true(time("1234567") == -1);
  assert_true(time("12a456") == -1);
  assert_true(time("") == -1);
}

TEST(decimals_are_exact) {
  Random random(6);
  for (int i = 0; i < 20'000; ++i) {
    const std::int64_t depth_e9 = random.between(-19'999'999'999'999, 19'999'999'999'999);
    const std::uint64_t magnitude = static_cast<std::uint64_t>(depth_e9 < 0 ? -depth_e9 : depth_e9);
    char text[64];
    std::snprintf(text, sizeof text, "PRVAT,,M,%s%llu.%09llu,Metres", depth_e9 < 0 ? "-" : "",
                  static_cast<unsigned long long>(magnitude / 1'000'000'000),
                  static_cast<unsigned long long>(magnitude % 1'000'000'000));
    const std::int64_t rounded = static_cast<std::int64_t>((magnitude + 500) / 1000);
    assert_true(body(text).depth_um == (depth_e9 < 0 ? -rounded : rounded));
  }
  assert_true(body("PRVAT,,M,1.0000004999,Metres").depth_um == 1'000'001);  // the tenth rounds
  assert_true(body("PRVAT,,M,1.0000004995,Metres").depth_um == 1'000'001);
  assert_true(body("PRVAT,,M,1.0000004994,Metres").depth_um == 1'000'000);
  assert_true(body("PRVAT,,M,1.00000049949,Metres").depth_um == 1'000'000);  // the tenth alone
  assert_true(body("PRVAT,,M,-0.0,Metres").depth_um == 0);
}

TEST(damage_costs_one_sentence) {
  for (const char* const line : kReal) {
    const Bytes intact = from_text(std::string(line) + "\r\n");
    for (std::size_t position = 0; position < intact.size(); ++position) {
      NmeaCodec codec({});
      const auto samples = feed(codec, without(intact, position) + intact + intact);
      // A lost line end costs nothing.
      assert_int_equal(samples.size(), position + 2 >= intact.size() ? 3 : 2);
      NmeaCodec cut({});
      const Bytes head(intact.begin(), intact.begin() + static_cast<std::ptrdiff_t>(position));
      assert_true(feed(cut, head + intact).size() == (position + 2 >= intact.size() ? 2 : 1));
    }
  }
}

TEST(every_start_ends_in_one_counter) {
  Random random(7);
  NmeaConfig config;
  NmeaCodec codec(config);
  const std::string alphabet = "$$!*,,.0123456789ABCDEFTM+-\r\n\x01\xff";
  std::size_t starts = 0;
  std::size_t records = 0;
  for (int i = 0; i < 200'000; ++i) {
    Bytes bytes;
    if (random.between(0, 20) == 0) {
      bytes = from_text(std::string(kReal[random.between(0, 5)]) + "\r\n");
    } else if (random.between(0, 500) == 0) {
      bytes = from_text("$" + std::string(static_cast<std::size_t>(random.between(150, 170)), 'x'));
    } else {
      bytes = {static_cast<std::uint8_t>(alphabet[static_cast<std::size_t>(
          random.between(0, static_cast<int>(alphabet.size()) - 1))])};
    }
    for (const std::uint8_t byte : bytes) {
      starts += byte == '$' ? 1 : 0;
    }
    records += feed(codec, bytes).size();
  }
  codec.restart();
  const auto& c = codec.counters();
  assert_int_equal(records, c.records + c.no_data);
  assert_true(records > 1000 && c.too_long > 0 && c.bad_byte > 0 && c.unfinished > 0);
  assert_int_equal(starts, c.records + c.ignored + c.no_data + c.bad_checksum + c.no_checksum +
                               c.bad_field + c.bad_byte + c.too_long + c.unfinished);
}

TEST(restart_forgets_half_a_sentence) {
  NmeaCodec codec({});
  assert_int_equal(feed(codec, from_text("$IIHDM,201")).size(), 0);
  codec.restart();
  assert_int_equal(feed(codec, from_text(".5,M*24\r\n")).size(), 0);
  assert_int_equal(feed(codec, from_text(std::string(kReal[1]) + "\r\n")).size(), 1);
  assert_int_equal(codec.counters().unfinished, 1);
  codec.restart();
  assert_int_equal(codec.counters().unfinished, 1);
}

TEST(position_without_a_quality_only_until_a_better_one_is_heard) {
  const NavSample gll = body("GPGLL,6010.001,N,02458.002,E,120000,A");
  assert_int_equal(gll.kind, leadline::base::NavKind::kPosition);
  assert_int_equal(gll.fields, leadline::base::kNavGeodetic | leadline::base::kNavUtc);
  assert_int_equal(gll.latitude_e9deg, 60'166'683'333);
  assert_int_equal(gll.longitude_e9deg, 24'966'700'000);
  assert_int_equal(body("GPGLL,6010.001,N,02458.002,E,120000,V").fields, 0);
  assert_int_equal(body("GPGLL,,,,,,").fields, 0);
  NmeaCodec codec({});
  const auto line = from_text(sealed("GPGLL,6010.001,N,02458.002,E,120000,A") + "\r\n");
  assert_int_equal(feed(codec, line).size(), 1);
  assert_int_equal(feed(codec, from_text(sealed("GPGGA,,,,,,0,,,,,,,") + "\r\n")).size(), 1);
  assert_int_equal(feed(codec, line).size(), 0);
  assert_int_equal(codec.counters().ignored, 1);
}

TEST(speeds_over_ground_and_through_water) {
  // data/nmea_signalk, REAL.
  const NavSample ground = only("$IIVTG,224.44,T,224.44,M,5.81,N,,,D*68");
  assert_int_equal(ground.kind, leadline::base::NavKind::kVelocity);
  assert_int_equal(ground.fields, leadline::base::kNavVelocityWorld);
  const double speed_um_s = 5.81 * 1852e6 / 3600;
  assert_near(static_cast<double>(ground.velocity_um_s[0]),
              speed_um_s * std::cos(224.44 / 57.29577951308232), 3);
  assert_near(static_cast<double>(ground.velocity_um_s[1]),
              speed_um_s * std::sin(224.44 / 57.29577951308232), 3);
  const NavSample water = only("$IIVHW,,T,,M,06.11,N,11.31,K*51");
  assert_int_equal(water.fields, leadline::base::kNavVelocityWater);
  assert_near(static_cast<double>(water.velocity_um_s[0]), 6.11 * 1852e6 / 3600, 3);
  assert_near(static_cast<double>(body("IIVHW,,T,,M,,N,11.31,K").velocity_um_s[0]), 11.31e6 / 3.6,
              3);
}

TEST(every_record_says_what_it_is_about) {
  using leadline::base::NavKind;
  const struct {
    const char* text;
    NavKind kind;
  } cases[] = {{"HCHDG,10,,,,", NavKind::kHeading},
               {"HCHDM,10,M", NavKind::kHeading},
               {"GPHDT,10,T", NavKind::kHeading},
               {"SDDBT,1,f,,M,,F", NavKind::kAltitude},
               {"SDDPT,1,0", NavKind::kAltitude},
               {"GPGGA,1,4807.0,N,01131.0,E,1", NavKind::kPosition},
               {"PHTRO,1,M,2,T", NavKind::kAttitude},
               {"HEROT,1,A", NavKind::kRates},
               {"GPZDA,000001,1,1,2000", NavKind::kTime},
               {"GPRMC,000001,A,0000.0,N,00000.0,E,,,010100", NavKind::kPosition},
               {"PRDID,1,2,3", NavKind::kAttitude},
               {"PASHR,1,10,T,1,2,0,0,0,0,0,0", NavKind::kAttitude},
               {"PRVAT,1,M,1,dBar", NavKind::kAltitude}};
  for (const auto& one : cases) {
    assert_int_equal(body(one.text).kind, one.kind);
  }
}

TEST(dates_and_times) {
  // date -u -d 2026-11-22T23:59:59.25Z +%s%6N
  const NavSample zda = body("GPZDA,235959.25,22,11,2026,00,00");
  assert_int_equal(zda.fields, leadline::base::kNavUtc);
  assert_int_equal(zda.utc_us, 1'795'391'999'250'000);
  assert_int_equal(body("GPZDA,000000,1,3,2000").utc_us, 951'868'800'000'000);
  assert_int_equal(body("GPZDA,000000,29,02,2024").utc_us, 1'709'164'800'000'000);
  assert_int_equal(body("GPZDA,000000,01,01,1980").utc_us, 315'532'800'000'000);
  assert_int_equal(body("GPZDA,000000,31,12,2099").utc_us, 4'102'358'400'000'000);
  for (const char* const wrong :
       {"GPZDA,000000,29,02,2023", "GPZDA,000000,31,04,2023", "GPZDA,000000,0,4,2023",
        "GPZDA,000000,1,13,2023", "GPZDA,000000,1,1,23", "GPZDA,240000,1,1,2023",
        "GPZDA,000000,1,1,1979", "GPZDA,000000,1,1,2100", "GPZDA,000000,1x,1,2000",
        "GPZDA,000000,001,1,2000", "GPZDA,000000,,1,2000", "GPZDA,1,1,1,2000"}) {
    NmeaCodec codec({});
    assert_int_equal(feed(codec, from_text(sealed(wrong) + "\r\n")).size(), 0);
    assert_int_equal(codec.counters().bad_field, 1);
  }
}

TEST(the_recommended_minimum) {
  const std::string text = "GPRMC,123519.5,A,4807.038,N,01131.000,E,022.4,084.4,230394,003.1,W,A";
  const NavSample rmc = body(text);
  assert_int_equal(rmc.fields, leadline::base::kNavUtc | leadline::base::kNavGeodetic |
                                   leadline::base::kNavVelocityWorld);
  assert_int_equal(rmc.utc_us, 764'426'119'500'000);
  assert_near(static_cast<double>(rmc.latitude_e9deg), 48.1173e9, 1);
  const double speed = 22.4 * 514'444.444;
  assert_near(static_cast<double>(rmc.velocity_um_s[0]),
              speed * std::cos(84.4 / 180.0 * 3.14159265358979), 10);
  assert_near(static_cast<double>(rmc.velocity_um_s[1]),
              speed * std::sin(84.4 / 180.0 * 3.14159265358979), 10);
  // Its place says the same as a GGA's, without a quality.
  NmeaCodec codec({});
  const auto both = feed(codec, from_text(sealed("GPGGA,120000,4807.0,N,01131.0,E,4") + "\r\n" +
                                          sealed(text) + "\r\n"));
  assert_int_equal(both.size(), 2);
  assert_int_equal(both[1].fields, leadline::base::kNavUtc | leadline::base::kNavVelocityWorld);
  assert_int_equal(body("GPRMC,000000,A,0000.0,N,00000.0,E,,,010126").fields,
                   leadline::base::kNavUtc | leadline::base::kNavGeodetic);
  for (const char* const wrong :
       {"GPRMC,000000,A,,,,,1,2,010126", "GPRMC,000000,A,0,N,0,E,1,2,320126",
        "GPRMC,000000,A,0,N,0,E,x,2,010126", "GPRMC,,A,0,N,0,E,1,2,010126",
        "GPRMC,000000,A,0,N,0,E,1,2,0101"}) {
    NmeaCodec wary({});
    assert_int_equal(feed(wary, from_text(sealed(wrong) + "\r\n")).size(), 0);
    assert_int_equal(wary.counters().bad_field, 1);
  }
}

TEST(turning_and_tilting) {
  // 60 degrees a minute are a degree a second, clockwise.
  const NavSample rot = body("HEROT,60.0,A");
  assert_int_equal(rot.fields, leadline::base::kNavYawRate);
  assert_int_equal(rot.rate_urad_s[2], 17'453);
  assert_int_equal(body("HEROT,-720,A").rate_urad_s[2], -209'440);
  const NavSample up = body("PHTRO,1.25,M,2.50,T");
  assert_int_equal(up.fields, leadline::base::kNavRollPitch);
  assert_near(degrees(up.attitude.pitch_bam32), 1.25, kBam);
  assert_near(degrees(up.attitude.roll_bam32), 2.5, kBam);
  const NavSample down = body("PHTRO,1.25,P,2.50,B");
  assert_near(degrees(down.attitude.pitch_bam32), -1.25, kBam);
  assert_near(degrees(down.attitude.roll_bam32), -2.5, kBam);
  for (const char* const wrong : {"PHTRO,1,X,2,T", "PHTRO,1,M,2,X", "PHTRO,91,M,2,T",
                                  "PHTRO,1,M,,T", "PHTRO,-1,M,2,T", "HEROT,x,A", "HEROT,36001,A"}) {
    NmeaCodec codec({});
    assert_int_equal(feed(codec, from_text(sealed(wrong) + "\r\n")).size(), 0);
    assert_int_equal(codec.counters().bad_field, 1);
  }
}
