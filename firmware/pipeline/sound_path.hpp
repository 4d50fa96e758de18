// From a beam as its head reported it to the straight line that the model takes: the water's sound speed in
// place of the one that the head reckoned with.
//
// Speed of the water: the profile's (WaterConfig), without one the configured speed where it is known.
// Without either, or where the head reckoned with the same speed and there is no profile, a ping stays as
// it is, bit by bit.
//
//   range      two-way time = 2 range / the head's speed, whatever the head took for a range
//   direction  an array fixes sin(angle from its face's normal) / speed by its phases: at another speed the
//              components along the face change in proportion, the one along the normal is what is left.
//              A head that points mechanically, or has one beam, is not turned (ArrayFace)
//   path       with a profile the ray is followed through the layers (estimator/refraction.hpp) from the
//              head's depth on, in its vertical plane; upward ones through the mirrored profile. The ping
//              becomes the straight line to the ray's end
//
// Beams flatter than estimator::kMinCosine at the head (84.3 degrees from the vertical) are not bent: they go
// straight at the speed at the head, off by range^2 gradient / 2 speed (0.1 m/s a metre, 40 m: 5 cm). A ray
// that gets there later, by the profile, has no end that is known: PingLoss::kNoPath.
//
// The footprint's axis (Ping::rotation_bam32) stays where it was, as far as the new direction lets it.
//
// Beams without an echo keep their range, and are turned only: they are not bent.
#pragma once

#include <cstdint>

#include "estimator/refraction.hpp"
#include "firmware/pipeline/config.hpp"
#include "firmware/pipeline/drivers.hpp"
#include "model/base/ping.hpp"
#include "model/base/pose.hpp"
#include "model/base/status.hpp"

namespace leadline::firmware {

/// About 2 KiB. Trivially copyable.
class SoundPath {
 public:
  /// * kOutOfRange: too many points, a depth or speed beyond the limits of estimator/refraction.hpp
  /// * kInvalidArgument: depths that do not increase
  /// Nothing changed then.
  [[nodiscard]] base::Status configure(const VehicleConfig& config);

  /// The water's speed from now on, where there is no profile; heads that state none go on reckoning with the
  /// configured one. kNotReady: there is a profile. kOutOfRange: beyond the limits of configure().
  [[nodiscard]] base::Status set_water_speed(std::int32_t speed_mm_s);

  /// Makes range and direction of `ping` those of the straight line; `head` is the pose of its mount,
  /// its depth below the surface. False: it has none, and the ping is not to be used. O(points).
  [[nodiscard]] bool straighten(base::Ping& ping, const base::Pose& head, ArrayFace face) const;

 private:
  [[nodiscard]] bool bend(base::Ping& ping, const base::Pose& head, std::int32_t told_mm_s) const;

  estimator::SoundSpeedProfile profile_;   ///< size 0: none
  estimator::SoundSpeedProfile mirrored_;  ///< for rays that go up
  std::int32_t configured_mm_s_ = 0;       ///< what a head reckons with that does not say
  std::int32_t water_mm_s_ = 0;
  bool known_ = false;
};

}  // namespace leadline::firmware
