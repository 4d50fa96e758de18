// Model::integrate and what it consists of: sighting, slope feedback, shell; the cone is in carve.cpp.
#include "model/base/fixed.hpp"
#include "model/column_kernels.hpp"
#include "model/cone_column.hpp"
#include "model/evidence.hpp"
#include "model/frustum.hpp"
#include "model/model.hpp"

namespace leadline::model {
namespace {

using base::clamp;
using base::max_of;
using base::min_of;
using base::mul_shift;
using base::ratio;

// Of a ping that heard nothing: an eighth of the best ping's weight, all along.
constexpr std::uint32_t kNoReturn_q14 = (255 * 16) << 7U;
// A column is looked at for voxels to rescale (kRescaleAbove) each time it has received this much
// evidence: less than what is left to the end of the range, so that no voxel gets there in between.
constexpr std::uint32_t kRescaleCheck = 30000;
// No column of any grid.
constexpr std::uint32_t kNoColumn = UINT32_MAX;
// A column is read again for the slope once its evidence has doubled.
constexpr std::uint32_t kRegrowth = 2;
// The slope's columns stand this many lateral standard deviations apart.
constexpr std::int64_t kSlopeStride = 2;
// Prior of the slope: as if a flat bottom had been seen with this weight (1 / 0.5^2 per cell^2).
constexpr std::int32_t kSlopeRidge = 4;
// Evidence of one column counts for at most this much information (1/cells^2), Q4.
constexpr std::int64_t kSlopeWeightCap_q4 = 63;

// Normalized radius squared along one row of columns, in entries of the profile: a quadratic in the
// column, run by differences. Q12: |xi|, |eta| < 100 inside the largest footprint (a cell's own variance
// keeps their steps below 1.5), which is half a million entries; a row of 48 columns drifts by less
// than a tenth of an entry.
struct RadiusRow {
  std::uint32_t value_q12;
  std::uint32_t step_q12;
};

constexpr std::int64_t kEntriesPerUnit_q10 = 27079;  // kProfileSteps / 4.84
constexpr std::uint32_t kProfileEnd_q12 = static_cast<std::uint32_t>(kProfileSteps) << 12U;

constexpr std::int64_t square_q32(std::int32_t xi_q16, std::int32_t eta_q16) {
  return std::int64_t{xi_q16} * xi_q16 + std::int64_t{eta_q16} * eta_q16;
}

// Of rows whose coordinates change by so much a column: 2 |step|^2.
std::uint32_t radius_second_difference_q12(std::int64_t step_squared_q32) {
  return static_cast<std::uint32_t>(
      (((2 * step_squared_q32) >> 8) * kEntriesPerUnit_q10 + (1 << 21)) >> 22);
}

RadiusRow radius_row(std::int32_t xi_q16, std::int32_t eta_q16, std::int32_t xi_de_q16,
                     std::int32_t eta_de_q16, std::int64_t step_squared_q32) {
  // Above zero by a few units, so that rounding never takes the centre below it.
  constexpr std::int64_t kMargin_q12 = 8;
  const std::int64_t change_q32 =
      2 * (std::int64_t{xi_de_q16} * xi_q16 + std::int64_t{eta_de_q16} * eta_q16) +
      step_squared_q32;
  return RadiusRow{
      static_cast<std::uint32_t>(
          (((square_q32(xi_q16, eta_q16) >> 8) * kEntriesPerUnit_q10) >> 22) + kMargin_q12),
      static_cast<std::uint32_t>(((change_q32 >> 8) * kEntriesPerUnit_q10) >> 22)};
}

// Weight of a two-axis beam at normalized lateral coordinates, Q15; 0 beyond the cut.
std::uint32_t two_axis_weight_q15(const std::uint16_t* along, const std::uint16_t* across,
                                  std::int64_t xi_q16, std::int64_t eta_q16) {
  const auto entry_q12 = [](std::int64_t value_q16) {
    return static_cast<std::uint64_t>(((value_q16 * value_q16 >> 8) * kEntriesPerUnit_q10) >> 22);
  };
  const std::uint64_t a_q12 = entry_q12(xi_q16);
  const std::uint64_t b_q12 = entry_q12(eta_q16);
  if (a_q12 + b_q12 >= kProfileEnd_q12) {
    return 0;
  }
  return (static_cast<std::uint32_t>(along[a_q12 >> 12U]) * across[b_q12 >> 12U]) >> 15U;
}

}  // namespace

PingResult Model::sight(const base::Ping& ping, const base::Pose& pose, Sighting& sighting) const {
  if ((pose.validity & base::kPoseAll) != base::kPoseAll) {
    return PingResult::kPoseInvalid;
  }
  for (int axis = 0; axis < 3; ++axis) {
    const std::int64_t offset_um = pose.position_um[axis] - sensor_->scale.origin_um[axis];
    const std::int64_t limit_um = static_cast<std::int64_t>(kMaxSideCells) * sensor_->scale.cell_um;
    if (offset_um < -limit_um || offset_um > limit_um) {
      return PingResult::kTooFar;
    }
    sighting.origin_q16[axis] =
        static_cast<std::int32_t>(mul_shift(offset_um, sensor_->scale.inverse_cell_q46, 30));
    const std::uint64_t sigma_mm =
        min_of<std::uint32_t>(pose.covariance.sigma_position_mm[axis], 1'000'000'000U);
    const std::int64_t sigma_q12 = base::limited_quotient_u32(
        sigma_mm * (1000U << 12U), static_cast<std::uint32_t>(sensor_->scale.cell_um), 1U << 20U);
    sighting.position_variance_q12[axis] = mul_shift(sigma_q12, sigma_q12, 12);
  }
  if (ping.kind == base::ReturnKind::kProfile) {
    return PingResult::kProfile;
  }
  if (ping.kind == base::ReturnKind::kNoReturn) {
    sighting.range_q16 = 0;
    return PingResult::kNoReturn;
  }
  if (ping.range_um < sensor_->config.min_range_um || ping.range_um <= 0) {
    return PingResult::kRangeTooShort;
  }
  if (ping.range_um > sensor_->config.max_range_um) {
    return PingResult::kRangeTooLong;
  }
  sighting.range_q16 =
      static_cast<std::int32_t>(mul_shift(ping.range_um, sensor_->scale.inverse_cell_q46, 30));
  return PingResult::kFused;
}

// The columns that the event will most likely touch, asked for before the slope is known: memory then
// works while the geometry is computed. A hint only; the result does not depend on it.
void Model::prefetch_columns(const BeamFrame& frame, const Sighting& sighting) const {
#if defined(__GNUC__)
  constexpr std::int32_t kAround = 2;
  std::int32_t centre[3];
  for (int axis = 0; axis < 3; ++axis) {
    centre[axis] = static_cast<std::int32_t>(
        (sighting.origin_q16[axis] + mul_shift(sighting.range_q16, frame.axis.q30[axis], 30)) >>
        16);
  }
  const std::int32_t n0 = max_of(centre[0] - kAround, 0);
  const std::int32_t n1 = min_of(centre[0] + kAround, sensor_->scale.size[0] - 1);
  const std::int32_t e0 = max_of(centre[1] - kAround, 0);
  const std::int32_t e1 = min_of(centre[1] + kAround, sensor_->scale.size[1] - 1);
  const std::int32_t k = clamp(centre[2] - 4, 0, sensor_->scale.size[2] - 1);
  for (std::int32_t n = n0; n <= n1; ++n) {
    for (std::int32_t e = e0; e <= e1; ++e) {
      const std::uint32_t column = grid_.column_index(n, e);
      const Voxel* const voxels = grid_.column_voxels(column);
      __builtin_prefetch(voxels, 1);
      __builtin_prefetch(voxels + k, 1);
      __builtin_prefetch(&grid_.column(column), 1);
    }
  }
#endif
}

// Columns that the slope is read from: nine, `stride` apart about the axis' end.
struct Model::SlopePlace {
  std::int32_t north, east, stride;
};

Model::SlopePlace Model::slope_place(const BeamFrame& frame, const Sighting& sighting) const {
  const std::int64_t range = sighting.range_q16;
  const std::int64_t range2_q6 = (range * range) >> 26;
  const std::int64_t lateral_q12 =
      mul_shift(range2_q6,
                static_cast<std::int64_t>(sensor_->table.beam_variance_along_q30) +
                    sensor_->table.pointing_variance_q30,
                24) +
      max_of(sighting.position_variance_q12[0], sighting.position_variance_q12[1]) + 2048;
  const auto sigma_q12 =
      static_cast<std::int64_t>(base::sqrt_u64(static_cast<std::uint64_t>(lateral_q12) << 12U));
  const auto stride = static_cast<std::int32_t>(
      clamp<std::int64_t>((kSlopeStride * sigma_q12 + 4096) >> 13, 1, kMaxFootprintCells / 2) * 2);
  // Centre and stride are even: a quarter of the columns serves all slopes, and is read less often.
  const auto centre_n = static_cast<std::int32_t>(
      ((sighting.origin_q16[0] + mul_shift(range, frame.axis.q30[0], 30) + 0x8000) >> 17) * 2);
  const auto centre_e = static_cast<std::int32_t>(
      ((sighting.origin_q16[1] + mul_shift(range, frame.axis.q30[1], 30) + 0x8000) >> 17) * 2);
  return SlopePlace{centre_n, centre_e, stride};
}

void Model::read_for_slope(std::uint32_t index) {
  ColumnRecord& record = grid_.column(index);
  const ColumnDepth column = depth_of(index, DepthMethod::kRobustMoment);
  ++counters_.column_extractions;
  ++work_.columns_read;
  grid_.tile(index >> 8U).flags |= kTileSideChanged;
  record.depth_q8 = column.depth_q8;
  record.mass = column.mass;
  record.gain = 0;
  // mass / 255 events of variance min_variance: information in 1/cells^2, Q4.
  record.slope_weight_q4 = static_cast<std::uint8_t>(clamp<std::int64_t>(
      base::quotient(static_cast<std::int64_t>(record.mass) << 8, sensor_->scale.min_variance_q12),
      1, kSlopeWeightCap_q4));
}

Slope Model::estimate_slope(const BeamFrame& frame, const Sighting& sighting) {
  const SlopePlace place = slope_place(frame, sighting);
  const std::int32_t centre_n = place.north;
  const std::int32_t centre_e = place.east;
  const std::int32_t stride = place.stride;

  // Weighted least squares of a plane through up to nine columns; depths relative to the first. Weights have 8 bits,
  // depths in Q8 less than 19: sums of their products less than 31.
  const std::int32_t north_cells = sensor_->scale.size[0];
  const std::int32_t east_cells = sensor_->scale.size[1];
  std::int32_t weight_of_row[3] = {};
  std::int32_t weight_of_file[3] = {};
  std::int32_t moment_of_row[3] = {};
  std::int32_t moment_of_file[3] = {};
  std::int32_t twist = 0;
  std::int32_t reference_q8 = kUnknownDepth;
  for (std::int32_t i = 0; i < 3; ++i) {
    const std::int32_t n = centre_n + (i - 1) * stride;
    for (std::int32_t j = 0; j < 3; ++j) {
      const std::int32_t e = centre_e + (j - 1) * stride;
      if (n < 0 || e < 0 || n >= north_cells || e >= east_cells) {
        continue;
      }
      const std::uint32_t index = grid_.column_index(n, e);
      ColumnRecord& record = grid_.column(index);
      if (record.gain > (kRegrowth - 1) * record.mass) {
        read_for_slope(index);
      }
      if (record.depth_q8 == kUnknownDepth) {
        continue;
      }
      reference_q8 = reference_q8 == kUnknownDepth ? record.depth_q8 : reference_q8;
      const std::int32_t weight = record.slope_weight_q4;
      const std::int32_t moment = weight * (record.depth_q8 - reference_q8);
      weight_of_row[i] += weight;
      weight_of_file[j] += weight;
      moment_of_row[i] += moment;
      moment_of_file[j] += moment;
      twist += weight * ((i - 1) * (j - 1));
    }
  }
  const std::int64_t s = weight_of_row[0] + weight_of_row[1] + weight_of_row[2];
  if (s == 0) {
    return Slope{0, 0};
  }
  const std::int64_t sn = weight_of_row[2] - weight_of_row[0];
  const std::int64_t se = weight_of_file[2] - weight_of_file[0];
  const std::int64_t sz = moment_of_row[0] + moment_of_row[1] + moment_of_row[2];
  const std::int64_t snn = weight_of_row[0] + weight_of_row[2];
  const std::int64_t sne = twist;
  const std::int64_t see = weight_of_file[0] + weight_of_file[2];
  const std::int64_t snz = moment_of_row[2] - moment_of_row[0];
  const std::int64_t sez = moment_of_file[2] - moment_of_file[0];
  // Centred moments times s; the ridge (Q4 information per cell^2) in units of stride^2.
  const std::int64_t ridge =
      max_of(1, static_cast<std::int32_t>(s) * kSlopeRidge * 16 / (stride * stride));
  const std::int64_t cnn = s * snn - sn * sn + ridge;
  const std::int64_t cee = s * see - se * se + ridge;
  const std::int64_t cne = s * sne - sn * se;
  const std::int64_t cnz = s * snz - sn * sz;
  const std::int64_t cez = s * sez - se * sz;
  const std::int64_t determinant = (cnn * cee - cne * cne) * stride;
  return Slope{ratio(cnz * cee - cez * cne, determinant, 4),
               ratio(cez * cnn - cnz * cne, determinant, 4)};
}

// What the columns of one shell have in common. Copied where the loop runs: it then stays in registers,
// which nothing can do that voxels, of whatever type, might alias.
struct Model::ShellContext {
  const std::uint16_t* along;
  const std::uint16_t* across;
  const std::int16_t (*kernel)[kKernelTaps];
  const std::uint8_t* kernel_first;
  const std::uint8_t* kernel_count;
  std::uint32_t weight_q7;
  std::uint32_t against_q15;  // share of the shell's evidence that speaks against it
  std::uint32_t now_ds;
  std::uint32_t seed;
  std::int32_t depth_cells;
  std::int32_t blur_q8;
  Rule rule;
  std::uint32_t pull_gain_q15;    // pulling rules
  std::uint32_t pull_signal_q16;  // the shell's own rho
};

namespace {

// The shell in one column: `weight_q7` around `depth_q16`. Returns the voxels written.
template <typename Context>
inline std::int32_t add_shell_column(const Context& shell, Voxel* voxels, std::int32_t depth_q16,
                                     std::uint32_t weight_q7, std::uint32_t dither) {
  const auto phase = static_cast<std::uint32_t>(depth_q16 >> 12) & 15U;
  const std::int32_t first = shell.kernel_first[phase];
  const std::int32_t taps = shell.kernel_count[phase];
  const std::int32_t start = (depth_q16 >> 16) - kKernelCentre + first;
  if (is_pulling(shell.rule)) {
    const std::int32_t low = max_of(start, 0);
    const std::int32_t count = min_of(start + taps, shell.depth_cells) - low;
    pull_shell(shell.rule, voxels + low, shell.kernel[phase] + first + (low - start), count,
               static_cast<std::uint32_t>(low),
               Pull{pull_gain(shell.pull_gain_q15, weight_q7), shell.pull_signal_q16}, dither);
    return max_of(count, 0);
  }
  const std::uint32_t against_q7 = (weight_q7 * shell.against_q15) >> 15U;
  const Evidence evidence{weight_q7 - against_q7, against_q7};
  if (start >= 0 && start <= shell.depth_cells - taps) {
    add_shell_taps(voxels + start, shell.kernel[phase], first, taps,
                   dither + static_cast<std::uint32_t>(start) * kDitherStep, evidence);
    return taps;
  }
  const std::int32_t low = max_of(start, 0);
  const std::int32_t count = min_of(start + taps, shell.depth_cells) - low;
  if (count <= 0) {
    return 0;
  }
  add_shell(voxels + low, shell.kernel[phase] + first + (low - start), count,
            static_cast<std::uint32_t>(low), evidence, dither);
  return count;
}

// Weight of the beam from column to column of a row.
template <bool kTwoAxis>
class LateralWalk {
 public:
  LateralWalk(std::int32_t xi_step_q16, std::int32_t eta_step_q16)
      : xi_step_q16_(xi_step_q16),
        eta_step_q16_(eta_step_q16),
        step_squared_q32_(square_q32(xi_step_q16, eta_step_q16)),
        bend_q12_(kTwoAxis ? 0 : radius_second_difference_q12(step_squared_q32_)) {}

  void begin_row(std::int32_t xi_q16, std::int32_t eta_q16) {
    if (kTwoAxis) {
      xi_q16_ = xi_q16;
      eta_q16_ = eta_q16;
    } else {
      radius_ = radius_row(xi_q16, eta_q16, xi_step_q16_, eta_step_q16_, step_squared_q32_);
    }
  }
  std::uint32_t next_q15(const std::uint16_t* along, const std::uint16_t* across) {
    if (kTwoAxis) {
      const std::uint32_t weight_q15 = two_axis_weight_q15(along, across, xi_q16_, eta_q16_);
      xi_q16_ += xi_step_q16_;
      eta_q16_ += eta_step_q16_;
      return weight_q15;
    }
    const std::uint32_t at_q12 = radius_.value_q12;
    radius_.value_q12 += radius_.step_q12;
    radius_.step_q12 += bend_q12_;
    return at_q12 < kProfileEnd_q12 ? along[at_q12 >> 12U] : 0U;
  }

 private:
  std::int32_t xi_step_q16_;
  std::int32_t eta_step_q16_;
  std::int64_t step_squared_q32_;
  std::uint32_t bend_q12_;
  std::int32_t xi_q16_ = 0;
  std::int32_t eta_q16_ = 0;
  RadiusRow radius_{};
};

inline void note_evidence(ColumnRecord& record, std::uint32_t weight_q7, std::uint32_t now_ds,
                          std::int32_t blur_q8) {
  const std::uint32_t units = (weight_q7 >> 7U) + 1U;
  record.gain += units;
  record.unchecked += units;
  record.last_touch_ds = now_ds;
  const std::int32_t change = (blur_q8 - record.blur_q8) >> 2;
  record.blur_q8 = static_cast<std::uint16_t>(
      (record.flags & kColumnTouched) != 0 ? record.blur_q8 + change : blur_q8);
  record.flags |= kColumnTouched | kColumnDirty;
}

}  // namespace

// The rows of a shell; the place in the grid is looked up once per tile. Returns a column to look at for saturation,
// or none.
template <bool kTwoAxis>
std::uint32_t Model::add_shell_rows(const ShellEvent& event, const ShellContext& context) {
  const ShellContext shell = context;
  std::uint32_t rescale_candidate = kNoColumn;
  std::uint32_t all_voxels = 0;
  std::uint32_t all_columns = 0;
  const std::int32_t depth_step = event.depth_de_q16;
  const std::int32_t east0 = event.east0;
  const std::int32_t east1 = event.east1;
  LateralWalk<kTwoAxis> lateral(event.xi_de_q16, event.eta_de_q16);
  const std::uint32_t column_dither = of_32_bits(kColumnDither);
  std::int32_t row_xi = event.xi0_q16;
  std::int32_t row_eta = event.eta0_q16;
  std::int32_t row_depth = event.depth0_q16;
  for (std::int32_t n = event.north0; n <= event.north1; ++n) {
    lateral.begin_row(row_xi, row_eta);
    std::int32_t depth = row_depth;
    // Dither follows the place in the grid, not in storage: the map must not depend on paging.
    std::uint32_t dither =
        shell.seed + static_cast<std::uint32_t>(n * kMaxSideCells + east0) * column_dither;
    std::int32_t e = east0;
    while (e <= east1) {
      const std::uint32_t first = grid_.column_index(n, e);
      Voxel* voxels = grid_.column_voxels(first);
      ColumnRecord* record = &grid_.column(first);
      const std::int32_t end = min_of(e | (kTileCells - 1), east1);
      const ColumnRecord* const record_end = record + (end - e + 1);
      std::uint32_t columns = 0;
      for (; record < record_end; ++record) {
        Voxel* const column_voxels = voxels;
        const std::int32_t column_depth_q16 = depth;
        const std::uint32_t place_dither = dither;
        voxels += shell.depth_cells;
        depth += depth_step;
        dither += column_dither;
        const std::uint32_t weight_q7 =
            (shell.weight_q7 * lateral.next_q15(shell.along, shell.across)) >> 15U;
        if (weight_q7 == 0) {
          continue;
        }
        const std::int32_t count =
            add_shell_column(shell, column_voxels, column_depth_q16, weight_q7, place_dither);
        if (count == 0) {
          continue;
        }
        all_voxels += static_cast<std::uint32_t>(count);
        ++columns;
        note_evidence(*record, weight_q7, shell.now_ds, shell.blur_q8);
        if (record->unchecked > kRescaleCheck) {
          rescale_candidate = first + static_cast<std::uint32_t>(end - e + 1) -
                              static_cast<std::uint32_t>(record_end - record);
        }
      }
      if (columns != 0) {
        all_columns += columns;
        grid_.touch(first >> 8U, ping_number_);
      }
      e = end + 1;
    }
    row_xi += event.xi_dn_q16;
    row_eta += event.eta_dn_q16;
    row_depth += event.depth_dn_q16;
  }
  voxels_this_ping_ += all_voxels;
  counters_.columns_updated += all_columns;
  work_.shell_columns += all_columns;
  return rescale_candidate;
}

void Model::add_shell_event(const ShellEvent& event, std::uint32_t now_ds) {
  ShellContext shell{sensor_->table.profile_q15[0][event.profile_class],
                     sensor_->table.profile_q15[1][event.profile_class],
                     sensor_->table.kernel_q15[event.level],
                     sensor_->table.kernel_first[event.level],
                     sensor_->table.kernel_count[event.level],
                     event.weight_q7,
                     0,
                     now_ds,
                     base::mix_u32(ping_number_),
                     sensor_->scale.size[2],
                     event.blur_q8,
                     config_.rule,
                     sensor_->scale.pull_gain_q15,
                     0};
  if (config_.rule != Rule::kLogOdds) {
    // rho = 1 - 0.5 sqrt(R / R_max) of the evidence speaks for the shell, the rest against it.
    shell.against_q15 = kEmptyRho_q15[range_entry(sensor_->scale, event.empty_range_q10)];
    shell.pull_signal_q16 = 65535U - 2U * shell.against_q15;
  }
  work_.shell_rows = static_cast<std::uint32_t>(event.north1 - event.north0 + 1);
  work_.shell_candidates =
      work_.shell_rows * static_cast<std::uint32_t>(event.east1 - event.east0 + 1);
  const std::uint32_t rescale_candidate = sensor_->table.two_axis != 0
                                              ? add_shell_rows<true>(event, shell)
                                              : add_shell_rows<false>(event, shell);
  work_.shell_voxels = voxels_this_ping_;
  // Pulled voxels cannot saturate: nothing to rescale.
  if (rescale_candidate != kNoColumn && !is_pulling(config_.rule)) {
    check_saturation(rescale_candidate);
  }
}

// At most one column a ping, and only where the work bound leaves room: a column that must wait is still
// a candidate at its next event.
void Model::check_saturation(std::uint32_t column) {
  const auto depth_cells = static_cast<std::uint32_t>(sensor_->scale.size[2]);
  if (voxels_this_ping_ + depth_cells > limit_voxels_) {
    return;
  }
  ColumnRecord& record = grid_.column(column);
  record.unchecked = 0;
  if (rescale_column(grid_.column_voxels(column), sensor_->scale.size[2])) {
    voxels_this_ping_ += depth_cells;
    ++counters_.columns_rescaled;
    record.mass /= 2;
    record.gain /= 2;
  }
}

// A windowed grid: whether the voxels of these columns (clipped by the grid already) are in memory. What is
// wanted, present or not, goes into wanted_.
bool Model::has_tiles(std::int32_t n0, std::int32_t n1, std::int32_t e0, std::int32_t e1) {
  if (n0 > n1 || e0 > e1) {
    return true;
  }
  const bool first = wanted_.north0 > wanted_.north1;
  wanted_ = TileBox{first ? n0 >> 4 : min_of(wanted_.north0, n0 >> 4),
                    first ? n1 >> 4 : max_of(wanted_.north1, n1 >> 4),
                    first ? e0 >> 4 : min_of(wanted_.east0, e0 >> 4),
                    first ? e1 >> 4 : max_of(wanted_.east1, e1 >> 4)};
  return grid_.resident(n0, n1, e0, e1);
}

bool Model::has_cone_tiles(const BeamFrame& frame, const Sighting& sighting,
                           std::int32_t range_q10) {
  if (range_q10 <= 0) {
    return true;
  }
  const Frustum frustum = make_frustum(sensor_->scale, sensor_->table, frame, sighting, range_q10);
  const CellRange rows = frustum_rows(frustum, sensor_->scale.size[0]);
  const std::int32_t tip = frustum.tip_q10[1];
  const std::int32_t radius = frustum.cone.radius_q10;
  const CellRange columns =
      cells_between(frustum.origin_q10[1] + min_of(tip, 0) - radius,
                    frustum.origin_q10[1] + max_of(tip, 0) + radius, sensor_->scale.size[1]);
  return has_tiles(rows.first, rows.last, columns.first, columns.last);
}

bool Model::has_slope_tiles(const BeamFrame& frame, const Sighting& sighting) {
  const SlopePlace place = slope_place(frame, sighting);
  return has_tiles(max_of(place.north - place.stride, 0),
                   min_of(place.north + place.stride, sensor_->scale.size[0] - 1),
                   max_of(place.east - place.stride, 0),
                   min_of(place.east + place.stride, sensor_->scale.size[1] - 1));
}

// Everything that a return reads and writes; `cone`: the way there too.
bool Model::has_return_tiles(const BeamFrame& frame, const Sighting& sighting, bool cone) {
  if (!has_slope_tiles(frame, sighting)) {
    return false;
  }
  const ShellEvent event =
      make_shell(sensor_->scale, sensor_->table, frame, sighting, estimate_slope(frame, sighting));
  const bool shell = has_tiles(event.north0, event.north1, event.east0, event.east1);
  return (!cone || has_cone_tiles(frame, sighting, event.empty_range_q10)) && shell;
}

// The shell of one return, written into the voxels.
ShellEvent Model::add_return(const base::Ping& ping, const BeamFrame& frame,
                             const Sighting& sighting, std::uint32_t share_q8) {
  prefetch_columns(frame, sighting);
  const Slope slope = estimate_slope(frame, sighting);
  ShellEvent event = make_shell(sensor_->scale, sensor_->table, frame, sighting, slope);
  event.weight_q7 = (event.weight_q7 * min_of(share_q8, kWholeShare_q8)) >> 8U;
  add_shell_event(event, static_cast<std::uint32_t>(base::quotient(ping.t_transmit_us, 100'000)));
  return event;
}

PingResult Model::integrate(const base::Ping& ping, const base::Pose& pose, std::size_t sensor,
                            const ReturnDetail& detail) {
  voxels_this_ping_ = 0;
  work_ = PingWork{};
  limit_voxels_ = bound_.total_voxels;
  wanted_ = TileBox{0, -1, 0, -1};
  if (!configured_ || sensor >= sensor_count_) {
    ++counters_.pings[static_cast<int>(PingResult::kNotConfigured)];
    return PingResult::kNotConfigured;
  }
  sensor_ = &sensors_[sensor];
  Sighting sighting{};
  const PingResult result = sight(ping, pose, sighting);
  const bool empty = result == PingResult::kNoReturn && config_.no_return == NoReturnPolicy::kEmpty;
  if (result != PingResult::kFused && !empty) {
    ++counters_.pings[static_cast<int>(result)];
    return result;
  }
  const BeamFrame frame =
      beam_frame(pose.attitude, ping.azimuth_bam32, ping.elevation_bam32, ping.rotation_bam32);
  if (empty) {
    const std::int64_t range_q16 =
        mul_shift(sensor_->config.detect_range_um, sensor_->scale.inverse_cell_q46, 30);
    if (grid_.windowed() &&
        !has_cone_tiles(frame, sighting, static_cast<std::int32_t>(range_q16 >> 6))) {
      ++counters_.pings[static_cast<int>(PingResult::kAbsentTile)];
      return PingResult::kAbsentTile;
    }
    ++ping_number_;
    carve(frame, sighting, nullptr, static_cast<std::int32_t>(range_q16 >> 6), kNoReturn_q14);
  } else {
    if (grid_.windowed() && !has_return_tiles(frame, sighting, true)) {
      ++counters_.pings[static_cast<int>(PingResult::kAbsentTile)];
      return PingResult::kAbsentTile;
    }
    ++ping_number_;
    const ShellEvent event = add_return(ping, frame, sighting, detail.share_q8);
    // At its far end the empty evidence is a fixed part of the shell's peak.
    const std::uint32_t peak_q15 = static_cast<std::uint32_t>(
        sensor_->table.kernel_q15[event.level][kKernelPhases / 2][kKernelCentre]);
    const std::int64_t clear_q10 =
        mul_shift(clamp<std::int64_t>(detail.clear_um, 0, sensor_->config.max_range_um),
                  sensor_->scale.inverse_cell_q46, 36);
    carve(frame, sighting, &event,
          static_cast<std::int32_t>(min_of<std::int64_t>(event.empty_range_q10, clear_q10)),
          (event.weight_q7 * peak_q15) >> (8U + kEmptyShift));
  }
  ++counters_.pings[static_cast<int>(result)];
  counters_.voxel_updates += voxels_this_ping_;
  counters_.last_voxels_per_ping = voxels_this_ping_;
  counters_.max_voxels_per_ping = max_of(counters_.max_voxels_per_ping, voxels_this_ping_);
  return result;
}

PingResult Model::integrate_behind(const base::Ping& ping, const base::Pose& pose,
                                   std::size_t sensor, const ReturnDetail& detail) {
  voxels_this_ping_ = 0;
  work_ = PingWork{};
  limit_voxels_ = bound_.behind_voxels;
  counters_.last_voxels_per_ping = 0;
  if (!configured_ || sensor >= sensor_count_) {
    return PingResult::kNotConfigured;
  }
  sensor_ = &sensors_[sensor];
  Sighting sighting{};
  const PingResult result = sight(ping, pose, sighting);
  if (result != PingResult::kFused) {
    return result;
  }
  const BeamFrame frame =
      beam_frame(pose.attitude, ping.azimuth_bam32, ping.elevation_bam32, ping.rotation_bam32);
  if (grid_.windowed() && !has_return_tiles(frame, sighting, false)) {
    return PingResult::kAbsentTile;
  }
  ++ping_number_;
  static_cast<void>(add_return(ping, frame, sighting, detail.share_q8));
  ++counters_.behind_fused;
  counters_.voxel_updates += voxels_this_ping_;
  counters_.last_voxels_per_ping = voxels_this_ping_;
  return result;
}

}  // namespace leadline::model
