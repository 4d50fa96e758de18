#include "estimator/kalman_cv.hpp"

#include "estimator/wide.hpp"
#include "model/base/fixed.hpp"

namespace leadline::estimator {
namespace {

using base::clamp;
using base::max_of;

constexpr int kTimeBits = 20;
constexpr std::int64_t kMaxRate = std::int64_t{1} << 44U;
constexpr std::int64_t kMaxValue = std::int64_t{1} << 60U;

std::int64_t seconds_q20(base::TimeUs duration_us) {
  return (clamp<base::TimeUs>(duration_us, 0, kMaxStep_us) * (1 << kTimeBits) + 500'000) /
         1'000'000;
}

std::int64_t times_seconds(std::int64_t value, std::int64_t dt_q20) {
  return mul_round(value, dt_q20, kTimeBits);
}

std::int64_t square(std::int64_t value) { return mul_div(value, value, 1); }

}  // namespace

std::int64_t sqrt_up(std::int64_t value) {
  if (value <= 0) {
    return 0;
  }
  // sqrt_u64 is good to 2^-14.
  const std::int64_t root = base::sqrt_u64(static_cast<std::uint64_t>(value));
  return root + (root >> 14) + 1;
}

void KalmanCv::start(base::TimeUs t_us, std::int64_t value, std::int64_t sigma) {
  t_us_ = t_us;
  value_ = clamp(value, -kMaxValue, kMaxValue);
  rate_ = 0;
  variance_ = square(clamp<std::int64_t>(sigma, 1, kMaxSigma));
  covariance_ = 0;
  rate_variance_ = square(clamp<std::int64_t>(config_.start_rate, 1, kMaxSigma));
  innovation_ = 0;
  gated_in_a_row_ = 0;
  started_ = true;
}

void KalmanCv::predict(base::TimeUs t_us) {
  if (!started_ || t_us <= t_us_) {
    return;
  }
  const std::int64_t dt = seconds_q20(t_us - t_us_);
  t_us_ = t_us;
  value_ = clamp(add_limited(value_, times_seconds(rate_, dt)), -kMaxValue, kMaxValue);

  const std::int64_t density = square(clamp<std::int64_t>(config_.acceleration, 0, kMaxSigma));
  const std::int64_t noise_rate = times_seconds(density, dt);      // q dt
  const std::int64_t noise_both = times_seconds(noise_rate, dt);   // q dt^2
  const std::int64_t noise_value = times_seconds(noise_both, dt);  // q dt^3
  const std::int64_t drift = times_seconds(rate_variance_, dt);    // dt P_vv
  // P_xx + dt (2 P_xv + dt P_vv) + q dt^3/3
  const std::int64_t twice = add_limited(add_limited(covariance_, covariance_), drift);
  variance_ = add_limited(add_limited(variance_, times_seconds(twice, dt)), noise_value / 3);
  covariance_ = add_limited(add_limited(covariance_, drift), noise_both / 2);
  rate_variance_ = add_limited(rate_variance_, noise_rate);
  keep_sound();
}

Fusion KalmanCv::update(const Measurement& measurement) {
  if (!started_) {
    return Fusion::kNotReady;
  }
  // z = [1, -age] (value, rate) + noise of the sensor and of the acceleration within the age.
  const std::int64_t age = seconds_q20(measurement.age_us);
  const std::int64_t expected = value_ - times_seconds(rate_, age);
  std::int64_t innovation = clamp(measurement.value, -kMaxValue, kMaxValue) - expected;
  if (config_.wraps) {
    innovation = static_cast<std::int32_t>(static_cast<std::uint32_t>(innovation));
  }
  const std::int64_t density = square(clamp<std::int64_t>(config_.acceleration, 0, kMaxSigma));
  const std::int64_t aged = times_seconds(times_seconds(times_seconds(density, age), age), age) / 3;
  const std::int64_t spread_value = add_limited(variance_, -times_seconds(covariance_, age));
  const std::int64_t spread_rate = add_limited(covariance_, -times_seconds(rate_variance_, age));
  const std::int64_t past =
      max_of<std::int64_t>(1, add_limited(spread_value, -times_seconds(spread_rate, age)));
  const std::int64_t noise = square(clamp<std::int64_t>(measurement.sigma, 1, kMaxSigma));
  return fuse(innovation, spread_value, spread_rate, add_limited(add_limited(past, aged), noise));
}

Fusion KalmanCv::update_rate(std::int64_t rate, std::int64_t sigma) {
  if (!started_) {
    return Fusion::kNotReady;
  }
  const std::int64_t noise = square(clamp<std::int64_t>(sigma, 1, kMaxSigma));
  return fuse(rate - rate_, covariance_, rate_variance_, add_limited(rate_variance_, noise));
}

// Innovation of variance `total`, whose covariances with value and rate are the two spreads. The covariance
// loses spread * spread' / total: for exact numbers the Joseph form's result; here each entry is rounded once,
// so that the rounding is below one unit squared, and keep_sound() sees to the sign.
Fusion KalmanCv::fuse(std::int64_t innovation, std::int64_t spread_value, std::int64_t spread_rate,
                      std::int64_t total) {
  innovation_ = innovation;
  if (config_.gate_q8 > 0) {
    const std::int64_t limit = mul_round(sqrt_up(total), config_.gate_q8, 8);
    if (innovation > limit || innovation < -limit) {
      ++gated_in_a_row_;
      return Fusion::kGated;
    }
  }
  gated_in_a_row_ = 0;
  value_ =
      clamp(add_limited(value_, mul_div(innovation, spread_value, total)), -kMaxValue, kMaxValue);
  rate_ = clamp(add_limited(rate_, mul_div(innovation, spread_rate, total)), -kMaxRate, kMaxRate);
  variance_ -= mul_div(spread_value, spread_value, total);
  covariance_ -= mul_div(spread_value, spread_rate, total);
  rate_variance_ -= mul_div(spread_rate, spread_rate, total);
  keep_sound();
  return Fusion::kFused;
}

// Variances within 1 .. kMaxVariance and a correlation within +-1.
void KalmanCv::keep_sound() {
  variance_ = clamp<std::int64_t>(variance_, 1, kMaxVariance);
  rate_variance_ = clamp<std::int64_t>(rate_variance_, 1, kMaxVariance);
  // The roots are good to 2^-14: a correlation beyond 1 by less than that is what may remain.
  const std::int64_t bound =
      static_cast<std::int64_t>(base::sqrt_u64(static_cast<std::uint64_t>(variance_))) *
      static_cast<std::int64_t>(base::sqrt_u64(static_cast<std::uint64_t>(rate_variance_)));
  covariance_ = clamp(covariance_, -bound, bound);
}

std::int64_t KalmanCv::sigma() const { return sqrt_up(variance_); }

}  // namespace leadline::estimator
