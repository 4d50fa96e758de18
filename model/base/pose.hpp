// Where the vehicle was: the estimator's product, the model's input. A plain record.
#pragma once

#include <cstdint>

#include "model/base/units.hpp"

namespace leadline::base {

/// Attitude of the body (FRD) in the world (NED): v_NED = Rz(heading) Ry(pitch) Rx(roll) v_FRD.
/// Roll positive starboard down, pitch positive nose up, heading clockwise from true/grid north.
struct Attitude {
  Bam32 roll_bam32;
  Bam32 pitch_bam32;
  Bam32 heading_bam32;
};

/// Bits of Pose::validity. A consumer must find every bit that it needs; an unknown bit is ignored.
enum PoseValidity : std::uint8_t {
  kPoseHorizontal = 1U << 0U,  ///< position_um[kNorth], [kEast] and their sigmas
  kPoseVertical = 1U << 1U,    ///< position_um[kDown] and its sigma
  kPoseAttitude = 1U << 2U,    ///< attitude and its sigmas
  kPoseAll = kPoseHorizontal | kPoseVertical | kPoseAttitude,
};

/// Covariance of a pose, one standard deviation each plus the correlations that a navigation filter
/// can state. Position and attitude are taken as uncorrelated with each other.
struct PoseCovariance {
  std::uint32_t sigma_position_mm[3];      ///< per NED axis, independent from one ping to the next
  std::int8_t correlation_ne_q7;           ///< north-east correlation coefficient * 128
  std::int8_t correlation_nd_q7;           ///< north-down
  std::int8_t correlation_ed_q7;           ///< east-down
  std::uint8_t reserved;                   ///< zero
  std::uint16_t sigma_attitude_urad16[3];  ///< roll, pitch, heading in units of 16 microradians
  std::uint16_t reserved2;                 ///< zero
};

/// The vehicle's reference point and attitude at one instant.
struct Pose {
  TimeUs t_us;
  std::int64_t position_um[3];  ///< NED from the survey's origin; |n|,|e| <= kMaxHorizontal_um
  Attitude attitude;
  PoseCovariance covariance;
  /// Changes whenever navigation jumps (a fix after a gap, a re-origin): poses of two epochs are
  /// never interpolated nor mixed silently.
  std::uint16_t epoch;
  std::uint8_t validity;  ///< PoseValidity bits
  std::uint8_t reserved;  ///< zero
};

static_assert(sizeof(Pose) == 72, "Pose is copied through rings: its size is part of the contract");

}  // namespace leadline::base
