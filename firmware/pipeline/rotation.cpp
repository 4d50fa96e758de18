#include "firmware/pipeline/rotation.hpp"

#include "model/base/fixed.hpp"

namespace leadline::firmware {
namespace {

using base::Attitude;
using base::Bam32;
using base::Pose;

constexpr int kSteps = 30;
// atan(2^-i), turn = 2^40.
constexpr std::int64_t kArcs_q40[kSteps] = {
    137438953472, 81134951838, 42869480287, 21761217566, 10922836750, 5466743129,
    2734038620,   1367102738,  683561799,   341782203,   170891265,   85445653,
    42722829,     21361415,    10680707,    5340354,     2670177,     1335088,
    667544,       333772,      166886,      83443,       41722,       20861,
    10430,        5215,        2608,        1304,        652,         326};

std::int32_t rounded_q30(std::int64_t sum_q60) {
  return static_cast<std::int32_t>((sum_q60 + (1LL << 29)) >> 30);
}

Bam32 halfway(Bam32 from, Bam32 to) {
  const auto arc = static_cast<std::int32_t>(to - from);
  return from + static_cast<Bam32>(arc / 2);
}

}  // namespace

Rotation rotation_of(const Attitude& attitude) {
  const std::int64_t sr = base::sin_q30(attitude.roll_bam32);
  const std::int64_t cr = base::cos_q30(attitude.roll_bam32);
  const std::int64_t sp = base::sin_q30(attitude.pitch_bam32);
  const std::int64_t cp = base::cos_q30(attitude.pitch_bam32);
  const std::int64_t sh = base::sin_q30(attitude.heading_bam32);
  const std::int64_t ch = base::cos_q30(attitude.heading_bam32);
  const std::int64_t sp_sr = rounded_q30(sp * sr);
  const std::int64_t sp_cr = rounded_q30(sp * cr);
  return Rotation{
      {{rounded_q30(ch * cp), rounded_q30(ch * sp_sr - sh * cr), rounded_q30(ch * sp_cr + sh * sr)},
       {rounded_q30(sh * cp), rounded_q30(sh * sp_sr + ch * cr), rounded_q30(sh * sp_cr - ch * sr)},
       {static_cast<std::int32_t>(-sp), rounded_q30(cp * sr), rounded_q30(cp * cr)}}};
}

Rotation product(const Rotation& a, const Rotation& b) {
  Rotation out{};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      // Three products of entries of at most one: below 2^62.
      std::int64_t sum = 0;
      for (int k = 0; k < 3; ++k) {
        sum += static_cast<std::int64_t>(a.m_q30[row][k]) * b.m_q30[k][column];
      }
      out.m_q30[row][column] = rounded_q30(sum);
    }
  }
  return out;
}

Bam32 atan2_bam32(std::int64_t y, std::int64_t x) {
  if (x == 0 && y == 0) {
    return 0;
  }
  // Into the right half plane, then towards the x axis in ever smaller steps.
  std::int64_t angle_q40 = 0;
  if (x < 0) {
    x = -x;
    y = -y;
    angle_q40 = std::int64_t{1} << 39U;
  }
  constexpr std::int64_t kGuard = 1 << 20;
  x *= kGuard;
  y *= kGuard;
  for (int step = 0; step < kSteps; ++step) {
    const std::int64_t dx = y >> step;
    const std::int64_t dy = x >> step;
    const bool above = y > 0;
    x += above ? dx : -dx;
    y += above ? -dy : dy;
    angle_q40 += above ? kArcs_q40[step] : -kArcs_q40[step];
  }
  return static_cast<Bam32>(static_cast<std::uint64_t>((angle_q40 + 128) >> 8));
}

Attitude attitude_of(const Rotation& rotation) {
  const auto& m = rotation.m_q30;
  const Bam32 heading = atan2_bam32(m[1][0], m[0][0]);
  const std::int64_t s = base::sin_q30(heading);
  const std::int64_t c = base::cos_q30(heading);
  // Rz(-heading) m = Ry(pitch) Rx(roll): (cos p, ..), (0, cos r, -sin r), (-sin p, ..).
  const std::int64_t cos_pitch = rounded_q30(c * m[0][0] + s * m[1][0]);
  const std::int64_t cos_roll = rounded_q30(c * m[1][1] - s * m[0][1]);
  const std::int64_t sin_roll = -rounded_q30(c * m[1][2] - s * m[0][2]);
  return Attitude{atan2_bam32(sin_roll, cos_roll),
                  atan2_bam32(-static_cast<std::int64_t>(m[2][0]), cos_pitch), heading};
}

void rotate_um(const Rotation& rotation, const std::int64_t vector_um[3], std::int64_t out_um[3]) {
  std::int64_t result[3];
  for (int row = 0; row < 3; ++row) {
    // Each product shifted alone: three of 2^62 do not fit together.
    result[row] = 0;
    for (int k = 0; k < 3; ++k) {
      const std::int64_t product = rotation.m_q30[row][k] * vector_um[k];
      result[row] += (product + (1LL << 29)) >> 30;
    }
  }
  for (int row = 0; row < 3; ++row) {
    out_um[row] = result[row];
  }
}

Pose pose_of_mount(const Pose& vehicle, const MountConfig& mount) {
  Pose pose = vehicle;
  const Rotation body = rotation_of(vehicle.attitude);
  std::int64_t lever_um[3];
  std::int64_t length2_mm2 = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const std::int64_t arm_mm = mount.lever_arm_mm[axis];
    lever_um[axis] = arm_mm * 1000;
    length2_mm2 += arm_mm * arm_mm;
  }
  rotate_um(body, lever_um, lever_um);
  std::uint32_t worst_urad16 = 0;
  for (const std::uint16_t sigma : vehicle.covariance.sigma_attitude_urad16) {
    worst_urad16 = base::max_of<std::uint32_t>(worst_urad16, sigma);
  }
  const auto length_mm =
      static_cast<std::int64_t>(base::sqrt_u64(static_cast<std::uint64_t>(length2_mm2)));
  const std::int64_t swing_mm = (length_mm * worst_urad16 * 16 + 999'999) / 1'000'000;
  for (int axis = 0; axis < 3; ++axis) {
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
    pose.attitude = attitude_of(product(body, rotation_of(boresight)));
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
