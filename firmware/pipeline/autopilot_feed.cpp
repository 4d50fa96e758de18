#include "firmware/pipeline/autopilot_feed.hpp"

#include "model/base/fixed.hpp"

namespace leadline::firmware {
namespace {

using base::Ping;
using base::TimeUs;
using base::Vector3;

constexpr std::int32_t kCosine15deg_q30 = 1'037'154'959;
constexpr std::int32_t kSine15deg_q30 = 277'904'834;
constexpr std::int64_t kUmPerCm = 10'000;
constexpr std::int64_t kLongest_cm = 65'533;  // one more and two more mean something
constexpr TimeUs kHeartbeat_us = 1'000'000;
constexpr TimeUs kDistance_us = 100'000;
constexpr TimeUs kObstacles_us = 200'000;
constexpr TimeUs kForget_us = 60'000'000;
constexpr TimeUs kOldEcho_us = 1'000'000;

std::uint16_t centimetres(std::int64_t length_um) {
  return static_cast<std::uint16_t>(
      base::clamp<std::int64_t>((length_um + kUmPerCm / 2) / kUmPerCm, 0, kLongest_cm));
}

/// Direction of the ping in the body's axes, Q30.
Vector3 body_beam(const Ping& ping, const base::Rotation& turned) {
  const auto q30 = [](std::int64_t product_q60) {
    return (product_q60 + (std::int64_t{1} << 29U)) >> 30U;
  };
  const std::int64_t level = base::cos_q30(ping.elevation_bam32);
  return base::rotated(turned, {q30(level * base::cos_q30(ping.azimuth_bam32)),
                                q30(level * base::sin_q30(ping.azimuth_bam32)),
                                base::sin_q30(ping.elevation_bam32)});
}

}  // namespace

void AutopilotFeed::configure(const VehicleConfig& config) {
  *this = AutopilotFeed{};
  min_cm_ = centimetres(config.model.min_range_um);
  max_cm_ = centimetres(config.model.max_range_um);
  for (std::size_t i = 0; i < config.mount_count; ++i) {
    const MountConfig& mount = config.mounts[i];
    mounts_[i].turned = base::rotation_of(mount.boresight);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      mounts_[i].lever_um[axis] = std::int64_t{mount.lever_arm_mm[axis]} * 1000;
    }
  }
  for (std::size_t i = 0; i < config.port_count; ++i) {
    const PortConfig& port = config.ports[i];
    lines_[i].sends = port.driver == Driver::kMavlink && (port.switches & kPortSend) != 0;
    if (port.address > 0) {
      lines_[i].sender.system = static_cast<std::uint8_t>(port.address);
    }
  }
}

void AutopilotFeed::take(const Ping& ping) {
  const bool echo = ping.kind == base::ReturnKind::kRange;
  if (echo && (ping.range_um <= 0 || ping.range_um > base::kMaxRange_um)) {
    return;
  }
  const Mount& mount = mounts_[ping.mount];
  const Vector3 beam_q30 = body_beam(ping, mount.turned);
  Vector3 echo_um{};
  const std::int64_t range_mm = echo ? ping.range_um / 1000 : 0;  // Q30 times millimetres fits
  for (std::size_t axis = 0; axis < 3; ++axis) {
    echo_um[axis] = mount.lever_um[axis] + ((beam_q30[axis] * range_mm) >> 30U) * 1000;
  }
  if (echo && beam_q30[2] >= kCosine15deg_q30) {
    take_below(ping, beam_q30, echo_um[2]);
  } else if (beam_q30[2] <= kSine15deg_q30 && beam_q30[2] >= -kSine15deg_q30) {
    take_around(ping, beam_q30, echo_um);
  }
}

void AutopilotFeed::take_below(const Ping& ping, const Vector3& beam_q30, std::int64_t down_um) {
  const auto cosine_q30 = static_cast<std::int32_t>(beam_q30[2]);
  const bool same = below_.count != 0 && below_.t_transmit_us == ping.t_transmit_us;
  if (same && cosine_q30 <= below_.cosine_q30) {
    return;
  }
  below_.count += same ? 0U : 1U;
  below_.t_transmit_us = ping.t_transmit_us;
  below_.cosine_q30 = cosine_q30;
  below_.distance_cm = centimetres(down_um);
  // 0 is "not stated", 1 is "invalid".
  below_.quality_percent = static_cast<std::uint8_t>(base::max_of(2, ping.quality * 100 / 255));
}

void AutopilotFeed::take_around(const Ping& ping, const Vector3& beam_q30, const Vector3& echo_um) {
  const bool echo = ping.kind == base::ReturnKind::kRange;
  const base::Bam32 azimuth = echo ? base::atan2_bam32(echo_um[1], echo_um[0])
                                   : base::atan2_bam32(beam_q30[1], beam_q30[0]);
  // Direction i is from half a step before i * 5 degrees to half a step behind.
  const std::uint64_t half = (std::uint64_t{1} << 32U) / (2 * kDirections);
  const auto number =
      static_cast<std::size_t>((((azimuth + half) * kDirections) >> 32U) % kDirections);
  std::uint16_t distance_cm = hal::kMavNoDistance_cm;
  if (echo) {
    const std::int64_t x_mm = echo_um[0] / 1000;
    const std::int64_t y_mm = echo_um[1] / 1000;
    distance_cm = centimetres(
        std::int64_t{base::isqrt_u64(static_cast<std::uint64_t>(x_mm * x_mm + y_mm * y_mm))} *
        1000);
    distance_cm = distance_cm > max_cm_ ? hal::kMavNoDistance_cm : distance_cm;
  }
  Direction& direction = around_[number];
  const bool same_look =
      direction.seen && (looking_at_ == number || direction.t_transmit_us == ping.t_transmit_us);
  direction.distance_cm =
      same_look ? base::min_of(direction.distance_cm, distance_cm) : distance_cm;
  direction.t_transmit_us = ping.t_transmit_us;
  direction.seen = true;
  looking_at_ = number;
}

std::size_t AutopilotFeed::send(std::size_t port, TimeUs now_us, std::uint8_t* out,
                                std::size_t capacity_bytes) {
  Line& line = lines_[port];
  if (!line.sends) {
    return 0;
  }
  if (!line.begun) {
    line.begun = true;
    line.heartbeat_due_us = now_us;
    line.distance_due_us = now_us;
    line.obstacles_due_us = now_us;
  }
  std::size_t size = send_heartbeat(line, now_us, out, capacity_bytes);
  size += send_distance(line, now_us, out + size, capacity_bytes - size);
  size += send_obstacles(line, now_us, out + size, capacity_bytes - size);
  return size;
}

std::size_t AutopilotFeed::send_heartbeat(Line& line, TimeUs now_us, std::uint8_t* out,
                                          std::size_t capacity_bytes) {
  if (now_us < line.heartbeat_due_us) {
    return 0;
  }
  const std::size_t size = write_mavlink_heartbeat(line.sender, out, capacity_bytes);
  if (size != 0) {
    line.heartbeat_due_us = now_us + kHeartbeat_us;
    ++frames_;
  }
  return size;
}

std::size_t AutopilotFeed::send_distance(Line& line, TimeUs now_us, std::uint8_t* out,
                                         std::size_t capacity_bytes) {
  if (now_us < line.distance_due_us || line.below_sent == below_.count ||
      now_us - below_.t_transmit_us > kOldEcho_us) {
    return 0;
  }
  hal::MavlinkDistance distance;
  distance.t_boot_ms = static_cast<std::uint32_t>(below_.t_transmit_us / 1000);
  distance.min_cm = min_cm_;
  distance.max_cm = max_cm_;
  distance.distance_cm = below_.distance_cm;
  distance.quality_percent = below_.quality_percent;
  const std::size_t size = write_mavlink_distance(line.sender, distance, out, capacity_bytes);
  if (size != 0) {
    line.distance_due_us = now_us + kDistance_us;
    line.below_sent = below_.count;
    ++frames_;
  }
  return size;
}

std::size_t AutopilotFeed::send_obstacles(Line& line, TimeUs now_us, std::uint8_t* out,
                                          std::size_t capacity_bytes) {
  if (now_us < line.obstacles_due_us) {
    return 0;
  }
  hal::MavlinkObstacles obstacles;
  obstacles.t_us = static_cast<std::uint64_t>(now_us);
  obstacles.min_cm = min_cm_;
  obstacles.max_cm = max_cm_;
  bool any = false;
  for (std::size_t i = 0; i < kDirections; ++i) {
    const Direction& direction = around_[i];
    const bool fresh = direction.seen && now_us - direction.t_transmit_us <= kForget_us;
    obstacles.distance_cm[i] = fresh ? direction.distance_cm : hal::kMavNoDistance_cm;
    any = any || fresh;
  }
  if (!any) {
    return 0;
  }
  const std::size_t size = write_mavlink_obstacles(line.sender, obstacles, out, capacity_bytes);
  if (size != 0) {
    line.obstacles_due_us = now_us + kObstacles_us;
    ++frames_;
  }
  return size;
}

}  // namespace leadline::firmware
