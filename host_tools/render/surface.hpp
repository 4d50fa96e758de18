// Rasters as smooth surfaces for the eye: filters, interpolation and shading. Nothing here feeds back
// into figures; a picture that was filtered says so in its caption.
#pragma once

#include <vector>

#include "host_tools/raster.hpp"

namespace leadline::host::render {

/// Median of the known cells in the square window of +-radius cells, where the cell itself is known;
/// of an even number the mean of the two in the middle. radius 0 copies.
[[nodiscard]] Raster display_median(const Raster& raster, int radius_cells);

/// Gives unknown cells the mean of their known neighbours (of eight), `passes` times: gaps shrink by
/// one cell per pass from every side.
[[nodiscard]] Raster display_dilation(const Raster& raster, int passes);

/// A raster sampled between its cell centres by a bicubic (Catmull-Rom) spline that passes through every
/// known cell. Unknown neighbours count as equal to the cell under the point.
class SmoothSurface {
 public:
  /// Keeps a reference: `raster` must outlive it.
  explicit SmoothSurface(const Raster& raster) : raster_(raster) {}

  /// Value at fractional cells from the north-west corner of the raster (column 0.5, row 0.5 is the
  /// centre of the first cell). NaN outside and where the cell under the point is unknown.
  [[nodiscard]] double at(double column, double row) const;

 private:
  const Raster& raster_;
};

/// Samples on a regular lattice over a raster.
struct Lattice {
  int columns = 0;
  int rows = 0;
  double step_cells = 1.0;    ///< distance of two samples
  std::vector<float> values;  ///< row-major from the north-west; NaN = unknown

  [[nodiscard]] std::size_t index(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
           static_cast<std::size_t>(column);
  }
  [[nodiscard]] float at(int row, int column) const { return values[index(row, column)]; }
};

/// `columns` x `rows` samples spread evenly over the raster, each at the centre of its share.
[[nodiscard]] Lattice sample_surface(const Raster& raster, int columns, int rows);

/// How the light falls.
struct Light {
  double azimuth_deg = 315.0;   ///< where it comes from, clockwise from north
  double elevation_deg = 45.0;  ///< above the horizon
};

/// Light on a surface of heights (metres up) with `spacing_m` between samples, heights multiplied by
/// `exaggeration`: a main lamp and three weaker ones around it, so that no slope is pitch-dark. 1 is
/// the light on level ground; about 0.2 .. 1.4. NaN where the surface is unknown.
[[nodiscard]] std::vector<float> relief_light(const Lattice& height, double spacing_m,
                                              double exaggeration, const Light& light);

/// Share of the sky that each cell sees (1 on a plain, less in a hollow), from the horizon in 16
/// directions out to `reach_cells`. Unknown cells hide nothing and see everything.
[[nodiscard]] Raster sky_share(const Raster& elevation, double exaggeration, int reach_cells);

/// Vertical exaggeration that makes relief readable: steep terrain is left as it is (1), flat terrain
/// is raised until its steep slopes (90th percentile) reach about 40 degrees; rounded to 1, 1.5, 2, 3,
/// 5, 7, 10, 15, ... at most 100.
[[nodiscard]] double readable_exaggeration(const Raster& elevation);

}  // namespace leadline::host::render
