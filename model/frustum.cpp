#include "model/frustum.hpp"

#include "model/base/fixed.hpp"

namespace leadline::model {
namespace {

using base::max_of;
using base::min_of;
using base::mul_shift;

// What is added to the outlines below, so that no column is left out that cone_span() would find something in by
// its rounding: an eighth of a cell.
constexpr std::int32_t kMargin_q10 = 132;
// What cutting columns off costs is more than it saves below so many cells^2 of them.
constexpr std::int32_t kWorthwhile_q20 = 40 << 20;

// A line seen from above that the cone stays on one side of: de k <= room + dn m; room > 0, |k| and |m| below 2^22.
Frustum::Edge edge_of(const Frustum& frustum, std::int32_t k_q20, std::int32_t m_q20,
                      std::int32_t room_q10) {
  constexpr std::int32_t kLeast_q20 = 1 << 10;
  const std::int32_t k = k_q20 < 0 ? -k_q20 : k_q20;
  const std::int32_t m = m_q20 < 0 ? -m_q20 : m_q20;
  if (k < kLeast_q20 || (m >> 10) >= k) {
    // |de| is less than the reach along the heading and the radius across it.
    return Frustum::Edge{
        Frustum::Edge::Side::kRow,
        room_q10 + static_cast<std::int32_t>(mul_shift(k, frustum.reach_q10, 19)) + 1, m_q20};
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
}

// The lines that the sides of the cone's outline follow: |y| <= (g x + kTouch c) / sqrt(A), with the margin and two
// units of the last place of s x, which is what a narrow beam looks along.
void set_sides(Frustum& frustum) {
  constexpr std::int64_t kLeastA_q30 = 1 << 22;
  const Cone& cone = frustum.cone;
  if (cone.a_q30 < kLeastA_q30 ||
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
  frustum.edges[0] = edge_of(frustum, hn - turned_e, he + turned_n, room_q10);
  frustum.edges[1] = edge_of(frustum, -hn - turned_e, turned_n - he, room_q10);
}

// The line that its far end does not pass: x <= c R + s r, where the box about it goes to c R + r.
void set_end(Frustum& frustum) {
  const Cone& cone = frustum.cone;
  const std::int32_t down_q30 = cone.down_q30 < 0 ? -cone.down_q30 : cone.down_q30;
  const auto rise_q10 = static_cast<std::int32_t>(mul_shift(down_q30, cone.radius_q10, 30));
  if (mul_shift(cone.radius_q10, cone.radius_q10 - rise_q10, 0) < kWorthwhile_q20) {
    return;
  }
  const std::int32_t end_q10 = frustum.reach_q10 - cone.radius_q10 + rise_q10 + kMargin_q10;
  frustum.edges[2] = edge_of(frustum, cone.heading_east_q20, -cone.heading_north_q20, end_q10);
}

// A cone that is almost upright lies within a circle about its far end, as wide as the end or as the transducer is
// far from it, whichever is more.
void set_disc(Frustum& frustum) {
  const Cone& cone = frustum.cone;
  const std::int32_t length_q10 = frustum.reach_q10 - cone.radius_q10;
  if (length_q10 > cone.radius_q10 ||
      mul_shift(cone.radius_q10, cone.radius_q10, 0) < kWorthwhile_q20) {
    return;
  }
  // Its halves are rounded by less than 2^-13 of themselves.
  const std::int32_t most_q10 = max_of(cone.radius_q10, length_q10 + kTouch_q10);
  frustum.disc_q10 = most_q10 + kMargin_q10 + (most_q10 >> 12);
}

}  // namespace

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
    out.band_slope_q20 =
        static_cast<std::int32_t>(base::quotient(out.cone.heading_east_q20 * (1LL << 20), hn));
    out.band_half_q10 = static_cast<std::int32_t>(min_of<std::int64_t>(
        base::quotient(out.cone.radius_q10 * (1LL << 20), hn < 0 ? -hn : hn), 16LL * kFar_q10));
  }
  if (out.cone.narrow) {
    set_sides(out);
    set_end(out);
    set_disc(out);
  }
  return out;
}

CellRange frustum_rows(const Frustum& frustum, std::int32_t cells) {
  const std::int32_t origin = frustum.origin_q10[0];
  const std::int32_t tip = frustum.tip_q10[0];
  const std::int32_t radius = frustum.cone.radius_q10;
  return cells_between(origin + min_of(tip, 0) - radius, origin + max_of(tip, 0) + radius, cells);
}

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
  if (frustum.disc_q10 != 0) {
    const std::int32_t off = dn - frustum.tip_q10[0];
    const std::int64_t rest_q20 =
        mul_shift(frustum.disc_q10, frustum.disc_q10, 0) - mul_shift(off, off, 0);
    if (rest_q20 < 0) {
      return CellRange{0, -1};
    }
    const auto half =
        static_cast<std::int32_t>(base::sqrt_u64(static_cast<std::uint64_t>(rest_q20)));
    low = max_of(low, tip - half);
    high = min_of(high, tip + half);
  }
  return cells_between(frustum.origin_q10[1] + low, frustum.origin_q10[1] + high, cells);
}

}  // namespace leadline::model
