// The cone of one ping: empty evidence along its way (Model::carve).
#include "model/base/fixed.hpp"
#include "model/column_kernels.hpp"
#include "model/cone_column.hpp"
#include "model/evidence.hpp"
#include "model/frustum.hpp"
#include "model/model.hpp"
#include "model/plain_cone.hpp"

namespace leadline::model {
namespace {

using base::clamp;
using base::max_of;
using base::min_of;
using base::mul_shift;

// Depth of a plane that is not there: below every grid.
constexpr std::int64_t kNoLimit_q16 = std::int64_t{kMaxDepthCells} << 17;
// Voxels of a column that share one weight of empty evidence.
constexpr std::int32_t kRun = 24;
// A cone no wider has too few columns for what plain cones prepare: two cells.
constexpr std::int32_t kFewColumns_q10 = 2 << 10;

// Entry of the beam weight table at (off / half_width)^2; both Q10, off squared Q20.
// half_width_q10 >= kTouch_q10, so that nothing is divided by zero.
std::uint32_t beam_entry(std::uint64_t off2_q20, std::int32_t half_width_q10) {
  const auto width = static_cast<std::uint64_t>(static_cast<std::uint32_t>(half_width_q10));
  const auto dividend =
      static_cast<std::uint32_t>(min_of<std::uint64_t>(off2_q20 >> 4U, UINT32_MAX));
  const auto divisor =
      static_cast<std::uint32_t>(min_of<std::uint64_t>((width * width) >> 10U, UINT32_MAX));
  return min_of<std::uint32_t>(dividend / divisor, kBeamWeightSteps);
}

// Keeps the part of `span` where coefficient * z <= room.
void limit_span(ColumnSpan& span, std::int64_t coefficient_q30, std::int64_t room_q10) {
  if (coefficient_q30 == 0) {
    span.bottom_q10 = room_q10 < 0 ? span.top_q10 - 1 : span.bottom_q10;
    return;
  }
  // |room| < 2^26: 32000 cells.
  const auto limit_q10 = static_cast<std::int32_t>(
      clamp<std::int64_t>(room_q10 * (1LL << 30) / coefficient_q30, -kFar_q10, kFar_q10));
  if (coefficient_q30 > 0) {
    span.bottom_q10 = min_of(span.bottom_q10, limit_q10);
  } else {
    span.top_q10 = max_of(span.top_q10, limit_q10);
  }
}

// Inside the wider axis' circle, what one axis of a two-axis beam holds:
// |a0 + a z| <= kTouch + g (p + s z).
void limit_to_axis(ColumnSpan& span, const Frustum& frustum, const ColumnOffset& offset,
                   const Direction& side, std::int32_t growth_q20) {
  const std::int64_t p_q10 = mul_shift(frustum.cone.horizontal_q30, offset.x, 30);
  const std::int64_t a0_q10 =
      (mul_shift(side.q30[0], offset.dn, 0) + mul_shift(side.q30[1], offset.de, 0)) >> 30;
  const std::int64_t room_q10 = kTouch_q10 + mul_shift(growth_q20, p_q10, 20);
  const std::int64_t widening_q30 = mul_shift(growth_q20, frustum.cone.down_q30, 20);
  limit_span(span, side.q30[2] - widening_q30, room_q10 - a0_q10);
  limit_span(span, -side.q30[2] - widening_q30, room_q10 + a0_q10);
}

// Voxels of a column of `cells` whose centres lie inside the cone.
CellRange frustum_column(const Frustum& frustum, const BeamFrame& frame, const ColumnOffset& offset,
                         std::int32_t cells) {
  if (!in_box(frustum, offset.x, offset.y)) {
    return CellRange{0, -1};
  }
  ColumnSpan span = cone_span_inline(frustum.cone, offset.x, offset.y);
  if (frustum.two_axis) {
    limit_to_axis(span, frustum, offset, frame.along, frustum.grow_along_q20);
    limit_to_axis(span, frustum, offset, frame.across, frustum.grow_across_q20);
  }
  return cells_between(span.top_q10 + frustum.origin_q10[2],
                       span.bottom_q10 + frustum.origin_q10[2], cells);
}

// Distance along the axis of the point `z` below the transducer.
std::int32_t frustum_slant(const Frustum& frustum, const ColumnOffset& offset, std::int32_t z) {
  return max_of(0, static_cast<std::int32_t>((mul_shift(frustum.cone.horizontal_q30, offset.x, 0) +
                                              mul_shift(frustum.cone.down_q30, z, 0)) >>
                                             30));
}

std::uint64_t squared(std::int32_t value) {
  return static_cast<std::uint64_t>(mul_shift(value, value, 0));
}

// Two-way pattern towards that point, Q15; -1 outside the footprint of a two-axis table, whose cone is
// round and holds more than the beam.
std::int32_t frustum_weight_q15(const Frustum& frustum, const LocalizationTable& table,
                                const BeamFrame& frame, const ColumnOffset& offset, std::int32_t z,
                                std::int32_t slant) {
  const auto half_width = [slant](std::int32_t growth_q20) {
    return kTouch_q10 + static_cast<std::int32_t>(mul_shift(growth_q20, slant, 20));
  };
  if (!frustum.two_axis) {
    const auto off = static_cast<std::int32_t>((mul_shift(frustum.cone.down_q30, offset.x, 0) -
                                                mul_shift(frustum.cone.horizontal_q30, z, 0)) >>
                                               30);
    return table.beam_weight_q15[0][beam_entry(squared(off) + squared(offset.y),
                                               half_width(frustum.cone.growth_q20))];
  }
  const auto component = [&](const Direction& side) {
    return static_cast<std::int32_t>((mul_shift(side.q30[0], offset.dn, 0) +
                                      mul_shift(side.q30[1], offset.de, 0) +
                                      mul_shift(side.q30[2], z, 0)) >>
                                     30);
  };
  const std::int32_t along = component(frame.along);
  const std::int32_t across = component(frame.across);
  const std::uint32_t entry_a = beam_entry(squared(along), half_width(frustum.grow_along_q20));
  const std::uint32_t entry_b = beam_entry(squared(across), half_width(frustum.grow_across_q20));
  if (entry_a >= kBeamWeightSteps || entry_b >= kBeamWeightSteps) {
    return -1;
  }
  return static_cast<std::int32_t>((static_cast<std::uint32_t>(table.beam_weight_q15[0][entry_a]) *
                                    table.beam_weight_q15[1][entry_b]) >>
                                   15U);
}

// Empty evidence along a cone. A ping that passes a voxel speaks against it as much as it would have spoken
// for it had it ended there: near echoes are precise and weigh much, so what passes near weighs as much.
// Otherwise a short false echo outvotes every wide echo that went through it.
struct Emptiness {
  std::uint32_t end_q14;  // strength at the far end
  std::uint32_t growth_q24;
  std::uint64_t inverse_range_q36;
};

Emptiness make_emptiness(std::uint32_t end_q14, std::uint32_t growth_q24, std::int32_t range_q10) {
  return Emptiness{end_q14, growth_q24,
                   static_cast<std::uint64_t>(base::quotient(1LL << 36, range_q10))};
}

inline std::uint32_t empty_strength_q7(const Emptiness& empty, std::int32_t slant_q10) {
  if (empty.growth_q24 == 0) {
    return min_of(empty.end_q14 >> 7U, kMostEmpty_q7);
  }
  const auto share_q16 = static_cast<std::uint32_t>(min_of<std::uint64_t>(
      (static_cast<std::uint32_t>(slant_q10) * empty.inverse_range_q36) >> 20U, 65536U));
  const std::uint64_t strength_q22 =
      static_cast<std::uint64_t>(empty.end_q14) * peak_gain_inline_q8(empty.growth_q24, share_q16);
  return static_cast<std::uint32_t>(min_of<std::uint64_t>(strength_q22 >> 15U, kMostEmpty_q7));
}

// Empty evidence of strength `strength_q7` at distance/64 of the maximum range.
Evidence empty_evidence(Rule rule, std::uint32_t strength_q7, std::uint32_t distance) {
  if (rule == Rule::kLogOdds) {
    return Evidence{0, (strength_q7 * kEmptyLogit_q15[distance]) >> 15U};
  }
  const std::uint32_t hit_q7 = (strength_q7 * kEmptyRho_q15[distance]) >> 15U;
  return Evidence{hit_q7, strength_q7 - hit_q7};
}

}  // namespace

// Empty evidence of strength `strength_q7`, at distance/64 of the maximum range, on a run of voxels.
inline void Model::add_empty(Voxel* voxels, std::int32_t count, std::uint32_t first,
                             std::uint32_t strength_q7, std::uint32_t distance,
                             std::uint32_t dither) const {
  if (is_pulling(config_.rule)) {
    const Pull pull{pull_gain(sensor_->scale.pull_gain_q15, strength_q7),
                    2U * kEmptyRho_q15[distance]};
    pull_uniform(config_.rule, voxels, count, first, pull, dither);
    return;
  }
  add_uniform(voxels, count, first, empty_evidence(config_.rule, strength_q7, distance), dither);
}

// What the rows of one cone have in common.
struct Model::CarveContext {
  const BeamFrame& frame;
  const ShellEvent* plane;  // whose kernel must not be reached; null: none
  Frustum frustum;
  Emptiness empty;
  std::int64_t limit0_q16;  // last depth before the plane over column (0, 0)
  std::uint32_t seed;

  [[nodiscard]] std::int64_t limit_at(std::int32_t n, std::int32_t e) const {
    return plane == nullptr ? limit0_q16
                            : limit0_q16 + mul_shift(n, plane->depth_dn_q16, 0) +
                                  mul_shift(e, plane->depth_de_q16, 0);
  }
};

struct Model::CarvedColumn {
  Voxel* voxels;
  ColumnOffset offset;
  CellRange cells;
  std::uint32_t dither;
};

// False: the work bound is met.
inline bool Model::carve_column(const CarveContext& context, const CarvedColumn& column,
                                std::uint32_t& room) {
  const Frustum& frustum = context.frustum;
  std::uint32_t runs = 0;
  for (std::int32_t k = column.cells.first; k <= column.cells.last; k += kRun) {
    const std::int32_t count = min_of(kRun, column.cells.last - k + 1);
    if (static_cast<std::uint32_t>(count) > room) {
      work_.cone_runs += runs;
      return false;
    }
    ++runs;
    // Off-axis position and distance of the run's middle.
    const std::int32_t z = k * 1024 + count * 512 - frustum.origin_q10[2];
    const std::int32_t slant = frustum_slant(frustum, column.offset, z);
    const std::int32_t beam_q15 =
        frustum_weight_q15(frustum, sensor_->table, context.frame, column.offset, z, slant);
    if (beam_q15 < 0) {
      continue;
    }
    const std::uint32_t distance = range_entry(sensor_->scale, slant);
    const std::uint32_t strength_q7 =
        (empty_strength_q7(context.empty, slant) * static_cast<std::uint32_t>(beam_q15)) >> 15U;
    add_empty(column.voxels + k, count, static_cast<std::uint32_t>(k), strength_q7, distance,
              column.dither);
    room -= static_cast<std::uint32_t>(count);
  }
  work_.cone_runs += runs;
  return true;
}

// The same.
bool Model::carve_row(const CarveContext& context, std::int32_t n) {
  const Frustum& frustum = context.frustum;
  const std::int32_t dn = n * 1024 + 512 - frustum.origin_q10[0];
  const CellRange row = frustum_row(frustum, dn, sensor_->scale.size[1]);
  if (row.first > row.last) {
    return true;
  }
  work_.cone_candidates += static_cast<std::uint32_t>(row.last - row.first + 1);
  const std::int32_t depth_cells = sensor_->scale.size[2];
  std::int64_t limit_q16 = context.limit_at(n, row.first);
  const std::int32_t limit_de_q16 = context.plane != nullptr ? context.plane->depth_de_q16 : 0;
  const auto row_place = static_cast<std::uint32_t>(n * kMaxSideCells);
  const std::uint32_t room_before = room_left();
  std::uint32_t room = room_before;
  // The place in the grid is looked up once per tile.
  std::int32_t e = row.first;
  bool within = true;
  while (e <= row.last && within) {
    const std::int32_t end = min_of(e | (kTileCells - 1), row.last);
    const TileId tile = grid_.tile_of(n, e);
    Voxel* voxels = grid_.column_voxels(grid_.column_index(n, e));
    std::uint32_t written = 0;
    for (; e <= end && within; ++e) {
      const std::int32_t de = e * 1024 + 512 - frustum.origin_q10[1];
      const std::int64_t limit = limit_q16 >> 16;
      limit_q16 += limit_de_q16;
      Voxel* const column_voxels = voxels;
      voxels += depth_cells;
      // Nothing nearer than the kernel's reach to the shell's plane, and nothing behind it.
      if (limit < 0) {
        continue;
      }
      const ColumnOffset offset = column_offset(frustum, dn, de);
      CellRange cells = frustum_column(frustum, context.frame, offset, depth_cells);
      if (limit < cells.last) {
        cells.last = static_cast<std::int32_t>(limit);
      }
      if (cells.first <= cells.last) {
        ++written;
        // Dither follows the place in the grid, not in storage.
        const std::uint32_t dither =
            context.seed + (row_place + static_cast<std::uint32_t>(e)) * kColumnDither;
        within = carve_column(context, CarvedColumn{column_voxels, offset, cells, dither}, room);
      }
    }
    if (written > 0) {
      work_.cone_columns += written;
      grid_.touch(tile, ping_number_);
    }
  }
  voxels_this_ping_ += room_before - room;
  return within;
}

// A column of a plain cone that holds something.
struct Model::PlacedColumn {
  PlainColumn at;
  std::int32_t e;
  CellRange cells;
};

// Columns of a tile's row: the voxels of its first column, its number, and the row's dither.
struct Model::PlainRow {
  Voxel* voxels;
  std::int32_t first_e;
  std::uint32_t dither;
};

// Of a plain cone: the columns [column, end), at least one, of a tile's row.
bool Model::carve_plain_columns(const PlainCone& cone, const PlainRow& row,
                                const PlacedColumn* column, const PlacedColumn* end,
                                std::uint32_t& room) {
  const std::int32_t depth_cells = sensor_->scale.size[2];
  std::uint32_t left_room = room;
  std::uint32_t runs = 0;
  bool within = true;
  work_.cone_columns += static_cast<std::uint32_t>(end - column);
  do {
    std::int32_t left = column->cells.last - column->cells.first + 1;
    if (static_cast<std::uint32_t>(left) > left_room) {
      // Whole runs only, and none after them.
      left = static_cast<std::int32_t>(left_room) / kRun * kRun;
      within = false;
      work_.cone_columns -= static_cast<std::uint32_t>(end - column - 1);
      end = column + 1;
    }
    left_room -= static_cast<std::uint32_t>(left);
    Voxel* run =
        row.voxels +
        static_cast<std::size_t>(column->e - row.first_e) * static_cast<std::size_t>(depth_cells) +
        column->cells.first;
    RunDither run_dither(row.dither + static_cast<std::uint32_t>(column->e) * kColumnDither +
                         static_cast<std::uint32_t>(column->cells.first) * kDitherStep);
    std::int32_t from_q12 = (column->cells.first * 1024 - cone.origin_q10) * 4;
    for (; left > 0; left -= kRun) {
      const std::int32_t count = min_of(kRun, left);
      add_misses(run, count, plain_strength_q7(cone, column->at, from_q12 + count * 2048),
                 run_dither);
      run += kRun;
      from_q12 += kRun * 4096;
      ++runs;
    }
    ++column;
  } while (column < end);
  work_.cone_runs += runs;
  room = left_room;
  return within;
}

// Of a plain cone: first the columns of a tile's row, then their voxels, so that each loop has the registers
// for itself.
template <ConeForm kForm>
bool Model::carve_plain_row(const CarveContext& context, const PlainCone& cone, std::int32_t n) {
  const Frustum& frustum = context.frustum;
  const std::int32_t dn = n * 1024 + 512 - frustum.origin_q10[0];
  CellRange row = frustum_row(frustum, dn, sensor_->scale.size[1]);
  work_.cone_candidates += static_cast<std::uint32_t>(max_of(0, row.last - row.first + 1));
  // 2^12 times along and across the heading, as column_offset() has them before their shift.
  const std::int32_t north_q30 = frustum.cone.heading_north_q20 * (1 << 10);
  const std::int32_t east_q30 = frustum.cone.heading_east_q20 * (1 << 10);
  const std::int64_t along_q42 = product(north_q30, dn * 4);
  const std::int64_t across_q42 = product(-east_q30, dn * 4);
  const std::int32_t half_q12 = 2048 - frustum.origin_q10[1] * 4;
  const auto inside = [&](std::int32_t e) {
    const std::int32_t de_q12 = e * 4096 + half_q12;
    return in_box(frustum, high_word_after(along_q42, east_q30, de_q12),
                  high_word_after(across_q42, north_q30, de_q12));
  };
  // The box is convex: what lies between two columns of it is in it.
  while (row.first <= row.last && !inside(row.first)) {
    ++row.first;
  }
  while (row.first < row.last && !inside(row.last)) {
    --row.last;
  }
  const std::int32_t depth_cells = sensor_->scale.size[2];
  // Within 32 bits all over the cone's box (carve()).
  auto limit_q16 = static_cast<std::int32_t>(context.limit_at(n, row.first));
  const std::int32_t limit_de_q16 = context.plane != nullptr ? context.plane->depth_de_q16 : 0;
  const std::uint32_t room_before = room_left();
  std::uint32_t room = room_before;
  PlacedColumn placed[kTileCells];
  std::int32_t e = row.first;
  bool within = true;
  while (e <= row.last && within) {
    const std::int32_t first_e = e;
    const std::int32_t end = min_of(e | (kTileCells - 1), row.last);
    PlacedColumn* place = placed;
    for (; e <= end; ++e) {
      const std::int32_t de_q12 = e * 4096 + half_q12;
      const std::int32_t x = high_word_after(along_q42, east_q30, de_q12);
      const std::int32_t y = high_word_after(across_q42, north_q30, de_q12);
      // Nothing nearer than the kernel's reach to the shell's plane, and nothing behind it.
      const CellRange cells =
          plain_cells<kForm>(cone, x, y, min_of(limit_q16 >> 16, depth_cells - 1));
      limit_q16 += limit_de_q16;
      if (cells.first <= cells.last) {
        *place = PlacedColumn{plain_column(cone, x, y), e, cells};
        ++place;
      }
    }
    if (place == placed) {
      continue;
    }
    const std::uint32_t first_column = grid_.column_index(n, first_e);
    grid_.touch(first_column >> 8U, ping_number_);
    // Dither follows the place in the grid, not in storage.
    const PlainRow at{grid_.column_voxels(first_column), first_e,
                      context.seed + static_cast<std::uint32_t>(n * kMaxSideCells) * kColumnDither};
    within = carve_plain_columns(cone, at, placed, place, room);
  }
  voxels_this_ping_ += room_before - room;
  return within;
}

// Whether the cone lies above the grid or below it, all of it: a head that looks about has many such beams, and each
// would ask every row and column that it passes.
bool Model::carves_nothing(const BeamFrame& frame, const Sighting& sighting,
                           std::int32_t range_q10) const {
  constexpr std::int32_t kMargin_q10 = 2 << 10;
  const auto radius_q10 = static_cast<std::int32_t>(
      kTouch_q10 + kMargin_q10 +
      max_of<std::int64_t>(mul_shift(sensor_->scale.cone_tan_q20, range_q10, 20), range_q10 >> 10));
  const auto reach_q10 = static_cast<std::int32_t>(mul_shift(frame.axis.q30[2], range_q10, 30));
  const std::int32_t origin_q10 = sighting.origin_q16[2] >> 6;
  return origin_q10 + max_of(reach_q10, 0) + radius_q10 < 0 ||
         origin_q10 + min_of(reach_q10, 0) - radius_q10 > sensor_->scale.size[2] * 1024;
}

void Model::carve(const BeamFrame& frame, const Sighting& sighting, const ShellEvent* shell,
                  std::int32_t range_q10, std::uint32_t end_q14) {
  if (range_q10 <= 0 || carves_nothing(frame, sighting, range_q10)) {
    return;
  }
  const bool plane = shell != nullptr && !shell->wall;
  const CarveContext context{
      frame,
      plane ? shell : nullptr,
      make_frustum(sensor_->scale, sensor_->table, frame, sighting, range_q10),
      make_emptiness(end_q14, shell != nullptr ? shell->growth_q24 : 0, range_q10),
      plane ? shell->plane0_q16 - kernel_reach_q16(shell->level) - 0x8000 : kNoLimit_q16,
      base::mix_u32(ping_number_ ^ 0x5BD1E995U)};
  const CellRange rows = frustum_rows(context.frustum, sensor_->scale.size[0]);
  const std::uint32_t before = voxels_this_ping_;
  work_.cone_rows = static_cast<std::uint32_t>(max_of(0, rows.last - rows.first + 1));
  // A step beyond the last column as well.
  const auto fits = [&context](std::int32_t n, std::int32_t e) {
    const std::int64_t limit_q16 = context.limit_at(n, e);
    return limit_q16 == static_cast<std::int32_t>(limit_q16);
  };
  const std::int32_t east = sensor_->scale.size[1];
  const bool plain = context.frustum.cone.radius_q10 > kFewColumns_q10 &&
                     is_plain(context.frustum, context.empty.inverse_range_q36) &&
                     config_.rule == Rule::kLogOdds && fits(rows.first, 0) &&
                     fits(rows.first, east) && fits(rows.last, 0) && fits(rows.last, east);
  const auto carve_rows = [this, &rows](const auto& carve_one) {
    for (std::int32_t n = rows.first; n <= rows.last; ++n) {
      if (!carve_one(n)) {
        ++counters_.cones_cut;
        return;
      }
    }
  };
  if (!plain) {
    carve_rows([&](std::int32_t n) { return carve_row(context, n); });
  } else {
    const PlainCone cone = make_plain_cone(
        context.frustum, sensor_->scale, sensor_->table, context.empty.end_q14,
        context.empty.growth_q24, static_cast<std::uint32_t>(context.empty.inverse_range_q36));
    carve_rows([&](std::int32_t n) {
      return cone.form == ConeForm::kUpright
                 ? carve_plain_row<ConeForm::kUpright>(context, cone, n)
                 : (cone.form == ConeForm::kSlanted
                        ? carve_plain_row<ConeForm::kSlanted>(context, cone, n)
                        : carve_plain_row<ConeForm::kAny>(context, cone, n));
    });
  }
  work_.cone_voxels = voxels_this_ping_ - before;
}

}  // namespace leadline::model
