// What a sonar head heard on one beam: a codec's product, the model's input. A plain record.
#pragma once

#include <cstdint>

#include "model/base/units.hpp"

namespace leadline::base {

/// What a beam brought back.
enum class ReturnKind : std::uint8_t {
  kRange = 0,     ///< One range: the first return that the head's detector accepted.
  kNoReturn = 1,  ///< Listened to the end of its range and heard nothing.
  kProfile = 2,   ///< Intensities per range bin, not yet detected.
};

/// Intensities of one beam. The bytes belong to whoever made the record and stay valid only during
/// the call that passes it on (no ownership, no copy).
struct RangeProfile {
  const std::uint16_t* intensity;  ///< bin_count values, linear, device scale; null when none
  std::uint32_t bin_um;            ///< length of one bin along the range
  std::int64_t first_bin_um;       ///< range of the centre of bin 0
  std::uint16_t bin_count;
};

/// One beam of one transmission. Several records share `t_transmit_us` when one transmission has many
/// beams; each is processed on its own.
struct Ping {
  TimeUs t_transmit_us;
  TimeUs t_receive_us;  ///< arrival of the detected echo (>= t_transmit_us)
  /// Beam direction in the mount's frame (FRD): v = (cos el cos az, cos el sin az, sin el).
  Bam32 azimuth_bam32;
  Bam32 elevation_bam32;
  /// Rotation of a non-axisymmetric beam about its own axis, right-handed; 0 keeps the along-track
  /// axis in the mount's forward direction.
  Bam32 rotation_bam32;
  std::uint16_t mount;  ///< index into the configured mounts (lever arm, boresight)
  ReturnKind kind;
  std::uint8_t quality;   ///< 0 = unusable .. 255 = best; a head without a measure reports 255
  std::int64_t range_um;  ///< kRange only: slant range, 0 < range_um <= kMaxRange_um
  RangeProfile profile;   ///< kProfile only
  /// Speed of sound that range_um and the beam's direction were made with; 0: the configured one.
  std::int32_t sound_speed_mm_s;
  /// The head's own clock at t_transmit_us, from an origin of its own; 0: it has none, or t_transmit_us is it.
  TimeUs t_device_us;
};

}  // namespace leadline::base
