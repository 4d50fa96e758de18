#include "host_tools/voxel_walk.hpp"

#include <cstddef>
#include <cstdlib>

namespace leadline::host {
namespace {

__extension__ typedef __int128 Int128;  // NOLINT: a typedef takes the extension mark

std::int64_t floor_div(std::int64_t value, std::int64_t divisor) {
  const std::int64_t quotient = value / divisor;
  return value % divisor < 0 ? quotient - 1 : quotient;
}

/// One axis of the walk. The next border is reached at the share distance_mm / length_mm of the
/// segment; upwards the border itself belongs to the next cell, downwards still to this one.
struct AxisWalk {
  std::int64_t length_mm;    ///< |to - from|; 0: this axis never steps
  std::int64_t distance_mm;  ///< from the start to the next border
  std::int64_t steps_left;
  int direction;
};

}  // namespace

CellIndex CellLattice::cell_of(const PointMm& point_mm) const {
  CellIndex cell{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    cell[axis] = floor_div(point_mm[axis] - origin_mm[axis], cell_mm);
  }
  return cell;
}

std::uint64_t segment_cell_count(const CellLattice& lattice, const PointMm& from_mm,
                                 const PointMm& to_mm) {
  const CellIndex first = lattice.cell_of(from_mm);
  const CellIndex last = lattice.cell_of(to_mm);
  std::uint64_t count = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    count += static_cast<std::uint64_t>(std::abs(last[axis] - first[axis]));
  }
  return count;
}

void walk_segment(const CellLattice& lattice, const PointMm& from_mm, const PointMm& to_mm,
                  const std::function<bool(const CellIndex&, double)>& visit) {
  CellIndex cell = lattice.cell_of(from_mm);
  const CellIndex last = lattice.cell_of(to_mm);
  std::array<AxisWalk, 3> axes{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::int64_t offset_mm =
        from_mm[axis] - lattice.origin_mm[axis] - cell[axis] * lattice.cell_mm;
    const bool up = to_mm[axis] > from_mm[axis];
    axes[axis] = {std::abs(to_mm[axis] - from_mm[axis]),
                  up ? lattice.cell_mm - offset_mm : offset_mm, std::abs(last[axis] - cell[axis]),
                  up ? 1 : -1};
  }
  // a is reached before b when a.distance / a.length < b.distance / b.length; at the same share the
  // steps upwards come first, because the point on the border is already in the upper cell.
  const auto order = [](const AxisWalk& a, const AxisWalk& b) {
    const Int128 left = static_cast<Int128>(a.distance_mm) * b.length_mm;
    const Int128 right = static_cast<Int128>(b.distance_mm) * a.length_mm;
    if (left != right) {
      return left < right ? -1 : 1;
    }
    return b.direction - a.direction;  // upwards sorts first
  };
  double share = 0.0;
  while (visit(cell, share)) {
    const AxisWalk* next = nullptr;
    for (const AxisWalk& axis : axes) {
      if (axis.steps_left > 0 && (next == nullptr || order(axis, *next) < 0)) {
        next = &axis;
      }
    }
    if (next == nullptr) {
      return;
    }
    const AxisWalk reached = *next;
    share = static_cast<double>(reached.distance_mm) / static_cast<double>(reached.length_mm);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      AxisWalk& walk = axes[axis];
      if (walk.steps_left > 0 && order(walk, reached) == 0) {
        cell[axis] += walk.direction;
        walk.distance_mm += lattice.cell_mm;
        walk.steps_left -= 1;
      }
    }
  }
}

}  // namespace leadline::host
