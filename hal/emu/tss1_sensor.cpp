#include "hal/emu/tss1_sensor.hpp"

#include <cmath>
#include <cstdio>

namespace leadline::emu {

namespace {

constexpr double kRadian_deg = 180.0 / 3.14159265358979323846;

/// Sign column and four digits.
void append(Bytes& line, double value) {
  char text[8];
  const long rounded = std::lround(std::fabs(value));
  std::snprintf(text, sizeof text, "%c%04ld", value < 0 && rounded != 0 ? '-' : ' ',
                rounded > 9999 ? 9999 : rounded);
  line.insert(line.end(), text, text + 5);
}

}  // namespace

Bytes tss1_line(const Motion& motion, char status) {
  // The angle between the athwartships axis and the horizon.
  const double roll = motion.roll_deg / kRadian_deg;
  const double pitch = motion.pitch_deg / kRadian_deg;
  const double off_level_deg = std::asin(std::sin(roll) * std::cos(pitch)) * kRadian_deg;
  Bytes line{':', '0', '0', '0', '0', '0', '0', ' '};
  append(line, motion.heave_m * 100.0);
  line.push_back(static_cast<std::uint8_t>(status));
  append(line, off_level_deg * 100.0);
  line.push_back(' ');
  append(line, motion.pitch_deg * 100.0);
  line.push_back('\r');
  line.push_back('\n');
  return line;
}

}  // namespace leadline::emu
