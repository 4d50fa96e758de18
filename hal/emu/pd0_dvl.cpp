#include "hal/emu/pd0_dvl.hpp"

#include <cmath>

#include "hal/checksums.hpp"
#include "hal/emu/wire_bytes.hpp"

namespace leadline::emu {

namespace {

constexpr double kRadian_deg = 180.0 / 3.14159265358979323846;
constexpr std::int16_t kBad = -32768;

using Vector = std::array<double, 3>;

double sine(double deg) { return std::sin(deg / kRadian_deg); }
double cosine(double deg) { return std::cos(deg / kRadian_deg); }

/// Clockwise from above: a vector (forward, starboard, down) seen from axes turned by `deg`.
Vector seen_from_turned(const Vector& v, double deg) {
  return {cosine(deg) * v[0] + sine(deg) * v[1], cosine(deg) * v[1] - sine(deg) * v[0], v[2]};
}

/// The bottom's velocity in the body of the vehicle, forward, starboard, down.
Vector bottom_in_body(const Motion& motion) {
  return {-motion.velocity_m_s[0], -motion.velocity_m_s[1], -motion.velocity_m_s[2]};
}

/// Body to level axes with the bow's heading: roll first, then pitch.
Vector level_of_body(const Vector& v, const Motion& motion) {
  const double starboard = cosine(motion.roll_deg) * v[1] - sine(motion.roll_deg) * v[2];
  const double keel = sine(motion.roll_deg) * v[1] + cosine(motion.roll_deg) * v[2];
  return {cosine(motion.pitch_deg) * v[0] + sine(motion.pitch_deg) * keel, starboard,
          cosine(motion.pitch_deg) * keel - sine(motion.pitch_deg) * v[0]};
}

std::int16_t mm_s(double m_s) { return static_cast<std::int16_t>(std::lround(m_s * 1000)); }

/// What each beam sees come towards it: minus the velocity along the beam's direction.
std::array<double, 4> beams_of(const Vector& instrument, const Pd0Setup& setup) {
  // Forward, starboard, down of the instrument; beam 3 looks forward, 4 aft. A head that looks up was
  // rolled by half a turn: its beams 1 and 2 have changed sides.
  const double outward = (setup.convex ? 1.0 : -1.0) * sine(setup.beam_angle_deg);
  const double along = cosine(setup.beam_angle_deg) * (setup.looks_up ? -1.0 : 1.0);
  const double starboard = setup.looks_up ? 1.0 : -1.0;  // side of beam 1
  const std::array<Vector, 4> directions{{{0, starboard * outward, along},
                                          {0, -starboard * outward, along},
                                          {outward, 0, along},
                                          {-outward, 0, along}}};
  std::array<double, 4> beams{};
  for (std::size_t i = 0; i < 4; ++i) {
    const Vector& d = directions[i];
    beams[i] = -(instrument[0] * d[0] + instrument[1] * d[1] + instrument[2] * d[2]);
  }
  return beams;
}

std::array<std::int16_t, 4> velocities(const Motion& motion, const Pd0Setup& setup) {
  const Vector body = bottom_in_body(motion);
  const Vector instrument = seen_from_turned(body, setup.alignment_deg);
  if (setup.coordinates == Pd0Coordinates::kBeam) {
    std::array<std::int16_t, 4> out{};
    const auto beams = beams_of(instrument, setup);
    for (std::size_t i = 0; i < 4; ++i) {
      out[i] = setup.bad_beam[i] ? kBad : mm_s(beams[i]);
    }
    return out;
  }
  for (const bool bad : setup.bad_beam) {
    if (bad) {
      return {kBad, kBad, kBad, kBad};
    }
  }
  if (setup.coordinates == Pd0Coordinates::kInstrument) {
    const double side = setup.looks_up ? -1 : 1;
    return {mm_s(side * instrument[1]), mm_s(instrument[0]), mm_s(-side * instrument[2]), 0};
  }
  const Vector level = setup.tilts ? level_of_body(body, motion) : body;
  if (setup.coordinates == Pd0Coordinates::kShip) {
    return {mm_s(level[1]), mm_s(level[0]), mm_s(-level[2]), 0};
  }
  const Vector ned = seen_from_turned(level, -motion.heading_deg);
  return {mm_s(ned[1]), mm_s(ned[0]), mm_s(-ned[2]), 0};
}

Bytes fixed_leader(const Pd0Setup& setup) {
  unsigned angle_code = 3;
  for (unsigned i = 0; i < 3; ++i) {
    constexpr std::array<double, 3> kAngles{15, 20, 30};
    angle_code = setup.beam_angle_deg == kAngles[i] ? i : angle_code;
  }
  const unsigned coordinates = (static_cast<unsigned>(setup.coordinates) << 3U) |
                               (setup.tilts ? 4U : 0U) | (setup.three_beam ? 2U : 0U);
  const unsigned sensors = 0x1DU | (setup.depth_sensor ? 0x20U : 0U);
  ByteWriter block(ByteOrder::kLittle);
  block.u16(0x0000).u8(51).u8(41);
  block.u8(0x03U | (setup.convex ? 0x08U : 0U) | (setup.looks_up ? 0x80U : 0U));
  block.u8(0x40U | angle_code);
  block.zeros(19).u8(coordinates);
  block.i16(std::lround(setup.alignment_deg * 100)).i16(0).u8(sensors).u8(sensors);
  block.zeros(26).u8(static_cast<unsigned>(setup.beam_angle_deg));
  return block.bytes();
}

Bytes variable_leader(const Motion& motion, unsigned number) {
  // 2026-03-02 and the time of day.
  const auto hundredths = static_cast<unsigned>(std::llround(motion.time_s * 100));
  // The pendulum's pitch.
  const double tilt_deg =
      std::atan2(sine(motion.pitch_deg) / cosine(motion.pitch_deg), cosine(motion.roll_deg)) *
      kRadian_deg;
  ByteWriter block(ByteOrder::kLittle);
  block.u16(0x0080).u16(number & 0xFFFFU).u8(26).u8(3).u8(2);
  block.u8(hundredths / 360'000).u8(hundredths / 6'000 % 60).u8(hundredths / 100 % 60);
  block.u8(hundredths % 100).u8(number >> 16U).u16(0);
  block.u16(static_cast<unsigned>(std::lround(motion.sound_speed_m_s)));
  block.u16(static_cast<unsigned>(std::lround(motion.depth_m * 10)));
  block.u16(static_cast<unsigned>(std::lround(motion.heading_deg * 100)) % 36'000);
  block.i16(std::lround(tilt_deg * 100)).i16(std::lround(motion.roll_deg * 100));
  block.u16(35).i16(std::lround(motion.temperature_degc * 100)).zeros(37);
  return block.bytes();
}

Bytes bottom_track(const Motion& motion, const Pd0Setup& setup) {
  const auto range_cm = static_cast<unsigned>(std::lround(motion.altitude_m * 100));
  ByteWriter block(ByteOrder::kLittle);
  block.u16(0x0600).zeros(14);
  for (const bool bad : setup.bad_beam) {
    block.u16(bad ? 0 : range_cm & 0xFFFFU);
  }
  for (const std::int16_t velocity : velocities(motion, setup)) {
    block.i16(velocity);
  }
  block.zeros(45);
  for (const bool bad : setup.bad_beam) {
    block.u8(bad ? 0 : range_cm >> 16U);
  }
  return block.bytes();
}

}  // namespace

Bytes pd0_frame(const std::vector<Bytes>& blocks) {
  std::size_t at = 6 + 2 * blocks.size();
  std::size_t size = at;
  for (const Bytes& block : blocks) {
    size += block.size();
  }
  ByteWriter frame(ByteOrder::kLittle);
  frame.u8(0x7F).u8(0x7F).u16(size).u8(0).u8(blocks.size());
  for (const Bytes& block : blocks) {
    frame.u16(at);
    at += block.size();
  }
  for (const Bytes& block : blocks) {
    frame.append(block);
  }
  frame.u16(hal::sum16(frame.bytes().data(), frame.bytes().size()));
  return frame.bytes();
}

Bytes pd0_ensemble(const Motion& motion, const Pd0Setup& setup, unsigned number) {
  std::vector<Bytes> blocks{fixed_leader(setup), variable_leader(motion, number)};
  if (setup.bottom_track) {
    blocks.push_back(bottom_track(motion, setup));
  }
  return pd0_frame(blocks);
}

}  // namespace leadline::emu
