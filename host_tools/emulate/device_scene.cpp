#include "host_tools/emulate/device_scene.hpp"

#include "host_tools/emulate/instruments.hpp"
#include "host_tools/sim/exact_math.hpp"

namespace leadline::host {
namespace {

// Periods that meet again only after 385 s.
constexpr double kRollPeriod_s = 5.0;
constexpr double kPitchPeriod_s = 7.0;
constexpr double kHeadingPeriod_s = 11.0;
// Beams flatter than this (cosine of the angle from the vertical) find nothing.
constexpr double kFlattest = 0.05;
constexpr double kMetresPerDegree = 111'195.0;

/// A swinging angle and its rate.
struct Rocking {
  double deg;
  double rate_deg_s;
};

Rocking rocking(double mean_deg, double amplitude_deg, double period_s, double t_s) {
  const double per_s = 2.0 * exact::kPi / period_s;
  const exact::SinCos phase = exact::sin_cos(per_s * t_s);
  return {mean_deg + amplitude_deg * phase.sin, amplitude_deg * per_s * phase.cos};
}

double turn(double deg) { return deg - 360.0 * std::floor(deg / 360.0); }

/// The transpose of world_from_vehicle().
Vec3 vehicle_from_world(const Attitude& attitude, Vec3 v) {
  const auto along = [&](Vec3 axis) {
    const Vec3 in_world = world_from_vehicle(attitude, axis);
    return in_world.x * v.x + in_world.y * v.y + in_world.z * v.z;
  };
  return {along({1, 0, 0}), along({0, 1, 0}), along({0, 0, 1})};
}

Attitude attitude_of(const emu::Motion& motion) {
  return {motion.roll_deg, motion.pitch_deg, motion.heading_deg};
}

}  // namespace

emu::Motion DeviceScene::motion(base::TimeUs t_us) const {
  const double t_s = static_cast<double>(t_us) * 1e-6;
  const Rocking roll = rocking(attitude.roll_deg, swing_deg, kRollPeriod_s, t_s);
  const Rocking pitch = rocking(attitude.pitch_deg, 0.5 * swing_deg, kPitchPeriod_s, t_s);
  const Rocking heading = rocking(attitude.heading_deg, 0.25 * swing_deg, kHeadingPeriod_s, t_s);
  emu::Motion motion;
  motion.roll_deg = roll.deg;
  motion.pitch_deg = pitch.deg;
  motion.heading_deg = turn(heading.deg);
  // Rates of Euler angles to rates about the body's axes.
  const exact::SinCos r = exact::sin_cos(roll.deg * exact::kRadPerDeg);
  const exact::SinCos p = exact::sin_cos(pitch.deg * exact::kRadPerDeg);
  motion.rate_rad_s = {
      (roll.rate_deg_s - heading.rate_deg_s * p.sin) * exact::kRadPerDeg,
      (pitch.rate_deg_s * r.cos + heading.rate_deg_s * p.cos * r.sin) * exact::kRadPerDeg,
      (heading.rate_deg_s * p.cos * r.cos - pitch.rate_deg_s * r.sin) * exact::kRadPerDeg};
  const Vec3 velocity = velocity_m_s();
  const Vec3 body = vehicle_from_world(attitude_of(motion), velocity);
  motion.velocity_m_s = {body.x, body.y, body.z};
  motion.position_m = {velocity.x * t_s, velocity.y * t_s, 0.0};
  motion.altitude_m = bottom_m;
  motion.depth_m = depth_m;
  motion.sound_speed_m_s = sound_speed_m_s;
  motion.time_s = t_s;
  return motion;
}

Vec3 DeviceScene::velocity_m_s() const {
  const exact::SinCos course = exact::sin_cos(attitude.heading_deg * exact::kRadPerDeg);
  return {speed_m_s * course.cos, speed_m_s * course.sin, 0.0};
}

double DeviceScene::range_m(base::TimeUs t_us, Vec3 direction, double longest_m) const {
  const double down = world_from_vehicle(attitude_of(motion(t_us)), direction).z;
  const double range = down > kFlattest ? bottom_m / down : 0.0;
  return range <= longest_m ? range : 0.0;
}

double DeviceScene::pressure_pa() const {
  return kSurfacePressure_pa + kWaterDensity_kg_m3 * kGravity_m_s2 * depth_m;
}

double DeviceScene::latitude_at(base::TimeUs t_us) const {
  return latitude_deg + motion(t_us).position_m[0] / kMetresPerDegree;
}

double DeviceScene::longitude_at(base::TimeUs t_us) const {
  const double per_degree_m = kMetresPerDegree * exact::cos(latitude_deg * exact::kRadPerDeg);
  return longitude_deg + motion(t_us).position_m[1] / per_degree_m;
}

}  // namespace leadline::host
