#include "model/work_bound.hpp"

#include "model/base/fixed.hpp"

namespace leadline::model {
namespace {

using base::max_of;
using base::min_of;
using base::mul_shift;

constexpr std::int64_t kPi_q12 = 12868;
// Steepest plane that an event follows: 2.5 columns' depths per column (event.cpp).
constexpr std::int64_t kMaxSlopeTimes2 = 5;
// Widest reach, 7 cells, over the secant of that slope.
constexpr std::int64_t kPlaneLoss_q10 = 2662;

// The grid's sides, shortest first.
struct Sides {
  std::int64_t cells[3];
};

Sides sorted_sides(const Scale& scale) {
  Sides sides{{scale.size[0], scale.size[1], scale.size[2]}};
  const auto order = [&sides](int i, int j) {
    if (sides.cells[j] < sides.cells[i]) {
      const std::int64_t swapped = sides.cells[i];
      sides.cells[i] = sides.cells[j];
      sides.cells[j] = swapped;
    }
  };
  order(0, 1);
  order(1, 2);
  order(0, 1);
  return sides;
}

// Area of a circle of radius r within |y| <= half: 4u - 2/3 u^3 - 0.1917 u^5 of r^2, u = half / r; the
// series of 2 (asin u + u sqrt(1 - u^2)), its tail folded into the last term so that u = 1 gives pi.
// All Q10, r below 2^24: error below 0.7 %.
std::int64_t strip_of_circle_q10(std::int64_t r_q10, std::int64_t half_q10) {
  const std::int64_t u_q12 = min_of<std::int64_t>((half_q10 << 12) / r_q10, 4096);
  const std::int64_t u3_q12 = mul_shift(mul_shift(u_q12, u_q12, 12), u_q12, 12);
  const std::int64_t u5_q12 = mul_shift(mul_shift(u3_q12, u_q12, 12), u_q12, 12);
  const std::int64_t share_q12 = 4 * u_q12 - 2 * u3_q12 / 3 - mul_shift(u5_q12, 785, 12);
  return mul_shift(mul_shift(r_q10, r_q10, 10), share_q12, 12);
}

// Section of the cone through a hole of d1 x d2 cells, d1 <= d2, in cells Q10. a >= b are the half-widths
// of the beam's axes: a two-axis beam fills the rectangle inside the circle of its wider axis.
std::int64_t section_q10(std::int64_t a_q10, std::int64_t b_q10, std::int64_t d1, std::int64_t d2) {
  const std::int64_t rectangle = mul_shift(4 * a_q10, b_q10, 10);
  const std::int64_t radius2_q10 = mul_shift(a_q10, a_q10, 10);
  std::int64_t circle = (d1 * d2) << 10;
  if (4 * radius2_q10 < (d1 * d1 + d2 * d2) << 10) {
    // The hole's corners lie outside the circle: both strips, less what they share.
    circle = strip_of_circle_q10(a_q10, d1 << 9) + strip_of_circle_q10(a_q10, d2 << 9) -
             mul_shift(radius2_q10, kPi_q12, 12);
  }
  return min_of(rectangle, circle);
}

}  // namespace

std::uint32_t cone_volume(const Scale& scale, std::int32_t range_q10, std::int64_t longest_q10) {
  if (range_q10 <= 0) {
    return 0;
  }
  const Sides sides = sorted_sides(scale);
  const std::int64_t d1 = sides.cells[0];
  const std::int64_t d2 = sides.cells[1];
  const std::int64_t d3 = sides.cells[2];
  const std::int64_t range = range_q10;
  const std::int64_t grow_a_q20 =
      cone_growth_q20(max_of(scale.tan_along_q20, scale.tan_across_q20), range_q10);
  const std::int64_t grow_b_q20 =
      cone_growth_q20(min_of(scale.tan_along_q20, scale.tan_across_q20), range_q10);
  std::int64_t lying_q10 = 0;
  std::int64_t standing_q10 = 0;
  // Slices of one cell from the far end, each at its middle; the last one may be thinner.
  for (std::int64_t from_end = 0; from_end < range; from_end += 1024) {
    const std::int64_t thick = min_of<std::int64_t>(1024, range - from_end);
    const std::int64_t middle = range - from_end - thick / 2;
    const std::int64_t a = kTouch_q10 + mul_shift(grow_a_q20, middle, 20);
    const std::int64_t b = kTouch_q10 + mul_shift(grow_b_q20, middle, 20);
    if (from_end < longest_q10) {
      lying_q10 += mul_shift(section_q10(a, b, d1, d2), thick, 10);
    }
    if (from_end < d1 << 10) {
      standing_q10 += mul_shift(section_q10(a, b, d2, d3), thick, 10);
    }
  }
  return static_cast<std::uint32_t>(
      min_of((max_of(lying_q10, standing_q10) >> 10) + 1, d1 * d2 * d3));
}

WorkBound work_bound(const Scale& scale) {
  const std::int64_t north = scale.size[0];
  const std::int64_t east = scale.size[1];
  const std::int64_t depth = scale.size[2];
  const std::int64_t side = 2 * static_cast<std::int64_t>(scale.footprint_cells);
  const std::int64_t taps = min_of<std::int64_t>(kernel_reach_q16(kKernelLevels - 1) >> 15, depth);
  const std::int32_t range_q10 = scale.max_range_q16 >> 6;
  // Longest line inside the grid, or near it when `square` is doubled: the part of a cone beyond it,
  // nearest to the transducer, is outside.
  const auto length_q10 = [](std::int64_t square) {
    return static_cast<std::int64_t>(base::sqrt_u64(static_cast<std::uint64_t>(square) << 20U));
  };
  const std::int64_t diagonal_q10 = length_q10(north * north + east * east + depth * depth);
  WorkBound bound{};
  const auto consider = [&](std::int64_t columns, std::int64_t range, std::int64_t longest_q10) {
    const std::uint32_t cone = cone_volume(scale, static_cast<std::int32_t>(range), longest_q10);
    const std::int64_t total = min_of(columns * taps + cone, north * east * depth);
    if (total > bound.total_voxels) {
      bound.shell_voxels = static_cast<std::uint32_t>(columns * taps);
      bound.cone_voxels = cone;
      bound.total_voxels = static_cast<std::uint32_t>(total);
    }
  };
  // No shell: a ping without return.
  consider(0, range_q10, diagonal_q10);
  // A plane as steep as it gets, seen square on: the cone ends the reach of the widest kernel, as seen
  // along the axis, before it. The columns are those that the plane crosses inside the grid, the beam
  // looks up or down the slope.
  const std::int64_t crossed =
      min_of(side, (2 * (depth + taps) + kMaxSlopeTimes2 - 1) / kMaxSlopeTimes2);
  consider(min_of(crossed, north) * min_of(side, east), range_q10 - kPlaneLoss_q10,
           length_q10(2 * (north * north + depth * depth)));
  consider(min_of(side, north) * min_of(crossed, east), range_q10 - kPlaneLoss_q10,
           length_q10(2 * (east * east + depth * depth)));
  // A wall: h columns on either side of the end need a radial deviation of (h - 1/2) / 2.2 cells, and the
  // cone ends two of them, or of the least, sqrt(1/2), before.
  for (std::int64_t half = 1; half <= scale.footprint_cells; ++half) {
    const std::int64_t columns = max_of(min_of(2 * half, north) * min_of(side, east),
                                        min_of(side, north) * min_of(2 * half, east));
    consider(columns, range_q10 - max_of<std::int64_t>(1448, (2 * half - 1) * 465), diagonal_q10);
  }
  bound.behind_voxels = static_cast<std::uint32_t>(min_of(side, north) * min_of(side, east) * taps);
  return bound;
}

}  // namespace leadline::model
