#include "firmware/pipeline/mount_pose.hpp"

#include "model/base/angle.hpp"
#include "model/base/fixed.hpp"

namespace leadline::firmware {
namespace {

using base::Attitude;
using base::Bam32;
using base::Pose;

Bam32 halfway(Bam32 from, Bam32 to) {
  const auto arc = static_cast<std::int32_t>(to - from);
  return from + static_cast<Bam32>(arc / 2);
}

}  // namespace

Pose pose_of_mount(const Pose& vehicle, const MountConfig& mount) {
  Pose pose = vehicle;
  const base::Rotation body = base::rotation_of(vehicle.attitude);
  base::Vector3 lever_um{};
  std::int64_t length2_mm2 = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t arm_mm = mount.lever_arm_mm[axis];
    lever_um[axis] = arm_mm * 1000;
    length2_mm2 += arm_mm * arm_mm;
  }
  lever_um = base::rotated(body, lever_um);
  std::uint32_t worst_urad16 = 0;
  for (const std::uint16_t sigma : vehicle.covariance.sigma_attitude_urad16) {
    worst_urad16 = base::max_of<std::uint32_t>(worst_urad16, sigma);
  }
  const auto length_mm =
      static_cast<std::int64_t>(base::sqrt_u64(static_cast<std::uint64_t>(length2_mm2)));
  const std::int64_t swing_mm = (length_mm * worst_urad16 * 16 + 999'999) / 1'000'000;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    pose.position_um[axis] += lever_um[axis];
    const std::int64_t sigma_mm =
        base::min_of<std::int64_t>(vehicle.covariance.sigma_position_mm[axis], 1'000'000'000);
    if (swing_mm != 0) {
      const auto square = static_cast<std::uint64_t>(sigma_mm * sigma_mm + swing_mm * swing_mm);
      pose.covariance.sigma_position_mm[axis] = base::sqrt_u64(square) + 1U;
    }
  }
  const Attitude& boresight = mount.boresight;
  if ((boresight.roll_bam32 | boresight.pitch_bam32 | boresight.heading_bam32) != 0) {
    pose.attitude = base::attitude_of(base::product(body, base::rotation_of(boresight)));
  }
  return pose;
}

Pose middle(const Pose& a, const Pose& b) {
  Pose pose = a;
  pose.t_us = a.t_us + (b.t_us - a.t_us) / 2;
  for (int axis = 0; axis < 3; ++axis) {
    pose.position_um[axis] = a.position_um[axis] + (b.position_um[axis] - a.position_um[axis]) / 2;
    pose.covariance.sigma_position_mm[axis] =
        base::max_of(a.covariance.sigma_position_mm[axis], b.covariance.sigma_position_mm[axis]);
    pose.covariance.sigma_attitude_urad16[axis] = base::max_of(
        a.covariance.sigma_attitude_urad16[axis], b.covariance.sigma_attitude_urad16[axis]);
  }
  pose.attitude.roll_bam32 = halfway(a.attitude.roll_bam32, b.attitude.roll_bam32);
  pose.attitude.pitch_bam32 = halfway(a.attitude.pitch_bam32, b.attitude.pitch_bam32);
  pose.attitude.heading_bam32 = halfway(a.attitude.heading_bam32, b.attitude.heading_bam32);
  pose.validity = static_cast<std::uint8_t>(a.validity & b.validity);
  return pose;
}

}  // namespace leadline::firmware
