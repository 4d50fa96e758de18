// The inside of the navigation filter, for its own files (navigation_filter.cpp, mm_*.cpp): its arrays as
// matrices, and the one way in which a measurement is gated and merged. Eigen stays behind this header.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

// Eigen's vectorized sums add in an order that differs from one instruction set to the next; plain loops
// do not. Its asserts are for sizes, which are all fixed here.
#define EIGEN_DONT_VECTORIZE
#define EIGEN_NO_MALLOC
#define EIGEN_NO_DEBUG
// NOLINTNEXTLINE(cppcoreguidelines-macro-usage): an option of Eigen
#define EIGEN_MAX_ALIGN_BYTES 0
#include <Eigen/Core>

#include "estimator/navigation_filter.hpp"

namespace leadline::estimator {

using Vector3 = Eigen::Matrix<float, 3, 1>;
using Matrix3 = Eigen::Matrix<float, 3, 3>;
using ErrorVector = Eigen::Matrix<float, kErrorStates, 1>;
using ErrorMatrix = Eigen::Matrix<float, kErrorStates, kErrorStates, Eigen::RowMajor>;
template <int kRows>
using Rows = Eigen::Matrix<float, kRows, kErrorStates>;
template <int kRows>
using Column = Eigen::Matrix<float, kRows, 1>;

/// First index of each part of the error state.
enum ErrorIndex : int {
  kErrorPosition = 0,
  kErrorVelocity = 3,
  kErrorAttitude = 6,
  kErrorRateBias = 9,
  kErrorCurrent = 12,
  kErrorScale = 14,
  kErrorMisalignment = 15,
};
inline constexpr int kFirstExtra = kErrorRateBias;

/// 5 sigma of one dimension, and the same probability in two and three.
inline constexpr float kGate1 = 25.0F;
inline constexpr float kGate2 = 28.7F;
inline constexpr float kGate3 = 31.8F;

[[nodiscard]] inline float metres(std::int64_t um) { return static_cast<float>(um) * 1e-6F; }
[[nodiscard]] inline float seconds(base::TimeUs us) { return static_cast<float>(us) * 1e-6F; }
[[nodiscard]] inline float radians(std::uint32_t urad) { return static_cast<float>(urad) * 1e-6F; }
[[nodiscard]] inline float square(float value) { return value * value; }

/// Signed difference of two binary angles, radians.
[[nodiscard]] inline float difference(base::Bam32 a, base::Bam32 b) {
  constexpr float kRadPerBam = 1.4629180792671596e-9F;
  return static_cast<float>(static_cast<std::int32_t>(a - b)) * kRadPerBam;
}

/// [v]x: cross(v, w) = skew(v) * w.
[[nodiscard]] inline Matrix3 skew(const Vector3& v) {
  Matrix3 m;
  m << 0.0F, -v[2], v[1], v[2], 0.0F, -v[0], -v[1], v[0], 0.0F;
  return m;
}

[[nodiscard]] inline Vector3 lever_metres(const LeverArm& lever) {
  return {static_cast<float>(lever.forward_mm) * 1e-3F, static_cast<float>(lever.right_mm) * 1e-3F,
          static_cast<float>(lever.down_mm) * 1e-3F};
}

/// Rounded micrometres of a length in metres, limited to +-9e9 m; 0 for NaN.
[[nodiscard]] std::int64_t micrometres(float value_m);

/// Body to NED, of a quaternion of length 1.
[[nodiscard]] Matrix3 rotation_of(const std::array<float, 4>& quaternion);

struct FilterAccess {
  NavigationFilter& filter;

  [[nodiscard]] Eigen::Map<ErrorMatrix> covariance() const {
    return Eigen::Map<ErrorMatrix>(filter.covariance_.data());
  }
  [[nodiscard]] Vector3 velocity() const {
    return {filter.velocity_[0], filter.velocity_[1], filter.velocity_[2]};
  }
  [[nodiscard]] Matrix3 rotation() const { return rotation_of(filter.quaternion_); }
  /// Bias taken off; zero where no sensor gives them.
  [[nodiscard]] Vector3 rates() const;
  /// Of one axis of rates(), (rad/s)^2.
  [[nodiscard]] float rate_variance() const;
  [[nodiscard]] float extra(int error_index) const {
    return filter.extra_[static_cast<std::size_t>(error_index - kFirstExtra)];
  }
  [[nodiscard]] const NavigationFilterConfig& config() const { return filter.config_; }
  [[nodiscard]] float nis() const { return filter.last_nis_; }

  /// Where the sensor at `lever` was `age_us` ago as the state says, less `measured_um`: metres,
  /// exact over any distance.
  [[nodiscard]] float position_error(base::Axis axis, std::int64_t measured_um, float lever_ned_m,
                                     base::TimeUs age_us) const;

  /// Sets one error state's variance and forgets its correlations.
  void set_variance(int index, float variance) const;
  void set_position(base::Axis axis, std::int64_t um, float variance, base::TimeUs age_us) const;
  void set_attitude(const base::Attitude& attitude) const;
  /// Turns the horizontal velocity clockwise by the angle with this cosine and sine.
  void turn_velocity(float cosine, float sine) const;

  /// The motion noise was made smaller since the last body velocity.
  [[nodiscard]] bool holds_motion_back() const;
  /// Adds what it was made smaller by to the variances of velocity and position.
  void give_motion_back() const;
  /// A body velocity came whose innovation had this squared length in sigmas as they were foreseen; `share` of
  /// the variance is the state's, the rest the sensor's.
  void follow_motion(float nis, float share) const;
  /// Merges kRows components if their innovation passes the gate; false, and nothing changed: it does not.
  /// innovation = measured - predicted, with their rows and variances (independent of each other). Component by
  /// component: their squared lengths, each in the light of those before, add up to that of the whole.
  template <int kRows>
  [[nodiscard]] bool merged(NavMeasurement kind, const Rows<kRows>& rows,
                            const Column<kRows>& innovation, const Column<kRows>& noise,
                            float gate) const {
    const ErrorMatrix before = covariance();
    const bool body_velocity =
        kind == NavMeasurement::kVelocityBottom || kind == NavMeasurement::kVelocityWater;
    ErrorVector error = ErrorVector::Zero();
    float nis = 0.0F;
    for (int i = 0; i < kRows; ++i) {
      nis += merge(rows.row(i).transpose(), innovation[i], noise[i], body_velocity, error);
    }
    filter.last_nis_ = nis;
    filter.last_dimension_ = kRows;
    if (!(nis <= gate)) {
      covariance() = before;
      return false;
    }
    inject(error);
    keep_sound();
    return true;
  }
  /// merged(), counted under `kind`.
  template <int kRows>
  [[nodiscard]] Fusion fuse(NavMeasurement kind, const Rows<kRows>& rows,
                            const Column<kRows>& innovation, const Column<kRows>& noise,
                            float gate) const {
    return merged<kRows>(kind, rows, innovation, noise, gate) ? accept(kind) : refuse(kind);
  }
  [[nodiscard]] Fusion accept(NavMeasurement kind) const;
  [[nodiscard]] Fusion refuse(NavMeasurement kind) const;
  /// After a change of the covariance that was not a measurement's.
  void keep_sound() const;

 private:
  /// One scalar: updates covariance and error, returns its squared innovation in variances. A body velocity
  /// leaves its own scale and misalignment as they are.
  [[nodiscard]] float merge(const ErrorVector& row, float innovation, float noise,
                            bool body_velocity, ErrorVector& error) const;
  void inject(const ErrorVector& error) const;
};

}  // namespace leadline::estimator
