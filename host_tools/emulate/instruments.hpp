// What the vehicle's instruments measure of the truth: ranges and echoes of sonar heads, attitude, fixes,
// pressure, each with its errors. Protocols and bytes are not here (hal/emu).
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "host_tools/emulate/mission.hpp"
#include "host_tools/emulate/trajectory.hpp"
#include "host_tools/sim/echo.hpp"
#include "host_tools/sim/random.hpp"

namespace leadline::host {

/// A slow error: a first-order Gauss-Markov process, zero at the start.
class SlowError {
 public:
  SlowError(double sigma, double time_s, std::uint64_t seed, std::uint64_t stream)
      : sigma_(sigma), time_s_(time_s), random_(seed, stream) {}
  /// Its value at `time_us`, not before the time of the call before.
  double at(std::int64_t time_us);

 private:
  double sigma_;
  double time_s_;
  Random random_;
  std::int64_t last_us_ = 0;
  double value_ = 0.0;
};

/// What one head heard of one ping.
struct Heard {
  std::optional<double> range_m;  ///< slant range with its error; unset: nothing
  bool outlier = false;
  bool dropout = false;
  std::optional<double> fish_m;  ///< slant range of a fish that was heard before the ground
  double fish_share = 0.0;       ///< its part of the ground's energy
};

/// One sonar head over a ground. Times are of the survey; 0 = it sets out.
class Sounder {
 public:
  /// All three must outlive the object. `number` of the head keeps its random numbers apart.
  Sounder(const Terrain& ground, const Trajectory& trajectory, const Mission& mission,
          std::size_t number);

  /// A ping transmitted at `time_us`, the beam turned to `azimuth_deg` (Ping360; a Ping1D looks down
  /// its axis). Marks the cells that it touched.
  Heard ping(std::int64_t time_us, double azimuth_deg, TouchedMask* touched);

  /// The echo of the last ping() over `length_m` from `start_m`, in `samples.size()` equal bins: 8 bit,
  /// the strongest at 220 over a floor of noise. An outlier is a short echo of its own, a fish one beside
  /// the ground's, a dropout leaves the noise.
  void profile(double start_m, double length_m, std::vector<std::uint8_t>* samples);

 private:
  const Trajectory& trajectory_;
  const Mission& mission_;
  const HeadSpec& head_;
  EchoModel echo_;
  Random range_;
  Random outlier_;
  Random dropout_;
  Random noise_;
  Random fish_;
  Vec3 misalignment_rad_;  ///< about the head's forward and right axes
  Heard last_;
  bool hit_ = false;  ///< the last ping met ground, whatever was made of it
};

struct FixReading {
  double latitude_deg;
  double longitude_deg;
};

/// The navigation sensors of one vehicle. Every call draws its errors: ask once per sentence, in order
/// of time.
class NavigationSensors {
 public:
  NavigationSensors(const Trajectory& trajectory, const Mission& mission);

  [[nodiscard]] Attitude attitude(std::int64_t time_us);
  [[nodiscard]] FixReading fix(std::int64_t time_us);
  /// Absolute, pascal.
  [[nodiscard]] double pressure_pa(std::int64_t time_us);

 private:
  const Trajectory& trajectory_;
  const NavigationSpec& spec_;
  Random attitude_;
  Random fix_;
  Random pressure_;
  SlowError heading_;
  SlowError north_;
  SlowError east_;
  double metres_per_degree_north_;
  double metres_per_degree_east_;
};

/// Pressure at the surface and what a metre of water adds, as vehicle.toml states them.
inline constexpr double kSurfacePressure_pa = 101'325.0;
inline constexpr double kWaterDensity_kg_m3 = 1029.0;
inline constexpr double kGravity_m_s2 = 9.80665;

}  // namespace leadline::host
