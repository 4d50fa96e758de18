#include "firmware/pipeline/sound_path.hpp"

#include <array>
#include <cstddef>

#include "model/base/angle.hpp"
#include "model/base/fixed.hpp"
#include "model/event.hpp"

namespace leadline::firmware {
namespace {

using base::Ping;
using base::Pose;
using base::Result;
using base::ReturnKind;
using base::Status;
using base::Vector3;

constexpr std::int64_t kOne2_q60 = std::int64_t{base::kOne_q30} * base::kOne_q30;

std::int64_t q30(std::int64_t product_q60) {
  return (product_q60 + (std::int64_t{1} << 29U)) >> 30U;
}

/// Length of the first two components, Q30.
std::int64_t level_part(const Vector3& v) {
  return base::isqrt_u64(static_cast<std::uint64_t>(v[0] * v[0] + v[1] * v[1]));
}

/// Unit vector of the ping's direction in the mount's frame, Q30.
Vector3 direction_of(const Ping& ping) {
  const std::int64_t level = base::cos_q30(ping.elevation_bam32);
  return {q30(level * base::cos_q30(ping.azimuth_bam32)),
          q30(level * base::sin_q30(ping.azimuth_bam32)), base::sin_q30(ping.elevation_bam32)};
}

std::int64_t dot_q60(const model::Direction& a, const model::Direction& b) {
  return std::int64_t{a.q30[0]} * b.q30[0] + std::int64_t{a.q30[1]} * b.q30[1] +
         std::int64_t{a.q30[2]} * b.q30[2];
}

/// Turns the beam to `v`. Its footprint keeps its axis, as far as that is square to the beam.
void set_direction(Ping& ping, const Vector3& v) {
  const model::Direction along =
      model::beam_frame({}, ping.azimuth_bam32, ping.elevation_bam32, ping.rotation_bam32).along;
  ping.azimuth_bam32 = base::atan2_bam32(v[1], v[0]);
  ping.elevation_bam32 = base::atan2_bam32(v[2], level_part(v));
  const model::BeamFrame plain = model::beam_frame({}, ping.azimuth_bam32, ping.elevation_bam32, 0);
  ping.rotation_bam32 =
      base::atan2_bam32(dot_q60(along, plain.across), dot_q60(along, plain.along));
}

/// Where the array's phases point at `actual_mm_s`. False: nowhere, the beam lies beyond the face.
bool steer(Ping& ping, ArrayFace face, std::int32_t told_mm_s, std::int32_t actual_mm_s) {
  if (face == ArrayFace::kNone || told_mm_s == actual_mm_s) {
    return true;
  }
  const std::size_t normal = face == ArrayFace::kDown ? 2 : 0;
  Vector3 v = direction_of(ping);
  std::int64_t left_q60 = kOne2_q60;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (axis != normal) {
      v[axis] = base::divide_rounded(v[axis] * actual_mm_s, told_mm_s);
      // Beyond the face already, and the square of what is longer may not fit.
      if (v[axis] > base::kOne_q30 || v[axis] < -base::kOne_q30) {
        return false;
      }
      left_q60 -= v[axis] * v[axis];
    }
  }
  if (left_q60 <= 0) {
    return false;
  }
  const std::int64_t along = base::isqrt_u64(static_cast<std::uint64_t>(left_q60));
  v[normal] = v[normal] < 0 ? -along : along;
  set_direction(ping, v);
  return true;
}

std::int64_t scaled_range_um(std::int64_t range_um, std::int32_t told_mm_s,
                             std::int32_t actual_mm_s) {
  return base::divide_rounded(range_um * actual_mm_s, told_mm_s);
}

}  // namespace

Status SoundPath::configure(const VehicleConfig& config) {
  const WaterConfig& water = config.water;
  if (water.point_count > kMaxSoundSpeedPoints) {
    return Status::kOutOfRange;
  }
  SoundPath path;
  path.configured_mm_s_ = config.sound_speed_mm_s;
  path.water_mm_s_ = config.sound_speed_mm_s;
  path.known_ = water.speed_known != 0;
  const std::size_t count = water.point_count;
  if (count != 0) {
    std::array<estimator::SoundSpeedPoint, kMaxSoundSpeedPoints> down{};
    std::array<estimator::SoundSpeedPoint, kMaxSoundSpeedPoints> up{};
    for (std::size_t i = 0; i < count; ++i) {
      const SoundSpeedEntry& entry = water.points[i];
      const std::int64_t depth_um = std::int64_t{entry.depth_mm} * 1000;
      down[i] = {depth_um, entry.speed_mm_s};
      up[count - 1 - i] = {-depth_um, entry.speed_mm_s};
    }
    const Status status = path.profile_.set(down.data(), count);
    if (status != Status::kOk) {
      return status;
    }
    static_cast<void>(path.mirrored_.set(up.data(), count));
  }
  *this = path;
  return Status::kOk;
}

Status SoundPath::set_water_speed(std::int32_t speed_mm_s) {
  if (profile_.size() != 0) {
    return Status::kNotReady;
  }
  if (speed_mm_s < estimator::kMinSoundSpeed_mm_s || speed_mm_s > estimator::kMaxSoundSpeed_mm_s) {
    return Status::kOutOfRange;
  }
  water_mm_s_ = speed_mm_s;
  known_ = true;
  return Status::kOk;
}

bool SoundPath::straighten(Ping& ping, const Pose& head, ArrayFace face) const {
  const bool layered = profile_.size() != 0;
  const std::int32_t told_mm_s =
      ping.sound_speed_mm_s != 0 ? ping.sound_speed_mm_s : configured_mm_s_;
  const std::int32_t water_mm_s = known_ ? water_mm_s_ : told_mm_s;
  if (!layered && told_mm_s == water_mm_s) {
    return true;
  }
  if (told_mm_s < estimator::kMinSoundSpeed_mm_s || told_mm_s > estimator::kMaxSoundSpeed_mm_s ||
      ping.range_um < 0 || ping.range_um > base::kMaxRange_um) {
    return false;
  }
  const std::int32_t actual_mm_s =
      layered ? profile_.speed_at_mm_s(head.position_um[base::kDown]) : water_mm_s;
  if (!steer(ping, face, told_mm_s, actual_mm_s)) {
    return false;
  }
  ping.sound_speed_mm_s = 0;
  if (ping.kind == ReturnKind::kNoReturn) {
    return true;
  }
  if (layered) {
    return bend(ping, head, told_mm_s);
  }
  ping.range_um = scaled_range_um(ping.range_um, told_mm_s, actual_mm_s);
  return true;
}

bool SoundPath::bend(Ping& ping, const Pose& head, std::int32_t told_mm_s) const {
  const base::Rotation attitude = base::rotation_of(head.attitude);
  const Vector3 world = base::rotated(attitude, direction_of(ping));
  const std::int64_t level = level_part(world);
  const bool up = world[2] < 0;
  const std::int64_t depth_um = head.position_um[base::kDown];
  estimator::RayLaunch launch{};
  launch.head_depth_um = up ? -depth_um : depth_um;
  launch.from_down_bam32 = base::atan2_bam32(level, up ? -world[2] : world[2]);
  launch.two_way_ns = base::divide_rounded(ping.range_um * 2'000'000, told_mm_s);
  if (base::cos_q30(launch.from_down_bam32) < base::kOne_q30 / 10) {
    ping.range_um = scaled_range_um(ping.range_um, told_mm_s, profile_.speed_at_mm_s(depth_um));
    return true;
  }
  const Result<estimator::RayEnd> end = trace_ray(up ? mirrored_ : profile_, launch);
  if (!end.ok()) {
    return false;
  }
  const estimator::StraightRay straight = estimator::straight_ray(end.value());
  const std::int64_t sine = base::sin_q30(straight.from_down_bam32);
  const std::int64_t cosine = base::cos_q30(straight.from_down_bam32);
  const Vector3 line = {level != 0 ? base::divide_rounded(world[0] * sine, level) : 0,
                        level != 0 ? base::divide_rounded(world[1] * sine, level) : 0,
                        up ? -cosine : cosine};
  set_direction(ping, base::rotated_back(attitude, line));
  ping.range_um = straight.range_um;
  return true;
}

}  // namespace leadline::firmware
