// What heads with many beams share: angles of the wire to directions of a ping. Vehicle code.
#pragma once

#include <cstdint>

#include "model/base/ping.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

/// `value` of `turn` parts of a full turn, rounded to the nearest; |value| <= 2^30, 0 < turn <= 2^30.
[[nodiscard]] constexpr base::Bam32 bam_of_parts(std::int64_t value, std::int64_t turn) {
  const std::int64_t scaled = value * (std::int64_t{1} << 32U);
  const std::int64_t half = scaled < 0 ? -(turn / 2) : turn / 2;
  return static_cast<base::Bam32>(static_cast<std::uint64_t>((scaled + half) / turn));
}

/// Directs a ping along a beam of a fan that looks down: the fan lies in the plane of the mount's down and
/// right axes, 0 is straight down, angles grow to the right (starboard),
///   direction = (0, sin a, cos a) in the mount's frame,
/// and the beam's along axis (the one that is wide where the transmitter is narrow across) lies fore and
/// aft. So a multibeam head on an unrotated mount looks at the bottom; every head of that kind uses this.
constexpr void set_fan_beam(base::Ping& ping, base::Bam32 to_starboard_bam32) {
  ping.azimuth_bam32 = base::kBam32QuarterTurn;
  ping.elevation_bam32 = base::kBam32QuarterTurn - to_starboard_bam32;
  ping.rotation_bam32 = base::kBam32QuarterTurn;
}

}  // namespace leadline::hal
