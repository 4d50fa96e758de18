// Velocity: of a Doppler log over the bottom or through the water (body, with the log's scale error s and yaw
// misalignment m), or over the ground in NED.
//   z = (1 + s) Rz(m)' (u + rate x l),   u = R' (v - current)
#include "estimator/filter_access.hpp"

namespace leadline::estimator {
namespace {

Vector3 cross(const Vector3& a, const Vector3& b) { return skew(a) * b; }

Vector3 metres_per_second(const std::int64_t velocity_um_s[3]) {
  return {metres(velocity_um_s[0]), metres(velocity_um_s[1]), metres(velocity_um_s[2])};
}

Fusion fuse_body(const FilterAccess& access, NavMeasurement kind,
                 const std::int64_t velocity_um_s[3], float variance, const LeverArm& lever,
                 const Vector3& current) {
  const Matrix3 r = access.rotation();
  const Vector3 through = access.velocity() - current;
  const Vector3 u = r.transpose() * through;
  const Vector3 arm = lever_metres(lever);
  const Vector3 at_sensor = u + cross(access.rates(), arm);
  // The misalignment is small: first order.
  const float m = access.extra(kErrorMisalignment);
  Matrix3 mount;
  mount << 1.0F, m, 0.0F, -m, 1.0F, 0.0F, 0.0F, 0.0F, 1.0F;
  const Matrix3 sensed = (1.0F + access.extra(kErrorScale)) * mount;

  Rows<3> rows = Rows<3>::Zero();
  rows.block<3, 3>(0, kErrorVelocity) = sensed * r.transpose();
  rows.block<3, 3>(0, kErrorAttitude) = sensed * r.transpose() * skew(through);
  // A larger bias is a smaller rate: -(b x l) = [l]x b.
  rows.block<3, 3>(0, kErrorRateBias) = sensed * skew(arm);
  if (kind == NavMeasurement::kVelocityWater) {
    rows.block<3, 2>(0, kErrorCurrent) = -(sensed * r.transpose()).leftCols<2>();
  }
  // Without the arm's part: its noise stands in the innovation as well, and would pull the scale to less,
  // a little at every measurement.
  rows.block<3, 1>(0, kErrorScale) = mount * u;
  rows(0, kErrorMisalignment) = u[1];
  rows(1, kErrorMisalignment) = -u[0];
  const Vector3 innovation = metres_per_second(velocity_um_s) - sensed * at_sensor;
  // The rate's own noise, at the end of the arm.
  const float arm_variance = access.rate_variance() * arm.squaredNorm();
  const Column<3> noise = Column<3>::Constant(variance + arm_variance);
  float expected = 0.0F;
  for (int i = 0; i < 3; ++i) {
    const ErrorVector row = rows.row(i).transpose();
    const ErrorVector spread = access.covariance() * row;
    expected += row.dot(spread);
  }
  // Longer than foreseen: the vehicle does what it did not before, and the log says how fast it goes.
  const bool held_back = access.holds_motion_back();
  constexpr float kForeseen3 = 3.0F;  // mean of three squares
  bool good = access.merged<3>(kind, rows, innovation, noise, held_back ? kForeseen3 : kGate3);
  const float nis = access.nis();
  if (!good && held_back) {
    access.give_motion_back();
    good = access.merged<3>(kind, rows, innovation, noise, kGate3);
  }
  access.follow_motion(nis, expected / (expected + noise.sum()));
  return good ? access.accept(kind) : access.refuse(kind);
}

}  // namespace

Fusion NavigationFilter::update_velocity_bottom(const std::int64_t velocity_um_s[3],
                                                std::int64_t sigma_um_s, const LeverArm& lever,
                                                base::TimeUs age_us) {
  if (!attitude_started()) {
    return Fusion::kNotReady;
  }
  const float variance =
      square(metres(sigma_um_s)) + square(config_.acceleration_m_s2) * seconds(age_us);
  return fuse_body(FilterAccess{*this}, NavMeasurement::kVelocityBottom, velocity_um_s, variance,
                   lever, Vector3::Zero());
}

Fusion NavigationFilter::update_velocity_water(const std::int64_t velocity_um_s[3],
                                               std::int64_t sigma_um_s, const LeverArm& lever,
                                               base::TimeUs age_us) {
  if (!attitude_started()) {
    return Fusion::kNotReady;
  }
  const FilterAccess access{*this};
  const float variance =
      square(metres(sigma_um_s)) + square(config_.acceleration_m_s2) * seconds(age_us);
  const Vector3 current(access.extra(kErrorCurrent), access.extra(kErrorCurrent + 1), 0.0F);
  return fuse_body(access, NavMeasurement::kVelocityWater, velocity_um_s, variance, lever, current);
}

Fusion NavigationFilter::update_velocity_world(const std::int64_t velocity_um_s[3],
                                               std::int64_t sigma_um_s, base::TimeUs age_us) {
  const FilterAccess access{*this};
  const float variance =
      square(metres(sigma_um_s)) + square(config_.acceleration_m_s2) * seconds(age_us);
  Rows<3> rows = Rows<3>::Zero();
  rows.block<3, 3>(0, kErrorVelocity) = Matrix3::Identity();
  const Vector3 innovation = metres_per_second(velocity_um_s) - access.velocity();
  return access.fuse<3>(NavMeasurement::kVelocityWorld, rows, innovation,
                        Column<3>::Constant(variance), kGate3);
}

}  // namespace leadline::estimator
