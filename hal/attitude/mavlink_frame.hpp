// Frames of MAVLink 1 and 2: found, checked, written. Shared by the codec (mavlink.hpp) and the encoders
// (mavlink_out.hpp).
//
//   version 1: FE, payload bytes, sequence, system, component, id u8, payload, CRC u16
//   version 2: FD, payload bytes, incompatible flags, compatible flags, sequence, system, component,
//              id u24, payload without its trailing zeros, CRC u16, 13 bytes more when signed
//
// All little-endian. CRC-16/MCRF4XX over everything between the start byte and the CRC, then over one
// byte that belongs to the message's layout ("extra"): a frame whose id is not in the table cannot be
// checked, so it is not believed, and counts as `unknown_id`. A signature is skipped, not checked: it
// makes no frame good whose CRC is not.
//
// Facts: mavlink message definitions; every row whose message is in the ArduSub log of the tests was
// confirmed by its CRCs.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/codec.hpp"

namespace leadline::hal {

inline constexpr std::uint8_t kMavlink1Start = 0xFE;
inline constexpr std::uint8_t kMavlink2Start = 0xFD;
inline constexpr std::size_t kMaxMavlinkPayload_bytes = 255;
inline constexpr std::size_t kMavlinkSignature_bytes = 13;
/// Version 2, signed.
inline constexpr std::size_t kMaxMavlinkFrame_bytes =
    10 + kMaxMavlinkPayload_bytes + 2 + kMavlinkSignature_bytes;

inline constexpr std::uint32_t kMavHeartbeat = 0;
inline constexpr std::uint32_t kMavSystemTime = 2;
inline constexpr std::uint32_t kMavScaledPressure = 29;
inline constexpr std::uint32_t kMavAttitude = 30;
inline constexpr std::uint32_t kMavAttitudeQuaternion = 31;
inline constexpr std::uint32_t kMavLocalPositionNed = 32;
inline constexpr std::uint32_t kMavGlobalPositionInt = 33;
inline constexpr std::uint32_t kMavVisionPositionEstimate = 102;
inline constexpr std::uint32_t kMavDistanceSensor = 132;
inline constexpr std::uint32_t kMavScaledPressure2 = 137;
inline constexpr std::uint32_t kMavScaledPressure3 = 143;
inline constexpr std::uint32_t kMavRangefinder = 173;
inline constexpr std::uint32_t kMavObstacleDistance = 330;
inline constexpr std::uint32_t kMavOdometry = 331;

/// The byte that the CRC of message `id` ends with. False: not in the table. O(table).
[[nodiscard]] bool mavlink_crc_extra(std::uint32_t id, std::uint8_t& extra);

/// What a frame says, as far as it can be told without its CRC.
struct MavlinkHeader {
  std::uint32_t id;
  std::uint8_t sequence;
  std::uint8_t system;
  std::uint8_t component;
  std::uint8_t payload_bytes;
  std::uint8_t payload_offset;  ///< from the start byte
  std::uint16_t frame_bytes;    ///< CRC and signature included
};

/// False: `available` bytes do not hold the header yet, or bytes[0] is no start. O(1).
[[nodiscard]] bool read_mavlink_header(const std::uint8_t* bytes, std::size_t available,
                                       MavlinkHeader& header);

/// The framer's rules (hal/codec.hpp). O(frame).
[[nodiscard]] Judgement judge_mavlink(const std::uint8_t* bytes, std::size_t available);

}  // namespace leadline::hal
