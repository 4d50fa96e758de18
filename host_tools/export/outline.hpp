// The outline of what is known: polygons round the known cells of a raster.
#pragma once

#include <vector>

#include "host_tools/raster.hpp"

namespace leadline::host {

/// A corner of cells, counted in cells from the raster's north-west corner.
struct GridCorner {
  int column;
  int row;
};

/// One connected area (cells that share an edge; a shared corner does not connect). Rings are closed
/// without repeating their first corner, have corners only where they turn, and touch others at most in
/// corners. Seen with north up, the outer ring runs counter-clockwise and the holes clockwise.
struct CoveredArea {
  std::vector<GridCorner> outer;
  std::vector<std::vector<GridCorner>> holes;
  std::size_t cells = 0;
};

/// Every connected area of known cells, in the order of its first cell from the north-west.
/// O(cells).
[[nodiscard]] std::vector<CoveredArea> covered_areas(const Raster& raster);

}  // namespace leadline::host
