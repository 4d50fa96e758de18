// Height above a bottom whose depth is known: the map's, where it has been seen before.
//   z = bottom - (p_d + (R l)_d - v_d age)
#include "estimator/filter_access.hpp"

namespace leadline::estimator {

Fusion NavigationFilter::update_altitude(std::int64_t altitude_um, std::int64_t bottom_depth_um,
                                         std::int64_t sigma_um, const LeverArm& lever,
                                         base::TimeUs age_us) {
  if (!vertical_started_) {
    return Fusion::kNotReady;
  }
  const FilterAccess access{*this};
  const Vector3 arm = access.rotation() * lever_metres(lever);
  const float age = seconds(age_us);
  Rows<1> row = Rows<1>::Zero();
  row(0, kErrorPosition + 2) = -1.0F;
  row(0, kErrorVelocity + 2) = age;
  row.block<1, 3>(0, kErrorAttitude) = skew(arm).row(2);
  const Column<1> innovation(
      access.position_error(base::kDown, bottom_depth_um - altitude_um, arm[2], age_us));
  const float moved = square(config_.vertical_acceleration_m_s2) * age * age * age / 3.0F;
  return access.fuse<1>(NavMeasurement::kAltitude, row, innovation,
                        Column<1>(square(metres(sigma_um)) + moved), kGate1);
}

}  // namespace leadline::estimator
