// What a configuration asks of a Cortex-M7, by estimate: instructions a second of whole cycles, before anything flies.
// Prices are measured on QEMU's board (toolchain/timing.sh); instructions, not cycles: wait states of memory come on top
// (firmware/README.md, "Timing").
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "firmware/config/vehicle_file.hpp"
#include "firmware/pipeline/config.hpp"
#include "model/base/units.hpp"
#include "model/localization_table.hpp"
#include "model/work_bound.hpp"

namespace leadline::host {

/// Instructions that each kind of work of a ping costs at most: measured with room for the longest ways through, not
/// derived. toolchain/timing.sh --search compares every ping that it replays.
struct M7PingPrices {
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
inline constexpr M7PingPrices kM7PingPrices;
/// What pings of surveys cost of these prices (toolchain/timing.sh: 0.866 to 0.873).
inline constexpr double kM7UsualPing = 0.87;

/// Of a ping that did `work` in a grid of so many cells of depth.
[[nodiscard]] double m7_ping_instructions(const model::PingWork& work, std::int32_t depth_cells);

/// Of a column in each stage of extraction, and of comparing it with what the link has: as of flights over whole maps,
/// not at most.
struct M7ColumnPrices {
  double read = 250;  ///< and for each cell of depth
  double read_cell = 30;
  double smoothed = 4000;
  double assessed = 1400;
  double compared = 80;
};
inline constexpr M7ColumnPrices kM7ColumnPrices;

/// Of a cycle, for everything that is neither ping nor extraction: devices' bytes, navigation, status.
inline constexpr double kM7Cycle_instructions = 115'000;
/// Of a byte of tile deltas.
inline constexpr double kM7DeltaByte_instructions = 4500;

inline constexpr double kM7Instructions_s = 480e6;
/// Whole cycles may take so much of them: external memory's wait states come on top.
inline constexpr double kM7Share = 0.15;

/// Instructions a second.
struct M7Load {
  double pings = 0;
  double extraction = 0;
  double rest = 0;     ///< cycles, and deltas for the link
  double pings_s = 0;  ///< beams a second that were reckoned with
  [[nodiscard]] double share() const { return (pings + extraction + rest) / kM7Instructions_s; }
};

/// The load of `config` in cycles of `cycle_us`, by these prices: of a vehicle that goes 1.5 m/s over a level bottom, the
/// grid's lowest cells, as far above it as heads hear and the water's surface allows, in the middle of a map that is known
/// everywhere. Heads ping at their interval; those that run free, as fast as sound comes back, 50 times a second at most.
/// `beams`: of a transmission of an array; 0: as many as its driver takes. What a ping does is counted, by a model on
/// the heap. `config` is one that a vehicle takes.
[[nodiscard]] M7Load m7_load(const firmware::VehicleConfig& config, base::TimeUs cycle_us,
                             const std::vector<model::LocalizationTable>& tables, int beams);

/// Where a Cortex-M7 extracts depths at a rate that it can carry: in passes, a column at most every 1.5 s.
inline constexpr std::uint32_t kM7ExtractInterval_us = 1'500'000;
inline constexpr std::uint32_t kM7TileBudget = 1;
/// Sets these two where [cycle] does not. Returns what was set, as "key = value" each.
std::vector<std::string> set_m7_defaults(VehicleFile* file);

/// For the user, without a line's end: what the load comes to; and, where it is over kM7Share, that, and what would
/// help ("" where it is not).
[[nodiscard]] std::string m7_load_text(const M7Load& load);
[[nodiscard]] std::string m7_load_warning(const firmware::VehicleConfig& config,
                                          base::TimeUs cycle_us,
                                          const std::vector<model::LocalizationTable>& tables,
                                          int beams, const M7Load& load);

}  // namespace leadline::host
