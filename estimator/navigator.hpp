// From sensor samples to poses: the navigation filter for position, velocity and what they depend on, one
// pose per attitude sample into the history. Attitude is as measured, or the filter's where a sensor gives
// rates. Why so: DESIGN.md. What it reaches: README.md.
//
// No heap, no clock: the result depends on the sequence of calls alone.
#pragma once

#include <array>
#include <cstdint>

#include "estimator/geodesy.hpp"
#include "estimator/kalman_cv.hpp"
#include "estimator/navigation_filter.hpp"
#include "estimator/pose_history.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/pose.hpp"
#include "model/base/status.hpp"

namespace leadline::estimator {

/// A sample that speaks of an instant this long before the newest one is still merged, at its own time;
/// an older one is dropped.
inline constexpr base::TimeUs kMaxSampleAge_us = 5'000'000;
/// Fixes or depths in a row beyond the gate that agree with each other: navigation jumped.
inline constexpr std::uint32_t kJumpCount = 5;
/// Samples in a row that are too old: the clock was set back.
inline constexpr std::uint32_t kStepBackCount = 50;
/// Without attitude for this long poses are made without it, this often.
inline constexpr base::TimeUs kBlindInterval_us = 1'000'000;

/// Where a sensor sits: its place from the reference point, and the rotation of its axes into the body's
/// (attitude, rates and velocities are turned by it).
struct SensorMount {
  LeverArm lever;
  base::Attitude boresight{};
};

struct NavigatorConfig {
  bool has_origin;
  /// With has_origin; otherwise the first fix that the next one confirms (within 1 km) is the origin.
  Geodetic origin;
  std::int32_t magnetic_variation_bam32;  ///< true = magnetic + variation
  std::int64_t surface_pressure_pa;
  std::int32_t water_density_g_m3;  ///< > 0
  std::int32_t gravity_um_s2;       ///< > 0
  // One sigma, of what a sensor does not state itself.
  std::int32_t sigma_fix_mm;
  std::int32_t sigma_depth_mm;
  std::int32_t sigma_attitude_urad;
  std::int32_t sigma_heading_urad;
  std::int32_t sigma_velocity_mm_s;
  /// Process noise: acceleration, one sigma.
  std::int32_t acceleration_mm_s2;
  std::int32_t angular_acceleration_urad_s2;
  base::TimeUs max_gap_us;  ///< farther apart than this, two attitudes are not a pair
};

/// What the navigator has seen since configure(). Never decremented; wraps at 2^32.
struct NavigatorCounters {
  std::uint32_t samples;
  std::uint32_t fused;         ///< measurements merged (a sample may carry several)
  std::uint32_t gated;         ///< innovation beyond the gate
  std::uint32_t unusable;      ///< quality 0, or nothing in it that is used here
  std::uint32_t out_of_range;  ///< a value that no place, pressure or speed has
  std::uint32_t stale;         ///< older than kMaxSampleAge_us
  std::uint32_t jumps;         ///< epochs begun
  std::uint32_t steps_back;    ///< restarts because the clock was set back
  std::uint32_t poses;         ///< pushed into the history
};

/// The filter and the history. 512 poses: 5 s of a 100 Hz attitude sensor.
class Navigator {
 public:
  static constexpr std::size_t kPoses = 512;

  Navigator() = default;
  Navigator(const Navigator&) = delete;
  Navigator& operator=(const Navigator&) = delete;

  /// Adopts a configuration and forgets everything. kOutOfRange: a density, gravity, sigma or acceleration
  /// that is not positive, a negative gap, an origin that LocalPlane refuses.
  [[nodiscard]] base::Status configure(const NavigatorConfig& config);

  /// Takes one sample. Every field in it is merged at sample.t_us, also when newer ones were merged before
  /// (kMaxSampleAge_us). A sample with roll and pitch that is newer than the last pose makes a pose.
  /// Rates turn the attitude until the next one, and make poses of their own in between.
  void take(const base::NavSample& sample, const SensorMount& mount = {});

  /// Depths are taken to be below a surface that stands so high over the zero of down; 0 at first.
  void set_water_level(std::int64_t level_um) { water_level_um_ = level_um; }

  /// To be called once per cycle: where no attitude comes, a pose without it (validity says so), so that
  /// what waits for poses goes on.
  void tick(base::TimeUs now_us);

  [[nodiscard]] const PoseHistory& history() const { return history_; }
  [[nodiscard]] const LocalPlane& plane() const { return plane_; }
  [[nodiscard]] const NavigationFilter& filter() const { return filter_; }
  [[nodiscard]] const NavigatorCounters& counters() const { return counters_; }
  /// Newest pose; validity 0 before the first.
  [[nodiscard]] const base::Pose& latest() const { return latest_; }
  [[nodiscard]] std::uint16_t epoch() const { return epoch_; }

 private:
  static constexpr base::TimeUs kNever_us = INT64_MIN;
  /// One kind of measurement: when it was merged last, and those refused since that agree with each other.
  struct Rejects {
    std::uint32_t count = 0;
    std::int64_t last[2] = {0, 0};
    base::TimeUs fused_us = kNever_us;
  };

  void reset_state();
  [[nodiscard]] bool too_old(base::TimeUs t_us);
  void advance(base::TimeUs t_us);
  [[nodiscard]] base::TimeUs age(base::TimeUs t_us) const { return newest_us_ - t_us; }
  void begin_epoch();
  [[nodiscard]] bool merge(const base::NavSample& sample, const LeverArm& lever);
  void take_heading(const base::NavSample& sample);
  [[nodiscard]] bool origin_ready(const Geodetic& fix);
  void take_fix(const base::NavSample& sample, const LeverArm& lever);
  void take_depth(const base::NavSample& sample, const LeverArm& lever);
  void take_velocity(const base::NavSample& sample, const LeverArm& lever);
  void take_level(const base::NavSample& sample);
  [[nodiscard]] bool attitude_recent(base::TimeUs t_us) const;
  [[nodiscard]] std::int64_t heading_sigma_urad(const base::NavSample& sample) const;
  void put_position(base::Pose& pose, base::Axis axis, base::TimeUs t_us) const;
  void put_attitude(base::Pose& pose) const;
  template <int kAxes>
  void merge_position(const std::int64_t* values, std::int64_t sigma_um, const LeverArm& lever,
                      base::TimeUs t_us, Rejects& rejects);
  [[nodiscard]] base::Attitude sensed_attitude(const base::NavSample& sample) const;
  [[nodiscard]] base::Pose pose_at(base::TimeUs t_us) const;
  void push(const base::Pose& pose);
  void make_pose(const base::NavSample& sample);
  void make_filter_pose(base::TimeUs t_us);

  NavigatorConfig config_{};
  LocalPlane plane_;
  Geodetic origin_candidate_{};
  bool has_candidate_ = false;
  NavigationFilter filter_;
  KalmanCv heading_;  ///< grid heading, 2^-32 turn: for attitude samples without one
  base::TimeUs newest_us_ = 0;
  bool any_ = false;
  base::TimeUs attitude_us_ = 0;  ///< newest roll and pitch
  bool attitude_known_ = false;
  base::Attitude attitude_{};
  std::int64_t water_level_um_ = 0;
  std::int32_t convergence_bam32_ = 0;  ///< at the newest fix
  Rejects fix_rejects_;
  Rejects depth_rejects_;
  std::uint32_t stale_in_a_row_ = 0;
  std::uint32_t level_refused_ = 0;  ///< in a row, while rates carry the attitude
  std::uint16_t epoch_ = 0;
  base::Pose latest_{};
  std::array<base::Pose, kPoses> storage_{};
  PoseHistory history_{storage_.data(), storage_.size(), 0};
  NavigatorCounters counters_{};
};

/// Depth below the surface of an absolute pressure: (p - surface) / (density * gravity), rounded,
/// micrometres. Positive arguments.
[[nodiscard]] std::int64_t pressure_depth_um(std::int64_t pressure_pa, std::int64_t surface_pa,
                                             std::int32_t density_g_m3, std::int32_t gravity_um_s2);

}  // namespace leadline::estimator
