// W(config): the most voxels that one ping can write, in closed form.
#pragma once

#include <cstdint>

#include "model/event.hpp"

namespace leadline::model {

/// The bound and its parts.
struct WorkBound {
  std::uint32_t shell_voxels;  ///< columns times the taps of the widest kernel
  std::uint32_t cone_voxels;   ///< volume of the thickened cone inside the grid
  std::uint32_t total_voxels;  ///< W: their sum, at most the grid's cells
  /// What each later return of a ping adds at most (Model::integrate_behind): the whole box of a shell.
  std::uint32_t behind_voxels;
};

/// What one ping did: everything that its instructions go with.
struct PingWork {
  std::uint32_t columns_read;      ///< for the slope, of at most Model::kSlopeColumns
  std::uint32_t shell_rows;        ///< of the shell's box
  std::uint32_t shell_candidates;  ///< columns of the box
  std::uint32_t shell_columns;     ///< written
  std::uint32_t shell_voxels;
  std::uint32_t cone_rows;        ///< that the cone may cross
  std::uint32_t cone_candidates;  ///< columns of these rows that were looked at
  std::uint32_t cone_columns;     ///< written
  std::uint32_t cone_runs;        ///< of voxels with one weight
  std::uint32_t cone_voxels;
};

/// Bound of `scale` (footprint half-width F, cone, grid): the largest of
///   a ping without return: the cone of the longest range;
///   a steep plane seen square on: all columns of the footprint that it crosses inside the grid, and the
///     cone up to the reach of the kernel before it;
///   a wall: 2 h x 2 F columns, h = 1 .. F, and the cone up to 2 (h - 1/2) / 2.2 cells before it;
/// each with the 14 taps of the widest kernel that fit, and never more than the grid has cells. The shell
/// alone cannot exceed it, since its box has at most 2 F columns a side; the cone stops at W, which the
/// integrator enforces and counts (a lattice can hold a few more centres than a volume). O(F * range).
[[nodiscard]] WorkBound work_bound(const Scale& scale);

/// Voxels of a cone of `range_q10` cells, of which the part nearer than `longest_q10` to its far end lies
/// in the grid: sections clipped by the two shorter sides of the grid (lying), or the last cells before
/// the far end, as many as the shortest side has (standing); the larger of the two. O(range).
[[nodiscard]] std::uint32_t cone_volume(const Scale& scale, std::int32_t range_q10,
                                        std::int64_t longest_q10 = INT64_MAX);

}  // namespace leadline::model
