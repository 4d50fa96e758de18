// Constant-velocity Kalman filter of one axis (method 1.5): a value and its rate, full 2 x 2 covariance, in
// 64-bit integers, the same bits on every machine.
//
// The unit of the value is the caller's (micrometre, 2^-32 turn) and small against every sigma: the
// covariance is kept in its square. Time is seconds in Q20.
//
// Process noise is white acceleration of density q = sigma_a^2 * 1 s, integrated over the step:
//   Q = q [dt^3/3, dt^2/2; dt^2/2, dt]
// so that a gap grows the covariance alike in one step or in many (DESIGN.md).
//
// Scaling: value +-2^60, rate +-2^44 per second, sigmas up to 2^31 units and units per second (kMaxSigma),
// variances therefore below 2^62; all products are 128 bits wide, rounded and limited (wide.hpp).
#pragma once

#include <cstdint>

#include "model/base/units.hpp"

namespace leadline::estimator {

/// Largest sigma of a value and of a rate: growth stops there.
inline constexpr std::int64_t kMaxSigma = std::int64_t{1} << 31U;
inline constexpr std::int64_t kMaxVariance = kMaxSigma * kMaxSigma;
/// Longest step of predict(); a longer one counts as this, at which every sigma has long met its limit.
inline constexpr base::TimeUs kMaxStep_us = 3'600'000'000;

/// What became of a measurement.
enum class Fusion : std::uint8_t {
  kFused = 0,
  kGated = 1,     ///< innovation beyond the gate: nothing changed
  kNotReady = 2,  ///< no state yet: start() first
};

struct KalmanConfig {
  std::int64_t acceleration;  ///< sigma_a, units/s^2, 0 .. 2^31
  std::int64_t start_rate;    ///< sigma of the rate at the start, units/s, 1 .. kMaxSigma
  std::int32_t gate_q8;       ///< innovations beyond gate * sigma are refused; 0 = no gate
  bool wraps;                 ///< the value is an angle: differences modulo 2^32
};

/// One measurement of the value: `value` as it was `age_us` before the filter's time.
struct Measurement {
  std::int64_t value;
  std::int64_t sigma;   ///< 1 .. kMaxSigma
  base::TimeUs age_us;  ///< >= 0
};

/// Trivially copyable. Every call is O(1).
class KalmanCv {
 public:
  KalmanCv() = default;
  explicit KalmanCv(const KalmanConfig& config) : config_(config) {}

  /// State from a first measurement, at rest.
  void start(base::TimeUs t_us, std::int64_t value, std::int64_t sigma);
  /// Forgets the state, not the configuration.
  void reset() { started_ = false; }
  [[nodiscard]] bool started() const { return started_; }

  /// Moves the state on to `t_us`; an earlier instant than its own changes nothing.
  void predict(base::TimeUs t_us);

  /// Merges a measurement of the value. An age counts: the value is compared with what the state says it
  /// was then, less certain by the process noise in between.
  Fusion update(const Measurement& measurement);
  /// Merges a measurement of the rate now, units/s.
  Fusion update_rate(std::int64_t rate, std::int64_t sigma);

  [[nodiscard]] base::TimeUs t_us() const { return t_us_; }
  /// Angles: the low 32 bits are the binary angle.
  [[nodiscard]] std::int64_t value() const { return value_; }
  [[nodiscard]] std::int64_t rate() const { return rate_; }
  [[nodiscard]] std::int64_t variance() const { return variance_; }
  [[nodiscard]] std::int64_t covariance() const { return covariance_; }
  [[nodiscard]] std::int64_t rate_variance() const { return rate_variance_; }
  /// One sigma of the value, rounded up within 2^-13.
  [[nodiscard]] std::int64_t sigma() const;
  /// Measurements refused since the last one that was not.
  [[nodiscard]] std::uint32_t gated_in_a_row() const { return gated_in_a_row_; }
  /// Innovation of the last measurement, fused or not.
  [[nodiscard]] std::int64_t innovation() const { return innovation_; }

 private:
  Fusion fuse(std::int64_t innovation, std::int64_t spread_value, std::int64_t spread_rate,
              std::int64_t total);
  void keep_sound();

  KalmanConfig config_{};
  base::TimeUs t_us_ = 0;
  std::int64_t value_ = 0;
  std::int64_t rate_ = 0;
  std::int64_t variance_ = 0;
  std::int64_t covariance_ = 0;
  std::int64_t rate_variance_ = 0;
  std::int64_t innovation_ = 0;
  std::uint32_t gated_in_a_row_ = 0;
  bool started_ = false;
};

/// sqrt rounded up within 2^-13; 0 for 0.
[[nodiscard]] std::int64_t sqrt_up(std::int64_t value);

}  // namespace leadline::estimator
