// Depth, of a pressure sensor at its lever arm.
//   z = p_d + (R l)_d - v_d age
#include "estimator/filter_access.hpp"

namespace leadline::estimator {

Fusion NavigationFilter::update_depth(std::int64_t depth_um, std::int64_t sigma_um,
                                      const LeverArm& lever, base::TimeUs age_us) {
  const FilterAccess access{*this};
  const Vector3 arm = access.rotation() * lever_metres(lever);
  const float variance = square(metres(sigma_um));
  if (!vertical_started_) {
    access.set_position(base::kDown, depth_um - micrometres(arm[2]), variance, age_us);
    vertical_started_ = true;
    return access.accept(NavMeasurement::kDepth);
  }
  const float age = seconds(age_us);
  Rows<1> row = Rows<1>::Zero();
  row(0, kErrorPosition + 2) = 1.0F;
  row(0, kErrorVelocity + 2) = -age;
  row.block<1, 3>(0, kErrorAttitude) = -skew(arm).row(2);
  const float moved = square(config_.vertical_acceleration_m_s2) * age * age * age / 3.0F;
  const Column<1> innovation(-access.position_error(base::kDown, depth_um, arm[2], age_us));
  return access.fuse<1>(NavMeasurement::kDepth, row, innovation, Column<1>(variance + moved),
                        kGate1);
}

}  // namespace leadline::estimator
