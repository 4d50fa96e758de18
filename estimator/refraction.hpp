// Where a sound ray ends that was launched at an angle and came back after a time, through water whose
// sound speed changes with depth: a ray bends, and a range along a straight line is wrong twice, in
// length and in direction.
//
// Water. Horizontal layers between the points of a profile; within a layer the speed changes linearly
// with depth, above the first and below the last point it stays. There a ray is an arc of a circle, and
// every step below is the closed form of that arc, written so that nothing cancels where the gradient goes
// to zero (no case distinction, no logarithm, no sine):
//   Snell        p = sin(angle) / c is constant along the ray
//   whole layer  chord d between speeds a and b:  t = d / sqrt(ab) * arsinh(q) / q,  q = g d / (2 sqrt(ab))
//   part of one  h = g t:  depth and distance from cosh h, sinh h / h, (cosh h - 1) / h^2
//
// Launch. The head steers by phase, for the sound speed that it was told; p = sin(angle) / told speed is
// what the array fixed, whatever the water at its face was. So a wrong speed at the head is corrected by
// putting the told speed in, nothing else (flat arrays, along the array's axis taken as horizontal).
//
// IEEE single precision with + - * / sqrt only: the same bits on every target. Relative error of the
// position below 2e-6 of the range (a test measures it against a double integration of the ray's
// equation), for q and |h| <= kMaxBend.
//
// Uncertainty. A speed that is off by s everywhere (the profile's own error; p is known) moves the end,
// to first order, by  down: |1 - tan^2| s/c of the depth below the head,  sideways: 2 s/c of the
// distance. It is zero at 45 degrees in depth and grows without bound towards the side: sigma_*_um say
// how much, for the profile's sigma.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/base/status.hpp"
#include "model/base/units.hpp"

namespace leadline::estimator {

inline constexpr std::size_t kMaxProfilePoints = 64;
/// Speeds that water has. Inclusive.
inline constexpr std::int32_t kMinSoundSpeed_mm_s = 1'300'000;
inline constexpr std::int32_t kMaxSoundSpeed_mm_s = 1'700'000;
/// Largest |q| and |h| of one layer that the series serve (a ray that turns within a layer gets there).
inline constexpr float kMaxBend = 0.25F;
/// Rays flatter than this cosine of the angle from straight down are refused. 84.3 degrees.
inline constexpr float kMinCosine = 0.1F;

struct SoundSpeedPoint {
  std::int64_t depth_um;  ///< down, in the frame of the head's depth
  std::int32_t speed_mm_s;
};

/// Speed by depth. Trivially copyable, about 1 KiB.
class SoundSpeedProfile {
 public:
  /// The same speed everywhere. kOutOfRange: nothing changed.
  [[nodiscard]] base::Status set_uniform(std::int32_t speed_mm_s);
  /// Copies `points`, depths strictly increasing.
  /// * kOutOfRange: a speed or depth beyond its limits; kInvalidArgument: none, too many, not increasing.
  ///   Nothing changed.
  [[nodiscard]] base::Status set(const SoundSpeedPoint* points, std::size_t count);

  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] const SoundSpeedPoint& point(std::size_t index) const { return points_[index]; }
  /// Linear between the points. 0 without points. O(points).
  [[nodiscard]] std::int32_t speed_at_mm_s(std::int64_t depth_um) const;

  /// One sigma of the profile as a whole, for the result's sigmas; 0 unless set.
  void set_sigma(std::int32_t sigma_mm_s) { sigma_mm_s_ = sigma_mm_s; }
  [[nodiscard]] std::int32_t sigma_mm_s() const { return sigma_mm_s_; }

 private:
  std::array<SoundSpeedPoint, kMaxProfilePoints> points_{};
  std::size_t count_ = 0;
  std::int32_t sigma_mm_s_ = 0;
};

/// One beam as the head reported it, turned into the world.
struct RayLaunch {
  std::int64_t head_depth_um;
  base::Bam32 from_down_bam32;   ///< angle from straight down, 0 .. quarter turn
  std::int32_t told_speed_mm_s;  ///< that the head steered with; 0: the profile's at the head
  std::int64_t two_way_ns;
};

struct RayEnd {
  std::int64_t across_um;  ///< horizontal distance, along the direction of launch
  std::int64_t down_um;    ///< below the head
  std::int64_t sigma_across_um;
  std::int64_t sigma_down_um;
};

/// The straight line to the same end: what the model takes.
struct StraightRay {
  std::int64_t range_um;
  base::Bam32 from_down_bam32;
};

/// Follows the ray for half the two-way time. O(points), at most kMaxProfilePoints + 1 layers.
/// * kNotReady: no profile
/// * kInvalidArgument: a time that is negative or over 40 s, an angle over a quarter turn, a speed outside
///   the limits
/// * kOutOfRange: flatter than kMinCosine somewhere on the way (the ray may turn back up), or bent by more
///   than kMaxBend in a layer
[[nodiscard]] base::Result<RayEnd> trace_ray(const SoundSpeedProfile& profile,
                                             const RayLaunch& launch);

/// O(1).
[[nodiscard]] StraightRay straight_ray(const RayEnd& end);

}  // namespace leadline::estimator
