// What work costs a Cortex-M7, in instructions: measured on QEMU's board (toolchain/timing.sh), each with room for the
// longest ways through where it says "at most". Of the vehicle's code as it stands: measured anew when that changes.
#pragma once

#include <cstdint>

namespace leadline::host::m7 {

/// Of each kind of work of a ping (model::PingWork), at most; toolchain/timing.sh --search compares every ping that it
/// replays.
struct PingPrices {
  double fixed = 7000;
  double column_read = 1850;
  double cell_read = 30;
  double shell_row = 410;
  double shell_candidate = 38;
  double shell_column = 66;
  double shell_voxel = 14.5;
  double cone_row = 680;
  double cone_candidate = 245;
  double cone_column = 30;
  double cone_run = 112;
  double cone_voxel = 4.2;
};
inline constexpr PingPrices kPingPrices;
/// What pings of surveys cost of these prices, at most (0.858, 0.836, 0.786, 0.703 of four kinds, the large first).
inline constexpr double kUsualPing = 0.87;

/// Of a column in each stage of extraction and of comparing it with what the link has, as of surveys over full maps.
struct UsualColumn {
  double read = 250;  ///< and for each cell of depth
  double read_cell = 30;
  double smoothed = 4000;
  double assessed = 1400;
  double compared = 80;
};
inline constexpr UsualColumn kUsualColumn;

/// Of a column at most; toolchain/timing.sh --search climbs towards it. Smoothing: of columns where few pings passed, all
/// at odds with each other.
inline constexpr std::uint32_t kMostRead = 2450;
inline constexpr std::uint32_t kMostReadCell = 182;
inline constexpr std::uint32_t kMostSmoothed = 16'000;
inline constexpr std::uint32_t kMostAssessed = 4'300;  ///< and compared
/// Of finding a pass's next step, for each tile of the grid, and of beginning a pass: in a cycle, at most.
inline constexpr std::uint32_t kMostSearchTile = 100;

/// Of a pass's part in a cycle at most (Vehicle: it stops once 1,024 columns for each tile of the budget are done, after
/// the tile under way). Reading takes whole tiles of 256 columns, the other stages 256 at most: so many tiles read, the
/// rest of the budget smoothed but for one column, and a whole tile more.
constexpr std::uint64_t pass_cycle_bound(std::uint32_t tile_budget, std::uint32_t depth_cells,
                                         std::uint32_t tiles) {
  constexpr std::uint64_t kTile = 256;
  static_assert(kMostSmoothed >= kMostAssessed, "the dearer of what follows reading");
  const std::uint64_t budget = 4 * kTile * tile_budget;
  const std::uint64_t read = kMostRead + std::uint64_t{kMostReadCell} * depth_cells;
  const std::uint64_t whole = budget * read;
  const std::uint64_t none = (budget + kTile - 1) * kMostSmoothed;
  const std::uint64_t mixed = (budget - kTile) * read + (2 * kTile - 1) * kMostSmoothed;
  const std::uint64_t most = whole > none ? whole : none;
  return (most > mixed ? most : mixed) + std::uint64_t{kMostSearchTile} * tiles;
}

/// Of a cycle, for everything that is neither ping nor extraction: devices' bytes, navigation, status; as of surveys.
inline constexpr double kUsualCycle = 115'000;
/// Of a byte of tile deltas.
inline constexpr double kDeltaByte = 4500;

}  // namespace leadline::host::m7
