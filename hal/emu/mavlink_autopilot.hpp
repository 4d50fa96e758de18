// An autopilot's messages: MAVLink 1, 2, and 2 signed (with a signature of no value).
#pragma once

#include <array>
#include <cstdint>

#include "hal/emu/emulated_device.hpp"
#include "hal/emu/motion.hpp"

namespace leadline::emu {

enum class MavlinkVersion : std::uint8_t { k1, k2, k2Signed };

struct MavlinkPeer {
  MavlinkVersion version = MavlinkVersion::k2;
  std::uint8_t system = 1;
  std::uint8_t component = 1;
  std::uint8_t sequence = 0;
};

/// Frame around a whole payload (version 2 cuts its trailing zeros); `extra` belongs to the message.
[[nodiscard]] Bytes mavlink_frame(const MavlinkPeer& peer, std::uint32_t id, std::uint8_t extra,
                                  const Bytes& payload);

[[nodiscard]] Bytes mavlink_attitude(const MavlinkPeer& peer, const Motion& motion);
[[nodiscard]] Bytes mavlink_attitude_quaternion(const MavlinkPeer& peer, const Motion& motion);
/// Message 29, 137 or 143 as `id`.
[[nodiscard]] Bytes mavlink_pressure(const MavlinkPeer& peer, std::uint32_t id,
                                     const Motion& motion, double pressure_hpa);
[[nodiscard]] Bytes mavlink_local_position(const MavlinkPeer& peer, const Motion& motion);
[[nodiscard]] Bytes mavlink_global_position(const MavlinkPeer& peer, const Motion& motion,
                                            double latitude_deg, double longitude_deg);
[[nodiscard]] Bytes mavlink_vision_position(const MavlinkPeer& peer, const Motion& motion,
                                            double sigma_m);
/// ODOMETRY: position in LOCAL_NED, velocity in BODY_FRD, their sigmas, quality -1 .. 100.
[[nodiscard]] Bytes mavlink_odometry(const MavlinkPeer& peer, const Motion& motion, double sigma_m,
                                     double sigma_m_s, int quality = 0, unsigned frame = 1,
                                     unsigned child = 12);
/// DISTANCE_SENSOR, of what is below.
[[nodiscard]] Bytes mavlink_distance(const MavlinkPeer& peer, const Motion& motion);
[[nodiscard]] Bytes mavlink_rangefinder(const MavlinkPeer& peer, const Motion& motion);
[[nodiscard]] Bytes mavlink_system_time(const MavlinkPeer& peer, const Motion& motion,
                                        std::uint64_t unix_us);

}  // namespace leadline::emu
