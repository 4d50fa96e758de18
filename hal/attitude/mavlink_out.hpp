// What the map tells an autopilot in MAVLink 2: HEARTBEAT, DISTANCE_SENSOR, OBSTACLE_DISTANCE.
//
// Facts: mavlink message definitions (common).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/attitude/mavlink_frame.hpp"

namespace leadline::hal {

/// Who sends, and the number of the next frame (counts frames, modulo 256: a receiver tells losses by it).
struct MavlinkSender {
  std::uint8_t system = 1;       ///< the vehicle's
  std::uint8_t component = 195;  ///< MAV_COMP_ID_PATHPLANNER
  std::uint8_t sequence = 0;
};

/// Bytes of the largest frame below.
inline constexpr std::size_t kMaxMavlinkOut_bytes = 10 + 167 + 2;

inline constexpr std::uint16_t kMavNoDistance_cm = 0xFFFF;
inline constexpr std::uint8_t kMavOrientationDown = 25;
inline constexpr std::uint8_t kMavFrameBodyFrd = 12;

/// DISTANCE_SENSOR of an ultrasonic sensor.
struct MavlinkDistance {
  std::uint32_t t_boot_ms = 0;
  std::uint16_t min_cm = 0;
  std::uint16_t max_cm = 0;
  std::uint16_t distance_cm = 0;
  std::uint8_t id = 0;
  std::uint8_t orientation = kMavOrientationDown;
  std::uint8_t variance_cm2 = 255;   ///< 255: not known
  std::uint32_t width_urad = 0;      ///< full opening angle both ways; 0: not stated
  std::uint8_t quality_percent = 0;  ///< 1: invalid, 100: best; 0: not stated
};

/// OBSTACLE_DISTANCE: the nearest obstacle in each of up to 72 directions, clockwise from angle_offset.
struct MavlinkObstacles {
  static constexpr std::size_t kDirections = 72;

  std::uint64_t t_us = 0;
  /// kMavNoDistance_cm: not known; max_cm + 1: nothing within max_cm.
  std::array<std::uint16_t, kDirections> distance_cm{};
  std::uint16_t min_cm = 0;
  std::uint16_t max_cm = 0;
  std::uint32_t increment_mdeg = 5000;  ///< between directions
  std::int32_t angle_offset_mdeg = 0;   ///< of the first, from the bow (kMavFrameBodyFrd)
};

/// Each writes one frame to `out` and counts the sender's sequence. Returns its size; 0, and nothing
/// changed, when `capacity_bytes` may be too small (kMaxMavlinkOut_bytes never is). O(frame).
[[nodiscard]] std::size_t write_mavlink_heartbeat(MavlinkSender& sender, std::uint8_t* out,
                                                  std::size_t capacity_bytes);
[[nodiscard]] std::size_t write_mavlink_distance(MavlinkSender& sender,
                                                 const MavlinkDistance& distance, std::uint8_t* out,
                                                 std::size_t capacity_bytes);
[[nodiscard]] std::size_t write_mavlink_obstacles(MavlinkSender& sender,
                                                  const MavlinkObstacles& obstacles,
                                                  std::uint8_t* out, std::size_t capacity_bytes);

}  // namespace leadline::hal
