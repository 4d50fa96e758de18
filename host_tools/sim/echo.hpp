// What a narrow-beam echo sounder hears: the physics of the test scenes and of the emulated heads.
//
// The beam is a cone of rays around its axis, each weighted (cos t - cos T) / (1 - cos T), t the angle
// off the axis and T the half-angle where the weight reaches zero. The rays' energies, sorted into range
// bins, are the echo; the range reported is where a given fraction of the energy has arrived. On a flat
// bottom that is a little beyond the nearest point, on a slope it lies uphill of the axis: every
// instrument that detects the leading edge reads natural ground shallow, and so does this one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "host_tools/sim/terrain.hpp"
#include "host_tools/sim/vec3.hpp"

namespace leadline::host {

struct EchoSpec {
  double beam_half_angle_deg = 3.0;  ///< T, in (0, 90)
  /// 0: the beam is that cone. Otherwise a fan: T along the beam's long side, this across it, in
  /// (0, 90), with weight 1 - r^2 over the ellipse of directions (both limits are the same for narrow
  /// cones).
  double across_half_angle_deg = 0.0;
  std::size_t ray_count = 300;       ///< at least 1
  double detection_fraction = 0.10;  ///< of the echo's energy, in (0, 1]
  double range_bin_m = 0.125;        ///< > 0; the scenes use 1/8 of a cell
  double max_range_m = 1000.0;       ///< rays that travel further return nothing
};

/// Marks the cells that any ray of any ping hit. Row-major like Terrain::depths_m, 1 = hit.
using TouchedMask = std::vector<std::uint8_t>;

/// Keeps scratch memory between calls: use one object per thread.
class EchoModel {
 public:
  /// `terrain` must outlive this object. Throws std::invalid_argument naming the field for values out
  /// of the ranges above.
  EchoModel(const Terrain& terrain, const EchoSpec& spec);

  const EchoSpec& spec() const { return spec_; }

  /// Detected range in metres of a ping from `position` along the unit vector `axis` (NED), without
  /// errors: the centre of the bin in which `detection_fraction` of the energy that came back has
  /// arrived. Nothing if less than one ray in a hundred meets the terrain within the maximum range: a
  /// beam that looks past the edge of the world. If `touched` is given it must have one byte per cell;
  /// the cells hit by rays are set to 1.
  ///
  /// A fan is turned about its axis so that its long side lies in the plane of `axis` and `long_side`
  /// (any vector not parallel to the axis); a cone does not look at it.
  std::optional<double> measure(Vec3 position, Vec3 axis, TouchedMask* touched = nullptr,
                                Vec3 long_side = {});

  /// One ray's part of an echo: bin number (floor(range / range_bin_m)) and weight.
  struct Arrival {
    double bin;
    double weight;
  };
  /// All of the last measure(), nearest first: what an instrument that keeps the whole echo records.
  [[nodiscard]] const std::vector<Arrival>& arrivals() const { return arrivals_; }

 private:
  struct Ray {
    double side;
    double other;
    double axial;
    double weight;
  };
  void fill_cone();
  void fill_fan();

  const Terrain& terrain_;
  EchoSpec spec_;
  std::vector<Ray> rays_;
  std::vector<Arrival> arrivals_;
  std::size_t min_hit_count_ = 1;
};

}  // namespace leadline::host
