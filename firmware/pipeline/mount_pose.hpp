// The pose of a head from the pose of the vehicle: lever arm and boresight.
#pragma once

#include <cstdint>

#include "firmware/pipeline/config.hpp"
#include "model/base/pose.hpp"
#include "model/base/units.hpp"

namespace leadline::firmware {

/// Pose of a head: lever arm and boresight applied to the vehicle's pose. Sigmas are the vehicle's, plus
/// what its attitude error moves the head by at the end of the lever arm.
[[nodiscard]] base::Pose pose_of_mount(const base::Pose& vehicle, const MountConfig& mount);

/// The pose that a ping transmitted at `a` and received at `b` was measured from: middle of the two
/// positions, middle of the two attitudes (angle by angle on the shorter arc), larger sigmas of the two,
/// validity of both, time of the middle. See README.md, "Pose of a ping".
[[nodiscard]] base::Pose middle(const base::Pose& a, const base::Pose& b);

}  // namespace leadline::firmware
