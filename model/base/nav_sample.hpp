// What an attitude, position, depth or speed sensor said: a codec's product, the estimator's input. A
// plain record.
#pragma once

#include <cstdint>

#include "model/base/pose.hpp"
#include "model/base/units.hpp"

namespace leadline::base {

/// Bits of NavSample::fields: what the sample carries. Everything else in it is zero.
enum NavField : std::uint32_t {
  kNavRollPitch = 1U << 0U,  ///< attitude.roll_bam32, attitude.pitch_bam32
  kNavHeading = 1U << 1U,    ///< attitude.heading_bam32, true north
  kNavHeadingMagnetic =
      1U << 2U,                   ///< attitude.heading_bam32, magnetic: the consumer adds variation
  kNavGeodetic = 1U << 3U,        ///< latitude_e9deg, longitude_e9deg
  kNavPressure = 1U << 4U,        ///< pressure_pa, absolute
  kNavDepth = 1U << 5U,           ///< depth_um below the surface
  kNavVelocityBody = 1U << 6U,    ///< velocity_um_s, FRD
  kNavVelocityWorld = 1U << 7U,   ///< velocity_um_s, NED
  kNavAltitude = 1U << 8U,        ///< altitude_um above the bottom
  kNavUtc = 1U << 9U,             ///< utc_us
  kNavRates = 1U << 10U,          ///< rate_urad_s, body FRD
  kNavHeave = 1U << 11U,          ///< heave_um
  kNavVelocityWater = 1U << 12U,  ///< velocity_um_s, FRD, through the water instead of over ground
  kNavPositionLocal = 1U << 13U,  ///< position_um, NED from an origin of the sensor's own
  kNavSoundSpeed = 1U << 14U,     ///< sound_speed_mm_s
  kNavTemperature = 1U << 15U,    ///< temperature_mdegc
  kNavYawRate = 1U << 16U,        ///< rate_urad_s[2] alone: a sensor of one axis
  kNavPulse = 1U << 17U,          ///< a line's edge at t_us; what it stands for, the port knows
  kNavLeak = 1U << 18U,           ///< leak
};

/// What a message of a sensor is about, whether or not it knew the value: a sample whose kind is kVelocity
/// and whose `fields` are 0 is a velocity that the sensor said to be invalid. Consumers use `fields`.
enum class NavKind : std::uint8_t {
  kOther = 0,
  kAttitude = 1,
  kHeading = 2,
  kPosition = 3,
  kDepth = 4,
  kPressure = 5,
  kVelocity = 6,
  kAltitude = 7,
  kRates = 8,
  kHeave = 9,
  kTime = 10,
  kWater = 11,  ///< sound speed, temperature
  kLine = 12,   ///< an edge or the level of a single line
};

struct NavSample {
  TimeUs t_us;           ///< instant that the sample speaks of: arrival less the sensor's latency
  std::uint32_t fields;  ///< NavField bits
  std::uint8_t quality;  ///< 0 = unusable .. 255 = best; a sensor without a measure reports 255
  NavKind kind;
  std::uint8_t leak;  ///< 1: water where none belongs, 0: none
  Attitude attitude;
  /// One sigma, as the sensor states it; 0 = not stated (the configuration's value holds).
  std::uint32_t sigma_attitude_urad[3];  ///< roll, pitch, heading
  std::uint32_t sigma_position_mm;       ///< horizontal (kNavGeodetic)
  std::int64_t latitude_e9deg;           ///< +-90e9
  std::int64_t longitude_e9deg;          ///< +-180e9
  std::int64_t pressure_pa;
  std::int64_t depth_um;
  std::int64_t altitude_um;
  std::int64_t velocity_um_s[3];
  std::int64_t utc_us;          ///< time of day or since 1970, as the sensor has it; informative
  std::int64_t rate_urad_s[3];  ///< about the body's forward, right, down axes, right-handed
  std::int64_t heave_um;        ///< down positive, about the sensor's own mean
  std::int64_t position_um[3];
  std::int32_t sound_speed_mm_s;
  std::int32_t temperature_mdegc;
  std::uint32_t sigma_velocity_um_s;  ///< each axis; 0 = not stated
  std::uint32_t sigma_vertical_mm;    ///< depth or vertical position; 0 = not stated
  /// The sensor's own clock at t_us, from an origin of its own; 0 = it has none.
  std::int64_t t_device_us;
};

}  // namespace leadline::base
