// Horizontal position: a fix of GNSS, USBL or LBL.
//   z = p + R l - v age,   rows: I for position, -age I for velocity, -[R l]x for attitude
#include "estimator/filter_access.hpp"

namespace leadline::estimator {

Fusion NavigationFilter::update_position(const std::int64_t north_east_um[2], std::int64_t sigma_um,
                                         const LeverArm& lever, base::TimeUs age_us) {
  const FilterAccess access{*this};
  const Vector3 arm = access.rotation() * lever_metres(lever);
  const float variance = square(metres(sigma_um));
  if (!horizontal_started_) {
    access.set_position(base::kNorth, north_east_um[0] - micrometres(arm[0]), variance, age_us);
    access.set_position(base::kEast, north_east_um[1] - micrometres(arm[1]), variance, age_us);
    horizontal_started_ = true;
    return access.accept(NavMeasurement::kPosition);
  }
  const float age = seconds(age_us);
  const Matrix3 turned = skew(arm);
  Rows<2> rows = Rows<2>::Zero();
  Column<2> innovation;
  for (int axis = 0; axis < 2; ++axis) {
    rows(axis, kErrorPosition + axis) = 1.0F;
    rows(axis, kErrorVelocity + axis) = -age;
    rows.block<1, 3>(axis, kErrorAttitude) = -turned.row(axis);
    innovation[axis] = -access.position_error(static_cast<base::Axis>(axis), north_east_um[axis],
                                              arm[axis], age_us);
  }
  // What the velocity may have changed since: white acceleration, integrated twice.
  const float moved = square(config_.acceleration_m_s2) * age * age * age / 3.0F;
  return access.fuse<2>(NavMeasurement::kPosition, rows, innovation,
                        Column<2>::Constant(variance + moved), kGate2);
}

}  // namespace leadline::estimator
