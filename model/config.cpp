#include "model/config.hpp"

#include "model/capacity.hpp"

namespace leadline::model {

base::Status check_config(const ModelConfig& config) {
  if (config.schema_version != kConfigSchemaVersion) {
    return base::Status::kBadVersion;
  }
  if (config.rule > Rule::kRecursive) {
    return base::Status::kOutOfRange;
  }
  if (is_pulling(config.rule) && (config.k_p_q16 < 1 || config.k_p_q16 > 65536)) {
    return base::Status::kOutOfRange;
  }
  if (config.no_return != NoReturnPolicy::kIgnore && config.no_return != NoReturnPolicy::kEmpty) {
    return base::Status::kOutOfRange;
  }
  if (config.cell_mm < 1 || config.cell_mm > 1'000'000) {
    return base::Status::kOutOfRange;
  }
  std::uint64_t voxels = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const std::int32_t limit = axis == 2 ? kMaxDepthCells : kMaxSideCells;
    if (config.size[axis] < 1 || config.size[axis] > limit) {
      return base::Status::kOutOfRange;
    }
    voxels *= static_cast<std::uint64_t>(config.size[axis]);
    const std::int64_t farthest_mm =
        (axis == 2 ? base::kMaxVertical_um : base::kMaxHorizontal_um) / 1000;
    if (config.origin_mm[axis] < -farthest_mm || config.origin_mm[axis] > farthest_mm) {
      return base::Status::kOutOfRange;
    }
    constexpr std::int64_t kWorstSigma_mm = 100'000'000;
    if (config.sigma_correlated_mm[axis] < 0 || config.sigma_correlated_mm[axis] > kWorstSigma_mm ||
        config.sigma_position_mm[axis] < 0 || config.sigma_position_mm[axis] > kWorstSigma_mm) {
      return base::Status::kOutOfRange;
    }
  }
  // Of a map larger than memory the window has to fit: Grid::configure knows.
  if (config.resident_tiles == 0 && voxels > kVoxelCapacity) {
    return base::Status::kOverCapacity;
  }
  return base::Status::kOk;
}

base::Status check_ranges(const ModelConfig& config, std::int64_t min_range_um,
                          std::int64_t max_range_um, std::int64_t detect_range_um) {
  const std::int64_t longest_um = static_cast<std::int64_t>(kMaxRangeCells) * config.cell_mm * 1000;
  if (min_range_um < 0 || max_range_um <= min_range_um || max_range_um > base::kMaxRange_um ||
      max_range_um > longest_um) {
    return base::Status::kOutOfRange;
  }
  if (config.no_return == NoReturnPolicy::kEmpty &&
      (detect_range_um <= 0 || detect_range_um > max_range_um)) {
    return base::Status::kOutOfRange;
  }
  return base::Status::kOk;
}

}  // namespace leadline::model
