// What a model is configured with: plain integers, schema-versioned, checked once.
#pragma once

#include <cstdint>

#include "model/base/status.hpp"
#include "model/base/units.hpp"

namespace leadline::model {

inline constexpr std::uint16_t kConfigSchemaVersion = 1;

/// Combining rule (method 1.3). Chosen per configuration, dispatched once per ping, never per voxel.
enum class Rule : std::uint8_t {
  kWeightedMean = 0,  ///< S = sum(w rho) / sum(w)
  kLogOdds = 1,       ///< L = sum of signed evidence, clamped by the voxel's saturation
  /// x in [-1, 1] is hit / 65535 or -miss / 65535, the other half is zero. An event y makes it
  /// x + y - |x| y where y has the sign of x, and x + y otherwise (the source's 4.2).
  kCertaintyFactor = 2,
  /// S' = k rho + (1 - k) S, k = k_p w (the source's 5.1), for both halves: hit / 65535 is the part of S
  /// that events have said, miss / 65535 that of 1 - S; what is missing from 1 is still unknown.
  kRecursive = 3,
};
/// The rules that pull a voxel towards an event's signal instead of adding up evidence.
[[nodiscard]] constexpr bool is_pulling(Rule rule) {
  return rule == Rule::kCertaintyFactor || rule == Rule::kRecursive;
}

/// What a ping without return says.
enum class NoReturnPolicy : std::uint8_t {
  kIgnore = 0,  ///< Nothing: the bottom may have been missed.
  kEmpty = 1,   ///< The cone is empty up to `detect_range_um`.
};

/// Configuration of one model. All lengths in the units of their names.
struct ModelConfig {
  std::uint16_t schema_version;  ///< kConfigSchemaVersion
  Rule rule;
  /// Gain of the pulling rules: share that the best ping's peak takes of a voxel, 1 .. 65536 (= 1). High
  /// trusts recent pings, low is a long memory. Not read by the others.
  std::uint32_t k_p_q16;
  NoReturnPolicy no_return;
  std::int32_t cell_mm;  ///< side of a voxel, 1 .. 1'000'000
  std::int32_t size[3];  ///< cells north, east, down; 1 .. kMaxSideCells (down: kMaxDepthCells)
  std::int64_t origin_mm[3];  ///< NED of the numerically lowest corner; cells are half-open
  /// Ranges of the sensor where there is one only (see SensorConfig in model.hpp); with more, each has
  /// its own and these are not read.
  std::int64_t min_range_um;
  std::int64_t max_range_um;
  std::int64_t detect_range_um;
  /// Independent position error per NED axis that events are dimensioned for, one sigma. A pose may
  /// state more; an event too wide for the footprint is cut.
  std::int64_t sigma_position_mm[3];
  /// Correlated navigation error per NED axis, one sigma: a floor of the reported uncertainty, added
  /// in quadrature and never averaged down.
  std::int64_t sigma_correlated_mm[3];
  /// Refuse a configuration whose work bound exceeds this many voxels per ping; 0 = no budget.
  std::uint32_t work_budget_voxels;
  /// A map larger than memory: at most so many tiles have their voxels in memory, and somebody brings the
  /// others (Grid::page_in, page_out). 0: all of them.
  std::uint32_t resident_tiles;
};

/// First thing wrong with `config`, or kOk. kOutOfRange for a value outside its stated range,
/// kOverCapacity for a grid over the compiled storage, kBadVersion for another schema.
[[nodiscard]] base::Status check_config(const ModelConfig& config);
/// kOutOfRange unless 0 <= min < max, both within what records and cells allow, and detect within them
/// where the configuration uses it.
[[nodiscard]] base::Status check_ranges(const ModelConfig& config, std::int64_t min_range_um,
                                        std::int64_t max_range_um, std::int64_t detect_range_um);

}  // namespace leadline::model
