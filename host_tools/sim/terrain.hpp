// A seafloor as a height field, for simulation and for measuring a map against its truth.
//
// Frame: NED, metres. Cell (i, j) covers [origin + i*cell, origin + (i+1)*cell) north and the same
// with j east; the stored depth (positive down) is that of the cell's *centre*, and the surface between
// centres is bilinear. The surface therefore ends half a cell inside the outer border of the grid.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "host_tools/sim/vec3.hpp"

namespace leadline::host {

/// Immutable after construction; all members are safe to call from several threads.
class Terrain {
 public:
  /// `depth_m` has north_count * east_count values, row by row from south to north, each row from west
  /// to east. Throws std::invalid_argument naming the value for fewer than 2 x 2 cells, a cell size that
  /// is not positive, a wrong number of depths, or a depth that is not finite.
  Terrain(std::size_t north_count, std::size_t east_count, double cell_m, double origin_north_m,
          double origin_east_m, std::vector<double> depth_m);

  std::size_t north_count() const { return north_count_; }
  std::size_t east_count() const { return east_count_; }
  double cell_m() const { return cell_m_; }
  /// Lowest corner of cell (0, 0).
  double origin_north_m() const { return origin_north_m_; }
  double origin_east_m() const { return origin_east_m_; }
  /// Borders of the bilinear surface (centres of the outermost cells).
  double south_m() const { return origin_north_m_ + 0.5 * cell_m_; }
  double west_m() const { return origin_east_m_ + 0.5 * cell_m_; }
  double north_m() const { return south_m() + static_cast<double>(north_count_ - 1) * cell_m_; }
  double east_m() const { return west_m() + static_cast<double>(east_count_ - 1) * cell_m_; }

  double shallowest_m() const { return shallowest_m_; }
  double deepest_m() const { return deepest_m_; }

  double depth_at_cell_m(std::size_t north_index, std::size_t east_index) const {
    return depth_m_[north_index * east_count_ + east_index];
  }
  /// Row-major, south to north: what was given to the constructor.
  const std::vector<double>& depths_m() const { return depth_m_; }

  /// True where the bilinear surface exists.
  bool contains(double north_m, double east_m) const;

  /// Depth of the surface, clamped to the nearest border point outside of it. O(1).
  double depth_m(double north_m, double east_m) const;

  /// Distance along `direction` (unit length) from `origin` to the first crossing of the surface, at
  /// most `max_range_m`; nothing if the ray leaves the terrain's sides first or starts below it. Exact
  /// on the bilinear patches (closed form), found through a pyramid of shallowest depths: about
  /// O(log cells) for a ray in open water. A ray may start outside the sides and enter.
  std::optional<double> intersect(Vec3 origin, Vec3 direction, double max_range_m) const;

 private:
  /// Shallowest depth under each block of 2^level x 2^level patches; level 0 is one patch, the square
  /// between four cell centres.
  struct Level {
    std::size_t north_count;
    std::size_t east_count;
    std::vector<double> shallowest_m;
  };

  void build_pyramid();
  std::optional<double> hit_patch(std::size_t i, std::size_t j, Vec3 local, Vec3 step, double enter,
                                  double leave) const;

  std::size_t north_count_;
  std::size_t east_count_;
  double cell_m_;
  double origin_north_m_;
  double origin_east_m_;
  std::vector<double> depth_m_;
  std::vector<Level> levels_;
  double shallowest_m_ = 0.0;
  double deepest_m_ = 0.0;
};

}  // namespace leadline::host
