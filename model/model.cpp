// Model::configure and what follows from a configuration once.
#include "model/model.hpp"

#include <cstring>

#include "model/base/fixed.hpp"

namespace leadline::model {
namespace {

using base::max_of;
using base::min_of;
using base::mul_shift;

std::int64_t cells_q12(std::int64_t length_um, std::int64_t cell_um) {
  return min_of<std::int64_t>((length_um << 12) / cell_um, 1LL << 28);
}

}  // namespace

const char* ping_result_name(PingResult result) {
  switch (result) {
    case PingResult::kFused:
      return "fused";
    case PingResult::kNoReturn:
      return "no_return";
    case PingResult::kRangeTooShort:
      return "range_below_min";
    case PingResult::kRangeTooLong:
      return "range_above_max";
    case PingResult::kPoseInvalid:
      return "pose_invalid";
    case PingResult::kTooFar:
      return "too_far_from_grid";
    case PingResult::kProfile:
      return "profile_undetected";
    case PingResult::kNotConfigured:
      return "not_configured";
    case PingResult::kAbsentTile:
      return "absent_tile";
    case PingResult::kCount:
      break;
  }
  return "unknown";
}

Scale sensor_scale(const ModelConfig& config, const LocalizationTable& table,
                   std::int64_t max_range_um) {
  Scale scale{};
  scale.cell_um = config.cell_mm * 1000;
  scale.inverse_cell_q46 = ((1LL << 46) + scale.cell_um / 2) / scale.cell_um;
  for (int axis = 0; axis < 3; ++axis) {
    scale.origin_um[axis] = config.origin_mm[axis] * 1000;
    scale.size[axis] = config.size[axis];
  }
  scale.sigma_range_q12 =
      min_of<std::int64_t>(cells_q12(table.sigma_range_um, scale.cell_um), 1 << 20);
  constexpr std::int64_t kFloorVariance_q12 = 82;
  scale.min_variance_q12 =
      mul_shift(scale.sigma_range_q12, scale.sigma_range_q12, 12) + kFloorVariance_q12;
  scale.max_range_q16 =
      static_cast<std::int32_t>(mul_shift(max_range_um, scale.inverse_cell_q46, 30));
  scale.tan_along_q20 = max_of(static_cast<std::int32_t>(table.tan_envelope_along_q24 >> 4U), 512);
  scale.tan_across_q20 =
      max_of(static_cast<std::int32_t>(table.tan_envelope_across_q24 >> 4U), 512);
  scale.cone_tan_q20 = max_of(scale.tan_along_q20, scale.tan_across_q20);
  scale.confidence_scale_q22 = static_cast<std::uint32_t>(min_of<std::int64_t>(
      (64LL << 22) / max_of<std::int64_t>(scale.max_range_q16 >> 6, 1), 1LL << 28));

  // Largest footprint: at maximum range, seen at 45 degrees (twice the angular variance).
  const std::int64_t range2_q6 =
      (static_cast<std::int64_t>(scale.max_range_q16) * scale.max_range_q16) >> 26;
  const std::int64_t beam_q30 =
      max_of<std::int64_t>(table.beam_variance_along_q30, table.beam_variance_across_q30);
  std::int64_t variance_q12 =
      2 * mul_shift(range2_q6, beam_q30 + table.pointing_variance_q30, 24) + 2048;
  const std::int64_t position_q12 = min_of<std::int64_t>(
      cells_q12(max_of(config.sigma_position_mm[0], config.sigma_position_mm[1]) * 1000,
                scale.cell_um),
      1 << 20);
  variance_q12 += mul_shift(position_q12, position_q12, 12) / 2;
  const auto sigma_q12 =
      static_cast<std::int64_t>(base::sqrt_u64(static_cast<std::uint64_t>(variance_q12) << 12U));
  constexpr std::int64_t kCut_q8 = 563;  // 2.2
  scale.footprint_cells = static_cast<std::int32_t>(base::clamp<std::int64_t>(
      (sigma_q12 * kCut_q8 + (1 << 20) - 1) >> 20, 2, kMaxFootprintCells));
  return scale;
}

// Table, ranges and everything that follows from them for one sensor.
base::Status Model::adopt_sensor(const SensorConfig& config, Sensor& sensor) const {
  if (config.table == nullptr) {
    return base::Status::kInvalidArgument;
  }
  base::Status status = check_table(config.table, config.table_size_bytes);
  if (status == base::Status::kOk) {
    status =
        check_ranges(config_, config.min_range_um, config.max_range_um, config.detect_range_um);
  }
  if (status != base::Status::kOk) {
    return status;
  }
  sensor.config = config;
  sensor.config.table = nullptr;
  std::memcpy(&sensor.table, config.table, sizeof(sensor.table));
  sensor.scale = sensor_scale(config_, sensor.table, config.max_range_um);
  return base::Status::kOk;
}

// The best ping takes k_p of the voxel at its peak, and its 255 units of evidence are the taps' sum of
// what it adds to an unknown column.
void Model::set_pull() {
  for (std::size_t i = 0; i < sensor_count_; ++i) {
    Scale& scale = sensors_[i].scale;
    const std::int64_t peak_q15 = sensors_[i].table.kernel_q15[kernel_level(scale.min_variance_q12)]
                                                              [kKernelPhases / 2][kKernelCentre];
    const std::int64_t gain_q15 =
        (static_cast<std::int64_t>(config_.k_p_q16) << 14) / max_of<std::int64_t>(peak_q15, 1);
    scale.pull_gain_q15 = static_cast<std::uint32_t>(max_of<std::int64_t>(gain_q15, 1));
    scale.pull_unit_q16 = static_cast<std::uint32_t>((255LL << 15) / scale.pull_gain_q15);
  }
}

// Depth of a column's own voxels; its mass in event units whatever the rule.
ColumnDepth Model::depth_of(std::uint32_t column, DepthMethod method) const {
  ColumnDepth found =
      column_depth(grid_.column_voxels(column), scale_.size[2], method, config_.rule);
  if (is_pulling(config_.rule) && found.mass != 0) {
    // At most 1024 voxels of 65535.
    found.mass = static_cast<std::uint32_t>(max_of<std::uint64_t>(
        (static_cast<std::uint64_t>(found.mass) * scale_.pull_unit_q16) >> 16U, 1));
  }
  return found;
}

base::Status Model::configure(const ModelConfig& config, const void* table_bytes,
                              std::size_t table_size_bytes) {
  const SensorConfig sensor{table_bytes, table_size_bytes, config.min_range_um, config.max_range_um,
                            config.detect_range_um};
  return configure_sensors(config, &sensor, 1);
}

base::Status Model::configure_sensors(const ModelConfig& config, const SensorConfig* sensors,
                                      std::size_t sensor_count) {
  configured_ = false;
  base::Status status = check_config(config);
  if (status != base::Status::kOk) {
    return status;
  }
  if (sensors == nullptr || sensor_count == 0) {
    return base::Status::kInvalidArgument;
  }
  if (sensor_count > kMaxSensors) {
    return base::Status::kOverCapacity;
  }
  config_ = config;
  sensor_count_ = sensor_count;
  sensor_ = sensors_;
  bound_ = WorkBound{};
  std::int64_t min_variance_q12 = INT64_MAX;
  for (std::size_t i = 0; i < sensor_count; ++i) {
    status = adopt_sensor(sensors[i], sensors_[i]);
    if (status != base::Status::kOk) {
      return status;
    }
    min_variance_q12 = min_of(min_variance_q12, sensors_[i].scale.min_variance_q12);
    const WorkBound bound = work_bound(sensors_[i].scale);
    const std::uint32_t behind_voxels = max_of(bound_.behind_voxels, bound.behind_voxels);
    bound_ = bound.total_voxels > bound_.total_voxels ? bound : bound_;
    bound_.behind_voxels = behind_voxels;
  }
  for (std::size_t i = 0; i < sensor_count; ++i) {
    sensors_[i].scale.min_variance_q12 = min_variance_q12;
  }
  if (is_pulling(config.rule)) {
    set_pull();
  }
  scale_ = sensors_[0].scale;
  for (int axis = 0; axis < 3; ++axis) {
    const std::int64_t sigma_q12 =
        cells_q12(config.sigma_correlated_mm[axis] * 1000, scale_.cell_um);
    correlated_q12_[axis] = mul_shift(sigma_q12, sigma_q12, 12);
  }

  // Navigation drifts even where nobody says so: unless the configuration declares its correlated
  // error, one cell is assumed, or one metre where cells are larger (DESIGN.md "Sigma").
  constexpr std::int64_t kRegistration_um = 1'000'000;
  const bool declared = config.sigma_correlated_mm[0] != 0 || config.sigma_correlated_mm[1] != 0;
  const std::int64_t registration_q12 =
      declared ? 0
               : cells_q12(min_of<std::int64_t>(scale_.cell_um, kRegistration_um), scale_.cell_um);
  registration_q12_ = mul_shift(registration_q12, registration_q12, 12);

  if (config.work_budget_voxels != 0 && bound_.total_voxels > config.work_budget_voxels) {
    return base::Status::kOverBudget;
  }
  status = clear_map();
  if (status != base::Status::kOk) {
    return status;
  }
  counters_ = ModelCounters{};
  configured_ = true;
  return base::Status::kOk;
}

base::Status Model::clear_map() {
  const base::Status status = grid_.configure(config_.size, config_.resident_tiles);
  if (status != base::Status::kOk) {
    return status;
  }
  wanted_ = TileBox{0, -1, 0, -1};
  ping_number_ = 0;
  voxels_this_ping_ = 0;
  for (std::uint32_t column = 0; column < grid_.column_count(); ++column) {
    results_[column] = ColumnResult{kUnknownDepth, 0, kUnknownDepth, 0, 0};
  }
  return base::Status::kOk;
}

base::Status Model::restart(const std::int64_t (&origin_mm)[3]) {
  ModelConfig moved = config_;
  for (int axis = 0; axis < 3; ++axis) {
    moved.origin_mm[axis] = origin_mm[axis];
  }
  if (!configured_ || check_config(moved) != base::Status::kOk) {
    return base::Status::kOutOfRange;
  }
  config_ = moved;
  for (int axis = 0; axis < 3; ++axis) {
    scale_.origin_um[axis] = origin_mm[axis] * 1000;
    for (Sensor& sensor : sensors_) {
      sensor.scale.origin_um[axis] = scale_.origin_um[axis];
    }
  }
  return clear_map();
}

}  // namespace leadline::model
