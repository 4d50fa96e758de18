// Three-vectors and the attitude convention of the pings file, in double precision.
#pragma once

#include <cmath>

#include "host_tools/sim/exact_math.hpp"

namespace leadline::host {

// North, east, down when in the world frame; forward, right, down when in the vehicle frame.
struct Vec3 {
  double x = 0.0;
  double y = 0.0;
  double z = 0.0;
};

inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator*(double k, Vec3 a) { return {k * a.x, k * a.y, k * a.z}; }
inline double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(Vec3 a, Vec3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double norm(Vec3 a) { return std::sqrt(dot(a, a)); }
inline Vec3 normalized(Vec3 a) { return (1.0 / norm(a)) * a; }

// Two unit vectors that make a right-handed orthonormal triad (side, other, axis) with `axis`.
struct Basis {
  Vec3 side;
  Vec3 other;
};
inline Basis basis_about(Vec3 axis) {
  // Start from the world axis that is least parallel, which keeps the cross product well conditioned.
  const double ax = std::fabs(axis.x);
  const double ay = std::fabs(axis.y);
  const double az = std::fabs(axis.z);
  Vec3 helper{0.0, 0.0, 1.0};
  if (ax <= ay && ax <= az) {
    helper = {1.0, 0.0, 0.0};
  } else if (ay <= az) {
    helper = {0.0, 1.0, 0.0};
  }
  const Vec3 side = normalized(cross(helper, axis));
  return {side, cross(axis, side)};
}

// Roll (starboard down), pitch (nose up), heading (clockwise from north seen from above), degrees.
struct Attitude {
  double roll_deg = 0.0;
  double pitch_deg = 0.0;
  double heading_deg = 0.0;
};

// v_NED = Rz(heading) Ry(pitch) Rx(roll) v_FRD.
inline Vec3 world_from_vehicle(const Attitude& attitude, Vec3 v) {
  const exact::SinCos r = exact::sin_cos(attitude.roll_deg * exact::kRadPerDeg);
  const exact::SinCos p = exact::sin_cos(attitude.pitch_deg * exact::kRadPerDeg);
  const exact::SinCos h = exact::sin_cos(attitude.heading_deg * exact::kRadPerDeg);
  const Vec3 rolled{v.x, r.cos * v.y - r.sin * v.z, r.sin * v.y + r.cos * v.z};
  const Vec3 pitched{p.cos * rolled.x + p.sin * rolled.z, rolled.y,
                     p.cos * rolled.z - p.sin * rolled.x};
  return {h.cos * pitched.x - h.sin * pitched.y, h.sin * pitched.x + h.cos * pitched.y, pitched.z};
}

// Azimuth (from forward, positive to starboard) and elevation (positive down) of a beam, degrees.
struct BeamAngles {
  double azimuth_deg = 0.0;
  double elevation_deg = 90.0;
};

// v_FRD = (cos el cos az, cos el sin az, sin el).
inline Vec3 vehicle_direction(const BeamAngles& beam) {
  const exact::SinCos az = exact::sin_cos(beam.azimuth_deg * exact::kRadPerDeg);
  const exact::SinCos el = exact::sin_cos(beam.elevation_deg * exact::kRadPerDeg);
  return {el.cos * az.cos, el.cos * az.sin, el.sin};
}

// Inverse of vehicle_direction: elevation in [-90, 90], azimuth in (-180, 180].
inline BeamAngles beam_angles(Vec3 direction) {
  const double horizontal = std::sqrt(direction.x * direction.x + direction.y * direction.y);
  return {exact::atan2(direction.y, direction.x) * exact::kDegPerRad,
          exact::atan2(direction.z, horizontal) * exact::kDegPerRad};
}

}  // namespace leadline::host
