// Simulated surveys: pings with all their errors, and the truth to measure a map against.
//
// A scene is a terrain, a sonar, a way to survey, and errors. simulate() flies it; write_scene() leaves
// it as a folder of the layout that `leadline map` and `leadline compare` work on:
//
//   pings.csv    what the vehicle reports: pose and beam columns with their errors, range
//   map.toml     the physical values, for `leadline map --config`
//   truth.asc    elevation of every cell (metres up = minus depth, row 0 north)
//   touched.asc  1 where any ray of any ping hit the ground, else 0
//
// Frames and signs are those of the pings file: NED positions of the transducer, v_FRD = (cos el cos az,
// cos el sin az, sin el), v_NED = Rz(heading) Ry(pitch) Rx(roll) v_FRD. Everything follows from the
// scene's seed: the same options give the same bytes on every host.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/sim/echo.hpp"
#include "host_tools/sim/terrain.hpp"
#include "host_tools/sim/terrain_sources.hpp"
#include "host_tools/sim/vec3.hpp"

namespace leadline::host {

enum class SurveyKind : std::uint8_t {
  /// Pings from random places over the grid (those over its outer half cell are dropped), at random
  /// altitudes, looking in random directions within `max_tilt_deg` of straight down (uniform in solid
  /// angle).
  kRandom,
  /// A lawn mower: lines along north, `line_spacing_m` apart, flown alternately north and south.
  /// `beam_count` beams are spread evenly over `opening_deg` across the track (one beam looks straight
  /// down), under sinusoidal roll, pitch and yaw.
  kLawnmower,
};

/// Sinusoid of time: amplitude_deg * sin(2 pi t / period_s + phase_rad).
struct Swing {
  double amplitude_deg = 0.0;
  double period_s = 1.0;
  double phase_rad = 0.0;
};

struct SurveySpec {
  SurveyKind kind = SurveyKind::kLawnmower;
  double interval_s = 0.1;  ///< between transmissions, over 0, at least a microsecond

  // kRandom
  std::size_t ping_count = 10000;  ///< planned; those that miss the terrain are dropped
  double altitude_min_m = 10.0;    ///< above the ground below the transducer
  double altitude_max_m = 40.0;
  double max_tilt_deg = 40.0;  ///< 0 .. below 90

  // kLawnmower
  double line_spacing_m = 4.0;  ///< the first line runs half of it from the west edge
  double along_step_m = 1.0;    ///< between transmissions
  double altitude_m = 15.0;     ///< above the ground below the transducer
  /// The altitude refers to the mean of the ground this far ahead and astern, as a vehicle with some
  /// inertia flies, but never falls under half of it. 0: the altitude is kept exactly.
  double altitude_smoothing_m = 0.0;
  /// Instead: this depth below the surface everywhere, NED z; must stay above the ground.
  std::optional<double> depth_m;
  std::size_t beam_count = 1;
  double opening_deg = 0.0;  ///< between the outermost beams' axes, 0 .. below 180
  Swing roll{0.0, 7.3, 0.0};
  Swing pitch{0.0, 5.1, 1.0};
  Swing yaw{0.0, 11.7, 2.0};
};

/// All sigmas are one standard deviation of a Gaussian.
struct ErrorSpec {
  double sigma_range_m = 0.0;
  double sigma_pointing_deg = 0.0;  ///< of each of the two angles across the beam's axis
  Vec3 sigma_position_m;            ///< north, east, down, independent per beam
  /// Horizontal drift of the reported position, the same for all beams of a transmission: a first
  /// order Gauss-Markov process per axis, zero at the start, this sigma in the long run.
  double drift_sigma_m = 0.0;
  double drift_time_s = 60.0;     ///< its correlation time
  double outlier_fraction = 0.0;  ///< returns replaced by one uniform between 0 and the range
  double dropout_fraction = 0.0;  ///< returns lost (empty range, though the bottom is there)
};

/// What map.toml says of the sonar and of navigation beyond the errors above.
struct DeclaredSpec {
  double min_range_m = 0.5;
  double max_range_m = 80.0;
  bool drift = false;                 ///< state the drift as sigma_correlated_mm
  std::size_t down_margin_cells = 4;  ///< of the grid above and below the terrain
};

struct Scene {
  std::uint64_t seed = 1;
  EchoSpec echo;
  SurveySpec survey;
  ErrorSpec errors;
  DeclaredSpec declared;
};

/// One row of pings.csv, as reported by the vehicle.
struct SimulatedPing {
  std::int64_t time_us = 0;
  Vec3 position_m;
  Attitude attitude;
  BeamAngles beam;
  std::optional<double> range_m;  ///< unset: no return heard
};

struct Survey {
  std::vector<SimulatedPing> pings;  ///< sorted by time, beams of a transmission port to starboard
  TouchedMask touched;               ///< one byte per cell, as Terrain::depths_m
  std::size_t planned_count = 0;     ///< beams sent
  std::size_t missed_count = 0;      ///< dropped because the beam missed the terrain
  std::size_t outlier_count = 0;
  std::size_t dropout_count = 0;
};

/// Flies `scene` over `terrain`. Errors are drawn from separate streams of the seed, so one can be
/// switched off without changing the others. `progress`, if given, is called with (done, planned) beams.
/// Throws std::invalid_argument naming field and value for what makes no sense.
[[nodiscard]] Survey simulate(
    const Terrain& terrain, const Scene& scene,
    const std::function<void(std::uint64_t, std::uint64_t)>& progress = {});

/// pings.csv, map.toml as text.
[[nodiscard]] std::string format_pings_csv(const Survey& survey);
[[nodiscard]] std::string format_map_toml(const Terrain& terrain, const Scene& scene);

/// Writes the four files into `directory` (created; whole or not at all, see OutputDir). Throws
/// HostError kOutput.
void write_scene(const std::string& directory, const Terrain& terrain, const Scene& scene,
                 const Survey& survey);

}  // namespace leadline::host
