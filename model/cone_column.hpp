// What the cone of empty evidence asks of every column, inline for the loop over them: where it enters and
// leaves (cone_span of event.hpp), and how much a nearer shell would have weighed (peak_gain_q8).
#pragma once

#include <cstdint>

#include "model/base/fixed.hpp"
#include "model/base/root.hpp"
#include "model/capacity.hpp"
#include "model/event.hpp"

namespace leadline::model {

/// `value`, of which the compiler knows no more than its 32 bits: on a 32-bit machine it would otherwise widen the
/// operands of a product to 64 bits outside of the loop, and multiply those by four instructions instead of one.
[[nodiscard]] inline std::int32_t of_32_bits(std::int32_t value) {
#if defined(__arm__)
  asm("" : "+r"(value));
#endif
  return value;
}
[[nodiscard]] inline std::uint32_t of_32_bits(std::uint32_t value) {
#if defined(__arm__)
  asm("" : "+r"(value));
#endif
  return value;
}

/// `depth` limited to +-kFar: depths beyond any grid are as good as infinite.
[[nodiscard]] inline std::int32_t limited_q10(std::int64_t depth_q10) {
  return static_cast<std::int32_t>(
      base::clamp<std::int64_t>(depth_q10, -std::int64_t{kFar_q10}, std::int64_t{kFar_q10}));
}

// C / q, limited likewise.
inline std::int32_t limited_ratio_q10(std::int64_t c_q20, std::int32_t q_q20) {
  const bool negative = (c_q20 < 0) != (q_q20 < 0);
  const auto c = static_cast<std::uint64_t>(c_q20 < 0 ? -c_q20 : c_q20) << 10U;
  const auto q = static_cast<std::uint32_t>(q_q20 < 0 ? -q_q20 : q_q20);
  // 2^26 at least: as good as infinite, and what is less has a quotient of 32 bits.
  const std::int32_t size =
      (c >> 26U) >= q ? kFar_q10 : static_cast<std::int32_t>(base::quotient_u32(c, q));
  return negative ? -size : size;
}

/// A column of a narrow cone (Cone::narrow): what its ends follow from. Lengths are below 2^18, |B| below 2^29, q
/// below 2^30, 1/A and 1/s below 2^26 and 2^24, so that no depth needs a limit but that of a division: all are
/// below 2^30.
struct NarrowColumn {
  std::int32_t p_q10;
  std::int64_t c_q20;
  std::int32_t q_q20;
  bool met;  ///< false: nothing of it is in the cone
};

[[nodiscard]] inline NarrowColumn narrow_column(const Cone& cone, std::int32_t x_q10,
                                                std::int32_t y_q10) {
  using base::mul_shift;
  const auto short_of = [](std::int64_t value) { return static_cast<std::int32_t>(value); };
  const std::int32_t p_q20 = short_of(mul_shift(cone.horizontal_q30, x_q10, 20));
  const std::int32_t gp_q20 = short_of(mul_shift(cone.growth_q20, p_q20, 20));
  const std::int32_t sum_q20 =
      p_q20 + short_of(mul_shift(cone.growth_q20, gp_q20, 20)) + cone.touch_growth_q20;
  const std::int32_t b_q20 = short_of(mul_shift(cone.down_q30 >> 6, sum_q20, 24));
  const std::int32_t sx_q10 = short_of(mul_shift(cone.down_q30, x_q10, 30));
  const std::int32_t radius_q10 = kTouch_q10 + (gp_q20 >> 10);
  NarrowColumn out{};
  out.p_q10 = p_q20 >> 10;
  out.c_q20 = mul_shift(sx_q10, sx_q10, 0) + mul_shift(y_q10, y_q10, 0) -
              mul_shift(radius_q10, radius_q10, 0);
  std::int64_t disc_q40 = mul_shift(b_q20, b_q20, 0) - mul_shift(cone.a_q24, out.c_q20, 4);
  if (disc_q40 < 0) {
    if (cone.a_q24 >= 0) {
      return out;
    }
    // A vertical inside the opening always meets the cone: see wide_cone_span().
    disc_q40 = 0;
  }
  const auto root_q20 =
      static_cast<std::int32_t>(base::sqrt_u64_inline(static_cast<std::uint64_t>(disc_q40)));
  out.q_q20 = b_q20 >= 0 ? b_q20 + root_q20 : b_q20 - root_q20;
  out.met = cone.inverse_down_q12 != 0 || (out.p_q10 >= 0 && out.p_q10 <= cone.range_q10);
  return out;
}

/// The part of a vertical that lies between the planes of the cone's two ends.
[[nodiscard]] inline ColumnSpan narrow_ends(const Cone& cone, std::int32_t p_q10) {
  using base::mul_shift;
  if (cone.inverse_down_q12 == 0) {
    return ColumnSpan{-kFar_q10, kFar_q10};
  }
  const auto at_start = static_cast<std::int32_t>(mul_shift(-p_q10, cone.inverse_down_q12, 12));
  const auto at_end =
      static_cast<std::int32_t>(mul_shift(cone.range_q10 - p_q10, cone.inverse_down_q12, 12));
  return cone.down_q30 > 0 ? ColumnSpan{at_start, at_end} : ColumnSpan{at_end, at_start};
}

/// q / A.
[[nodiscard]] inline std::int32_t narrow_far_root_q10(const Cone& cone, std::int32_t q_q20) {
  using base::mul_shift;
  if (cone.inverse_a_q16 != 0) {
    return static_cast<std::int32_t>(mul_shift(q_q20 >> 6, cone.inverse_a_q16, 20));
  }
  // Close to the vertical A is small and worth a division.
  if (cone.a_q30 <= -16 || cone.a_q30 >= 16) {
    return limited_q10(base::quotient(mul_shift(q_q20, 1 << 20, 0), cone.a_q30));
  }
  return (q_q20 >= 0) != (cone.a_q24 < 0) ? kFar_q10 : -kFar_q10;
}

/// cone_span() of a narrow cone.
[[nodiscard]] inline ColumnSpan narrow_span(const Cone& cone, const NarrowColumn& column) {
  using base::max_of;
  using base::min_of;
  if (!column.met) {
    return ColumnSpan{1, 0};
  }
  const ColumnSpan ends = narrow_ends(cone, column.p_q10);
  const std::int32_t one_q10 =
      column.q_q20 == 0 ? 0 : limited_ratio_q10(column.c_q20, column.q_q20);
  const std::int32_t other_q10 = narrow_far_root_q10(cone, column.q_q20);
  const std::int32_t low = min_of(one_q10, other_q10);
  const std::int32_t high = max_of(one_q10, other_q10);
  if (cone.a_q24 >= 0) {
    return ColumnSpan{max_of(low, ends.top_q10), min_of(high, ends.bottom_q10)};
  }
  // The vertical runs inside the opening: forward of the farther root only.
  return cone.down_q30 > 0 ? ColumnSpan{max_of(high, ends.top_q10), ends.bottom_q10}
                           : ColumnSpan{ends.top_q10, min_of(low, ends.bottom_q10)};
}

/// Voxels first .. last of a column, none when last < first.
struct CellRange {
  std::int32_t first;
  std::int32_t last;
};

/// Cells of [0, cells) whose centres lie between two offsets from the grid's corner.
[[nodiscard]] inline CellRange cells_between(std::int32_t low_q10, std::int32_t high_q10,
                                             std::int32_t cells) {
  return CellRange{base::max_of(0, (low_q10 + 511) >> 10),
                   base::min_of(cells - 1, (high_q10 - 512) >> 10)};
}

/// First cell whose centre lies below c / q of the transducer, which is origin_q10 below the grid's top: at
/// least 0, kMaxDepthCells if it is that or more. c >= 0, 0 < q < 2^30. With m = origin + 511 it is
/// floor((floor(2^10 c / q) + m) / 2^10) = floor((c + floor(m q / 2^10)) / q): ten bits, of one division of the
/// leading bits, which is wrong by one at most.
[[nodiscard]] inline std::int32_t first_cell_below(std::int64_t c_q20, std::int32_t q_q20,
                                                   std::int32_t origin_q10) {
  const std::int64_t numerator = c_q20 + base::mul_shift(origin_q10 + 511, q_q20, 10);
  if (numerator < 0) {
    return 0;
  }
  const auto n = static_cast<std::uint64_t>(numerator);
  const auto q = static_cast<std::uint32_t>(q_q20);
  if ((n >> 10U) >= q) {
    return kMaxDepthCells;
  }
  // 22 bits of q at most: the numerator then has 32.
  const auto shift = static_cast<unsigned>(base::max_of(10 - base::leading_zeros(q), 0));
  const std::uint32_t cell = static_cast<std::uint32_t>(n >> shift) / (q >> shift);
  // Between -q and 2 q, below 2^31: the low word says it all.
  const auto rest = static_cast<std::int32_t>(static_cast<std::uint32_t>(n) - cell * q);
  const std::int32_t correction = rest < 0 ? -1 : (rest >= q_q20 ? 1 : 0);
  return static_cast<std::int32_t>(cell) + correction;
}

/// cells_between() of narrow_span(), mostly without its divisions.
[[nodiscard]] inline CellRange narrow_cells(const Cone& cone, std::int32_t x_q10,
                                            std::int32_t y_q10, std::int32_t origin_q10,
                                            std::int32_t cells) {
  using base::max_of;
  const NarrowColumn column = narrow_column(cone, x_q10, y_q10);
  if (!column.met) {
    return CellRange{0, -1};
  }
  if (column.c_q20 >= 0 && cone.down_q30 > 0) {
    const ColumnSpan ends = narrow_ends(cone, column.p_q10);
    if (cone.a_q24 < 0) {
      // C / q and q / A have different signs.
      if (column.q_q20 > 0) {
        CellRange out =
            cells_between(ends.top_q10 + origin_q10, ends.bottom_q10 + origin_q10, cells);
        out.first = max_of(out.first, first_cell_below(column.c_q20, column.q_q20, origin_q10));
        return out;
      }
      if (column.q_q20 < 0) {
        const std::int32_t top_q10 = max_of(narrow_far_root_q10(cone, column.q_q20), ends.top_q10);
        return cells_between(top_q10 + origin_q10, ends.bottom_q10 + origin_q10, cells);
      }
    } else if (column.q_q20 > 0) {
      // C / q is the nearer root, unless both are one and rounding parts them.
      const std::int32_t nearer = first_cell_below(column.c_q20, column.q_q20, origin_q10);
      const std::int32_t far_q10 = narrow_far_root_q10(cone, column.q_q20);
      if (nearer < (far_q10 + origin_q10 + 511) >> 10) {
        CellRange out = cells_between(ends.top_q10 + origin_q10,
                                      base::min_of(far_q10, ends.bottom_q10) + origin_q10, cells);
        out.first = max_of(out.first, nearer);
        return out;
      }
    }
  }
  const ColumnSpan span = narrow_span(cone, column);
  return cells_between(span.top_q10 + origin_q10, span.bottom_q10 + origin_q10, cells);
}

/// cone_span() of any cone; what is not narrow is rare.
[[nodiscard]] ColumnSpan wide_cone_span(const Cone& cone, std::int32_t x_q10, std::int32_t y_q10);
[[nodiscard]] inline ColumnSpan cone_span_inline(const Cone& cone, std::int32_t x_q10,
                                                 std::int32_t y_q10) {
  return cone.narrow ? narrow_span(cone, narrow_column(cone, x_q10, y_q10))
                     : wide_cone_span(cone, x_q10, y_q10);
}

/// peak_gain_q8() of v, the part of the variance: v^-1.5.
[[nodiscard]] inline std::uint32_t peak_gain_of_variance_q8(std::uint32_t v_q24) {
  // m^-1.5 at m = 1 + i / 32, Q15, and what it falls by from there to the next.
  static constexpr std::uint16_t kPower_q15[33] = {
      32768, 31290, 29920, 28647, 27461, 26356, 25322, 24354, 23447, 22594, 21792,
      21036, 20323, 19650, 19012, 18409, 17837, 17293, 16777, 16286, 15819, 15373,
      14948, 14542, 14154, 13784, 13429, 13089, 12763, 12450, 12150, 11862, 11585};
  constexpr std::uint32_t kRootTwo_q15 = 46341;
  constexpr std::uint32_t kMostHalvings = 8;  // 2^(1.5 * 8) = 4096
  // v = m 2^-halvings with 1 <= m < 2; of zero, more than enough of them.
  const auto halvings = static_cast<std::uint32_t>(base::leading_zeros(v_q24)) - 7U;
  if (halvings > kMostHalvings) {
    return 4096U << 8U;
  }
  const std::uint32_t over_q24 = (v_q24 << halvings) - (1U << 24U);
  const std::uint32_t index = over_q24 >> 19U;
  const std::uint32_t fraction_q19 = over_q24 & ((1U << 19U) - 1U);
  const std::uint32_t step = kPower_q15[index] - kPower_q15[index + 1];
  const std::uint32_t power_q15 = kPower_q15[index] - ((step * fraction_q19) >> 19U);
  const std::uint32_t odd_q15 =
      (halvings & 1U) != 0 ? (power_q15 * kRootTwo_q15) >> 15U : power_q15;
  return (odd_q15 << ((3U * halvings) >> 1U)) >> 7U;
}

/// peak_gain_q8().
[[nodiscard]] inline std::uint32_t peak_gain_inline_q8(std::uint32_t growth_q24,
                                                       std::uint32_t share_q16) {
  const std::uint64_t share = base::min_of<std::uint32_t>(share_q16, 65536);
  const auto square_q24 = static_cast<std::uint32_t>((share * share) >> 8U);
  const auto kept_q24 = static_cast<std::uint32_t>(
      (static_cast<std::uint64_t>(growth_q24) * ((1U << 24U) - square_q24)) >> 24U);
  return peak_gain_of_variance_q8((1U << 24U) - kept_q24);
}

}  // namespace leadline::model
