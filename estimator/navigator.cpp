#include "estimator/navigator.hpp"

#include "estimator/wide.hpp"
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
constexpr std::int64_t kStartSpeed_um_s = 2'000'000;
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

std::uint32_t millimetres_up(std::int64_t um) {
  return static_cast<std::uint32_t>(clamp<std::int64_t>((um + 999) / 1000, 0, UINT32_MAX));
}

KalmanCv position_axis(const NavigatorConfig& config) {
  return KalmanCv(KalmanConfig{static_cast<std::int64_t>(config.acceleration_mm_s2) * 1000,
                               kStartSpeed_um_s, kGate_q8, false});
}

// Body velocity to the world: Rz(heading) Ry(pitch) Rx(roll) v.
void to_world(const base::Attitude& attitude, const std::int64_t body[3], std::int64_t world[3]) {
  const auto turn = [](base::Bam32 angle, std::int64_t& x, std::int64_t& y) {
    const std::int64_t s = base::sin_q30(angle);
    const std::int64_t c = base::cos_q30(angle);
    const std::int64_t turned = (c * x - s * y) >> 30;
    y = (s * x + c * y) >> 30;
    x = turned;
  };
  for (int axis = 0; axis < 3; ++axis) {
    world[axis] = body[axis];
  }
  turn(attitude.roll_bam32, world[1], world[2]);
  turn(attitude.pitch_bam32, world[2], world[0]);
  turn(attitude.heading_bam32, world[0], world[1]);
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
  has_candidate_ = false;
  convergence_bam32_ = 0;
  epoch_ = 0;
  counters_ = NavigatorCounters{};
  history_ = PoseHistory(storage_.data(), storage_.size(), config.max_gap_us);
  reset_state();
  return Status::kOk;
}

void Navigator::reset_state() {
  for (KalmanCv& axis : axes_) {
    axis = position_axis(config_);
  }
  heading_ = KalmanCv(KalmanConfig{bam_of_urad(config_.angular_acceleration_urad_s2),
                                   bam_of_urad(kStartTurn_urad_s), kGate_q8, true});
  any_ = false;
  attitude_known_ = false;
  fix_rejects_ = Rejects{};
  depth_rejects_ = Rejects{};
  stale_in_a_row_ = 0;
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
  for (KalmanCv& axis : axes_) {
    axis.predict(newest_us_);
  }
  heading_.predict(newest_us_);
}

void Navigator::take(const NavSample& sample) {
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
  if (!merge(sample)) {
    ++counters_.unusable;
  }
}

// False when the sample carries nothing that is used here.
bool Navigator::merge(const NavSample& sample) {
  constexpr std::uint16_t kUsed =
      base::kNavRollPitch | base::kNavHeading | base::kNavHeadingMagnetic | base::kNavGeodetic |
      base::kNavPressure | base::kNavDepth | base::kNavVelocityBody | base::kNavVelocityWorld;
  if ((sample.fields & kUsed) == 0) {
    return false;
  }
  advance(sample.t_us);
  if ((sample.fields & (base::kNavHeading | base::kNavHeadingMagnetic)) != 0) {
    take_heading(sample);
  }
  if ((sample.fields & base::kNavGeodetic) != 0) {
    take_fix(sample);
  }
  if ((sample.fields & (base::kNavPressure | base::kNavDepth)) != 0) {
    take_depth(sample);
  }
  if ((sample.fields & base::kNavRollPitch) != 0) {
    make_pose(sample);
  }
  if ((sample.fields & (base::kNavVelocityBody | base::kNavVelocityWorld)) != 0) {
    take_velocity(sample);
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

void Navigator::take_heading(const NavSample& sample) {
  const std::int64_t sigma = bam_of_urad(min_of<std::int64_t>(
      stated_or(sample.sigma_attitude_urad[2], config_.sigma_heading_urad), 3'000'000));
  const std::int64_t value = sensed_attitude(sample).heading_bam32;
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
    begin_epoch();
  }
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

void Navigator::take_fix(const NavSample& sample) {
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
  merge_position(axes_, 2, values, sigma_um, sample.t_us, fix_rejects_);
}

void Navigator::take_depth(const NavSample& sample) {
  std::int64_t depth_um = sample.depth_um;
  if ((sample.fields & base::kNavDepth) == 0) {
    if (!within(sample.pressure_pa, 400'000'000)) {
      ++counters_.out_of_range;
      return;
    }
    depth_um = pressure_depth_um(sample.pressure_pa, config_.surface_pressure_pa,
                                 config_.water_density_g_m3, config_.gravity_um_s2);
  }
  if (!within(depth_um, base::kMaxVertical_um)) {
    ++counters_.out_of_range;
    return;
  }
  merge_position(axes_ + 2, 1, &depth_um, static_cast<std::int64_t>(config_.sigma_depth_mm) * 1000,
                 sample.t_us, depth_rejects_);
}

// Merges one measurement of `axis_count` axes, of all or of none.
void Navigator::merge_position(KalmanCv* axes, int axis_count, const std::int64_t* values,
                               std::int64_t sigma_um, TimeUs t_us, Rejects& rejects) {
  KalmanCv merged[2] = {axes[0], axes[axis_count - 1]};
  bool gated = false;
  bool moved = false;
  for (int i = 0; i < axis_count; ++i) {
    if (!merged[i].started()) {
      merged[i].start(t_us, values[i], sigma_um);
      merged[i].predict(newest_us_);
      continue;
    }
    const Fusion fusion = merged[i].update(Measurement{values[i], sigma_um, age(t_us)});
    gated = gated || fusion == Fusion::kGated;
    moved = moved || !within(merged[i].value() - axes[i].value(), kJumpSigmas * sigma_um);
  }
  if (!gated) {
    for (int i = 0; i < axis_count; ++i) {
      axes[i] = merged[i];
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
  for (int i = 0; i < axis_count; ++i) {
    agrees = agrees && within(values[i] - rejects.last[i], room_um);
    rejects.last[i] = values[i];
  }
  rejects.count = agrees ? rejects.count + 1 : 1;
  if (rejects.count < kJumpCount) {
    return;
  }
  // They agree with each other and not with the state: the state is wrong.
  for (int i = 0; i < axis_count; ++i) {
    axes[i].start(t_us, values[i], sigma_um);
    axes[i].predict(newest_us_);
  }
  rejects.count = 0;
  rejects.fused_us = t_us;
  begin_epoch();
}

void Navigator::take_velocity(const NavSample& sample) {
  for (const std::int64_t speed : sample.velocity_um_s) {
    if (!within(speed, kFastest_um_s)) {
      ++counters_.out_of_range;
      return;
    }
  }
  std::int64_t world[3] = {sample.velocity_um_s[0], sample.velocity_um_s[1],
                           sample.velocity_um_s[2]};
  if ((sample.fields & base::kNavVelocityWorld) == 0) {
    const TimeUs apart = sample.t_us - attitude_us_;
    if (!attitude_known_ || !within(apart, max_of(config_.max_gap_us, kAttitudeInterval_us))) {
      ++counters_.unusable;
      return;
    }
    to_world(attitude_, sample.velocity_um_s, world);
  }
  // What the velocity may have changed since the sample's instant: sigma_a over the whole age.
  const std::int64_t sigma_um_s = static_cast<std::int64_t>(config_.sigma_velocity_mm_s) * 1000 +
                                  age(sample.t_us) / 1000 * config_.acceleration_mm_s2;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const Fusion fusion = axes_[axis].update_rate(world[axis], sigma_um_s);
    counters_.fused += fusion == Fusion::kFused ? 1U : 0U;
    counters_.gated += fusion == Fusion::kGated ? 1U : 0U;
  }
}

// Position at an instant not later than newest_us_, attitude left open.
Pose Navigator::pose_at(TimeUs t_us) const {
  Pose pose{};
  pose.t_us = t_us;
  pose.epoch = epoch_;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const KalmanCv& filter = axes_[axis];
    pose.position_um[axis] = filter.value() - mul_div(filter.rate(), age(t_us), 1'000'000);
    pose.covariance.sigma_position_mm[axis] = millimetres_up(filter.sigma());
  }
  if (axes_[base::kNorth].started() && axes_[base::kEast].started()) {
    pose.validity |= base::kPoseHorizontal;
  }
  if (axes_[base::kDown].started()) {
    pose.validity |= base::kPoseVertical;
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
  attitude_ = pose.attitude;
  attitude_us_ = sample.t_us;
  attitude_known_ = true;
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
