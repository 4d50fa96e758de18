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
    case PingResult::kCount:
      break;
  }
  return "unknown";
}

base::Status Model::configure(const ModelConfig& config, const void* table_bytes,
                              std::size_t table_size_bytes) {
  configured_ = false;
  base::Status status = check_config(config);
  if (status != base::Status::kOk) {
    return status;
  }
  if (table_bytes == nullptr) {
    return base::Status::kInvalidArgument;
  }
  status = check_table(table_bytes, table_size_bytes);
  if (status != base::Status::kOk) {
    return status;
  }
  config_ = config;
  std::memcpy(&table_, table_bytes, sizeof(table_));

  scale_ = Scale{};
  scale_.cell_um = config.cell_mm * 1000;
  scale_.inverse_cell_q46 = ((1LL << 46) + scale_.cell_um / 2) / scale_.cell_um;
  for (int axis = 0; axis < 3; ++axis) {
    scale_.origin_um[axis] = config.origin_mm[axis] * 1000;
    scale_.size[axis] = config.size[axis];
    const std::int64_t sigma_q12 =
        cells_q12(config.sigma_correlated_mm[axis] * 1000, scale_.cell_um);
    correlated_q12_[axis] = mul_shift(sigma_q12, sigma_q12, 12);
  }
  scale_.sigma_range_q12 =
      min_of<std::int64_t>(cells_q12(table_.sigma_range_um, scale_.cell_um), 1 << 20);
  constexpr std::int64_t kFloorVariance_q12 = 82;
  scale_.min_variance_q12 =
      mul_shift(scale_.sigma_range_q12, scale_.sigma_range_q12, 12) + kFloorVariance_q12;
  scale_.max_range_q16 =
      static_cast<std::int32_t>(mul_shift(config.max_range_um, scale_.inverse_cell_q46, 30));
  scale_.tan_along_q20 = static_cast<std::int32_t>(table_.tan_envelope_along_q24 >> 4U);
  scale_.tan_across_q20 = static_cast<std::int32_t>(table_.tan_envelope_across_q24 >> 4U);
  scale_.tan_along_q20 = max_of(scale_.tan_along_q20, 512);
  scale_.tan_across_q20 = max_of(scale_.tan_across_q20, 512);
  scale_.cone_tan_q20 = max_of(scale_.tan_along_q20, scale_.tan_across_q20);
  scale_.confidence_scale_q22 = static_cast<std::uint32_t>(min_of<std::int64_t>(
      (64LL << 22) / max_of<std::int64_t>(scale_.max_range_q16 >> 6, 1), 1LL << 28));

  // Largest footprint: at maximum range, seen at 45 degrees (twice the angular variance).
  const std::int64_t range2_q6 =
      (static_cast<std::int64_t>(scale_.max_range_q16) * scale_.max_range_q16) >> 26;
  const std::int64_t beam_q30 =
      max_of<std::int64_t>(table_.beam_variance_along_q30, table_.beam_variance_across_q30);
  std::int64_t variance_q12 =
      2 * mul_shift(range2_q6, beam_q30 + table_.pointing_variance_q30, 24) + 2048;
  const std::int64_t position_q12 = min_of<std::int64_t>(
      cells_q12(max_of(config.sigma_position_mm[0], config.sigma_position_mm[1]) * 1000,
                scale_.cell_um),
      1 << 20);
  variance_q12 += mul_shift(position_q12, position_q12, 12) / 2;
  const auto sigma_q12 =
      static_cast<std::int64_t>(base::sqrt_u64(static_cast<std::uint64_t>(variance_q12) << 12U));
  constexpr std::int64_t kCut_q8 = 563;  // 2.2
  scale_.footprint_cells = static_cast<std::int32_t>(base::clamp<std::int64_t>(
      (sigma_q12 * kCut_q8 + (1 << 20) - 1) >> 20, 2, kMaxFootprintCells));

  // Navigation drifts even where nobody says so: unless the configuration declares its correlated
  // error, one cell is assumed, or one metre where cells are larger (DESIGN.md "Sigma").
  constexpr std::int64_t kRegistration_um = 1'000'000;
  const bool declared = config.sigma_correlated_mm[0] != 0 || config.sigma_correlated_mm[1] != 0;
  const std::int64_t registration_q12 =
      declared ? 0
               : cells_q12(min_of<std::int64_t>(scale_.cell_um, kRegistration_um), scale_.cell_um);
  registration_q12_ = mul_shift(registration_q12, registration_q12, 12);

  bound_ = work_bound(scale_);
  if (config.work_budget_voxels != 0 && bound_.total_voxels > config.work_budget_voxels) {
    return base::Status::kOverBudget;
  }
  status = grid_.configure(config.size);
  if (status != base::Status::kOk) {
    return status;
  }
  counters_ = ModelCounters{};
  ping_number_ = 0;
  voxels_this_ping_ = 0;
  for (std::uint32_t column = 0; column < grid_.column_count(); ++column) {
    results_[column] = ColumnResult{kUnknownDepth, 0, kUnknownDepth, 0, 0};
  }
  configured_ = true;
  return base::Status::kOk;
}

}  // namespace leadline::model
