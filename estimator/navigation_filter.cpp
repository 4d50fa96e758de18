#include "estimator/navigation_filter.hpp"

#include "estimator/filter_access.hpp"
#include "model/base/angle.hpp"
#include "model/base/fixed.hpp"

namespace leadline::estimator {
namespace {

using base::clamp;
using base::TimeUs;

// A quarter of a mission without any sensor: every sigma has met its limit by then.
constexpr TimeUs kLongestStep_us = 3'600'000'000;
// Where growth stops: 2 km, 20 m/s, half a turn, 0.2 rad/s, 5 m/s, a quarter.
constexpr float kMaxVariances[kErrorStates] = {4e6F,  4e6F,  4e6F,  400.0F, 400.0F, 400.0F,
                                               10.0F, 10.0F, 10.0F, 0.04F,  0.04F,  0.04F,
                                               25.0F, 25.0F, 0.06F, 0.06F};
constexpr float kMinVariance = 1e-14F;
// A velocity sensor that is silent for so long says nothing about how the vehicle moves now.
constexpr TimeUs kMotionHold_us = 3'000'000;

Eigen::Matrix<float, 4, 1> quaternion_of(const base::Attitude& attitude) {
  const auto half = [](base::Bam32 angle, float& s, float& c) {
    // Half of the signed angle, so that the sign of the quaternion does not depend on the wrap.
    const auto signed_half = static_cast<base::Bam32>(static_cast<std::int32_t>(angle) / 2);
    s = static_cast<float>(base::sin_q30(signed_half)) * 0x1p-30F;
    c = static_cast<float>(base::cos_q30(signed_half)) * 0x1p-30F;
  };
  float sr = 0;
  float cr = 0;
  float sp = 0;
  float cp = 0;
  float sh = 0;
  float ch = 0;
  half(attitude.roll_bam32, sr, cr);
  half(attitude.pitch_bam32, sp, cp);
  half(attitude.heading_bam32, sh, ch);
  return {cr * cp * ch + sr * sp * sh, sr * cp * ch - cr * sp * sh, cr * sp * ch + sr * cp * sh,
          cr * cp * sh - sr * sp * ch};
}

// q <- p * q, normalized.
void turn(std::array<float, 4>& q, const float (&p)[4]) {
  const float w = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3];
  const float x = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2];
  const float y = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1];
  const float z = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0];
  const float length = std::sqrt(w * w + x * x + y * y + z * z);
  if (!(length > 0.1F && length < 10.0F)) {
    return;  // an error that no measurement within its gate makes
  }
  q = {w / length, x / length, y / length, z / length};
}

// Rotation by the vector `angle` (radians, up to about one): sine and cosine of half its length by their
// series, the same everywhere.
void quaternion_of_vector(const Vector3& angle, float (&q)[4]) {
  const float half2 = 0.25F * angle.squaredNorm();
  const float sine_over =
      0.5F * (1.0F - half2 / 6.0F * (1.0F - half2 / 20.0F * (1.0F - half2 / 42.0F)));
  q[0] = 1.0F - half2 / 2.0F * (1.0F - half2 / 12.0F * (1.0F - half2 / 30.0F));
  for (int i = 0; i < 3; ++i) {
    q[i + 1] = angle[i] * sine_over;
  }
}

// Adds white noise of density `q` that is integrated once, over dt, to value and rate of one axis.
void add_motion_noise(Eigen::Map<ErrorMatrix>& p, int value, int rate, float q, float dt) {
  p(value, value) += q * dt * dt * dt / 3.0F;
  p(value, rate) += q * dt * dt / 2.0F;
  p(rate, value) += q * dt * dt / 2.0F;
  p(rate, rate) += q * dt;
}

// Turns the horizontal velocity, and its errors with it, by a small angle about down.
void turn_velocity(const FilterAccess& access, float angle) {
  const float s = angle * (1.0F - angle * angle / 6.0F);
  const float c = 1.0F - angle * angle / 2.0F;
  access.turn_velocity(c, s);
  Eigen::Map<ErrorMatrix> p = access.covariance();
  const ErrorVector north_row = p.row(kErrorVelocity).transpose();
  const ErrorVector east_row = p.row(kErrorVelocity + 1).transpose();
  p.row(kErrorVelocity) = (c * north_row - s * east_row).transpose();
  p.row(kErrorVelocity + 1) = (s * north_row + c * east_row).transpose();
  const ErrorVector north = p.col(kErrorVelocity);
  const ErrorVector east = p.col(kErrorVelocity + 1);
  p.col(kErrorVelocity) = c * north - s * east;
  p.col(kErrorVelocity + 1) = s * north + c * east;
}

std::uint32_t rounded_up(float value) {
  return value >= 4e9F ? UINT32_MAX : static_cast<std::uint32_t>(value) + 1U;
}

}  // namespace

std::int64_t micrometres(float value_m) {
  if (!(value_m >= -9e9F && value_m <= 9e9F)) {
    return 0;
  }
  const float um = value_m * 1e6F;
  return static_cast<std::int64_t>(um + (um < 0.0F ? -0.5F : 0.5F));
}

Matrix3 rotation_of(const std::array<float, 4>& quaternion) {
  const float w = quaternion[0];
  const float x = quaternion[1];
  const float y = quaternion[2];
  const float z = quaternion[3];
  Matrix3 r;
  r << 1.0F - 2.0F * (y * y + z * z), 2.0F * (x * y - w * z), 2.0F * (x * z + w * y),
      2.0F * (x * y + w * z), 1.0F - 2.0F * (x * x + z * z), 2.0F * (y * z - w * x),
      2.0F * (x * z - w * y), 2.0F * (y * z + w * x), 1.0F - 2.0F * (x * x + y * y);
  return r;
}

Vector3 FilterAccess::rates() const {
  if (!filter.rates_valid_) {
    return Vector3::Zero();
  }
  return {filter.rates_[0] - filter.extra_[0], filter.rates_[1] - filter.extra_[1],
          filter.rates_[2] - filter.extra_[2]};
}

float FilterAccess::rate_variance() const {
  return filter.rates_valid_ ? square(config().rate_noise_rad_rts) / filter.rates_interval_s_
                             : square(config().turn_rate_rad_s);
}

float FilterAccess::position_error(base::Axis axis, std::int64_t measured_um, float lever_ned_m,
                                   TimeUs age_us) const {
  const std::int64_t here_um = filter.position_um(axis, age_us);
  constexpr std::int64_t kFar_um = 9'000'000'000'000'000;
  return metres(clamp<std::int64_t>(here_um - measured_um, -kFar_um, kFar_um)) + lever_ned_m;
}

void FilterAccess::turn_velocity(float cosine, float sine) const {
  const float north = filter.velocity_[0];
  const float east = filter.velocity_[1];
  filter.velocity_[0] = cosine * north - sine * east;
  filter.velocity_[1] = sine * north + cosine * east;
}

void FilterAccess::set_variance(int index, float variance) const {
  Eigen::Map<ErrorMatrix> p = covariance();
  p.row(index).setZero();
  p.col(index).setZero();
  p(index, index) = variance;
}

void FilterAccess::set_position(base::Axis axis, std::int64_t um, float variance,
                                TimeUs age_us) const {
  const int index = kErrorPosition + static_cast<int>(axis);
  const float dt = seconds(age_us);
  filter.position_um_[axis] = um + micrometres(filter.velocity_[axis] * dt);
  set_variance(index, variance);
  // Moved on from the measured instant, as predict() does.
  Eigen::Map<ErrorMatrix> p = covariance();
  const int rate = kErrorVelocity + static_cast<int>(axis);
  p.row(index) += dt * p.row(rate);
  p.col(index) += dt * p.col(rate);
  keep_sound();
}

void FilterAccess::set_attitude(const base::Attitude& attitude) const {
  const Eigen::Matrix<float, 4, 1> q = quaternion_of(attitude);
  filter.quaternion_ = {q[0], q[1], q[2], q[3]};
}

// Joseph's form in two steps, (I - k h) P and then times (I - k h)' plus k r k': what cancels in the first
// step is multiplied by what is left of it in the second, so single precision does. Right for any gain.
float FilterAccess::merge(const ErrorVector& row, float innovation, float noise, bool body_velocity,
                          ErrorVector& error) const {
  Eigen::Map<ErrorMatrix> p = covariance();
  const ErrorVector spread = p * row;
  const float total = row.dot(spread) + noise;
  if (!(total > 0.0F)) {
    return INFINITY;
  }
  const float rest = innovation - row.dot(error);
  ErrorVector gain = spread / total;
  if (body_velocity) {
    gain[kErrorScale] = 0.0F;
    gain[kErrorMisalignment] = 0.0F;
  }
  error += gain * rest;
  ErrorMatrix half = p;
  half.noalias() -= gain * spread.transpose();
  const ErrorVector left = half * row;
  half.noalias() -= left * gain.transpose();
  half.noalias() += (noise * gain) * gain.transpose();
  p = half;
  return rest * rest / total;
}

bool FilterAccess::holds_motion_back() const {
  return filter.held_back_[0] > 0.0F || filter.held_back_[1] > 0.0F || filter.held_back_[2] > 0.0F;
}

// As predict() would have added it, evenly over the time since.
void FilterAccess::give_motion_back() const {
  Eigen::Map<ErrorMatrix> p = covariance();
  const float dt = seconds(filter.t_us_ - filter.motion_us_);
  for (int axis = 0; axis < 3; ++axis) {
    float& held = filter.held_back_[static_cast<std::size_t>(axis)];
    if (dt > 0.0F) {
      add_motion_noise(p, kErrorPosition + axis, kErrorVelocity + axis, held / dt, dt);
    }
    held = 0.0F;
  }
}

// Raised to the innovation's excess: in the long run the mean square of the innovations is then what the
// covariance says, whatever the motion. The first measurements weigh more, so that what is configured does not
// last; one alone weighs no more than kMostExcess (of honest ones one in 100,000 is longer), so that a wild one does not
// open the gate for others. A sensor that
// is noisier than the vehicle moves says nothing about motion: where little of the variance is the state's, the noise does
// not shrink further. Without rates turns are not foreseen and the noise stays.
void FilterAccess::follow_motion(float nis, float share) const {
  filter.last_nis_ = nis;
  const float nis_per_dimension = nis / 3.0F;
  constexpr float kMostExcess = 8.0F;
  constexpr float kLeastMotion = 1e-4F;
  constexpr float kMostMotion = 16.0F;
  if (!(config().motion_gain > 0.0F && filter.rates_valid_)) {
    return;
  }
  const std::uint32_t before = filter.motion_count_;
  filter.motion_count_ += before < UINT32_MAX ? 1U : 0U;
  filter.motion_us_ = filter.t_us_;
  filter.held_back_ = {};
  if (before == 0) {
    return;  // says how well the velocity was known, not how it moves
  }
  const float mean_gain = 1.0F / static_cast<float>(before);
  const float gain = mean_gain > config().motion_gain ? mean_gain : config().motion_gain;
  const float excess =
      nis_per_dimension < 1.0F + kMostExcess ? nis_per_dimension - 1.0F : kMostExcess;
  constexpr float kLeastShare = 0.1F;
  if (excess < 0.0F && !(share > kLeastShare)) {
    return;
  }
  // exp(gain * excess), near enough and the same everywhere.
  const float eighth = 1.0F + gain * excess / 8.0F;
  filter.motion_ =
      clamp(filter.motion_ * square(square(square(eighth))), kLeastMotion, kMostMotion);
}

Fusion FilterAccess::accept(NavMeasurement kind) const {
  NavMeasurementCounters& counters = filter.counters_[static_cast<std::size_t>(kind)];
  ++counters.fused;
  counters.gated_in_a_row = 0;
  filter.faults_ &= ~(1U << static_cast<unsigned>(kind));
  return Fusion::kFused;
}

Fusion FilterAccess::refuse(NavMeasurement kind) const {
  NavMeasurementCounters& counters = filter.counters_[static_cast<std::size_t>(kind)];
  ++counters.gated;
  ++counters.gated_in_a_row;
  if (counters.gated_in_a_row >= kFaultCount) {
    filter.faults_ |= 1U << static_cast<unsigned>(kind);
    const bool velocity = kind == NavMeasurement::kVelocityBottom ||
                          kind == NavMeasurement::kVelocityWater ||
                          kind == NavMeasurement::kVelocityWorld;
    if (velocity) {
      // The velocity in the state is wrong, or the sensor is; to believe neither is to find out. Without this
      // a state once off would refuse for good what would mend it.
      for (int axis = 0; axis < 3; ++axis) {
        set_variance(kErrorVelocity + axis, square(config().start_speed_m_s));
      }
    }
  }
  return Fusion::kGated;
}

void FilterAccess::inject(const ErrorVector& error) const {
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    filter.position_um_[i] += micrometres(error[kErrorPosition + axis]);
    filter.velocity_[i] += error[kErrorVelocity + axis];
  }
  float q[4];
  quaternion_of_vector(error.segment<3>(kErrorAttitude), q);
  turn(filter.quaternion_, q);
  for (int i = kFirstExtra; i < kErrorStates; ++i) {
    filter.extra_[static_cast<std::size_t>(i - kFirstExtra)] += error[i];
  }
}

// Symmetric, variances within their limits, correlations within one. What cannot be kept so is rebuilt, and
// said.
void FilterAccess::keep_sound() const {
  Eigen::Map<ErrorMatrix> p = covariance();
  bool sound = true;
  for (int i = 0; i < kErrorStates; ++i) {
    const float variance = p(i, i);
    if (!(variance > kMinVariance)) {
      sound = sound && variance > -kMinVariance;
      p(i, i) = kMinVariance;
    }
    if (!(p(i, i) <= kMaxVariances[i])) {
      sound = sound && p(i, i) < INFINITY;
      set_variance(i, kMaxVariances[i]);
    }
  }
  for (int i = 0; i < kErrorStates; ++i) {
    for (int j = 0; j < i; ++j) {
      const float limit = std::sqrt(p(i, i)) * std::sqrt(p(j, j));
      float value = 0.5F * (p(i, j) + p(j, i));
      if (!(value <= limit)) {
        sound = sound && value < INFINITY;
        value = value > 0.0F ? limit : 0.0F;
      }
      value = value < -limit ? -limit : value;
      p(i, j) = value;
      p(j, i) = value;
    }
  }
  if (!sound) {
    filter.faults_ |= kFaultCovariance;
  }
}

void NavigationFilter::reset() {
  t_us_ = 0;
  any_ = false;
  horizontal_started_ = false;
  vertical_started_ = false;
  level_started_ = false;
  heading_started_ = false;
  rates_valid_ = false;
  position_um_ = {};
  velocity_ = {};
  quaternion_ = {1.0F, 0.0F, 0.0F, 0.0F};
  rates_ = {};
  rates_interval_s_ = 1.0F;
  extra_ = {};
  counters_ = {};
  faults_ = 0;
  last_nis_ = 0.0F;
  last_dimension_ = 0;
  motion_ = 1.0F;
  motion_count_ = 0;
  motion_us_ = 0;
  held_back_ = {};
  covariance_ = {};
  const FilterAccess access{*this};
  Eigen::Map<ErrorMatrix> p = access.covariance();
  for (int axis = 0; axis < 3; ++axis) {
    p(kErrorPosition + axis, kErrorPosition + axis) = kMaxVariances[axis];
    p(kErrorVelocity + axis, kErrorVelocity + axis) = square(config_.start_speed_m_s);
    p(kErrorAttitude + axis, kErrorAttitude + axis) = kMaxVariances[kErrorAttitude];
    p(kErrorRateBias + axis, kErrorRateBias + axis) = square(config_.rate_bias_rad_s);
  }
  p(kErrorCurrent, kErrorCurrent) = square(config_.current_m_s);
  p(kErrorCurrent + 1, kErrorCurrent + 1) = square(config_.current_m_s);
  p(kErrorScale, kErrorScale) = square(config_.velocity_scale);
  p(kErrorMisalignment, kErrorMisalignment) = square(config_.velocity_misalignment_rad);
  access.keep_sound();
  faults_ = 0;
}

void NavigationFilter::set_rates(const std::int64_t rate_urad_s[3]) {
  constexpr std::int64_t kFastest_urad_s = 35'000'000;  // 2,000 degrees a second
  for (std::size_t i = 0; i < 3; ++i) {
    if (rate_urad_s[i] < -kFastest_urad_s || rate_urad_s[i] > kFastest_urad_s) {
      return;
    }
  }
  for (std::size_t i = 0; i < 3; ++i) {
    rates_[i] = static_cast<float>(rate_urad_s[i]) * 1e-6F;
  }
  if (rates_valid_) {
    constexpr TimeUs kShortest_us = 1'000;
    rates_interval_s_ = seconds(base::max_of(t_us_ - rates_us_, kShortest_us));
  }
  rates_valid_ = true;
  rates_us_ = t_us_;
}

void NavigationFilter::predict(TimeUs t_us) {
  if (!any_) {
    any_ = true;
    t_us_ = t_us;
    return;
  }
  if (t_us <= t_us_) {
    return;
  }
  const float dt = seconds(base::min_of(t_us - t_us_, kLongestStep_us));
  t_us_ = t_us;
  const FilterAccess access{*this};
  Eigen::Map<ErrorMatrix> p = access.covariance();

  for (std::size_t axis = 0; axis < 3; ++axis) {
    position_um_[axis] += micrometres(velocity_[axis] * dt);
  }
  p.middleRows<3>(kErrorPosition) += dt * p.middleRows<3>(kErrorVelocity);
  p.middleCols<3>(kErrorPosition) += dt * p.middleCols<3>(kErrorVelocity);
  rates_valid_ = rates_valid_ && t_us - rates_us_ <= kRatesHold_us;
  if (motion_count_ > 0 && t_us - motion_us_ > kMotionHold_us) {
    access.give_motion_back();
    motion_ = 1.0F;
    motion_count_ = 0;
  }
  float q_horizontal = square(config_.acceleration_m_s2);
  if (motion_count_ > 0) {
    q_horizontal += square(config_.turn_slip * access.rates()[2]) *
                    (square(velocity_[0]) + square(velocity_[1]));
  }
  for (int axis = 0; axis < 3; ++axis) {
    const float q = axis == 2 ? square(config_.vertical_acceleration_m_s2) : q_horizontal;
    add_motion_noise(p, kErrorPosition + axis, kErrorVelocity + axis, motion_ * q, dt);
    if (motion_ < 1.0F) {
      held_back_[static_cast<std::size_t>(axis)] += (1.0F - motion_) * q * dt;
    }
  }

  float turn_variance = square(config_.turn_rate_rad_s) * dt;
  if (rates_valid_) {
    const Matrix3 r = access.rotation();
    p.middleRows<3>(kErrorAttitude) -= (dt * r) * p.middleRows<3>(kErrorRateBias);
    p.middleCols<3>(kErrorAttitude) -= p.middleCols<3>(kErrorRateBias) * (dt * r).transpose();
    const Vector3 angle = r * access.rates() * dt;
    float q[4];
    quaternion_of_vector(angle, q);
    turn(quaternion_, q);
    if (config_.velocity_turns) {
      turn_velocity(access, angle[2]);
    }
    turn_variance = square(config_.rate_noise_rad_rts) * dt;
    for (int axis = 0; axis < 3; ++axis) {
      p(kErrorRateBias + axis, kErrorRateBias + axis) += square(config_.rate_bias_walk) * dt;
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    p(kErrorAttitude + axis, kErrorAttitude + axis) += turn_variance;
  }
  p(kErrorCurrent, kErrorCurrent) += square(config_.current_walk) * dt;
  p(kErrorCurrent + 1, kErrorCurrent + 1) += square(config_.current_walk) * dt;
  p(kErrorScale, kErrorScale) += square(config_.velocity_scale_walk) * dt;
  p(kErrorMisalignment, kErrorMisalignment) += square(config_.velocity_misalignment_walk_rad) * dt;
  access.keep_sound();
}

std::int64_t NavigationFilter::position_um(base::Axis axis, TimeUs age_us) const {
  return position_um_[axis] - micrometres(velocity_[axis] * seconds(age_us));
}

std::uint32_t NavigationFilter::sigma_position_mm(base::Axis axis) const {
  const std::size_t i = static_cast<std::size_t>(axis) * (kErrorStates + 1);
  return rounded_up(std::sqrt(covariance_[i]) * 1e3F);
}

std::int8_t NavigationFilter::correlation_q7(base::Axis a, base::Axis b) const {
  const auto at = [this](std::size_t i, std::size_t j) {
    return covariance_[i * kErrorStates + j];
  };
  const float limit = std::sqrt(at(a, a)) * std::sqrt(at(b, b));
  return static_cast<std::int8_t>(clamp(at(a, b) / limit * 127.0F, -127.0F, 127.0F));
}

std::int64_t NavigationFilter::velocity_um_s(base::Axis axis) const {
  return micrometres(velocity_[axis]);
}

base::Attitude NavigationFilter::attitude() const {
  const Matrix3 r = rotation_of(quaternion_);
  const auto q30 = [](float value) { return static_cast<std::int64_t>(value * 0x1p30F); };
  base::Attitude attitude{};
  attitude.roll_bam32 = base::atan2_bam32(q30(r(2, 1)), q30(r(2, 2)));
  const float level = std::sqrt(square(r(2, 1)) + square(r(2, 2)));
  attitude.pitch_bam32 = base::atan2_bam32(-q30(r(2, 0)), q30(level));
  attitude.heading_bam32 = base::atan2_bam32(q30(r(1, 0)), q30(r(0, 0)));
  return attitude;
}

std::uint32_t NavigationFilter::sigma_attitude_urad(int index) const {
  Vector3 axis(0.0F, 0.0F, 1.0F);
  if (index < 2) {
    const Vector3 forward = rotation_of(quaternion_).col(0);
    const float length = std::sqrt(square(forward[0]) + square(forward[1])) + 1e-6F;
    const float n = forward[0] / length;
    const float e = forward[1] / length;
    axis = index == 0 ? Vector3(n, e, 0.0F) : Vector3(-e, n, 0.0F);
  }
  const Matrix3 block =
      Eigen::Map<const ErrorMatrix>(covariance_.data()).block<3, 3>(kErrorAttitude, kErrorAttitude);
  const float variance = axis.dot(block * axis);
  return rounded_up(std::sqrt(variance > 0.0F ? variance : 0.0F) * 1e6F);
}

float NavigationFilter::state(int index) const {
  return extra_[static_cast<std::size_t>(index - kFirstExtra)];
}

float NavigationFilter::sigma(int index) const {
  return std::sqrt(covariance_[static_cast<std::size_t>(index) * (kErrorStates + 1)]);
}

}  // namespace leadline::estimator
