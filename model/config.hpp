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
};

/// What a ping without return says.
enum class NoReturnPolicy : std::uint8_t {
  kIgnore = 0,  ///< Nothing: the bottom may have been missed.
  kEmpty = 1,   ///< The cone is empty up to `detect_range_um`.
};

/// Configuration of one model. All lengths in the units of their names.
struct ModelConfig {
  std::uint16_t schema_version;  ///< kConfigSchemaVersion
  Rule rule;
  NoReturnPolicy no_return;
  std::int32_t cell_mm;  ///< side of a voxel, 1 .. 1'000'000
  std::int32_t size[3];  ///< cells north, east, down; 1 .. kMaxSideCells (down: kMaxDepthCells)
  std::int64_t origin_mm[3];     ///< NED of the numerically lowest corner; cells are half-open
  std::int64_t min_range_um;     ///< shorter ranges are rejected and carve nothing
  std::int64_t max_range_um;     ///< longer ranges are rejected; the signal drowns in noise here
  std::int64_t detect_range_um;  ///< kEmpty: range at which a target would have been detected
  /// Independent position error per NED axis that events are dimensioned for, one sigma. A pose may
  /// state more; an event too wide for the footprint is cut.
  std::int64_t sigma_position_mm[3];
  /// Correlated navigation error per NED axis, one sigma: a floor of the reported uncertainty, added
  /// in quadrature and never averaged down.
  std::int64_t sigma_correlated_mm[3];
  /// Refuse a configuration whose work bound exceeds this many voxels per ping; 0 = no budget.
  std::uint32_t work_budget_voxels;
};

/// First thing wrong with `config`, or kOk. kOutOfRange for a value outside its stated range,
/// kOverCapacity for a grid over the compiled storage, kBadVersion for another schema.
[[nodiscard]] base::Status check_config(const ModelConfig& config);

}  // namespace leadline::model
