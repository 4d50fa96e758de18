#include "host_tools/emulate/trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "host_tools/sim/exact_math.hpp"
#include "host_tools/sim/require.hpp"

namespace leadline::host {
namespace {

constexpr std::int64_t kStep_us = 20'000;
constexpr double kStep_s = 0.02;
// Longest survey that is flown: a plan that never arrives (a current stronger than the vehicle) ends.
constexpr double kMaxDuration_s = 40'000.0;
// The helmsman aims at the point of the line this far ahead.
constexpr double kLookahead_m = 1.6;
constexpr int kGroundSamplesPerSide = 6;

void check(const MotionPlan& plan) {
  require(plan.north_m > plan.south_m, "north_m", plan.north_m, "over south_m");
  require(plan.east_m > plan.west_m, "east_m", plan.east_m, "over west_m");
  require(plan.line_spacing_m > 0.0 && std::isfinite(plan.line_spacing_m), "line_spacing_m",
          plan.line_spacing_m, "over 0");
  require(plan.run_out_m >= 0.0 && plan.run_out_m <= 1e4, "run_out_m", plan.run_out_m, "0 .. 1e4");
  require(plan.altitude_m > 0.0 && plan.altitude_m <= 1e4, "altitude_m", plan.altitude_m,
          "over 0, at most 1e4");
  require(plan.altitude_smoothing_m >= 0.0 && plan.altitude_smoothing_m <= 1e4,
          "altitude_smoothing_m", plan.altitude_smoothing_m, "0 .. 1e4");
  require(plan.speed_m_s > 0.0 && plan.speed_m_s <= 10.0, "speed_m_s", plan.speed_m_s,
          "over 0, at most 10");
  require(plan.turn_speed_m_s > 0.0 && plan.turn_speed_m_s <= 10.0, "turn_speed_m_s",
          plan.turn_speed_m_s, "over 0, at most 10");
  require(plan.acceleration_m_s2 > 0.0 && plan.acceleration_m_s2 <= 10.0, "acceleration_m_s2",
          plan.acceleration_m_s2, "over 0, at most 10");
  require(plan.turn_rate_deg_s > 0.0 && plan.turn_rate_deg_s <= 180.0, "turn_rate_deg_s",
          plan.turn_rate_deg_s, "over 0, at most 180");
  require(plan.turn_acceleration_deg_s2 > 0.0 && plan.turn_acceleration_deg_s2 <= 1000.0,
          "turn_acceleration_deg_s2", plan.turn_acceleration_deg_s2, "over 0, at most 1000");
  require(plan.climb_rate_m_s > 0.0 && plan.climb_rate_m_s <= 10.0, "climb_rate_m_s",
          plan.climb_rate_m_s, "over 0, at most 10");
  require(plan.climb_acceleration_m_s2 > 0.0 && plan.climb_acceleration_m_s2 <= 10.0,
          "climb_acceleration_m_s2", plan.climb_acceleration_m_s2, "over 0, at most 10");
  const double steady_m_s = std::sqrt(plan.current_north_m_s * plan.current_north_m_s +
                                      plan.current_east_m_s * plan.current_east_m_s);
  const double current_m_s = steady_m_s + std::fabs(plan.current_swing_m_s);
  // Below half of the slowest speed the vehicle makes way against it in every direction.
  require(current_m_s <= 0.5 * std::min(plan.speed_m_s, plan.turn_speed_m_s),
          "current_north_m_s, current_east_m_s and current_swing_m_s together", current_m_s,
          "at most half of turn_speed_m_s");
  require(plan.current_period_s > 0.0 && plan.current_period_s <= 1e6, "current_period_s",
          plan.current_period_s, "over 0, at most 1e6");
  for (const Swing* const swing : {&plan.roll, &plan.pitch, &plan.yaw}) {
    require(swing->amplitude_deg >= 0.0 && swing->amplitude_deg <= 45.0, "amplitude_deg",
            swing->amplitude_deg, "0 .. 45");
    require(swing->period_s >= 0.5 && swing->period_s <= 1e6, "period_s", swing->period_s,
            "0.5 .. 1e6");
  }
}

// The fundamental, and a fifth of it at a period that does not fit: no two waves are alike.
double swing_deg(const Swing& swing, double time_s) {
  if (swing.amplitude_deg == 0.0) {
    return 0.0;
  }
  const double turns = time_s / swing.period_s;
  return swing.amplitude_deg *
         (0.8 * exact::sin(2.0 * exact::kPi * turns + swing.phase_rad) +
          0.2 * exact::sin(2.0 * exact::kPi * turns * 2.618 + 1.7 * swing.phase_rad));
}

double wrap_180_deg(double angle_deg) {
  return angle_deg - 360.0 * std::floor(angle_deg / 360.0 + 0.5);
}

// Moves `rate` towards `wanted` by at most `step`.
double approach(double rate, double wanted, double step) {
  return rate + std::clamp(wanted - rate, -step, step);
}

// Rate that covers `error` as fast as may be and still stops on it: limited, and no more than what a
// constant deceleration brings to rest. The linear part near zero keeps it from hunting.
double stopping_rate(double error, double max_rate, double deceleration) {
  const double size = std::fabs(error);
  const double brake = std::sqrt(2.0 * 0.7 * deceleration * size);
  const double linear = 1.5 * size;
  return std::copysign(std::min({max_rate, brake, linear}), error);
}

// The helmsman and his vehicle, one step at a time.
class Helm {
 public:
  Helm(const Terrain& terrain, const MotionPlan& plan) : terrain_(terrain), plan_(plan) {
    const double width_m = plan.east_m - plan.west_m;
    const double lines = std::floor(width_m / plan.line_spacing_m + 0.5 + 1e-9);
    require(lines <= 100000.0, "line_spacing_m", plan.line_spacing_m, "at most 100000 lines apart");
    line_count_ = std::max<std::size_t>(1, static_cast<std::size_t>(lines));
    position_ = {plan.south_m - plan.run_out_m, line_east_m(0), 0.0};
    position_.z = wanted_depth_m();
  }

  [[nodiscard]] bool arrived() const { return line_ >= line_count_; }
  [[nodiscard]] Vec3 position() const { return position_; }
  [[nodiscard]] double course_deg() const { return course_deg_; }
  [[nodiscard]] double turn_rate_deg_s() const { return turn_rate_deg_s_; }

  [[nodiscard]] Vec3 velocity(double time_s) const {
    const exact::SinCos course = exact::sin_cos(course_deg_ * exact::kRadPerDeg);
    const Vec3 water = current(time_s);
    return {speed_ * course.cos + water.x, speed_ * course.sin + water.y, climb_};
  }

  void step(double time_s) {
    const double wanted_course = wanted_course_deg(time_s);
    const double error_deg = wrap_180_deg(wanted_course - course_deg_);
    const double wanted_turn =
        stopping_rate(error_deg, plan_.turn_rate_deg_s, plan_.turn_acceleration_deg_s2);
    turn_rate_deg_s_ =
        approach(turn_rate_deg_s_, wanted_turn, plan_.turn_acceleration_deg_s2 * kStep_s);
    speed_ = approach(speed_, wanted_speed(error_deg), plan_.acceleration_m_s2 * kStep_s);
    const double wanted_climb = stopping_rate(wanted_depth_m() - position_.z, plan_.climb_rate_m_s,
                                              plan_.climb_acceleration_m_s2);
    climb_ = approach(climb_, wanted_climb, plan_.climb_acceleration_m_s2 * kStep_s);
    // The mean of both ends of the step: positions and velocities then fit one smooth curve.
    const Vec3 before = velocity(time_s);
    course_deg_ += turn_rate_deg_s_ * kStep_s;
    const Vec3 after = velocity(time_s + kStep_s);
    position_ = position_ + 0.5 * kStep_s * (before + after);
    if (beyond_end_m() >= plan_.run_out_m) {
      ++line_;
    }
  }

 private:
  [[nodiscard]] double line_east_m(std::size_t line) const {
    const double width_m = plan_.east_m - plan_.west_m;
    if (line_count_ == 1 && plan_.line_spacing_m > width_m) {
      return 0.5 * (plan_.west_m + plan_.east_m);
    }
    return plan_.west_m + (static_cast<double>(line) + 0.5) * plan_.line_spacing_m;
  }
  [[nodiscard]] bool northward() const { return line_ % 2 == 0; }
  /// How far the vehicle is past the end of its line; negative on it.
  [[nodiscard]] double beyond_end_m() const {
    return northward() ? position_.x - plan_.north_m : plan_.south_m - position_.x;
  }

  [[nodiscard]] Vec3 current(double time_s) const {
    const exact::SinCos phase = exact::sin_cos(2.0 * exact::kPi * time_s / plan_.current_period_s);
    return {plan_.current_north_m_s + plan_.current_swing_m_s * phase.sin,
            plan_.current_east_m_s + plan_.current_swing_m_s * phase.cos, 0.0};
  }

  /// Heading whose way through the water, with the current, leads to the aim ahead on the line.
  [[nodiscard]] double wanted_course_deg(double time_s) const {
    const double ahead = northward() ? kLookahead_m : -kLookahead_m;
    const double aside = line_east_m(std::min(line_, line_count_ - 1)) - position_.y;
    const double length = std::sqrt(ahead * ahead + aside * aside);
    const double north = ahead / length;
    const double east = aside / length;
    const Vec3 water = current(time_s);
    const double across = water.y * north - water.x * east;
    // The vehicle cancels what the current pushes across the wanted way.
    const double speed = std::max(speed_, 0.5 * plan_.turn_speed_m_s);
    const double sine = std::clamp(-across / speed, -0.8, 0.8);
    const double cosine = std::sqrt(1.0 - sine * sine);
    return exact::atan2(cosine * east + sine * north, cosine * north - sine * east) *
           exact::kDegPerRad;
  }

  [[nodiscard]] double wanted_speed(double error_deg) const {
    if (std::fabs(error_deg) > 25.0 || arrived()) {
      return plan_.turn_speed_m_s;
    }
    // Slow down in time for the turn at the end of the line.
    const double to_go_m = std::max(0.0, plan_.run_out_m - beyond_end_m());
    const double slow = plan_.turn_speed_m_s;
    return std::min(plan_.speed_m_s,
                    std::sqrt(slow * slow + 2.0 * plan_.acceleration_m_s2 * to_go_m));
  }

  [[nodiscard]] double wanted_depth_m() const {
    const exact::SinCos course = exact::sin_cos(course_deg_ * exact::kRadPerDeg);
    double sum_m = 0.0;
    double shallowest_m = terrain_.depth_m(position_.x, position_.y);
    for (int k = -kGroundSamplesPerSide; k <= kGroundSamplesPerSide; ++k) {
      const double along_m = plan_.altitude_smoothing_m * k / kGroundSamplesPerSide;
      const double depth_m =
          terrain_.depth_m(position_.x + along_m * course.cos, position_.y + along_m * course.sin);
      sum_m += depth_m;
      shallowest_m = std::min(shallowest_m, depth_m);
    }
    const double mean_m = sum_m / (2 * kGroundSamplesPerSide + 1);
    // A step ahead is climbed before it is there.
    return std::min(mean_m - plan_.altitude_m, shallowest_m - 0.6 * plan_.altitude_m);
  }

  const Terrain& terrain_;
  const MotionPlan& plan_;
  std::size_t line_count_ = 1;
  std::size_t line_ = 0;
  Vec3 position_;
  double course_deg_ = 0.0;
  double turn_rate_deg_s_ = 0.0;
  double speed_ = 0.0;
  double climb_ = 0.0;
};

// Cubic through (a, slope da) and (b, slope db), `share` of the way.
double hermite(double a, double da, double b, double db, double share, double length) {
  const double s = share;
  const double one = 1.0 - s;
  return (1.0 + 2.0 * s) * one * one * a + s * one * one * length * da +
         s * s * (3.0 - 2.0 * s) * b - s * s * one * length * db;
}

Vec3 hermite(Vec3 a, Vec3 da, Vec3 b, Vec3 db, double share, double length) {
  return {hermite(a.x, da.x, b.x, db.x, share, length),
          hermite(a.y, da.y, b.y, db.y, share, length),
          hermite(a.z, da.z, b.z, db.z, share, length)};
}

}  // namespace

Trajectory::Trajectory(const Terrain& terrain, const MotionPlan& plan) : plan_(plan) {
  check(plan);
  Helm helm(terrain, plan);
  double time_s = 0.0;
  while (!helm.arrived()) {
    const Vec3 position = helm.position();
    const double clearance_m = terrain.depth_m(position.x, position.y) - position.z;
    if (clearance_m < 0.2 * plan.altitude_m) {
      throw std::invalid_argument("emulate: at " + std::to_string(position.x) + " m north, " +
                                  std::to_string(position.y) + " m east the vehicle comes within " +
                                  std::to_string(clearance_m) +
                                  " m of the ground: raise altitude_m, altitude_smoothing_m or "
                                  "climb_rate_m_s, or lower speed_m_s");
    }
    steps_.push_back({position, helm.velocity(time_s), helm.course_deg(), helm.turn_rate_deg_s()});
    helm.step(time_s);
    time_s = static_cast<double>(steps_.size()) * kStep_s;
    if (time_s > kMaxDuration_s) {
      throw std::invalid_argument("emulate: the survey takes over " +
                                  std::to_string(kMaxDuration_s) +
                                  " s: raise speed_m_s or line_spacing_m");
    }
  }
  duration_s_ = static_cast<double>(steps_.size() - 1) * kStep_s;
}

std::int64_t Trajectory::duration_us() const {
  return static_cast<std::int64_t>(steps_.size() - 1) * kStep_us;
}

TruePose Trajectory::at(std::int64_t time_us) const {
  const std::int64_t clamped_us = std::clamp<std::int64_t>(time_us, 0, duration_us());
  const auto index = static_cast<std::size_t>(clamped_us / kStep_us);
  const Step& a = steps_[index];
  const Step& b = steps_[std::min(index + 1, steps_.size() - 1)];
  const double share = static_cast<double>(clamped_us % kStep_us) / static_cast<double>(kStep_us);
  TruePose pose;
  pose.position_m =
      hermite(a.position_m, a.velocity_m_s, b.position_m, b.velocity_m_s, share, kStep_s);
  pose.velocity_m_s = (1.0 - share) * a.velocity_m_s + share * b.velocity_m_s;
  const double course_deg =
      hermite(a.course_deg, a.turn_rate_deg_s, b.course_deg, b.turn_rate_deg_s, share, kStep_s);
  const double time_s = static_cast<double>(clamped_us) * 1e-6;
  pose.attitude.roll_deg = swing_deg(plan_.roll, time_s);
  pose.attitude.pitch_deg = swing_deg(plan_.pitch, time_s);
  const double heading_deg = course_deg + swing_deg(plan_.yaw, time_s);
  pose.attitude.heading_deg = heading_deg - 360.0 * std::floor(heading_deg / 360.0);
  return pose;
}

}  // namespace leadline::host
