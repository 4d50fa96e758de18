// What a configuration asks of a Cortex-M7, by estimate: instructions a second of whole cycles, before anything flies.
// Prices: m7_prices.hpp; instructions, not cycles: wait states of memory come on top
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

/// Of a ping that did `work` in a grid of so many cells of depth, at most.
[[nodiscard]] double m7_ping_instructions(const model::PingWork& work, std::int32_t depth_cells);

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
/// What a pass of extraction takes of a cycle at most, and what a cycle has; "" where there are no passes.
[[nodiscard]] std::string m7_pass_text(const firmware::VehicleConfig& config,
                                       base::TimeUs cycle_us);
[[nodiscard]] std::string m7_load_warning(const firmware::VehicleConfig& config,
                                          base::TimeUs cycle_us,
                                          const std::vector<model::LocalizationTable>& tables,
                                          int beams, const M7Load& load);

}  // namespace leadline::host
