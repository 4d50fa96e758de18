#include "hal/emu/mavlink_autopilot.hpp"

#include <cmath>

#include "hal/checksums.hpp"
#include "hal/emu/wire_bytes.hpp"

namespace leadline::emu {

namespace {

constexpr double kRadians = 3.14159265358979323846 / 180.0;

ByteWriter begun(const Motion& motion) {
  ByteWriter payload(ByteOrder::kLittle);
  payload.u32(static_cast<std::uint64_t>(std::llround(motion.time_s * 1e3)));
  return payload;
}

void three(ByteWriter& payload, const std::array<double, 3>& values) {
  for (const double value : values) {
    payload.f32(value);
  }
}

double wrapped(double deg) { return std::remainder(deg, 360.0) * kRadians; }

}  // namespace

Bytes mavlink_frame(const MavlinkPeer& peer, std::uint32_t id, std::uint8_t extra,
                    const Bytes& payload) {
  Bytes body = payload;
  const bool second = peer.version != MavlinkVersion::k1;
  while (second && body.size() > 1 && body.back() == 0) {
    body.pop_back();
  }
  const bool is_signed = peer.version == MavlinkVersion::k2Signed;
  ByteWriter frame(ByteOrder::kLittle);
  frame.u8(second ? 0xFD : 0xFE).u8(body.size());
  if (second) {
    frame.u8(is_signed ? 1 : 0).u8(0);
  }
  frame.u8(peer.sequence).u8(peer.system).u8(peer.component).u8(id);
  if (second) {
    frame.u16(id >> 8U);
  }
  frame.append(body);
  Bytes summed(frame.bytes().begin() + 1, frame.bytes().end());
  summed.push_back(extra);
  frame.u16(hal::crc16_mcrf4xx(summed.data(), summed.size()));
  if (is_signed) {
    frame.append(Bytes(13, 0x5A));
  }
  return frame.bytes();
}

Bytes mavlink_attitude(const MavlinkPeer& peer, const Motion& motion) {
  ByteWriter payload = begun(motion);
  three(payload,
        {motion.roll_deg * kRadians, motion.pitch_deg * kRadians, wrapped(motion.heading_deg)});
  three(payload, motion.rate_rad_s);
  return mavlink_frame(peer, 30, 39, payload.bytes());
}

Bytes mavlink_attitude_quaternion(const MavlinkPeer& peer, const Motion& motion) {
  const double h = motion.heading_deg * kRadians / 2;
  const double p = motion.pitch_deg * kRadians / 2;
  const double r = motion.roll_deg * kRadians / 2;
  ByteWriter payload = begun(motion);
  payload.f32(std::cos(h) * std::cos(p) * std::cos(r) + std::sin(h) * std::sin(p) * std::sin(r));
  payload.f32(std::cos(h) * std::cos(p) * std::sin(r) - std::sin(h) * std::sin(p) * std::cos(r));
  payload.f32(std::cos(h) * std::sin(p) * std::cos(r) + std::sin(h) * std::cos(p) * std::sin(r));
  payload.f32(std::sin(h) * std::cos(p) * std::cos(r) - std::cos(h) * std::sin(p) * std::sin(r));
  three(payload, motion.rate_rad_s);
  return mavlink_frame(peer, 31, 246, payload.bytes());
}

Bytes mavlink_pressure(const MavlinkPeer& peer, std::uint32_t id, const Motion& motion,
                       double pressure_hpa) {
  const std::uint8_t extra = id == 29 ? 115 : (id == 137 ? 195 : 131);
  ByteWriter payload = begun(motion);
  payload.f32(pressure_hpa).f32(0).i16(std::llround(motion.temperature_degc * 100));
  return mavlink_frame(peer, id, extra, payload.bytes());
}

Bytes mavlink_local_position(const MavlinkPeer& peer, const Motion& motion) {
  ByteWriter payload = begun(motion);
  three(payload, motion.position_m);
  three(payload, motion.velocity_m_s);
  return mavlink_frame(peer, 32, 185, payload.bytes());
}

Bytes mavlink_global_position(const MavlinkPeer& peer, const Motion& motion, double latitude_deg,
                              double longitude_deg) {
  ByteWriter payload = begun(motion);
  payload.u32(static_cast<std::uint64_t>(std::llround(latitude_deg * 1e7)));
  payload.u32(static_cast<std::uint64_t>(std::llround(longitude_deg * 1e7)));
  payload.u32(static_cast<std::uint64_t>(std::llround(-motion.depth_m * 1e3)));
  payload.u32(static_cast<std::uint64_t>(std::llround(-motion.depth_m * 1e3)));
  for (const double speed : motion.velocity_m_s) {
    payload.i16(std::llround(speed * 100));
  }
  payload.u16(0xFFFF);
  return mavlink_frame(peer, 33, 104, payload.bytes());
}

Bytes mavlink_vision_position(const MavlinkPeer& peer, const Motion& motion, double sigma_m) {
  ByteWriter payload(ByteOrder::kLittle);
  payload.u64(static_cast<std::uint64_t>(std::llround(motion.time_s * 1e6)));
  three(payload, motion.position_m);
  three(payload, {motion.roll_deg * kRadians, motion.pitch_deg * kRadians, 0});
  for (int i = 0; i < 21; ++i) {
    const bool variance = i == 0 || i == 6 || i == 11;
    payload.f32(variance ? sigma_m * sigma_m : 0);
  }
  payload.u8(0);
  return mavlink_frame(peer, 102, 158, payload.bytes());
}

Bytes mavlink_odometry(const MavlinkPeer& peer, const Motion& motion, double sigma_m,
                       double sigma_m_s, int quality, unsigned frame, unsigned child) {
  ByteWriter payload(ByteOrder::kLittle);
  payload.u64(static_cast<std::uint64_t>(std::llround(motion.time_s * 1e6)));
  three(payload, motion.position_m);
  payload.f32(1).f32(0).f32(0).f32(0);
  three(payload, motion.velocity_m_s);
  three(payload, motion.rate_rad_s);
  for (const double sigma : {sigma_m, sigma_m_s}) {
    for (int i = 0; i < 21; ++i) {
      const bool variance = i == 0 || i == 6 || i == 11;
      payload.f32(variance ? sigma * sigma : 0);
    }
  }
  payload.u8(frame).u8(child).u8(0).u8(0).u8(static_cast<std::uint8_t>(quality));
  return mavlink_frame(peer, 331, 91, payload.bytes());
}

Bytes mavlink_distance(const MavlinkPeer& peer, const Motion& motion) {
  ByteWriter payload = begun(motion);
  payload.u16(20).u16(5000).u16(static_cast<std::uint64_t>(std::llround(motion.altitude_m * 100)));
  payload.u8(1).u8(0).u8(25).u8(255);
  return mavlink_frame(peer, 132, 85, payload.bytes());
}

Bytes mavlink_rangefinder(const MavlinkPeer& peer, const Motion& motion) {
  ByteWriter payload(ByteOrder::kLittle);
  payload.f32(motion.altitude_m).f32(2.5);
  return mavlink_frame(peer, 173, 83, payload.bytes());
}

Bytes mavlink_system_time(const MavlinkPeer& peer, const Motion& motion, std::uint64_t unix_us) {
  ByteWriter payload(ByteOrder::kLittle);
  payload.u64(unix_us).append(begun(motion).bytes());
  return mavlink_frame(peer, 2, 137, payload.bytes());
}

}  // namespace leadline::emu
