// Where the vehicle is, how it lies and how fast it goes, from every sensor that says something about it: an
// error-state Kalman filter with full covariance. Why so: DESIGN.md. What it reaches: README.md.
//
// Nominal state: position in integer micrometres (NED), velocity, attitude as a quaternion, biases.
// Error state, single precision (index, unit):
//   0-2   position, m NED             9-11  bias of the rate sensor, rad/s FRD
//   3-5   velocity, m/s NED           12-13 current of the water, m/s north and east
//   6-8   attitude, rad about NED     14    scale error of the velocity sensor (bottom and water)
//                                     15    yaw misalignment of the velocity sensor, rad
// where R_true = (I + [error]x) R_nominal.
//
// Process: white acceleration of density acceleration^2 * 1 s (constant velocity, integrated over the
// step, so a gap grows the covariance alike in one step or in many); attitude follows the rates where a
// sensor gives them, and otherwise is free to turn by `turn_rate` (what sensors measure passes through);
// biases, current, scale and misalignment wander.
//
// Motion is not white: next to nothing on a leg, bursts in turns. While a velocity sensor of the body is heard,
// the noise has a part that goes with speed and turning, and all of it times `motion`, which follows the length of
// that sensor's innovations. What this took away is given back before such a measurement that is longer than foreseen is
// merged, and when the sensor falls silent. What a velocity sensor errs by itself it cannot tell: scale and misalignment are learnt from
// everything else, and count in its measurements as what they are known to.
//
// One file per measurement (mm_*.cpp): the innovation, its row and its noise; gate, Joseph update and health
// are here, once. Innovations are gated by their squared length in sigmas, positive test: NaN never passes.
//
// Single precision only, no contraction, no vectorized reductions, no library function but sqrt: the same
// bits on every target. No heap, no clock. Every call is O(1): at most three products of 16 x 16 matrices.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "estimator/kalman_cv.hpp"
#include "model/base/pose.hpp"
#include "model/base/units.hpp"

namespace leadline::estimator {

inline constexpr int kErrorStates = 16;
inline constexpr std::size_t kCovarianceEntries = std::size_t{kErrorStates} * kErrorStates;

/// Kinds of measurements: indices of the counters, bits (1 << kind) of the faults.
enum class NavMeasurement : std::uint8_t {
  kPosition = 0,
  kDepth = 1,
  kLevel = 2,  ///< roll and pitch
  kHeading = 3,
  kVelocityBottom = 4,
  kVelocityWater = 5,
  kVelocityWorld = 6,
  kAltitude = 7,
};
inline constexpr int kNavMeasurements = 8;
/// Bit of faults() besides those of the measurements: the covariance was found unsound and rebuilt.
inline constexpr std::uint32_t kFaultCovariance = 1U << 31U;
/// As many measurements in a row beyond the gate raise the fault bit of their kind; the next one that is
/// merged clears it.
inline constexpr std::uint32_t kFaultCount = 5;

struct NavMeasurementCounters {
  std::uint32_t fused;
  std::uint32_t gated;
  std::uint32_t gated_in_a_row;
};

/// One sigma, SI units. Defaults: a small survey vehicle with a MEMS attitude sensor and a DVL.
struct NavigationFilterConfig {
  float acceleration_m_s2 = 0.2F;
  float vertical_acceleration_m_s2 = 0.2F;
  float start_speed_m_s = 2.0F;
  /// With rates: between measurements the velocity turns as the heading does (a vehicle that goes
  /// where its bow points); false: it keeps its direction over the ground.
  bool velocity_turns = true;
  float turn_rate_rad_s = 0.35F;     ///< without rates: how fast the attitude may change
  float rate_noise_rad_rts = 2e-3F;  ///< of the rate sensor, rad per root second
  float rate_bias_rad_s = 5e-3F;
  float rate_bias_walk = 2e-5F;  ///< rad/s per root second
  float current_m_s = 0.3F;
  float current_walk = 3e-3F;  ///< m/s per root second
  float velocity_scale = 5e-3F;
  float velocity_misalignment_rad = 1e-2F;
  float velocity_scale_walk = 5e-4F;             ///< per root second
  float velocity_misalignment_walk_rad = 5e-4F;  ///< rad per root second
  /// How much of a velocity's innovation goes into the motion noise: 1 / gain measurements long is its
  /// memory. 0: the noise stays what is configured, in turns as well.
  float motion_gain = 0.2F;
  float turn_slip = 2.0F;  ///< acceleration beyond the configured one, in speed * rate of turn
};

/// A measured vector or value with what is needed to merge it.
struct LeverArm {
  std::int32_t forward_mm = 0;
  std::int32_t right_mm = 0;
  std::int32_t down_mm = 0;
};

/// Trivially copyable. All angles enter and leave as binary angles.
class NavigationFilter {
 public:
  NavigationFilter() { reset(); }
  explicit NavigationFilter(const NavigationFilterConfig& config) : config_(config) { reset(); }

  /// Forgets the state and the counters, not the configuration.
  void reset();

  /// Moves the state on to `t_us`; an earlier instant than its own changes nothing. The first call sets
  /// the time.
  void predict(base::TimeUs t_us);
  [[nodiscard]] base::TimeUs t_us() const { return t_us_; }

  /// Rates of the body about forward, right, down, as measured now: predict() uses them until
  /// kRatesHold_us later, and turns by them from here on.
  void set_rates(const std::int64_t rate_urad_s[3]);
  static constexpr base::TimeUs kRatesHold_us = 250'000;
  [[nodiscard]] bool has_rates() const { return rates_valid_; }

  // Measurements. `age_us` >= 0: how long before the filter's time they were true. sigma > 0. The first of
  // its kind starts its part of the state (kFused); velocities before that are kNotReady.

  /// North and east of the sensor at `lever`.
  Fusion update_position(const std::int64_t north_east_um[2], std::int64_t sigma_um,
                         const LeverArm& lever, base::TimeUs age_us);
  /// Depth of the sensor at `lever`.
  Fusion update_depth(std::int64_t depth_um, std::int64_t sigma_um, const LeverArm& lever,
                      base::TimeUs age_us);
  Fusion update_level(base::Bam32 roll_bam32, base::Bam32 pitch_bam32,
                      const std::uint32_t sigma_urad[2], base::TimeUs age_us);
  /// From the north that the positions use (grid).
  Fusion update_heading(base::Bam32 heading_bam32, std::uint32_t sigma_urad, base::TimeUs age_us);
  /// Velocity over the ground of the sensor at `lever`, FRD; its scale and misalignment are estimated.
  Fusion update_velocity_bottom(const std::int64_t velocity_um_s[3], std::int64_t sigma_um_s,
                                const LeverArm& lever, base::TimeUs age_us);
  /// The same through the water; the current is estimated.
  Fusion update_velocity_water(const std::int64_t velocity_um_s[3], std::int64_t sigma_um_s,
                               const LeverArm& lever, base::TimeUs age_us);
  /// Velocity over the ground, NED.
  Fusion update_velocity_world(const std::int64_t velocity_um_s[3], std::int64_t sigma_um_s,
                               base::TimeUs age_us);
  /// Height of the sensor above a bottom whose depth the map knows.
  Fusion update_altitude(std::int64_t altitude_um, std::int64_t bottom_depth_um,
                         std::int64_t sigma_um, const LeverArm& lever, base::TimeUs age_us);

  /// Starts a part of the state anew: what measurements agree on is right, the state is not.
  void restart_horizontal() { horizontal_started_ = false; }
  void restart_vertical() { vertical_started_ = false; }
  void restart_heading() { heading_started_ = false; }
  void restart_level() { level_started_ = false; }

  [[nodiscard]] bool horizontal_started() const { return horizontal_started_; }
  [[nodiscard]] bool vertical_started() const { return vertical_started_; }
  /// Roll, pitch and heading.
  [[nodiscard]] bool attitude_started() const { return level_started_ && heading_started_; }

  /// Position of the reference point `age_us` ago, micrometres.
  [[nodiscard]] std::int64_t position_um(base::Axis axis, base::TimeUs age_us) const;
  [[nodiscard]] std::uint32_t sigma_position_mm(base::Axis axis) const;
  /// Correlation coefficient of two axes of position * 128.
  [[nodiscard]] std::int8_t correlation_q7(base::Axis a, base::Axis b) const;
  [[nodiscard]] std::int64_t velocity_um_s(base::Axis axis) const;
  [[nodiscard]] base::Attitude attitude() const;
  /// About forward-level (roll), right-level (pitch) and down (heading), microradians.
  [[nodiscard]] std::uint32_t sigma_attitude_urad(int index) const;
  /// Estimates of the further states, for reports and tests, and their one sigma. Index 9 .. 15.
  [[nodiscard]] float state(int index) const;
  [[nodiscard]] float sigma(int index) const;

  [[nodiscard]] const NavMeasurementCounters& counters(NavMeasurement kind) const {
    return counters_[static_cast<std::size_t>(kind)];
  }
  [[nodiscard]] std::uint32_t faults() const { return faults_; }
  /// Squared length of the last innovation in sigmas as they were foreseen, and its dimension (0: none yet).
  [[nodiscard]] float last_nis() const { return last_nis_; }
  [[nodiscard]] int last_dimension() const { return last_dimension_; }
  /// Motion noise in use, of that configured; 1 without a velocity sensor of the body.
  [[nodiscard]] float motion() const { return motion_; }
  /// 16 x 16, row by row, symmetric.
  [[nodiscard]] const std::array<float, kCovarianceEntries>& covariance() const {
    return covariance_;
  }

 private:
  friend struct FilterAccess;

  NavigationFilterConfig config_;
  base::TimeUs t_us_ = 0;
  bool any_ = false;
  bool horizontal_started_ = false;
  bool vertical_started_ = false;
  bool level_started_ = false;
  bool heading_started_ = false;
  bool rates_valid_ = false;
  base::TimeUs rates_us_ = 0;
  std::array<std::int64_t, 3> position_um_{};
  std::array<float, 3> velocity_{};    ///< m/s NED
  std::array<float, 4> quaternion_{};  ///< w, x, y, z; body to NED, length 1
  std::array<float, 3> rates_{};       ///< as measured, rad/s
  float rates_interval_s_ = 1.0F;      ///< between the last two
  std::array<float, 7> extra_{};       ///< error states 9 .. 15 as estimated
  std::array<float, kCovarianceEntries> covariance_{};
  float motion_ = 1.0F;
  std::uint32_t motion_count_ = 0;  ///< velocities that made it
  base::TimeUs motion_us_ = 0;      ///< the last of them
  std::array<float, 3>
      held_back_{};  ///< variance of the velocity that `motion_` took away since then
  std::array<NavMeasurementCounters, kNavMeasurements> counters_{};
  std::uint32_t faults_ = 0;
  float last_nis_ = 0.0F;
  int last_dimension_ = 0;
};

}  // namespace leadline::estimator
