// Which voxels a straight line passes through, exactly.
#pragma once

#include <array>
#include <cstdint>
#include <functional>

namespace leadline::host {

/// Index of a cell per axis (north, east, down); may lie outside any grid.
using CellIndex = std::array<std::int64_t, 3>;
/// A point, NED millimetres.
using PointMm = std::array<std::int64_t, 3>;

/// Cells of a regular grid without ends: cell i of an axis is [origin + i cell, origin + (i + 1) cell).
struct CellLattice {
  PointMm origin_mm;
  std::int64_t cell_mm;  ///< over 0

  [[nodiscard]] CellIndex cell_of(const PointMm& point_mm) const;
};

/// Cells between two points, as walk_segment would visit them (an upper bound: steps of several axes at
/// once count separately).
[[nodiscard]] std::uint64_t segment_cell_count(const CellLattice& lattice, const PointMm& from_mm,
                                               const PointMm& to_mm);

/// Calls `visit(cell, share)` for every cell that holds a point of the segment, in order from `from_mm`
/// to `to_mm`; `share` in 0..1 is where the segment enters the cell. Exact for half-open cells: a
/// segment through an edge or corner visits no cell that only touches it. Stops when `visit` returns
/// false. Coordinates within +-2^40 mm. O(cells), no heap.
void walk_segment(const CellLattice& lattice, const PointMm& from_mm, const PointMm& to_mm,
                  const std::function<bool(const CellIndex&, double)>& visit);

}  // namespace leadline::host
