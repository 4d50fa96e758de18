// `leadline query`: is it free, occupied or unknown along a line or in a box? The question a pilot or a
// planner asks the saved model. Unknown stays unknown: it is never taken for free.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/voxel_walk.hpp"

namespace leadline::host {

enum class VoxelState : std::uint8_t { kFree = 0, kOccupied = 1, kUnknown = 2 };

/// "free", "occupied", "unknown".
[[nodiscard]] const char* voxel_state_name(VoxelState state);

/// A saved model as queries see it.
struct VoxelStates {
  CellLattice lattice;
  CellIndex size;  ///< cells north, east, down
  /// State of a voxel inside `size`.
  std::function<VoxelState(const CellIndex&)> state;

  [[nodiscard]] bool contains(const CellIndex& cell) const;
};

/// How many voxels are what. Those outside the grid are counted as unknown and in `outside`.
struct StateCounts {
  std::array<std::uint64_t, 3> of{};  ///< by VoxelState
  std::uint64_t outside = 0;

  /// Occupied when any voxel is, else unknown when any is, else free.
  [[nodiscard]] VoxelState verdict() const;
};

/// A stretch of a segment in one state; distances from its start.
struct StateRun {
  VoxelState state;
  double from_m;
  double to_m;
};

struct SegmentAnswer {
  StateCounts counts;
  double length_m = 0;
  std::vector<StateRun> runs;  ///< in order, adjacent runs differ, together the whole segment
  std::optional<double> first_occupied_m;
};

/// Most voxels that one query looks at.
inline constexpr std::uint64_t kMaxQueryCells = 100'000'000;

/// Every voxel that holds a point of the segment. Throws HostError kUsage over kMaxQueryCells.
[[nodiscard]] SegmentAnswer query_segment(const VoxelStates& voxels, const PointMm& from_mm,
                                          const PointMm& to_mm);

/// Every voxel that shares volume with the box between two corners (in any order), or holds it when
/// the box has no extent. Throws HostError kUsage over kMaxQueryCells inside the grid.
[[nodiscard]] StateCounts query_box(const VoxelStates& voxels, const PointMm& corner_mm,
                                    const PointMm& opposite_mm);

struct QueryOptions {
  std::string map_path;  ///< folder that `leadline map` wrote, or its model.llm
  std::string from;      ///< "north,east,down" metres
  std::string to;
  bool box = false;  ///< from and to are corners of a box instead of ends of a line
  bool json = false;
};

/// The command; returns 0 whatever the verdict. Throws HostError: kUsage (points, size of the query),
/// kInput (the saved model: not there, cut, damaged, another version).
int run_query(const QueryOptions& options);

/// "north,east,down" metres as the nearest millimetres. Throws HostError kUsage naming
/// `option` and the text: not three decimal numbers, or beyond 2,000 km (20 km down).
[[nodiscard]] PointMm parse_point(const std::string& option, const std::string& text);

/// The answer as text or JSON, ending in a newline.
[[nodiscard]] std::string format_segment_answer(const SegmentAnswer& answer, bool json);
[[nodiscard]] std::string format_box_answer(const StateCounts& counts, bool json);

}  // namespace leadline::host
