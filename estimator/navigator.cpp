#include "estimator/navigator.hpp"

#include "estimator/wide.hpp"
#include "model/base/angle.hpp"
#include "model/base/fixed.hpp"

namespace leadline::estimator {
namespace {

using base::clamp;
using base::max_of;
using base::min_of;
using base::NavSample;
using base::Pose;
using base::Status;
using base::TimeUs;

// A turn of 2^32 has 2 pi 1e6 microradians.
constexpr std::int64_t kBamPerUrad_q20 = 716'770'142;

constexpr std::int32_t kGate_q8 = 5 * 256;
constexpr std::int64_t kStartTurn_urad_s = 500'000;
// A measurement that moves the position by more than so many of its sigmas, after a gap of so long, begins a
// new epoch.
constexpr std::int64_t kJumpSigmas = 4;
constexpr TimeUs kLongGap_us = 10'000'000;
// Refused measurements agree when they lie this close: sigmas, and what a vehicle moves in between.
constexpr std::int64_t kAgreeSigmas = 6;
constexpr std::int64_t kAgree_um = 3'000'000;
constexpr std::int64_t kOriginAgree_um = 1'000'000'000;
constexpr std::int64_t kFastest_um_s = 100'000'000;
// Poses from rates alone: no more often than this.
constexpr TimeUs kPoseInterval_us = 10'000;
// Attitude that comes at least this often needs no allowance for what happens in between.
constexpr TimeUs kAttitudeInterval_us = 120'000;

bool within(std::int64_t value, std::int64_t limit) { return value >= -limit && value <= limit; }

std::int64_t bam_of_urad(std::int64_t urad) { return mul_round(urad, kBamPerUrad_q20, 20); }

std::int64_t stated_or(std::uint32_t stated, std::int32_t otherwise) {
  return stated != 0 ? static_cast<std::int64_t>(stated) : otherwise;
}

std::uint16_t urad16(std::int64_t urad) {
  return static_cast<std::uint16_t>(clamp<std::int64_t>((urad + 15) / 16, 1, UINT16_MAX));
}

void turn_vector(const base::Rotation& rotation, std::int64_t (&v)[3]) {
  constexpr std::int64_t kMost = (std::int64_t{1} << 31U) - 1;
  const base::Vector3 turned = base::rotated(
      rotation,
      {clamp(v[0], -kMost, kMost), clamp(v[1], -kMost, kMost), clamp(v[2], -kMost, kMost)});
  for (std::size_t i = 0; i < 3; ++i) {
    v[i] = turned[i];
  }
}

NavigationFilter filter_of(const NavigatorConfig& config) {
  NavigationFilterConfig filter;
  filter.acceleration_m_s2 = static_cast<float>(config.acceleration_mm_s2) * 1e-3F;
  filter.vertical_acceleration_m_s2 = filter.acceleration_m_s2;
  return NavigationFilter(filter);
}

// What a sensor measured in its own axes, in the body's.
NavSample in_body_axes(const NavSample& sample, const base::Attitude& boresight) {
  if (boresight.roll_bam32 == 0 && boresight.pitch_bam32 == 0 && boresight.heading_bam32 == 0) {
    return sample;
  }
  NavSample turned = sample;
  const base::Rotation mounted = base::rotation_of(boresight);
  constexpr std::uint16_t kVectors = base::kNavVelocityBody | base::kNavVelocityWater;
  if ((sample.fields & kVectors) != 0) {
    turn_vector(mounted, turned.velocity_um_s);
  }
  if ((sample.fields & base::kNavRates) != 0) {
    turn_vector(mounted, turned.rate_urad_s);
  }
  if ((sample.fields & base::kNavRollPitch) != 0) {
    // Sensor to world is body to world times sensor to body.
    turned.attitude = base::attitude_of(
        base::product(base::rotation_of(sample.attitude), base::transposed(mounted)));
  }
  return turned;
}

}  // namespace

std::int64_t pressure_depth_um(std::int64_t pressure_pa, std::int64_t surface_pa,
                               std::int32_t density_g_m3, std::int32_t gravity_um_s2) {
  // Pa = kg / (m s^2): metres are (p - p0) / (density_g 1e-3 * gravity_um 1e-6), micrometres 1e15 of that.
  return mul_div((pressure_pa - surface_pa) * 1'000'000, 1'000'000'000,
                 static_cast<std::int64_t>(density_g_m3) * gravity_um_s2);
}

Status Navigator::configure(const NavigatorConfig& config) {
  const std::int32_t positive[] = {config.water_density_g_m3,  config.gravity_um_s2,
                                   config.sigma_fix_mm,        config.sigma_depth_mm,
                                   config.sigma_attitude_urad, config.sigma_heading_urad,
                                   config.acceleration_mm_s2,  config.angular_acceleration_urad_s2,
                                   config.sigma_velocity_mm_s};
  for (const std::int32_t value : positive) {
    if (value <= 0) {
      return Status::kOutOfRange;
    }
  }
  if (config.max_gap_us < 0 || !within(config.surface_pressure_pa, 200'000'000)) {
    return Status::kOutOfRange;
  }
  LocalPlane plane;
  if (config.has_origin && plane.configure(config.origin) != Status::kOk) {
    return Status::kOutOfRange;
  }
  config_ = config;
  plane_ = plane;
  water_level_um_ = 0;
  has_candidate_ = false;
  convergence_bam32_ = 0;
  epoch_ = 0;
  counters_ = NavigatorCounters{};
  // Nothing of a survey before shows, whatever is looked at before it is known.
  origin_candidate_ = Geodetic{};
  newest_us_ = 0;
  attitude_us_ = 0;
  attitude_ = base::Attitude{};
  history_ = PoseHistory(storage_.data(), storage_.size(), config.max_gap_us);
  reset_state();
  return Status::kOk;
}

void Navigator::reset_state() {
  filter_ = filter_of(config_);
  heading_ = KalmanCv(KalmanConfig{bam_of_urad(config_.angular_acceleration_urad_s2),
                                   bam_of_urad(kStartTurn_urad_s), kGate_q8, true});
  any_ = false;
  attitude_known_ = false;
  fix_rejects_ = Rejects{};
  depth_rejects_ = Rejects{};
  stale_in_a_row_ = 0;
  level_refused_ = 0;
  latest_ = Pose{};
}

bool Navigator::too_old(TimeUs t_us) {
  if (!any_ || age(t_us) <= kMaxSampleAge_us) {
    stale_in_a_row_ = 0;
    return false;
  }
  ++counters_.stale;
  ++stale_in_a_row_;
  if (stale_in_a_row_ < kStepBackCount) {
    return true;
  }
  // Not stragglers: the clock was set back, or one wild time stood ahead of all others.
  ++counters_.steps_back;
  reset_state();
  history_.clear();
  begin_epoch();
  return false;
}

void Navigator::begin_epoch() {
  ++epoch_;
  ++counters_.jumps;
}

void Navigator::advance(TimeUs t_us) {
  newest_us_ = any_ ? max_of(newest_us_, t_us) : t_us;
  any_ = true;
  filter_.predict(newest_us_);
  heading_.predict(newest_us_);
}

void Navigator::take(const NavSample& sample, const SensorMount& mount) {
  ++counters_.samples;
  if (!within(sample.t_us, kMaxTime_us)) {
    ++counters_.out_of_range;
    return;
  }
  if (sample.quality == 0) {
    ++counters_.unusable;
    return;
  }
  if (too_old(sample.t_us)) {
    return;
  }
  if (!merge(in_body_axes(sample, mount.boresight), mount.lever)) {
    ++counters_.unusable;
  }
}

// False when the sample carries nothing that is used here.
bool Navigator::merge(const NavSample& sample, const LeverArm& lever) {
  constexpr std::uint16_t kVelocities =
      base::kNavVelocityBody | base::kNavVelocityWorld | base::kNavVelocityWater;
  constexpr std::uint16_t kUsed =
      base::kNavRollPitch | base::kNavHeading | base::kNavHeadingMagnetic | base::kNavGeodetic |
      base::kNavPressure | base::kNavDepth | base::kNavRates | kVelocities;
  if ((sample.fields & kUsed) == 0) {
    return false;
  }
  advance(sample.t_us);
  if ((sample.fields & base::kNavRates) != 0) {
    filter_.set_rates(sample.rate_urad_s);
  }
  if ((sample.fields & (base::kNavHeading | base::kNavHeadingMagnetic)) != 0) {
    take_heading(sample);
  }
  if ((sample.fields & base::kNavRollPitch) != 0) {
    take_level(sample);
  }
  if ((sample.fields & base::kNavGeodetic) != 0) {
    take_fix(sample, lever);
  }
  if ((sample.fields & (base::kNavPressure | base::kNavDepth)) != 0) {
    take_depth(sample, lever);
  }
  if ((sample.fields & kVelocities) != 0) {
    take_velocity(sample, lever);
  }
  if ((sample.fields & base::kNavRollPitch) != 0) {
    make_pose(sample);
  } else if ((sample.fields & base::kNavRates) != 0) {
    make_filter_pose(sample.t_us);
  }
  return true;
}

// The sample's angles, the heading from grid north.
base::Attitude Navigator::sensed_attitude(const NavSample& sample) const {
  base::Attitude attitude = sample.attitude;
  if ((sample.fields & base::kNavHeading) == 0) {
    attitude.heading_bam32 += static_cast<base::Bam32>(config_.magnetic_variation_bam32);
  }
  attitude.heading_bam32 -= static_cast<base::Bam32>(convergence_bam32_);
  return attitude;
}

std::int64_t Navigator::heading_sigma_urad(const NavSample& sample) const {
  return min_of<std::int64_t>(stated_or(sample.sigma_attitude_urad[2], config_.sigma_heading_urad),
                              3'000'000);
}

void Navigator::take_heading(const NavSample& sample) {
  const std::int64_t sigma = bam_of_urad(heading_sigma_urad(sample));
  const base::Bam32 heading_bam32 = sensed_attitude(sample).heading_bam32;
  static_cast<void>(filter_.update_heading(
      heading_bam32, static_cast<std::uint32_t>(heading_sigma_urad(sample)), age(sample.t_us)));
  const std::int64_t value = heading_bam32;
  if (!heading_.started()) {
    heading_.start(sample.t_us, value, sigma);
    heading_.predict(newest_us_);
    ++counters_.fused;
    return;
  }
  if (heading_.update(Measurement{value, sigma, age(sample.t_us)}) == Fusion::kFused) {
    ++counters_.fused;
    return;
  }
  ++counters_.gated;
  if (heading_.gated_in_a_row() >= kJumpCount) {
    heading_.start(sample.t_us, value, sigma);
    heading_.predict(newest_us_);
    filter_.restart_heading();
    begin_epoch();
  }
}

void Navigator::take_level(const NavSample& sample) {
  const std::uint32_t sigma_urad[2] = {
      static_cast<std::uint32_t>(
          stated_or(sample.sigma_attitude_urad[0], config_.sigma_attitude_urad)),
      static_cast<std::uint32_t>(
          stated_or(sample.sigma_attitude_urad[1], config_.sigma_attitude_urad))};
  const auto merge = [&] {
    return filter_.update_level(sample.attitude.roll_bam32, sample.attitude.pitch_bam32, sigma_urad,
                                age(sample.t_us));
  };
  const bool refused = merge() == Fusion::kGated && filter_.has_rates();
  level_refused_ = refused ? level_refused_ + 1 : 0;
  if (level_refused_ < kJumpCount) {
    return;
  }
  // Rates that are wrong (a gyro that hangs) have led the attitude away from where down is.
  level_refused_ = 0;
  filter_.restart_level();
  static_cast<void>(merge());
  begin_epoch();
}

bool Navigator::origin_ready(const Geodetic& fix) {
  if (plane_.configured()) {
    return true;
  }
  LocalPlane candidate;
  if (has_candidate_ && candidate.configure(origin_candidate_) == Status::kOk) {
    const base::Result<PlanePoint> here = candidate.to_plane(fix);
    if (here.ok() && within(here.value().north_um, kOriginAgree_um) &&
        within(here.value().east_um, kOriginAgree_um)) {
      plane_ = candidate;
      return true;
    }
  }
  origin_candidate_ = fix;
  has_candidate_ = true;
  return false;
}

void Navigator::take_fix(const NavSample& sample, const LeverArm& lever) {
  const Geodetic fix{sample.latitude_e9deg, sample.longitude_e9deg};
  if (!origin_ready(fix)) {
    return;
  }
  const base::Result<PlanePoint> point = plane_.to_plane(fix);
  if (!point.ok()) {
    ++counters_.out_of_range;
    return;
  }
  convergence_bam32_ = point.value().convergence_bam32;
  const std::int64_t values[2] = {point.value().north_um, point.value().east_um};
  const std::int64_t sigma_um =
      min_of<std::int64_t>(stated_or(sample.sigma_position_mm, config_.sigma_fix_mm), 1'000'000) *
      1000;
  merge_position<2>(values, sigma_um, lever, sample.t_us, fix_rejects_);
}

void Navigator::take_depth(const NavSample& sample, const LeverArm& lever) {
  std::int64_t depth_um = sample.depth_um;
  if ((sample.fields & base::kNavDepth) == 0) {
    if (!within(sample.pressure_pa, 400'000'000)) {
      ++counters_.out_of_range;
      return;
    }
    depth_um = pressure_depth_um(sample.pressure_pa, config_.surface_pressure_pa,
                                 config_.water_density_g_m3, config_.gravity_um_s2);
  }
  depth_um -= water_level_um_;
  if (!within(depth_um, base::kMaxVertical_um)) {
    ++counters_.out_of_range;
    return;
  }
  const std::int64_t sigma_um = stated_or(sample.sigma_vertical_mm, config_.sigma_depth_mm) * 1000;
  merge_position<1>(&depth_um, min_of<std::int64_t>(sigma_um, 1'000'000'000), lever, sample.t_us,
                    depth_rejects_);
}

// A fix (two axes) or a depth.
template <int kAxes>
void Navigator::merge_position(const std::int64_t* values, std::int64_t sigma_um,
                               const LeverArm& lever, TimeUs t_us, Rejects& rejects) {
  // North and east, or down.
  const auto axis = [](int i) {
    if (kAxes == 1) {
      return base::kDown;
    }
    return i == 0 ? base::kNorth : base::kEast;
  };
  const auto merge = [&] {
    if constexpr (kAxes == 2) {
      return filter_.update_position(values, sigma_um, lever, age(t_us));
    }
    return filter_.update_depth(values[0], sigma_um, lever, age(t_us));
  };
  const bool started = kAxes == 2 ? filter_.horizontal_started() : filter_.vertical_started();
  std::int64_t before[2] = {0, 0};
  for (int i = 0; i < kAxes; ++i) {
    before[i] = filter_.position_um(axis(i), 0);
  }
  if (merge() == Fusion::kFused) {
    bool moved = false;
    for (int i = 0; i < kAxes; ++i) {
      const std::int64_t after = filter_.position_um(axis(i), 0);
      moved = moved || (started && !within(after - before[i], kJumpSigmas * sigma_um));
    }
    const bool gap = rejects.fused_us != kNever_us && t_us - rejects.fused_us > kLongGap_us;
    rejects.count = 0;
    rejects.fused_us = t_us;
    ++counters_.fused;
    if (moved && gap) {
      begin_epoch();
    }
    return;
  }
  ++counters_.gated;
  const std::int64_t room_um = kAgreeSigmas * sigma_um + kAgree_um;
  bool agrees = rejects.count > 0;
  for (int i = 0; i < kAxes; ++i) {
    agrees = agrees && within(values[i] - rejects.last[i], room_um);
    rejects.last[i] = values[i];
  }
  rejects.count = agrees ? rejects.count + 1 : 1;
  if (rejects.count < kJumpCount) {
    return;
  }
  // They agree with each other and not with the state: the state is wrong.
  if constexpr (kAxes == 2) {
    filter_.restart_horizontal();
  } else {
    filter_.restart_vertical();
  }
  static_cast<void>(merge());
  rejects.count = 0;
  rejects.fused_us = t_us;
  begin_epoch();
}

void Navigator::take_velocity(const NavSample& sample, const LeverArm& lever) {
  for (const std::int64_t speed : sample.velocity_um_s) {
    if (!within(speed, kFastest_um_s)) {
      ++counters_.out_of_range;
      return;
    }
  }
  const std::int64_t sigma_um_s =
      sample.sigma_velocity_um_s != 0
          ? static_cast<std::int64_t>(sample.sigma_velocity_um_s)
          : static_cast<std::int64_t>(config_.sigma_velocity_mm_s) * 1000;
  const TimeUs age_us = age(sample.t_us);
  Fusion fusion = Fusion::kNotReady;
  if ((sample.fields & base::kNavVelocityWorld) != 0) {
    fusion = filter_.update_velocity_world(sample.velocity_um_s, sigma_um_s, age_us);
  } else if (!attitude_recent(sample.t_us)) {
    ++counters_.unusable;
    return;
  } else if ((sample.fields & base::kNavVelocityBody) != 0) {
    fusion = filter_.update_velocity_bottom(sample.velocity_um_s, sigma_um_s, lever, age_us);
  } else {
    fusion = filter_.update_velocity_water(sample.velocity_um_s, sigma_um_s, lever, age_us);
  }
  counters_.fused += fusion == Fusion::kFused ? 1U : 0U;
  counters_.gated += fusion == Fusion::kGated ? 1U : 0U;
  counters_.unusable += fusion == Fusion::kNotReady ? 1U : 0U;
}

// Whether the body's axes are known at `t_us`.
bool Navigator::attitude_recent(TimeUs t_us) const {
  return attitude_known_ &&
         within(t_us - attitude_us_, max_of(config_.max_gap_us, kAttitudeInterval_us));
}

void Navigator::put_position(Pose& pose, base::Axis axis, TimeUs t_us) const {
  pose.position_um[axis] = filter_.position_um(axis, age(t_us));
  pose.covariance.sigma_position_mm[axis] = filter_.sigma_position_mm(axis);
}

// Position at an instant not later than newest_us_, attitude left open.
Pose Navigator::pose_at(TimeUs t_us) const {
  Pose pose{};
  pose.t_us = t_us;
  pose.epoch = epoch_;
  if (filter_.horizontal_started()) {
    pose.validity |= base::kPoseHorizontal;
    put_position(pose, base::kNorth, t_us);
    put_position(pose, base::kEast, t_us);
    pose.covariance.correlation_ne_q7 = filter_.correlation_q7(base::kNorth, base::kEast);
  }
  if (filter_.vertical_started()) {
    pose.validity |= base::kPoseVertical;
    put_position(pose, base::kDown, t_us);
  }
  if (filter_.horizontal_started() && filter_.vertical_started()) {
    pose.covariance.correlation_nd_q7 = filter_.correlation_q7(base::kNorth, base::kDown);
    pose.covariance.correlation_ed_q7 = filter_.correlation_q7(base::kEast, base::kDown);
  }
  return pose;
}

void Navigator::make_pose(const NavSample& sample) {
  if (latest_.validity != 0 && sample.t_us <= latest_.t_us) {
    return;
  }
  Pose pose = pose_at(sample.t_us);
  const bool has_heading = (sample.fields & (base::kNavHeading | base::kNavHeadingMagnetic)) != 0;
  pose.attitude = sensed_attitude(sample);
  std::int64_t heading_urad = stated_or(sample.sigma_attitude_urad[2], config_.sigma_heading_urad);
  if (!has_heading) {
    const std::int64_t heading =
        heading_.value() - mul_div(heading_.rate(), age(sample.t_us), 1'000'000);
    pose.attitude.heading_bam32 = static_cast<base::Bam32>(static_cast<std::uint64_t>(heading));
    heading_urad = mul_div(heading_.sigma(), 1 << 20, kBamPerUrad_q20);
  }
  if (has_heading || heading_.started()) {
    pose.validity |= base::kPoseAttitude;
  }
  // Attitude that comes seldom is interpolated over an arc that bends: alpha dt^2 / 8 at most.
  const TimeUs interval = attitude_known_ ? sample.t_us - attitude_us_ : 0;
  std::int64_t bend_urad = 0;
  if (interval > kAttitudeInterval_us && interval <= config_.max_gap_us) {
    const std::int64_t interval_ms = min_of<std::int64_t>(interval / 1000, 100'000);
    bend_urad = config_.angular_acceleration_urad_s2 * (interval_ms * interval_ms / 1000) / 8000;
  }
  const std::int64_t stated[3] = {
      stated_or(sample.sigma_attitude_urad[0], config_.sigma_attitude_urad),
      stated_or(sample.sigma_attitude_urad[1], config_.sigma_attitude_urad), heading_urad};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t own = min_of<std::int64_t>(stated[axis], 10'000'000);
    pose.covariance.sigma_attitude_urad16[axis] =
        urad16(sqrt_up(own * own + mul_div(bend_urad, bend_urad, 1)));
  }
  attitude_us_ = sample.t_us;
  attitude_known_ = true;
  if (filter_.has_rates() && filter_.attitude_started()) {
    put_attitude(pose);
  }
  attitude_ = pose.attitude;
  push(pose);
}

// The filter's attitude, which the rates carry on from sample to sample. Its sigma: no less than half of a
// single sample's, since what sensors err by does not average out.
void Navigator::put_attitude(Pose& pose) const {
  pose.attitude = filter_.attitude();
  const std::int64_t floor_urad[3] = {config_.sigma_attitude_urad / 2,
                                      config_.sigma_attitude_urad / 2,
                                      config_.sigma_heading_urad / 2};
  for (int axis = 0; axis < 3; ++axis) {
    pose.covariance.sigma_attitude_urad16[axis] =
        urad16(max_of<std::int64_t>(filter_.sigma_attitude_urad(axis), floor_urad[axis]));
  }
  pose.validity |= base::kPoseAttitude;
}

// Between attitude samples, from the rates.
void Navigator::make_filter_pose(TimeUs t_us) {
  const bool late = latest_.validity != 0 && t_us - latest_.t_us < kPoseInterval_us;
  if (late || t_us != newest_us_ || !filter_.attitude_started() || !attitude_recent(t_us)) {
    return;
  }
  Pose pose = pose_at(t_us);
  put_attitude(pose);
  attitude_ = pose.attitude;
  push(pose);
}

void Navigator::push(const Pose& pose) {
  if (history_.push(pose) == Status::kOk) {
    ++counters_.poses;
    latest_ = pose;
  }
}

void Navigator::tick(TimeUs now_us) {
  if (!any_ || now_us - max_of(latest_.t_us, attitude_known_ ? attitude_us_ : INT64_MIN) <
                   kBlindInterval_us) {
    return;
  }
  Pose pose = pose_at(newest_us_);
  if (pose.validity == 0) {
    return;
  }
  advance(now_us);
  pose = pose_at(now_us);
  pose.attitude = attitude_;
  push(pose);
}

}  // namespace leadline::estimator
