// Rows and columns that the integrator looks at, against a plain reference: every column of a grid, one by one.
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "model/frustum.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::model;  // NOLINT: a test of this namespace
using leadline::test::Random;

constexpr double kPi = 3.14159265358979323846;

std::int32_t q10(double cells) { return static_cast<std::int32_t>(std::lround(cells * 1024.0)); }

/// A cone anywhere near a grid; a table of one axis, and nothing else of it counts.
struct Case {
  Frustum frustum;
  double elevation;
  double tangent;
};

Case make_case(Random& random, double tangent, double elevation, double heading, double range) {
  static LocalizationTable table{};
  Scale scale{};
  scale.cone_tan_q20 = static_cast<std::int32_t>(std::lround(tangent * 0x1.0p20));
  BeamFrame frame{};
  frame.axis = {
      {static_cast<std::int32_t>(std::lround(std::cos(elevation) * std::cos(heading) * 0x1.0p30)),
       static_cast<std::int32_t>(std::lround(std::cos(elevation) * std::sin(heading) * 0x1.0p30)),
       static_cast<std::int32_t>(std::lround(std::sin(elevation) * 0x1.0p30))}};
  Sighting sighting{};
  // Some part of the axis in the middle of the grid.
  const double part = random.uniform();
  for (int axis = 0; axis < 3; ++axis) {
    sighting.origin_q16[axis] = static_cast<std::int32_t>(
        std::lround((38.0 + 20.0 * random.uniform()) * 65536.0 -
                    part * range * 0x1.0p-14 * static_cast<double>(frame.axis.q30[axis])));
  }
  return Case{make_frustum(scale, table, frame, sighting, q10(range)), elevation, tangent};
}

/// Whether the cone holds anything of the column, as deep as no grid is.
bool holds(const Frustum& frustum, const ColumnOffset& offset) {
  if (!in_box(frustum, offset.x, offset.y)) {
    return false;
  }
  const ColumnSpan span = cone_span(frustum.cone, offset.x, offset.y);
  constexpr std::int32_t kDeep = 4096;
  const CellRange cells =
      cells_between(span.top_q10 + frustum.origin_q10[2] + kDeep / 2 * 1024,
                    span.bottom_q10 + frustum.origin_q10[2] + kDeep / 2 * 1024, kDeep);
  return cells.first <= cells.last;
}

struct Count {
  std::int64_t looked_at;
  std::int64_t held;
};

/// As wide as the band and the box without lines and circle, which round a unit this way or that.
bool at_the_rim(const Frustum& frustum, const ColumnOffset& offset) {
  constexpr std::int32_t kRim_q10 = 4;
  const std::int32_t inner_q10 = frustum.cone.radius_q10 - kRim_q10;
  const auto beyond = [inner_q10](std::int32_t off_q10, std::int32_t tip_q10) {
    return off_q10 < std::min(tip_q10, 0) - inner_q10 || off_q10 > std::max(tip_q10, 0) + inner_q10;
  };
  return std::abs(offset.y) > inner_q10 || beyond(offset.dn, frustum.tip_q10[0]) ||
         beyond(offset.de, frustum.tip_q10[1]);
}

/// Compares all columns of a grid; fails where one that is held is left out: by the lines and the circle none, by
/// the box and the band none but at their rim.
Count compare(const Case& c) {
  constexpr std::int32_t kCells = 96;
  const Frustum& frustum = c.frustum;
  Frustum bare = frustum;
  for (Frustum::Edge& edge : bare.edges) {
    edge.side = Frustum::Edge::Side::kNone;
  }
  bare.disc_q10 = 0;
  const CellRange rows = frustum_rows(frustum, kCells);
  Count count{0, 0};
  for (std::int32_t n = 0; n < kCells; ++n) {
    const std::int32_t dn = n * 1024 + 512 - frustum.origin_q10[0];
    const bool looked = n >= rows.first && n <= rows.last;
    const CellRange row = looked ? frustum_row(frustum, dn, kCells) : CellRange{0, -1};
    const CellRange wider = looked ? frustum_row(bare, dn, kCells) : CellRange{0, -1};
    count.looked_at += std::max(0, row.last - row.first + 1);
    for (std::int32_t e = 0; e < kCells; ++e) {
      const ColumnOffset offset =
          column_offset(frustum, dn, e * 1024 + 512 - frustum.origin_q10[1]);
      if (!holds(frustum, offset)) {
        continue;
      }
      ++count.held;
      const bool banded = e >= wider.first && e <= wider.last;
      if (banded ? e < row.first || e > row.last : !at_the_rim(frustum, offset)) {
        fail_msg(
            "tan %.17g, elevation %.17g, range %d: column (%d, %d) of the cone is not among %d .. "
            "%d",
            c.tangent, c.elevation, frustum.cone.range_q10, n, e, row.first, row.last);
      }
    }
  }
  return count;
}

TEST(no_column_of_a_cone_is_left_out) {
  Random random(31);
  Count all{0, 0};
  int edges[4] = {};
  int discs = 0;
  for (int trial = 0; trial < 3'000; ++trial) {
    const double tangent = std::exp(std::log(0.001) + std::log(2000.0) * random.uniform());
    // Level, upright, at the border where a cone just holds the vertical, and anything.
    double elevation = (random.uniform() - 0.3) * kPi;
    elevation = trial % 8 == 0 ? 0.002 * random.normal() : elevation;
    elevation = trial % 8 == 1 ? kPi / 2 + 0.02 * random.normal() : elevation;
    elevation = trial % 8 == 2 ? kPi / 2 - std::atan(tangent) + 0.02 * random.normal() : elevation;
    // Along the grid's axes too, where a line of the outline is almost a row.
    double heading = 2.0 * kPi * random.uniform();
    heading = trial % 3 == 0
                  ? kPi / 2 * static_cast<double>(random.between(0, 3)) + 1e-3 * random.normal()
                  : heading;
    const double range = 0.5 + 250.0 * random.uniform() * random.uniform();
    const Case c = make_case(random, tangent, elevation, heading, range);
    const Count count = compare(c);
    all.looked_at += count.looked_at;
    all.held += count.held;
    for (const Frustum::Edge& edge : c.frustum.edges) {
      ++edges[static_cast<int>(edge.side)];
    }
    discs += c.frustum.disc_q10 != 0 ? 1 : 0;
  }
  print_message("%lld columns looked at, %lld held; lines west %d, east %d, rows %d; circles %d\n",
                static_cast<long long>(all.looked_at), static_cast<long long>(all.held), edges[1],
                edges[2], edges[3], discs);
  // All the ways of leaving columns out took part, and what is left is not much more than what is held.
  assert_true(edges[1] > 300 && edges[2] > 300 && edges[3] > 15 && discs > 100);
  assert_true(all.held > 500'000);
  assert_true(all.looked_at * 100 < all.held * 130);
}

TEST(few_columns_beside_the_cone_are_looked_at) {
  Random random(32);
  struct Kind {
    double half_angle_deg;
    double elevation_deg;
    double most;
  };
  // What they were before there were lines and circles: 1.27 upright, 2.1 level.
  for (const Kind& kind : {Kind{12.5, 90, 1.12}, Kind{12.5, 80, 1.12}, Kind{12.5, 45, 1.12},
                           Kind{12.5, 0, 1.12}, Kind{3, 30, 1.25}}) {
    Count all{0, 0};
    for (int i = 0; i < 40; ++i) {
      const Case c = make_case(random, std::tan(kind.half_angle_deg * kPi / 180),
                               kind.elevation_deg * kPi / 180, 2 * kPi * random.uniform(), 60);
      const Count count = compare(c);
      all.looked_at += count.looked_at;
      all.held += count.held;
    }
    const double share = static_cast<double>(all.looked_at) / static_cast<double>(all.held);
    print_message("%g degrees wide, %g down: %.3f looked at of each held\n",
                  2 * kind.half_angle_deg, kind.elevation_deg, share);
    assert_true(share < kind.most);
  }
}

}  // namespace
