#include "hal/attitude/pd0.hpp"
#include "hal/emu/pd0_dvl.hpp"
#include "hal/emu/wire_bytes.hpp"
#include "tests/support/nav_streams.hpp"

namespace {

using leadline::base::NavSample;
using leadline::emu::Motion;
using leadline::emu::pd0_ensemble;
using leadline::emu::pd0_frame;
using leadline::emu::Pd0Coordinates;
using leadline::emu::Pd0Setup;
using leadline::hal::Pd0Codec;
using leadline::hal::Pd0Config;
using leadline::test::Bytes;
using leadline::test::degrees;
using leadline::test::samples_of;
using leadline::test::turn;
using leadline::test::operator+;
using namespace leadline::base;  // NOLINT: the bits' names

std::vector<NavSample> decoded(const Bytes& bytes, const Pd0Config& config = {}) {
  Pd0Codec codec(config);
  auto samples = samples_of(codec, bytes);
  assert_true(!samples.empty());
  assert_true(samples[0].kind == NavKind::kVelocity);
  return samples;
}

/// The one record of a kind.
NavSample of_kind(const std::vector<NavSample>& samples, NavKind kind) {
  NavSample found{};
  int count = 0;
  for (const NavSample& sample : samples) {
    if (sample.kind == kind) {
      found = sample;
      ++count;
    }
  }
  assert_int_equal(count, 1);
  return found;
}

Motion some_motion() {
  Motion motion;
  motion.roll_deg = -8.0;
  motion.pitch_deg = 12.0;
  motion.heading_deg = 300.0;
  motion.velocity_m_s = {1.5, -0.25, 0.125};
  motion.altitude_m = 812.34;
  motion.depth_m = 45.6;
  motion.temperature_degc = -1.25;
  motion.sound_speed_m_s = 1467;
  motion.time_s = 45'296.78;
  return motion;
}

void check_velocity(const NavSample& sample, double forward, double right, double down,
                    double slack_mm_s) {
  assert_near(static_cast<double>(sample.velocity_um_s[0]) / 1e3, forward * 1e3, slack_mm_s);
  assert_near(static_cast<double>(sample.velocity_um_s[1]) / 1e3, right * 1e3, slack_mm_s);
  assert_near(static_cast<double>(sample.velocity_um_s[2]) / 1e3, down * 1e3, slack_mm_s);
}

/// A leader of bottom track in instrument coordinates, down-looking, convex, 20 degrees.
Bytes ensemble_by_hand(unsigned coordinates, const std::array<int, 4>& velocity_mm_s,
                       unsigned heading_cdeg = 0, int pitch_cdeg = 0, int roll_cdeg = 0) {
  using leadline::emu::ByteOrder;
  using leadline::emu::ByteWriter;
  ByteWriter fixed(ByteOrder::kLittle);
  fixed.u16(0).zeros(2).u8(0x0B).u8(0x41).zeros(19).u8(coordinates).zeros(33);
  ByteWriter variable(ByteOrder::kLittle);
  variable.u16(0x80).zeros(16).u16(heading_cdeg).i16(pitch_cdeg).i16(roll_cdeg).zeros(41);
  ByteWriter bottom(ByteOrder::kLittle);
  bottom.u16(0x600).zeros(22);
  for (const int velocity : velocity_mm_s) {
    bottom.i16(velocity);
  }
  bottom.zeros(49);
  return pd0_frame({fixed.bytes(), variable.bytes(), bottom.bytes()});
}

}  // namespace

// Instrument axes: x starboard, y forward, z up. A bottom that moves aft (-y) is a vehicle that moves
// forward; one that moves to port (-x), to starboard; one that moves up (+z), down.
TEST(instrument_signs_by_hand) {
  check_velocity(decoded(ensemble_by_hand(0x08, {0, -1000, 0, 0}))[0], 1, 0, 0, 0.001);
  check_velocity(decoded(ensemble_by_hand(0x08, {-1000, 0, 0, 0}))[0], 0, 1, 0, 0.001);
  check_velocity(decoded(ensemble_by_hand(0x08, {0, 0, 1000, 0}))[0], 0, 0, 1, 0.001);
  Pd0Config config;
  config.velocity_of_bottom = false;
  check_velocity(decoded(ensemble_by_hand(0x08, {0, 1000, 0, 0}), config)[0], 1, 0, 0, 0.001);
}

// Beams are positive towards the transducer. A vehicle that moves forward sees the bottom come towards beam 3
// (forward) with sin 20 of its speed and go from beam 4: b3 = +342.02, b4 = -342.02 mm/s at 1 m/s.
TEST(beam_signs_by_hand) {
  check_velocity(decoded(ensemble_by_hand(0x00, {0, 0, 342, -342}))[0], 1, 0, 0, 0.1);
  // To starboard: beam 2 is there.
  check_velocity(decoded(ensemble_by_hand(0x00, {-342, 342, 0, 0}))[0], 0, 1, 0, 0.1);
  // Down: the bottom comes towards all with cos 20 = 939.69.
  check_velocity(decoded(ensemble_by_hand(0x00, {940, 940, 940, 940}))[0], 0, 0, 1, 0.4);
}

// Earth: east, north, up. A bottom that goes west is a vehicle that goes east.
TEST(earth_signs_by_hand) {
  const NavSample sample = decoded(ensemble_by_hand(0x18, {-1000, 500, 250, 0}))[0];
  assert_int_equal(sample.fields, kNavVelocityWorld);
  check_velocity(sample, -0.5, 1, 0.25, 0.001);
}

// Ship coordinates are level (0x14: tilts used). With the bow 30 degrees up a vehicle that moves level
// at 1 m/s moves forward cos 30 and down (of its own) sin 30.
TEST(ship_signs_by_hand) {
  const Bytes level = ensemble_by_hand(0x14, {0, -1000, 0, 0}, 0, 3000);
  check_velocity(decoded(level)[0], std::sqrt(0.75), 0, 0.5, 0.01);
  // Starboard down by 30 degrees: moving level to starboard is right cos 30 and up (of its own) sin 30.
  const Bytes rolled = ensemble_by_hand(0x14, {-1000, 0, 0, 0}, 0, 0, 3000);
  check_velocity(decoded(rolled)[0], 0, std::sqrt(0.75), -0.5, 0.01);
  const Bytes untilted = ensemble_by_hand(0x10, {0, -1000, 0, 0}, 0, 3000);
  check_velocity(decoded(untilted)[0], 1, 0, 0, 0.001);
}

TEST(attitude_signs_by_hand) {
  const auto samples = decoded(ensemble_by_hand(0x08, {0, 0, 0, 0}, 27'050, 310, -763));
  const NavSample attitude = of_kind(samples, NavKind::kAttitude);
  assert_int_equal(attitude.fields, kNavRollPitch | kNavHeadingMagnetic);
  assert_near(turn(attitude.attitude.heading_bam32), 270.5, 1e-7);
  assert_near(degrees(attitude.attitude.pitch_bam32), 3.10, 1e-7);
  assert_near(degrees(attitude.attitude.roll_bam32), -7.63, 1e-7);
  Pd0Config config;
  config.true_heading = true;
  config.euler_pitch = true;
  const NavSample euler =
      of_kind(decoded(ensemble_by_hand(0x08, {0, 0, 0, 0}, 27'050, 3000, 6000), config),
              NavKind::kAttitude);
  assert_int_equal(euler.fields, kNavRollPitch | kNavHeading);
  // tan P = tan 30 cos 60 = 0.288675: P = 16.1021 degrees.
  assert_near(degrees(euler.attitude.pitch_bam32), 16.10211, 3e-5);
}

// Whatever the frame, the geometry and the attitude: the vehicle's velocity comes back.
TEST(all_frames_agree) {
  leadline::test::Random random(8);
  for (int i = 0; i < 400; ++i) {
    Motion motion = some_motion();
    motion.roll_deg = static_cast<double>(random.between(-300, 300)) / 10;
    motion.pitch_deg = static_cast<double>(random.between(-300, 300)) / 10;
    motion.heading_deg = static_cast<double>(random.between(0, 3599)) / 10;
    for (double& v : motion.velocity_m_s) {
      v = static_cast<double>(random.between(-2000, 2000)) / 1000;
    }
    Pd0Setup setup;
    setup.coordinates = static_cast<Pd0Coordinates>(random.between(0, 2));
    setup.looks_up = setup.coordinates != Pd0Coordinates::kShip && random.between(0, 1) == 1;
    setup.convex = random.between(0, 1) == 1;
    setup.tilts = random.between(0, 1) == 1;
    setup.beam_angle_deg = std::array<double, 4>{15, 20, 30, 25}[random.next() % 4];
    // The tilts of an aligned head are about other axes than the vehicle's: level frames without.
    setup.alignment_deg = setup.coordinates == Pd0Coordinates::kShip
                              ? 0
                              : static_cast<double>(random.between(-1800, 1800)) / 10;
    const NavSample sample = decoded(pd0_ensemble(motion, setup))[0];
    assert_int_equal(sample.fields, kNavVelocityBody);
    check_velocity(sample, motion.velocity_m_s[0], motion.velocity_m_s[1], motion.velocity_m_s[2],
                   4.0);  // half a mm/s in each beam, tilts to 0.005 degrees
  }
}

TEST(earth_is_the_world) {
  Motion motion;
  motion.heading_deg = 90;
  motion.velocity_m_s = {1, 0, 0.5};
  Pd0Setup setup;
  setup.coordinates = Pd0Coordinates::kEarth;
  check_velocity(decoded(pd0_ensemble(motion, setup))[0], 0, 1, 0.5, 0.6);
}

// devices.md 8, trap 13: -32768 is no velocity; the ensemble still makes its record.
TEST(bad_beams) {
  Pd0Setup setup;
  setup.bad_beam = {false, true, false, false};
  for (const auto coordinates : {Pd0Coordinates::kBeam, Pd0Coordinates::kInstrument,
                                 Pd0Coordinates::kShip, Pd0Coordinates::kEarth}) {
    setup.coordinates = coordinates;
    const auto samples = decoded(pd0_ensemble(some_motion(), setup));
    assert_int_equal(samples[0].fields, 0);
    assert_int_equal(samples[0].velocity_um_s[0], 0);
    // Beams 3 and 4 are opposite each other.
    assert_int_equal(of_kind(samples, NavKind::kAltitude).altitude_um, 812'340'000);
  }
  setup.coordinates = Pd0Coordinates::kBeam;
  setup.three_beam = true;
  for (std::size_t bad = 0; bad < 4; ++bad) {
    setup.bad_beam = {};
    setup.bad_beam[bad] = true;
    const NavSample sample = decoded(pd0_ensemble(some_motion(), setup))[0];
    check_velocity(sample, 1.5, -0.25, 0.125, 6.0);
  }
  setup.bad_beam = {true, true, false, false};
  assert_int_equal(decoded(pd0_ensemble(some_motion(), setup))[0].fields, 0);
  setup.bad_beam = {true, false, true, false};
  assert_int_equal(decoded(pd0_ensemble(some_motion(), setup)).size(), 3);  // no altitude
}

TEST(every_ensemble_has_one_velocity) {
  Pd0Setup setup;
  setup.bottom_track = false;
  const auto samples = decoded(pd0_ensemble(some_motion(), setup));
  assert_int_equal(samples.size(), 3);  // velocity, attitude, water
  assert_int_equal(samples[0].fields, 0);
  // Not even leaders; and an offset that leads out.
  assert_int_equal(decoded(pd0_frame({{0x00, 0x01, 5, 6}})).size(), 1);
  Bytes astray = pd0_frame({{0x00, 0x01, 5, 6}});
  astray[6] = 0x70;
  const std::uint16_t sum = static_cast<std::uint16_t>(astray[astray.size() - 2] +
                                                       256 * astray[astray.size() - 1] + 0x70 - 8);
  astray[astray.size() - 2] = static_cast<std::uint8_t>(sum);
  astray[astray.size() - 1] = static_cast<std::uint8_t>(sum >> 8U);
  Pd0Codec codec(Pd0Config{});
  assert_int_equal(samples_of(codec, astray).size(), 1);
  assert_int_equal(codec.counters().bad_values, 1);
}

TEST(unknown_beam_angle) {
  Pd0Setup setup;
  setup.beam_angle_deg = 2;
  assert_int_equal(decoded(pd0_ensemble(some_motion(), setup))[0].fields, 0);
}

TEST(leaders) {
  Pd0Setup setup;
  setup.depth_sensor = true;
  const Bytes ensemble = pd0_ensemble(some_motion(), setup, 70'000);
  Pd0Codec codec(Pd0Config{});
  const auto samples = samples_of(codec, ensemble);
  assert_int_equal(samples.size(), 5);
  const NavSample attitude = of_kind(samples, NavKind::kAttitude);
  assert_near(turn(attitude.attitude.heading_bam32), 300.0, 1e-7);
  // 2026-03-02 12:34:56.78; 20514 days since 1970.
  assert_int_equal(attitude.utc_us, (20'514LL * 86'400 + 45'296) * 1'000'000 + 780'000);
  assert_int_equal(of_kind(samples, NavKind::kDepth).depth_um, 45'600'000);
  const NavSample water = of_kind(samples, NavKind::kWater);
  assert_int_equal(water.sound_speed_mm_s, 1'467'000);
  assert_int_equal(water.temperature_mdegc, -1'250);
  assert_int_equal(codec.ensemble().number, 70'000);
  assert_int_equal(codec.ensemble().range_cm[0], 81'234);  // above 65535: the high byte counts
}

TEST(damage_costs_one_ensemble) {
  const Bytes ensemble = pd0_ensemble(some_motion(), Pd0Setup{});
  leadline::test::check_damage_costs_one_frame<Pd0Codec>(Pd0Config{}, ensemble);
  leadline::test::check_damage_is_noticed<Pd0Codec>(Pd0Config{}, ensemble);
  leadline::test::check_noise<Pd0Codec>(Pd0Config{}, ensemble);
}

TEST(lengths_that_cannot_be) {
  const auto bad_length = [](const Bytes& bytes) {
    Pd0Codec codec(Pd0Config{});
    samples_of(codec, bytes);
    return codec.counters().bad_length;
  };
  assert_int_equal(bad_length({0x7F, 0x7F, 0xFF, 0xFF, 0, 1}), 1);
  assert_int_equal(bad_length({0x7F, 0x7F, 0x40, 0x00, 0, 0}), 1);
  assert_int_equal(bad_length({0x7F, 0x7F, 0x40, 0x00, 0, 65}), 1);
  assert_int_equal(bad_length({0x7F, 0x7F, 0x08, 0x00, 0, 1}), 1);
  assert_int_equal(bad_length({0x7F, 0x7F, 0x40, 0x00, 0, 2, 0x05, 0x00}), 1);
}

TEST(restart_forgets) {
  const Bytes ensemble = pd0_ensemble(some_motion(), Pd0Setup{});
  Pd0Codec codec(Pd0Config{});
  NavSample sample{};
  for (const std::uint8_t byte : ensemble) {
    if (codec.feed(byte, 0, sample)) {
      break;
    }
  }
  codec.restart();  // with records still waiting
  assert_false(codec.next(sample));
  assert_int_equal(samples_of(codec, ensemble).size(), 4);
}
