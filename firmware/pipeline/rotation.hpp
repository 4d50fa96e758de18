// Rotations in integers: lever arms, boresight, and the pose of a head from the pose of the vehicle.
#pragma once

#include <cstdint>

#include "firmware/pipeline/config.hpp"
#include "model/base/pose.hpp"
#include "model/base/units.hpp"

namespace leadline::firmware {

/// Rotation matrix, Q30, row by row: v_outer = m v_inner.
struct Rotation {
  std::int32_t m_q30[3][3];
};

/// Rz(heading) Ry(pitch) Rx(roll). Entries within 2e-6 of the exact ones. O(1).
[[nodiscard]] Rotation rotation_of(const base::Attitude& attitude);
/// a b, rounded.
[[nodiscard]] Rotation product(const Rotation& a, const Rotation& b);
/// The angles of a rotation. Near pitch +-90 degrees, where heading and roll are not defined one by one,
/// they still give the same rotation: roll is found after the heading is taken out. Within 3e-6 rad. O(1).
[[nodiscard]] base::Attitude attitude_of(const Rotation& rotation);
/// rotation * vector, micrometres; |vector| below 2^32.
void rotate_um(const Rotation& rotation, const std::int64_t vector_um[3], std::int64_t out_um[3]);

/// Angle of (x, y) from the x axis towards y, all four quadrants; 0 for (0, 0). |x|, |y| <= 2^31. Within
/// 4e-9 rad of the exact angle for vectors of 2^28 and longer. 30 steps of CORDIC.
[[nodiscard]] base::Bam32 atan2_bam32(std::int64_t y, std::int64_t x);

/// Pose of a head: lever arm and boresight applied to the vehicle's pose. Sigmas are the vehicle's, plus
/// what its attitude error moves the head by at the end of the lever arm.
[[nodiscard]] base::Pose pose_of_mount(const base::Pose& vehicle, const MountConfig& mount);

/// The pose that a ping transmitted at `a` and received at `b` was measured from: middle of the two
/// positions, middle of the two attitudes (angle by angle on the shorter arc), larger sigmas of the two,
/// validity of both, time of the middle. See README.md, "Pose of a ping".
[[nodiscard]] base::Pose middle(const base::Pose& a, const base::Pose& b);

}  // namespace leadline::firmware
