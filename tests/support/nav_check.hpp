// What every sample of every codec keeps, whatever the bytes: for fuzz targets, so without a test framework.
#pragma once

#include <cstdint>
#include <cstdlib>

#include "model/base/nav_sample.hpp"

namespace leadline::test {

inline void require(bool condition) {
  if (!condition) {
    std::abort();
  }
}

inline bool within(std::int64_t value, std::int64_t low, std::int64_t high) {
  return value >= low && value <= high;
}

/// `has` carries values within the range; without it they are 0.
inline void require_range(bool has, std::int64_t value, std::int64_t low, std::int64_t high) {
  require(has ? within(value, low, high) : value == 0);
}

/// Aborts when a value lies outside its range, or is there without its bit.
inline void require_sound(const base::NavSample& sample) {
  using namespace base;  // NOLINT: the bits' names
  const auto has = [&sample](unsigned bits) { return (sample.fields & bits) != 0; };
  const bool heading = has(kNavHeading | kNavHeadingMagnetic);
  require(!(has(kNavHeading) && has(kNavHeadingMagnetic)));
  require(heading || sample.attitude.heading_bam32 == 0);
  require(has(kNavRollPitch) ||
          (sample.attitude.roll_bam32 == 0 && sample.attitude.pitch_bam32 == 0));
  require_range(has(kNavGeodetic), sample.latitude_e9deg, -90'000'000'000, 90'000'000'000);
  require_range(has(kNavGeodetic), sample.longitude_e9deg, -180'000'000'000, 180'000'000'000);
  require_range(has(kNavPressure), sample.pressure_pa, 1, 210'000'000);
  require_range(has(kNavDepth), sample.depth_um, -kMaxVertical_um, kMaxVertical_um);
  require_range(has(kNavAltitude), sample.altitude_um, 1, kMaxRange_um);
  require_range(has(kNavHeave), sample.heave_um, -kMaxVertical_um, kMaxVertical_um);
  require_range(has(kNavUtc), sample.utc_us, 0, std::int64_t{1} << 62U);
  require_range(has(kNavTemperature), sample.temperature_mdegc, -50'000, 150'000);
  require_range(has(kNavSoundSpeed), sample.sound_speed_mm_s, 1'000'000, 2'000'000);
  const bool moving = has(kNavVelocityBody | kNavVelocityWorld | kNavVelocityWater);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    require_range(moving, sample.velocity_um_s[axis], -700'000'000, 700'000'000);
    const bool turning = has(kNavRates) || (axis == 2 && has(kNavYawRate));
    require_range(turning, sample.rate_urad_s[axis], -100'000'000, 100'000'000);
    require_range(has(kNavPositionLocal), sample.position_um[axis], -kMaxHorizontal_um,
                  kMaxHorizontal_um);
  }
  for (const std::uint32_t sigma_urad : sample.sigma_attitude_urad) {
    require(sigma_urad <= 3'141'593);
  }
}

}  // namespace leadline::test
