// The depth of one column, read from its voxels and nothing else.
#pragma once

#include <cstdint>

#include "model/grid.hpp"

namespace leadline::model {

/// What a column says about its surface.
struct ColumnDepth {
  std::int32_t depth_q8;  ///< 1/256 cell from the top of the grid, or kUnknownDepth
  std::uint32_t mass;     ///< sum of `hit` over the column: information in event units
  bool multi_surface;     ///< a second surface, separated and at least a quarter as credible
  /// How many pings the run stands for, in event units x cells^2, Q4: its evidence times its variance (a
  /// ping's weight goes with the inverse of its variance, so each adds about the same). 0 when unknown.
  std::uint32_t support_q4;
};

/// How a depth is read from the voxels of a column.
enum class DepthMethod : std::uint8_t {
  kRobustMoment = 0,   ///< default: centre of the strongest run in a symmetric, tapering window
  kFirstMoment = 1,    ///< the source's: sum(z S) / sum(S) over voxels with S > 0.7
  kUpperCrossing = 2,  ///< where S first rises through 0.5, interpolated
};

/// Robust moment: peaks of the smoothed evidence, at most four, each with the run around it above a tenth of
/// it; of these runs the most credible one: evidence x width x hit / (hit + 2 miss), that is a count of
/// pings that ended here rather than their precision, less what passed through. It gives mean and width; then the mean in a window of 3.5 widths, tapered by 1 - u^2 and kept symmetric about the
/// estimate (so that the grid's top and bottom do not pull), iterated. The evidence of a voxel is its
/// `hit`, unless its empty evidence is larger (kLogOdds), or hit - miss where positive
/// (kWeightedMean, whose empty evidence leaves traces in both halves). O(depth), no division per voxel.
/// Reads past the column as gather_profile() does.
[[nodiscard]] ColumnDepth column_depth(const Voxel* column_voxels, std::int32_t column_cells,
                                       DepthMethod method, Rule rule);

/// Half of a voxel's range: a column below it can take as much again before anything saturates.
inline constexpr std::uint32_t kRescaleAbove = 32768;

/// Halves every voxel of the column when one of its halves has reached kRescaleAbove; rounding
/// alternates, so that it is unbiased. Returns whether it did. O(depth).
bool rescale_column(Voxel* voxels, std::int32_t depth_cells);

}  // namespace leadline::model
