// Lines of equal value through a lattice, joined to polylines.
#pragma once

#include <vector>

#include "host_tools/render/surface.hpp"

namespace leadline::host::render {

struct PointOnLattice {
  double column;  ///< 0 is sample 0
  double row;
};

struct Contour {
  double level;
  bool closed;  ///< the last point joins the first (which is not repeated)
  std::vector<PointOnLattice> points;
};

/// Contours at every multiple of `interval` > 0 in `lowest` .. `highest` that the lattice crosses, by
/// marching squares. A square with an unknown corner has none; a saddle is resolved by the mean of its
/// corners. A sample equal to a level counts as above it. O(samples + points).
[[nodiscard]] std::vector<Contour> contours(const Lattice& lattice, double interval, double lowest,
                                            double highest);

}  // namespace leadline::host::render
