// Every driver that there is: its number, its name, and what it brings. Adding one is a line here and a line
// in driver_codecs.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace leadline::firmware {

/// What speaks at the end of a port. The numbers stand in logs: never changed, never used again.
enum class Driver : std::uint8_t {
  kNone = 0,
  kPing1d = 1,
  kPing360 = 2,
  kNmea = 3,
  kCerulean = 4,
  kImagenex = 5,
  kDeltat83p = 6,
  kTritech = 7,
  kR2sonic = 8,
  kKongsberg = 9,
  kWl3d = 10,
  kTss1 = 11,
  kVectornav = 12,
  kXsens = 13,
  kTrax = 14,
  kWldvl = 15,
  kPd0 = 16,
  kKeller = 17,
  kNmea2000 = 18,
  kMavlink = 19,
  kLine = 20,
};
inline constexpr std::uint8_t kLastDriver = 20;

enum class DriverKind : std::uint8_t {
  kHead = 0,    ///< sonar: its records are base::Ping, and it sits on a mount
  kSensor = 1,  ///< attitude, position, depth, speed: its records are base::NavSample
};

/// Face of an array that forms its beams by phase, in the mount's frame. Phases fix the direction for the
/// speed of sound that the head reckons with: another one turns the beam (sound_path.hpp).
enum class ArrayFace : std::uint8_t {
  kNone = 0,     ///< a beam as the head points: nothing turns it
  kDown = 1,     ///< looks down: steered across
  kForward = 2,  ///< looks ahead: steered both ways
};

struct DriverInfo {
  Driver driver = Driver::kNone;
  const char* name = "none";  ///< in vehicle.toml, on command lines, in reports
  DriverKind kind = DriverKind::kSensor;
  ArrayFace face = ArrayFace::kNone;
};

/// In the order of their numbers, kNone left out.
inline constexpr std::array<DriverInfo, kLastDriver> kDrivers{{
    {Driver::kPing1d, "ping1d", DriverKind::kHead},
    {Driver::kPing360, "ping360", DriverKind::kHead},
    {Driver::kNmea, "nmea", DriverKind::kSensor},
    {Driver::kCerulean, "cerulean", DriverKind::kHead, ArrayFace::kDown},
    {Driver::kImagenex, "imagenex", DriverKind::kHead},
    {Driver::kDeltat83p, "deltat83p", DriverKind::kHead, ArrayFace::kDown},
    {Driver::kTritech, "tritech", DriverKind::kHead},
    {Driver::kR2sonic, "r2sonic", DriverKind::kHead, ArrayFace::kDown},
    {Driver::kKongsberg, "kongsberg", DriverKind::kHead, ArrayFace::kDown},
    {Driver::kWl3d, "wl3d", DriverKind::kHead, ArrayFace::kForward},
    {Driver::kTss1, "tss1", DriverKind::kSensor},
    {Driver::kVectornav, "vectornav", DriverKind::kSensor},
    {Driver::kXsens, "xsens", DriverKind::kSensor},
    {Driver::kTrax, "trax", DriverKind::kSensor},
    {Driver::kWldvl, "wldvl", DriverKind::kSensor},
    {Driver::kPd0, "pd0", DriverKind::kSensor},
    {Driver::kKeller, "keller", DriverKind::kSensor},
    {Driver::kNmea2000, "nmea2000", DriverKind::kSensor},
    {Driver::kMavlink, "mavlink", DriverKind::kSensor},
    {Driver::kLine, "line", DriverKind::kSensor},
}};

namespace detail {
constexpr bool numbered_in_order() {
  for (std::size_t i = 0; i < kDrivers.size(); ++i) {
    if (static_cast<std::size_t>(kDrivers[i].driver) != i + 1) {
      return false;
    }
  }
  return true;
}
// By index, not by pointer: under a sanitizer g++ 12 takes no pointer to a constant for a constant.
constexpr bool known(Driver driver) {
  return driver != Driver::kNone && static_cast<std::size_t>(driver) <= kDrivers.size();
}
constexpr const DriverInfo& row_of(Driver driver) {
  return kDrivers[static_cast<std::size_t>(driver) - 1];
}
}  // namespace detail
static_assert(detail::numbered_in_order(), "driver_info() looks a driver up by its number");

/// Null for kNone and for numbers that no driver has (a log of a newer version). O(1).
[[nodiscard]] constexpr const DriverInfo* driver_info(Driver driver) {
  const auto number = static_cast<std::size_t>(driver);
  return number >= 1 && number <= kDrivers.size() ? &kDrivers[number - 1] : nullptr;
}

/// "none" where driver_info() knows nothing. O(1).
[[nodiscard]] constexpr const char* driver_name(Driver driver) {
  const DriverInfo* const info = driver_info(driver);
  return info != nullptr ? info->name : "none";
}

[[nodiscard]] constexpr ArrayFace array_face(Driver driver) {
  return detail::known(driver) ? detail::row_of(driver).face : ArrayFace::kNone;
}

[[nodiscard]] constexpr bool is_head(Driver driver) {
  return detail::known(driver) && detail::row_of(driver).kind == DriverKind::kHead;
}

}  // namespace leadline::firmware
