// Model::integrate and what it consists of: sighting, slope feedback, shell, cone.
#include <type_traits>

#include "model/base/fixed.hpp"
#include "model/column_kernels.hpp"
#include "model/cone_column.hpp"
#include "model/model.hpp"

namespace leadline::model {
namespace {

using base::clamp;
using base::max_of;
using base::min_of;
using base::mul_shift;
using base::ratio;

// Strength of the empty evidence of one ping beside the peak that its shell would have had in the same
// voxel: 1/2. A voxel is a surface when it was hit more than half as often as it was looked through.
constexpr int kEmptyShift = 1;
// Of a ping that heard nothing: an eighth of the best ping's weight, all along.
constexpr std::uint32_t kNoReturn_q14 = (255 * 16) << 7U;
constexpr std::uint32_t kMostEmpty_q7 = kMaxWeight_q7 >> kEmptyShift;
// Separates the dither sequences of columns (odd, so that it is a permutation).
constexpr std::uint32_t kColumnDither = 0x85EBCA6BU;
// A column is looked at for voxels to rescale (kRescaleAbove) each time it has received this much
// evidence: less than what is left to the end of the range, so that no voxel gets there in between.
constexpr std::uint32_t kRescaleCheck = 30000;
// Depth of a plane that is not there: below every grid.
constexpr std::int64_t kNoLimit_q16 = std::int64_t{kMaxDepthCells} << 17;
// No column of any grid.
constexpr std::uint32_t kNoColumn = UINT32_MAX;
// Voxels of a column that share one weight of empty evidence.
constexpr std::int32_t kRun = 24;
// A column is read again for the slope once its evidence has doubled.
constexpr std::uint32_t kRegrowth = 2;
// The slope's columns stand this many lateral standard deviations apart.
constexpr std::int64_t kSlopeStride = 2;
// Prior of the slope: as if a flat bottom had been seen with this weight (1 / 0.5^2 per cell^2).
constexpr std::int64_t kSlopeRidge = 4;
// Evidence of one column counts for at most this much information (1/cells^2), Q4.
constexpr std::int64_t kSlopeWeightCap_q4 = 63;

// Confidence of "empty" at (i / 64) of the maximum range, Q15: logit(rho) / logit(0.02) with the
// source's rho = 0.5 sqrt(r / R_max) (method 1.2), for log-odds; and 1 - 2 rho for the weighted mean,
// whose evidence against is w (1 - rho).
constexpr std::uint16_t kEmptyLogit_q15[65] = {
    32767, 22800, 19647, 17754, 16384, 15301, 14402, 13630, 12952, 12346, 11796, 11293, 10829,
    10396, 9991,  9610,  9250,  8908,  8582,  8271,  7972,  7686,  7410,  7144,  6887,  6638,
    6397,  6163,  5935,  5713,  5497,  5287,  5081,  4880,  4683,  4490,  4301,  4116,  3934,
    3755,  3580,  3407,  3237,  3070,  2905,  2743,  2583,  2425,  2270,  2116,  1964,  1814,
    1666,  1519,  1374,  1231,  1089,  949,   809,   672,   535,   399,   265,   132,   0};
constexpr std::uint16_t kEmptyRho_q15[65] = {
    0,     2048,  2896,  3547,  4096,  4579,  5017,  5418,  5793,  6144,  6476,  6792,  7094,
    7384,  7663,  7932,  8192,  8444,  8689,  8927,  9159,  9385,  9606,  9822,  10033, 10240,
    10443, 10642, 10837, 11029, 11217, 11403, 11585, 11765, 11942, 12116, 12288, 12457, 12625,
    12790, 12953, 13114, 13273, 13430, 13585, 13738, 13890, 14040, 14189, 14336, 14482, 14626,
    14768, 14910, 15050, 15188, 15326, 15462, 15597, 15731, 15864, 15995, 16126, 16255, 16384};

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

// The cone of one ping with what its rows and columns have in common.
struct Frustum {
  Cone cone;
  std::int32_t origin_q10[3];  // transducer, from the grid's corner
  std::int32_t tip_q10[2];     // far end of the axis, from the transducer
  std::int32_t reach_q10;      // how far the cone extends along its heading
  bool two_axis;
  std::int32_t grow_along_q20;  // openings, two-axis tables only
  std::int32_t grow_across_q20;
  // Seen from above the cone is a band |y| <= radius: a row cuts it between (he dn +- radius) / hn.
  bool banded;
  std::int32_t band_slope_q20;  // below 2^24
  std::int32_t band_half_q10;   // limited to 2^30
  // And a fan between two lines that leave a point behind the transducer, of a long cone that holds no vertical;
  // in the row dn they lie at start + slope dn; of one that is almost a row, start + slope dn >= 0 says which
  // rows it leaves (kRow).
  struct Edge {
    enum class Side : std::uint8_t { kNone, kWest, kEast, kRow } side;
    std::int32_t start_q10;
    std::int32_t slope_q20;
  } edges[2];
};

// The lines that the cone's outline seen from above follows: |y| <= (g x + kTouch c) / sqrt(A), and a little
// more, so that no column is left out that cone_span() would find something in by its rounding: an eighth of a
// cell, and two units of the last place of s x, which is what a narrow beam looks along.
void set_edges(Frustum& frustum) {
  constexpr std::int64_t kLeastA_q30 = 1 << 22;
  constexpr std::int32_t kMargin_q10 = 132;
  // What they cost is more than they save below so many cells^2.
  constexpr std::int64_t kWorthwhile_q20 = std::int64_t{40} << 20;
  const Cone& cone = frustum.cone;
  if (!cone.narrow || cone.a_q30 < kLeastA_q30 ||
      mul_shift(cone.radius_q10, frustum.reach_q10, 0) < kWorthwhile_q20) {
    return;
  }
  const std::uint32_t root_q20 = base::sqrt_u64(static_cast<std::uint64_t>(cone.a_q30) << 10U);
  const auto tan_q20 = static_cast<std::int32_t>(
      base::quotient_u32(static_cast<std::uint64_t>(cone.growth_q20) << 20U, root_q20));
  const std::int32_t down_q20 = (cone.down_q30 < 0 ? -cone.down_q30 : cone.down_q30) >> 10;
  const auto room_q10 = static_cast<std::int32_t>(
      static_cast<std::uint32_t>(kMargin_q10 + 2 * down_q20 / tan_q20) +
      base::quotient_u32(static_cast<std::uint64_t>(cone.horizontal_q30 >> 10) * kTouch_q10,
                         root_q20));
  const std::int32_t hn = cone.heading_north_q20;
  const std::int32_t he = cone.heading_east_q20;
  const auto turned_n = static_cast<std::int32_t>(mul_shift(tan_q20, hn, 20));
  const auto turned_e = static_cast<std::int32_t>(mul_shift(tan_q20, he, 20));
  // +-y <= T x + room, as de k <= room + dn m.
  const std::int32_t reach_q10 = frustum.reach_q10;
  const auto edge = [room_q10, reach_q10](std::int32_t k_q20, std::int32_t m_q20) {
    constexpr std::int32_t kLeast_q20 = 1 << 10;
    const std::int32_t k = k_q20 < 0 ? -k_q20 : k_q20;
    const std::int32_t m = m_q20 < 0 ? -m_q20 : m_q20;
    if (k < kLeast_q20 || (m >> 10) >= k) {
      // |de| is less than the reach along the heading and the radius across it.
      return Frustum::Edge{Frustum::Edge::Side::kRow,
                           room_q10 + static_cast<std::int32_t>(mul_shift(k, reach_q10, 19)) + 1,
                           m_q20};
    }
    const auto over_k = [k](std::int32_t value) {
      return static_cast<std::int32_t>(base::quotient_u32(static_cast<std::uint64_t>(value) << 20U,
                                                          static_cast<std::uint32_t>(k)));
    };
    const bool east = k_q20 > 0;
    const std::int32_t start = over_k(room_q10) + 1;
    const std::int32_t slope = over_k(m);
    return Frustum::Edge{east ? Frustum::Edge::Side::kEast : Frustum::Edge::Side::kWest,
                         east ? start : -start, east == (m_q20 > 0) ? slope : -slope};
  };
  frustum.edges[0] = edge(hn - turned_e, he + turned_n);
  frustum.edges[1] = edge(-hn - turned_e, turned_n - he);
}

Frustum make_frustum(const Scale& scale, const LocalizationTable& table, const BeamFrame& frame,
                     const Sighting& sighting, std::int32_t range_q10) {
  Frustum out{};
  out.cone = make_cone(scale, frame.axis, range_q10);
  for (int axis = 0; axis < 3; ++axis) {
    out.origin_q10[axis] = sighting.origin_q16[axis] >> 6;
  }
  out.tip_q10[0] = static_cast<std::int32_t>(mul_shift(range_q10, frame.axis.q30[0], 30));
  out.tip_q10[1] = static_cast<std::int32_t>(mul_shift(range_q10, frame.axis.q30[1], 30));
  out.reach_q10 = static_cast<std::int32_t>(mul_shift(out.cone.horizontal_q30, range_q10, 30)) +
                  out.cone.radius_q10;
  out.two_axis = table.two_axis != 0;
  if (out.two_axis) {
    out.grow_along_q20 = cone_growth_q20(scale.tan_along_q20, range_q10);
    out.grow_across_q20 = cone_growth_q20(scale.tan_across_q20, range_q10);
  }
  const std::int32_t hn = out.cone.heading_north_q20;
  out.banded = hn > (1 << 16) || hn < -(1 << 16);
  if (out.banded) {
    out.band_slope_q20 = static_cast<std::int32_t>(out.cone.heading_east_q20 * (1LL << 20) / hn);
    out.band_half_q10 = static_cast<std::int32_t>(min_of<std::int64_t>(
        out.cone.radius_q10 * (1LL << 20) / (hn < 0 ? -hn : hn), 16LL * kFar_q10));
  }
  set_edges(out);
  return out;
}

// Rows that the cone may cross.
CellRange frustum_rows(const Frustum& frustum, std::int32_t cells) {
  const std::int32_t origin = frustum.origin_q10[0];
  const std::int32_t tip = frustum.tip_q10[0];
  const std::int32_t radius = frustum.cone.radius_q10;
  return cells_between(origin + min_of(tip, 0) - radius, origin + max_of(tip, 0) + radius, cells);
}

// Columns that it may cross in the row `dn` north of the transducer.
CellRange frustum_row(const Frustum& frustum, std::int32_t dn, std::int32_t cells) {
  const std::int32_t tip = frustum.tip_q10[1];
  const std::int32_t radius = frustum.cone.radius_q10;
  std::int32_t low = min_of(tip, 0) - radius;
  std::int32_t high = max_of(tip, 0) + radius;
  if (frustum.banded) {
    // Below 2^29 as the slope is below 16 and rows lie within the cone.
    const auto middle = static_cast<std::int32_t>(mul_shift(frustum.band_slope_q20, dn, 20));
    low = max_of(low, middle - frustum.band_half_q10);
    high = min_of(high, middle + frustum.band_half_q10);
  }
  for (const Frustum::Edge& edge : frustum.edges) {
    // Of a narrow cone: below 2^18 times 2^10.
    const std::int32_t at =
        edge.start_q10 + static_cast<std::int32_t>(mul_shift(edge.slope_q20, dn, 20));
    if (edge.side == Frustum::Edge::Side::kEast) {
      high = min_of(high, at);
    } else if (edge.side == Frustum::Edge::Side::kWest) {
      low = max_of(low, at);
    } else if (edge.side == Frustum::Edge::Side::kRow && at < 0) {
      return CellRange{0, -1};
    }
  }
  return cells_between(frustum.origin_q10[1] + low, frustum.origin_q10[1] + high, cells);
}

// Where a column stands from the transducer, Q10: north and east, and along the heading and across it.
struct ColumnOffset {
  std::int32_t dn;
  std::int32_t de;
  std::int32_t x;
  std::int32_t y;
};

ColumnOffset column_offset(const Frustum& frustum, std::int32_t dn, std::int32_t de) {
  const std::int64_t hn = frustum.cone.heading_north_q20;
  const std::int64_t he = frustum.cone.heading_east_q20;
  return ColumnOffset{dn, de, static_cast<std::int32_t>((hn * dn + he * de) >> 20),
                      static_cast<std::int32_t>((hn * de - he * dn) >> 20)};
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
template <bool kPlain>
inline CellRange frustum_column(const Frustum& frustum, const BeamFrame& frame,
                                const ColumnOffset& offset, std::int32_t cells) {
  const std::int32_t radius = frustum.cone.radius_q10;
  if (offset.y > radius || offset.y < -radius || offset.x < -radius ||
      offset.x > frustum.reach_q10) {
    return CellRange{0, -1};
  }
  if (kPlain) {
    return narrow_cells(frustum.cone, offset.x, offset.y, frustum.origin_q10[2], cells);
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
  return Emptiness{end_q14, growth_q24, (1ULL << 36U) / static_cast<std::uint32_t>(range_q10)};
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

std::uint32_t radius_second_difference_q12(std::int64_t xi_de_q16, std::int64_t eta_de_q16) {
  const std::int64_t twice_q32 = 2 * (xi_de_q16 * xi_de_q16 + eta_de_q16 * eta_de_q16);
  return static_cast<std::uint32_t>(((twice_q32 >> 8) * kEntriesPerUnit_q10 + (1 << 21)) >> 22);
}

RadiusRow radius_row(std::int64_t xi_q16, std::int64_t eta_q16, std::int64_t xi_de_q16,
                     std::int64_t eta_de_q16) {
  // Above zero by a few units, so that rounding never takes the centre below it.
  constexpr std::int64_t kMargin_q12 = 8;
  const std::int64_t square_q32 = xi_q16 * xi_q16 + eta_q16 * eta_q16;
  const std::int64_t change_q32 =
      xi_de_q16 * (2 * xi_q16 + xi_de_q16) + eta_de_q16 * (2 * eta_q16 + eta_de_q16);
  return RadiusRow{
      static_cast<std::uint32_t>((((square_q32 >> 8) * kEntriesPerUnit_q10) >> 22) + kMargin_q12),
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

// Entry of the tables over range / max_range.
std::uint32_t range_entry(const Scale& scale, std::int32_t range_q10) {
  const auto range = static_cast<std::uint64_t>(static_cast<std::uint32_t>(max_of(range_q10, 0)));
  return static_cast<std::uint32_t>(
      min_of<std::uint64_t>((range * scale.confidence_scale_q22) >> 22U, 64));
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
    const auto sigma_mm = static_cast<std::int64_t>(
        min_of<std::uint32_t>(pose.covariance.sigma_position_mm[axis], 1'000'000'000U));
    const std::int64_t sigma_q12 =
        min_of<std::int64_t>((sigma_mm * 1000 << 12) / sensor_->scale.cell_um, 1 << 20);
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

Slope Model::estimate_slope(const BeamFrame& frame, const Sighting& sighting) {
  const SlopePlace place = slope_place(frame, sighting);
  const std::int32_t centre_n = place.north;
  const std::int32_t centre_e = place.east;
  const std::int32_t stride = place.stride;

  // Weighted least squares of a plane through up to nine columns; depths relative to the first.
  std::int64_t s = 0;
  std::int64_t sn = 0;
  std::int64_t se = 0;
  std::int64_t sz = 0;
  std::int64_t snn = 0;
  std::int64_t sne = 0;
  std::int64_t see = 0;
  std::int64_t snz = 0;
  std::int64_t sez = 0;
  std::int32_t reference_q8 = kUnknownDepth;
  for (std::int32_t i = -1; i <= 1; ++i) {
    for (std::int32_t j = -1; j <= 1; ++j) {
      const std::int32_t n = centre_n + i * stride;
      const std::int32_t e = centre_e + j * stride;
      if (n < 0 || e < 0 || n >= sensor_->scale.size[0] || e >= sensor_->scale.size[1]) {
        continue;
      }
      const std::uint32_t index = grid_.column_index(n, e);
      ColumnRecord& record = grid_.column(index);
      if (record.gain > (kRegrowth - 1) * record.mass) {
        const ColumnDepth column = depth_of(index, DepthMethod::kRobustMoment);
        ++counters_.column_extractions;
        ++work_.columns_read;
        grid_.tile(index >> 8U).flags |= kTileSideChanged;
        record.depth_q8 = column.depth_q8;
        record.mass = column.mass;
        record.gain = 0;
        // mass / 255 events of variance min_variance: information in 1/cells^2, Q4.
        record.slope_weight_q4 = static_cast<std::uint8_t>(clamp<std::int64_t>(
            (static_cast<std::int64_t>(record.mass) << 8) / sensor_->scale.min_variance_q12, 1,
            kSlopeWeightCap_q4));
      }
      if (record.depth_q8 == kUnknownDepth) {
        continue;
      }
      reference_q8 = reference_q8 == kUnknownDepth ? record.depth_q8 : reference_q8;
      const std::int64_t weight = record.slope_weight_q4;
      const std::int64_t z = record.depth_q8 - reference_q8;
      s += weight;
      sn += weight * i;
      se += weight * j;
      sz += weight * z;
      snn += weight * i * i;
      sne += weight * i * j;
      see += weight * j * j;
      snz += weight * i * z;
      sez += weight * j * z;
    }
  }
  if (s == 0) {
    return Slope{0, 0};
  }
  // Centred moments times s; the ridge (Q4 information per cell^2) in units of stride^2.
  const std::int64_t stride2 = static_cast<std::int64_t>(stride) * stride;
  const std::int64_t ridge = max_of<std::int64_t>(1, s * kSlopeRidge * 16 / stride2);
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

// Gain of an event of `weight_q7`.
inline std::uint32_t pull_gain(std::uint32_t gain_q15, std::uint32_t weight_q7) {
  return static_cast<std::uint32_t>(static_cast<std::uint64_t>(gain_q15) * weight_q7 /
                                    kMaxWeight_q7);
}

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

// One row of a shell; the place in the grid is looked up once per tile.
template <bool kTwoAxis>
Model::RowTotals Model::add_shell_row(const ShellEvent& event, const ShellContext& context,
                                      std::int32_t n) {
  const ShellContext shell = context;
  RowTotals totals{0, 0, kNoColumn};
  const std::int32_t row = n - event.north0;
  std::int32_t xi = event.xi0_q16 + row * event.xi_dn_q16;
  std::int32_t eta = event.eta0_q16 + row * event.eta_dn_q16;
  std::int32_t depth = event.depth0_q16 + row * event.depth_dn_q16;
  const std::int32_t xi_step = event.xi_de_q16;
  const std::int32_t eta_step = event.eta_de_q16;
  const std::int32_t depth_step = event.depth_de_q16;
  RadiusRow radius{};
  std::uint32_t bend = 0;
  if (!kTwoAxis) {
    radius = radius_row(xi, eta, xi_step, eta_step);
    bend = radius_second_difference_q12(xi_step, eta_step);
  }
  // Dither follows the place in the grid, not in storage: the map must not depend on paging.
  std::uint32_t dither =
      shell.seed + static_cast<std::uint32_t>(n * kMaxSideCells + event.east0) * kColumnDither;
  const std::int32_t east1 = event.east1;
  std::int32_t e = event.east0;
  while (e <= east1) {
    const std::uint32_t base = grid_.column_index(n, e & ~(kTileCells - 1));
    const std::uint32_t first = base + static_cast<std::uint32_t>(e & (kTileCells - 1));
    Voxel* voxels = grid_.column_voxels(first);
    ColumnRecord* record = &grid_.column(first);
    const std::int32_t end = min_of(e | (kTileCells - 1), east1);
    const std::uint32_t columns_before = totals.columns;
    const TileId tile = grid_.tile_of(n, e);
    for (; e <= end; ++e, ++record) {
      Voxel* const column_voxels = voxels;
      const std::int32_t column_depth_q16 = depth;
      const std::uint32_t column_dither = dither;
      voxels += shell.depth_cells;
      depth += depth_step;
      dither += kColumnDither;
      std::uint32_t lateral_q15 = 0;
      if (kTwoAxis) {
        lateral_q15 = two_axis_weight_q15(shell.along, shell.across, xi, eta);
        xi += xi_step;
        eta += eta_step;
      } else {
        const std::uint32_t at_q12 = radius.value_q12;
        radius.value_q12 += radius.step_q12;
        radius.step_q12 += bend;
        lateral_q15 = at_q12 < kProfileEnd_q12 ? shell.along[at_q12 >> 12U] : 0U;
      }
      const std::uint32_t weight_q7 = (shell.weight_q7 * lateral_q15) >> 15U;
      if (weight_q7 == 0) {
        continue;
      }
      const std::int32_t count =
          add_shell_column(shell, column_voxels, column_depth_q16, weight_q7, column_dither);
      if (count == 0) {
        continue;
      }
      totals.voxels += static_cast<std::uint32_t>(count);
      ++totals.columns;
      note_evidence(*record, weight_q7, shell.now_ds, shell.blur_q8);
      if (record->unchecked > kRescaleCheck) {
        totals.rescale_candidate = base + static_cast<std::uint32_t>(e & (kTileCells - 1));
      }
    }
    if (totals.columns != columns_before) {
      grid_.touch(tile, ping_number_);
    }
  }
  return totals;
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
  const bool two_axis = sensor_->table.two_axis != 0;
  std::uint32_t rescale_candidate = kNoColumn;
  work_.shell_rows = static_cast<std::uint32_t>(event.north1 - event.north0 + 1);
  work_.shell_candidates =
      work_.shell_rows * static_cast<std::uint32_t>(event.east1 - event.east0 + 1);
  for (std::int32_t n = event.north0; n <= event.north1; ++n) {
    const RowTotals row =
        two_axis ? add_shell_row<true>(event, shell, n) : add_shell_row<false>(event, shell, n);
    voxels_this_ping_ += row.voxels;
    counters_.columns_updated += row.columns;
    work_.shell_columns += row.columns;
    rescale_candidate =
        row.rescale_candidate == kNoColumn ? rescale_candidate : row.rescale_candidate;
  }
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

// What the runs of a plain cone's columns need, at hand: a narrow cone of a round beam, log-odds. The same numbers
// as the general form below.
struct Model::PlainCone {
  std::int32_t horizontal_q30;
  std::int32_t down_q30;
  std::uint32_t growth_q20;
  std::int32_t origin_q10;  // depth of the transducer
  const std::uint16_t* pattern_q15;
  std::uint32_t confidence_scale_q22;
  // As in Emptiness; level: what is the same all along without growth.
  std::uint32_t end_q14;
  std::uint32_t level_q7;
  std::uint32_t growth_q24;
  std::uint32_t inverse_range_q36;  // of a range of 17 / 1024 cells at least
};

namespace {

// What each voxel gets of a run whose middle is z below the transducer.
template <typename Context>
inline std::uint32_t plain_strength_q7(const Context& cone, std::int64_t hx_q40,
                                       std::int64_t sx_q40, std::int64_t y2_q20, std::int32_t z) {
  const std::uint32_t slant = of_32_bits(static_cast<std::uint32_t>(max_of(
      0, static_cast<std::int32_t>((hx_q40 + mul_shift(of_32_bits(cone.down_q30), z, 0)) >> 30))));
  const auto off =
      static_cast<std::int32_t>((sx_q40 - mul_shift(of_32_bits(cone.horizontal_q30), z, 0)) >> 30);
  // Below 2^18, as is every length of a narrow cone.
  const std::uint32_t half_width =
      kTouch_q10 +
      static_cast<std::uint32_t>((std::uint64_t{slant} * of_32_bits(cone.growth_q20)) >> 20U);
  const auto off2_q20 = static_cast<std::uint64_t>(y2_q20 + mul_shift(off, off, 0));
  const std::uint32_t dividend =
      (off2_q20 >> 36U) != 0 ? UINT32_MAX : static_cast<std::uint32_t>(off2_q20 >> 4U);
  const auto divisor = static_cast<std::uint32_t>((std::uint64_t{half_width} * half_width) >> 10U);
  const std::uint32_t pattern_q15 =
      cone.pattern_q15[min_of<std::uint32_t>(dividend / divisor, kBeamWeightSteps)];
  // Parts of the range: a voxel of the cone lies a few cells beyond it at most, so that neither passes 32 bits.
  const std::uint32_t distance =
      min_of(static_cast<std::uint32_t>(
                 (std::uint64_t{slant} * of_32_bits(cone.confidence_scale_q22)) >> 22U),
             64U);
  std::uint32_t strength_q7 = cone.level_q7;
  if (cone.growth_q24 != 0) {
    const std::uint32_t share_q16 = min_of(
        static_cast<std::uint32_t>((std::uint64_t{slant} * cone.inverse_range_q36) >> 20U), 65536U);
    const std::uint64_t strength_q22 =
        std::uint64_t{cone.end_q14} * of_32_bits(peak_gain_inline_q8(cone.growth_q24, share_q16));
    // Of 21 and 20 bits: a quotient of 26.
    strength_q7 = min_of(static_cast<std::uint32_t>(strength_q22 >> 15U), kMostEmpty_q7);
  }
  return (((strength_q7 * pattern_q15) >> 15U) * kEmptyLogit_q15[distance]) >> 15U;
}

}  // namespace

// False: the work bound is met.
inline bool Model::carve_plain_column(const PlainCone& cone, const CarvedColumn& column,
                                      std::uint32_t& room) {
  std::int32_t left = column.cells.last - column.cells.first + 1;
  bool within = true;
  if (static_cast<std::uint32_t>(left) > room) {
    // Whole runs only.
    left = static_cast<std::int32_t>(room) / kRun * kRun;
    within = false;
  }
  room -= static_cast<std::uint32_t>(left);
  const std::int64_t hx_q40 = mul_shift(cone.horizontal_q30, column.offset.x, 0);
  const std::int64_t sx_q40 = mul_shift(cone.down_q30, column.offset.x, 0);
  const std::int64_t y2_q20 = mul_shift(column.offset.y, column.offset.y, 0);
  work_.cone_runs += static_cast<std::uint32_t>(left + kRun - 1) / static_cast<std::uint32_t>(kRun);
  Voxel* voxels = column.voxels + column.cells.first;
  std::uint32_t dither =
      column.dither + static_cast<std::uint32_t>(column.cells.first) * kDitherStep;
  std::int32_t from = column.cells.first * 1024 - cone.origin_q10;
  for (; left > 0; left -= kRun) {
    const std::int32_t count = min_of(kRun, left);
    // Off-axis position and distance of the run's middle.
    const Evidence evidence{0, plain_strength_q7(cone, hx_q40, sx_q40, y2_q20, from + count * 512)};
    add_uniform(voxels, count, 0, evidence, dither);
    voxels += kRun;
    from += kRun * 1024;
    dither = of_32_bits(dither + static_cast<std::uint32_t>(kRun) * kDitherStep);
  }
  return within;
}

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
template <bool kPlain>
bool Model::carve_row(const CarveContext& context, std::int32_t n) {
  const Frustum& frustum = context.frustum;
  const std::int32_t dn = n * 1024 + 512 - frustum.origin_q10[0];
  const CellRange row = frustum_row(frustum, dn, sensor_->scale.size[1]);
  if (row.first > row.last) {
    return true;
  }
  work_.cone_candidates += static_cast<std::uint32_t>(row.last - row.first + 1);
  const std::int32_t depth_cells = sensor_->scale.size[2];
  // Of a plain cone within 32 bits all over its box.
  using Limit = std::conditional_t<kPlain, std::int32_t, std::int64_t>;
  auto limit_q16 = static_cast<Limit>(context.limit_at(n, row.first));
  const std::int32_t limit_de_q16 = context.plane != nullptr ? context.plane->depth_de_q16 : 0;
  const auto row_place = static_cast<std::uint32_t>(n * kMaxSideCells);
  const PlainCone plain{frustum.cone.horizontal_q30,
                        frustum.cone.down_q30,
                        static_cast<std::uint32_t>(frustum.cone.growth_q20),
                        frustum.origin_q10[2],
                        sensor_->table.beam_weight_q15[0],
                        sensor_->scale.confidence_scale_q22,
                        context.empty.end_q14,
                        min_of(context.empty.end_q14 >> 7U, kMostEmpty_q7),
                        context.empty.growth_q24,
                        static_cast<std::uint32_t>(context.empty.inverse_range_q36)};
  const std::uint32_t room_before =
      bound_.total_voxels - min_of(voxels_this_ping_, bound_.total_voxels);
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
      const Limit limit = limit_q16 >> 16;
      limit_q16 += limit_de_q16;
      Voxel* const column_voxels = voxels;
      voxels += depth_cells;
      // Nothing nearer than the kernel's reach to the shell's plane, and nothing behind it.
      if (limit < 0) {
        continue;
      }
      const ColumnOffset offset = column_offset(frustum, dn, de);
      CellRange cells = frustum_column<kPlain>(frustum, context.frame, offset, depth_cells);
      if (limit < cells.last) {
        cells.last = static_cast<std::int32_t>(limit);
      }
      if (cells.first <= cells.last) {
        ++written;
        // Dither follows the place in the grid, not in storage.
        const std::uint32_t dither =
            context.seed + of_32_bits(row_place + static_cast<std::uint32_t>(e)) * kColumnDither;
        const CarvedColumn column{column_voxels, offset, cells, dither};
        within =
            kPlain ? carve_plain_column(plain, column, room) : carve_column(context, column, room);
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

void Model::carve(const BeamFrame& frame, const Sighting& sighting, const ShellEvent* shell,
                  std::int32_t range_q10, std::uint32_t end_q14) {
  if (range_q10 <= 0) {
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
  const bool plain = !context.frustum.two_axis && config_.rule == Rule::kLogOdds &&
                     context.frustum.cone.narrow && context.empty.inverse_range_q36 <= UINT32_MAX &&
                     fits(rows.first, 0) && fits(rows.first, east) && fits(rows.last, 0) &&
                     fits(rows.last, east);
  for (std::int32_t n = rows.first; n <= rows.last; ++n) {
    if (!(plain ? carve_row<true>(context, n) : carve_row<false>(context, n))) {
      ++counters_.cones_cut;
      break;
    }
  }
  work_.cone_voxels = voxels_this_ping_ - before;
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
  add_shell_event(event, static_cast<std::uint32_t>(ping.t_transmit_us / 100'000));
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
