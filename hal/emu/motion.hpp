// What the emulated navigation sensors measure at one instant, in the vehicle's axes: body forward-right-
// down, world north-east-down.
#pragma once

#include <array>

namespace leadline::emu {

struct Motion {
  double roll_deg = 0;                   ///< Euler: starboard down positive
  double pitch_deg = 0;                  ///< bow up positive
  double heading_deg = 0;                ///< clockwise from north
  std::array<double, 3> rate_rad_s{};    ///< about forward, right, down
  std::array<double, 3> velocity_m_s{};  ///< over ground, body
  std::array<double, 3> position_m{};    ///< north, east, down from where the sensor was started
  double heave_m = 0;                    ///< up positive
  double altitude_m = 0;                 ///< above the bottom; 0: none heard
  double depth_m = 0;
  double temperature_degc = 15;
  double sound_speed_m_s = 1500;
  double time_s = 0;  ///< of the sensor's own clock
};

}  // namespace leadline::emu
