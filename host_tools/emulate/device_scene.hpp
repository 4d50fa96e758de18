// The small world of a single emulated device: a flat bottom, and a vehicle that rocks above it.
#pragma once

#include "hal/emu/motion.hpp"
#include "host_tools/sim/vec3.hpp"
#include "model/base/units.hpp"

namespace leadline::host {

/// All of it a function of time alone.
struct DeviceScene {
  double bottom_m = 8.0;   ///< below the device
  double depth_m = 2.0;    ///< of the device below the surface
  Attitude attitude{};     ///< mean
  double swing_deg = 2.0;  ///< amplitude of roll; pitch has half of it, heading a quarter; 0: none
  double speed_m_s = 0.5;  ///< over ground, level, along the mean heading
  double sound_speed_m_s = 1500.0;
  double latitude_deg = 54.3;  ///< where it starts
  double longitude_deg = 10.2;
  double beams_share =
      1.0;  ///< of the beams of a survey multibeam, of the width and height of a camera's picture

  [[nodiscard]] emu::Motion motion(base::TimeUs t_us) const;
  /// To the bottom along `direction` (body frame FRD, of length 1); 0: it meets none, or farther than
  /// `longest_m`.
  [[nodiscard]] double range_m(base::TimeUs t_us, Vec3 direction, double longest_m) const;
  /// Over ground: north, east, down.
  [[nodiscard]] Vec3 velocity_m_s() const;
  /// Absolute, at the device.
  [[nodiscard]] double pressure_pa() const;
  [[nodiscard]] double latitude_at(base::TimeUs t_us) const;
  [[nodiscard]] double longitude_at(base::TimeUs t_us) const;
};

}  // namespace leadline::host
