#include "host_tools/query.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "host_tools/exit_codes.hpp"
#include "host_tools/ping_csv.hpp"
#include "host_tools/text.hpp"
#include "model/base/units.hpp"

namespace leadline::host {
namespace {

constexpr std::array<const char*, 3> kNames = {"free", "occupied", "unknown"};

void count_state(StateCounts* counts, VoxelState state, std::uint64_t voxels = 1) {
  counts->of[static_cast<std::size_t>(state)] += voxels;
}

[[noreturn]] void too_many(std::uint64_t cells) {
  throw HostError(ExitCode::kUsage, "the query touches " + std::to_string(cells) +
                                        " voxels, at most " + std::to_string(kMaxQueryCells) +
                                        " are allowed: ask in parts");
}

std::string metres(double value) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.3f", value);
  return text.data();
}

std::string counts_json(const StateCounts& counts) {
  std::string text =
      "\"verdict\": " + json_string(voxel_state_name(counts.verdict())) + ", \"voxels\": {";
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    text += json_string(kNames[i]) + ": " + std::to_string(counts.of[i]) + ", ";
  }
  return text + "\"outside\": " + std::to_string(counts.outside) + "}";
}

std::string counts_text(const StateCounts& counts) {
  std::string text = std::string(voxel_state_name(counts.verdict())) + "\nvoxels    ";
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    text += (i == 0 ? "" : ", ") + std::to_string(counts.of[i]) + " " + kNames[i];
  }
  if (counts.outside > 0) {
    text += " (" + std::to_string(counts.outside) + " of them outside the grid)";
  }
  return text + "\n";
}

}  // namespace

const char* voxel_state_name(VoxelState state) { return kNames[static_cast<std::size_t>(state)]; }

bool VoxelStates::contains(const CellIndex& cell) const {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (cell[axis] < 0 || cell[axis] >= size[axis]) {
      return false;
    }
  }
  return true;
}

VoxelState StateCounts::verdict() const {
  if (of[static_cast<std::size_t>(VoxelState::kOccupied)] > 0) {
    return VoxelState::kOccupied;
  }
  return of[static_cast<std::size_t>(VoxelState::kUnknown)] > 0 ? VoxelState::kUnknown
                                                                : VoxelState::kFree;
}

SegmentAnswer query_segment(const VoxelStates& voxels, const PointMm& from_mm,
                            const PointMm& to_mm) {
  const std::uint64_t cells = segment_cell_count(voxels.lattice, from_mm, to_mm);
  if (cells > kMaxQueryCells) {
    too_many(cells);
  }
  SegmentAnswer answer;
  double square_m2 = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double difference_m = static_cast<double>(to_mm[axis] - from_mm[axis]) * 1e-3;
    square_m2 += difference_m * difference_m;
  }
  answer.length_m = std::sqrt(square_m2);
  walk_segment(voxels.lattice, from_mm, to_mm, [&](const CellIndex& cell, double share) {
    const bool inside = voxels.contains(cell);
    const VoxelState state = inside ? voxels.state(cell) : VoxelState::kUnknown;
    count_state(&answer.counts, state);
    answer.counts.outside += inside ? 0 : 1;
    const double at_m = share * answer.length_m;
    if (state == VoxelState::kOccupied && !answer.first_occupied_m) {
      answer.first_occupied_m = at_m;
    }
    if (answer.runs.empty() || answer.runs.back().state != state) {
      if (!answer.runs.empty()) {
        answer.runs.back().to_m = at_m;
      }
      answer.runs.push_back({state, at_m, at_m});
    }
    return true;
  });
  answer.runs.back().to_m = answer.length_m;
  return answer;
}

StateCounts query_box(const VoxelStates& voxels, const PointMm& corner_mm,
                      const PointMm& opposite_mm) {
  PointMm low_mm{};
  PointMm last_mm{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    low_mm[axis] = std::min(corner_mm[axis], opposite_mm[axis]);
    // The upper face only touches the cells behind it, unless the box has no extent here.
    last_mm[axis] = std::max(std::max(corner_mm[axis], opposite_mm[axis]) - 1, low_mm[axis]);
  }
  const CellIndex first = voxels.lattice.cell_of(low_mm);
  const CellIndex last = voxels.lattice.cell_of(last_mm);
  CellIndex inside_first{};
  CellIndex inside_last{};
  std::uint64_t inside = 1;
  // Up to 4e9 cells an axis horizontally and 4e7 vertically: the product is only used as a double.
  double all = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    inside_first[axis] = std::max<std::int64_t>(first[axis], 0);
    inside_last[axis] = std::min(last[axis], voxels.size[axis] - 1);
    inside *= static_cast<std::uint64_t>(
        std::max<std::int64_t>(inside_last[axis] - inside_first[axis] + 1, 0));
    all *= static_cast<double>(last[axis] - first[axis] + 1);
  }
  if (inside > kMaxQueryCells) {
    too_many(inside);
  }
  StateCounts counts;
  CellIndex cell{};
  for (cell[0] = inside_first[0]; inside > 0 && cell[0] <= inside_last[0]; ++cell[0]) {
    for (cell[1] = inside_first[1]; cell[1] <= inside_last[1]; ++cell[1]) {
      for (cell[2] = inside_first[2]; cell[2] <= inside_last[2]; ++cell[2]) {
        count_state(&counts, voxels.state(cell));
      }
    }
  }
  const double outside = std::min(all - static_cast<double>(inside), 1e18);
  counts.outside = static_cast<std::uint64_t>(std::max(outside, 0.0));
  count_state(&counts, VoxelState::kUnknown, counts.outside);
  return counts;
}

PointMm parse_point(const std::string& option, const std::string& text) {
  const std::string place = option + " " + printable(text) + ": ";
  PointMm point_mm{};
  std::size_t begin = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t comma = text.find(',', begin);
    const bool expected = axis < 2 ? comma != std::string::npos : comma == std::string::npos;
    const std::size_t end = std::min(comma, text.size());
    std::int64_t value_mm = 0;
    if (!expected || decimal_to_scaled(std::string_view(text).substr(begin, end - begin), 3, false,
                                       &value_mm) != DecimalStatus::kOk) {
      throw HostError(ExitCode::kUsage, place + "has to be NORTH,EAST,DOWN in metres");
    }
    const std::int64_t limit_um =
        axis == base::kDown ? base::kMaxVertical_um : base::kMaxHorizontal_um;
    if (std::abs(value_mm) > limit_um / 1000) {
      throw HostError(ExitCode::kUsage,
                      place + "has to lie within 2,000 km of the origin and 20 km of its level");
    }
    point_mm[axis] = value_mm;
    begin = end + 1;
  }
  return point_mm;
}

std::string format_segment_answer(const SegmentAnswer& answer, bool json) {
  std::string text;
  if (json) {
    text = "{\"query\": \"segment\", " + counts_json(answer.counts) +
           ", \"length_m\": " + json_number(answer.length_m) + ", \"first_occupied_m\": " +
           (answer.first_occupied_m ? json_number(*answer.first_occupied_m) : "null") +
           ", \"runs\": [";
    for (const StateRun& run : answer.runs) {
      text += std::string(&run == answer.runs.data() ? "" : ", ") +
              "{\"state\": " + json_string(voxel_state_name(run.state)) +
              ", \"from_m\": " + json_number(run.from_m) + ", \"to_m\": " + json_number(run.to_m) +
              "}";
    }
    return text + "]}\n";
  }
  text = counts_text(answer.counts);
  for (const StateRun& run : answer.runs) {
    std::string name = voxel_state_name(run.state);
    name.resize(10, ' ');
    text += name + metres(run.from_m) + " m to " + metres(run.to_m) + " m\n";
  }
  return text;
}

std::string format_box_answer(const StateCounts& counts, bool json) {
  return json ? "{\"query\": \"box\", " + counts_json(counts) + "}\n" : counts_text(counts);
}

}  // namespace leadline::host
