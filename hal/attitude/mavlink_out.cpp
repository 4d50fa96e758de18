#include "hal/attitude/mavlink_out.hpp"

#include "hal/checksums.hpp"
#include "hal/wire.hpp"

namespace leadline::hal {

namespace {

constexpr std::size_t kHeader_bytes = 10;
constexpr std::uint8_t kUltrasound = 1;  // MAV_DISTANCE_SENSOR

/// Frame around a payload of `payload_bytes` that already stands behind the header in `out`.
std::size_t seal(MavlinkSender& sender, std::uint32_t id, std::size_t payload_bytes,
                 std::uint8_t* out) {
  // The first byte of a payload is sent whatever it is.
  while (payload_bytes > 1 && out[kHeader_bytes + payload_bytes - 1] == 0) {
    --payload_bytes;
  }
  out[0] = kMavlink2Start;
  out[1] = static_cast<std::uint8_t>(payload_bytes);
  out[2] = 0;
  out[3] = 0;
  out[4] = sender.sequence;
  out[5] = sender.system;
  out[6] = sender.component;
  out[7] = static_cast<std::uint8_t>(id);
  write_u16_le(out + 8, static_cast<std::uint16_t>(id >> 8U));
  std::uint8_t extra = 0;
  if (!mavlink_crc_extra(id, extra)) {
    return 0;
  }
  const std::size_t end = kHeader_bytes + payload_bytes;
  write_u16_le(out + end, crc16_mcrf4xx(&extra, 1, crc16_mcrf4xx(out + 1, end - 1)));
  sender.sequence = static_cast<std::uint8_t>(sender.sequence + 1);
  return end + 2;
}

/// Zeros where the payload goes; null when there is no room.
std::uint8_t* payload_in(std::uint8_t* out, std::size_t capacity_bytes, std::size_t payload_bytes) {
  if (capacity_bytes < kHeader_bytes + payload_bytes + 2) {
    return nullptr;
  }
  for (std::size_t i = 0; i < payload_bytes; ++i) {
    out[kHeader_bytes + i] = 0;
  }
  return out + kHeader_bytes;
}

}  // namespace

std::size_t write_mavlink_heartbeat(MavlinkSender& sender, std::uint8_t* out,
                                    std::size_t capacity_bytes) {
  constexpr std::size_t kPayload_bytes = 9;
  constexpr std::uint8_t kOnboardController = 18;  // MAV_TYPE
  constexpr std::uint8_t kNoAutopilot = 8;
  constexpr std::uint8_t kActive = 4;
  constexpr std::uint8_t kVersion = 3;
  std::uint8_t* payload = payload_in(out, capacity_bytes, kPayload_bytes);
  if (payload == nullptr) {
    return 0;
  }
  payload[4] = kOnboardController;
  payload[5] = kNoAutopilot;
  payload[7] = kActive;
  payload[8] = kVersion;
  return seal(sender, kMavHeartbeat, kPayload_bytes, out);
}

std::size_t write_mavlink_distance(MavlinkSender& sender, const MavlinkDistance& distance,
                                   std::uint8_t* out, std::size_t capacity_bytes) {
  constexpr std::size_t kPayload_bytes = 39;
  std::uint8_t* payload = payload_in(out, capacity_bytes, kPayload_bytes);
  if (payload == nullptr) {
    return 0;
  }
  write_u32_le(payload, distance.t_boot_ms);
  write_u16_le(payload + 4, distance.min_cm);
  write_u16_le(payload + 6, distance.max_cm);
  write_u16_le(payload + 8, distance.distance_cm);
  payload[10] = kUltrasound;
  payload[11] = distance.id;
  payload[12] = distance.orientation;
  payload[13] = distance.variance_cm2;
  const std::uint32_t width_bits = f32_bits_of_ratio(distance.width_urad, 1'000'000);
  write_u32_le(payload + 14, width_bits);
  write_u32_le(payload + 18, width_bits);
  payload[38] = distance.quality_percent;
  return seal(sender, kMavDistanceSensor, kPayload_bytes, out);
}

std::size_t write_mavlink_obstacles(MavlinkSender& sender, const MavlinkObstacles& obstacles,
                                    std::uint8_t* out, std::size_t capacity_bytes) {
  constexpr std::size_t kPayload_bytes = 167;
  constexpr std::uint32_t kMdegPerDegree = 1000;
  std::uint8_t* payload = payload_in(out, capacity_bytes, kPayload_bytes);
  if (payload == nullptr) {
    return 0;
  }
  write_u32_le(payload, static_cast<std::uint32_t>(obstacles.t_us));
  write_u32_le(payload + 4, static_cast<std::uint32_t>(obstacles.t_us >> 32U));
  for (std::size_t i = 0; i < MavlinkObstacles::kDirections; ++i) {
    write_u16_le(payload + 8 + 2 * i, obstacles.distance_cm[i]);
  }
  write_u16_le(payload + 152, obstacles.min_cm);
  write_u16_le(payload + 154, obstacles.max_cm);
  payload[156] = kUltrasound;
  // Whole degrees for those who know no better; the exact one stands behind.
  payload[157] = static_cast<std::uint8_t>(obstacles.increment_mdeg / kMdegPerDegree);
  write_u32_le(payload + 158, f32_bits_of_ratio(obstacles.increment_mdeg, kMdegPerDegree));
  write_u32_le(payload + 162, f32_bits_of_ratio(obstacles.angle_offset_mdeg, kMdegPerDegree));
  payload[166] = kMavFrameBodyFrd;
  return seal(sender, kMavObstacleDistance, kPayload_bytes, out);
}

}  // namespace leadline::hal
