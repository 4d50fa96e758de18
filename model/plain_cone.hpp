// The cone that most pings carve: narrow (Cone::narrow), of a round beam, merged as log-odds. Its columns and runs by
// the fewest instructions of a 32-bit machine: the same bits as cone_column.hpp and carve.cpp have for every cone.
//
// Where there a product is shifted by n, here its factors are made larger by 32 - n bits beforehand, and what counts
// is its high word: one instruction in place of three. Lengths of a narrow cone are below 2^18, with 1 + g^2 below
// 2^18 as well, which every factor's room follows from; the rest is said where it is needed.
#pragma once

#include <cstdint>

#include "model/base/fixed.hpp"
#include "model/base/root.hpp"
#include "model/cone_column.hpp"
#include "model/evidence.hpp"
#include "model/frustum.hpp"
#include "model/localization_table.hpp"

namespace leadline::model {

/// a b, sum + a b, and floor(a b / 2^32): an instruction each, where the compiler would not always see it.
[[nodiscard]] inline std::int64_t product(std::int32_t a, std::int32_t b) {
#if defined(__ARM_FEATURE_SIMD32)
  std::int64_t out = 0;
  asm("smull %Q0, %R0, %1, %2" : "=&r"(out) : "r"(a), "r"(b));
  return out;
#else
  return std::int64_t{a} * b;
#endif
}
[[nodiscard]] inline std::int64_t sum_with_product(std::int64_t sum, std::int32_t a,
                                                   std::int32_t b) {
#if defined(__ARM_FEATURE_SIMD32)
  asm("smlal %Q0, %R0, %1, %2" : "+r"(sum) : "r"(a), "r"(b));
  return sum;
#else
  return sum + std::int64_t{a} * b;
#endif
}
[[nodiscard]] inline std::int32_t high_word(std::int32_t a, std::int32_t b) {
#if defined(__ARM_FEATURE_SIMD32)
  std::int32_t out = 0;
  asm("smmul %0, %1, %2" : "=r"(out) : "r"(a), "r"(b));
  return out;
#else
  return static_cast<std::int32_t>((std::int64_t{a} * b) >> 32);
#endif
}
[[nodiscard]] inline std::uint32_t high_word(std::uint32_t a, std::uint32_t b) {
  return static_cast<std::uint32_t>((std::uint64_t{of_32_bits(a)} * of_32_bits(b)) >> 32U);
}
/// floor((sum + a b) / 2^32).
[[nodiscard]] inline std::int32_t high_word_after(std::int64_t sum, std::int32_t a,
                                                  std::int32_t b) {
  return static_cast<std::int32_t>(sum_with_product(sum, a, b) >> 32);
}

/// Which way the columns of a plain cone go.
enum class ConeForm : std::uint8_t {
  kAny,      ///< narrow_cells()
  kUpright,  ///< looks down and holds the vertical
  kSlanted,  ///< looks down and does not
};

/// What the columns and runs of such a cone have in common.
struct PlainCone {
  const Frustum* frustum;
  std::int32_t horizontal_q30;
  std::int32_t down_q30;
  std::int32_t origin_q10;  // depth of the transducer
  // Columns.
  ConeForm form;
  std::int32_t growth_q29;
  std::int32_t touch_growth_q20;
  std::int32_t even_down_q30;  // its last six bits zero
  std::int32_t minus_a_q24;
  std::int32_t inverse_a_q16;
  std::int32_t inverse_down_q12;
  std::int32_t range_q10;
  // Runs.
  std::int32_t minus_horizontal_q30;
  std::uint32_t growth_q20;
  std::uint32_t confidence_scale_q22;
  std::uint32_t inverse_range_q36;  // of a range of 17 / 1024 cells at least
  const std::uint16_t* pattern_q15;
  std::uint32_t end_q14;              // evidence at the far end
  std::uint32_t variance_growth_q28;  // ShellEvent::growth_q24
};

/// Whether a cone is plain, but for the rule.
[[nodiscard]] inline bool is_plain(const Frustum& frustum, std::uint64_t inverse_range_q36) {
  return !frustum.two_axis && frustum.cone.narrow && inverse_range_q36 <= UINT32_MAX;
}

[[nodiscard]] PlainCone make_plain_cone(const Frustum& frustum, const Scale& scale,
                                        const LocalizationTable& table, std::uint32_t end_q14,
                                        std::uint32_t variance_growth_q24,
                                        std::uint32_t inverse_range_q36);

/// As base::sqrt_u64(t / 16) of 2^36 <= t < 2^62, by its words.
[[nodiscard]] inline std::uint32_t root_of_16th(std::uint32_t high, std::uint32_t low) {
  const auto shift = static_cast<unsigned>((33 - __builtin_clz(high)) & ~1);  // 6 .. 30
  const std::uint32_t x = (high << (32U - shift)) | (low >> shift);
  return base::root_step(x, base::kRootTable[x >> 24U]) << (shift / 2U - 2U);
}

/// floor((c + floor(m q / 2^10)) / q), as first_cell_below() has it but for its limits: negative below 0, and
/// kMaxDepthCells if it is that or more. 0 <= c < 2^38, 0 < q < 2^30.
[[nodiscard]] inline std::int32_t cell_of_root(std::int64_t c_q20, std::int32_t q_q20,
                                               std::int32_t m_q10) {
  const std::int64_t n = c_q20 + (product(m_q10, q_q20) >> 10);
  if (n < 0) {
    return -1;
  }
  const std::uint64_t leading = static_cast<std::uint64_t>(n) >> 10U;
  const auto q = static_cast<std::uint32_t>(q_q20);
  if (leading >= q) {
    return kMaxDepthCells;
  }
  const auto low = static_cast<std::uint32_t>(n);
  // Of q below 2^22 the numerator has 32 bits; else twelve bits of q are enough for a cell wrong by one at most.
  if (q < (1U << 22U)) {
    return static_cast<std::int32_t>(low / q);
  }
  const std::uint32_t cell = static_cast<std::uint32_t>(leading) / (q >> 10U);
  // Between -q and 2 q, below 2^31: the low word says it all.
  const auto rest = static_cast<std::int32_t>(low - cell * q);
  return static_cast<std::int32_t>(cell) + (rest < 0 ? -1 : (rest >= q_q20 ? 1 : 0));
}

/// Cells of a column of any plain cone, none below `deepest`: narrow_cells().
[[nodiscard]] CellRange plain_cells_otherwise(const PlainCone& cone, std::int32_t x, std::int32_t y,
                                              std::int32_t deepest);

/// Cells of a column, as frustum_column() has them, none below `deepest`; nothing: last < first. The column is in_box(),
/// kForm is the cone's, or kAny.
template <ConeForm kForm>
[[nodiscard]] inline CellRange plain_cells(const PlainCone& cone, std::int32_t x, std::int32_t y,
                                           std::int32_t deepest) {
  using base::max_of;
  using base::min_of;
  constexpr bool kUpright = kForm == ConeForm::kUpright;
  if (kForm == ConeForm::kAny) {
    return plain_cells_otherwise(cone, x, y, deepest);
  }
  // narrow_column(): |p| < 2^28, g |p| < 2^28, B < 2^29.
  const std::int32_t p_q20 = high_word(cone.horizontal_q30, x * 4096);
  const std::int32_t gp_q20 = high_word(cone.growth_q29, p_q20 * 8);
  const std::int32_t sum_q20 =
      p_q20 + high_word(cone.growth_q29, gp_q20 * 8) + cone.touch_growth_q20;
  const std::int32_t b_q20 = high_word(cone.even_down_q30, sum_q20 * 4);
  const std::int32_t sx_q10 = high_word(cone.down_q30, x * 4);
  const std::int32_t radius_q10 = kTouch_q10 + (gp_q20 >> 10);
  const std::int64_t c_q20 =
      sum_with_product(sum_with_product(product(y, y), sx_q10, sx_q10), radius_q10, -radius_q10);
  // 16 (B^2 - floor(A C / 16)), but its last four bits; -A C by words of C, the lower one signed.
  const auto c_low = static_cast<std::int32_t>(static_cast<std::uint32_t>(c_q20));
  const std::uint32_t c_high =
      static_cast<std::uint32_t>(c_q20 >> 32) + (static_cast<std::uint32_t>(c_q20) >> 31U);
  const auto minus_a = static_cast<std::uint32_t>(cone.minus_a_q24);
  const std::int64_t words =
      sum_with_product(sum_with_product(15, b_q20 * 4, b_q20 * 4), cone.minus_a_q24, c_low);
  const auto disc16_high =
      static_cast<std::int32_t>(static_cast<std::uint32_t>(words >> 32) + minus_a * c_high);
  // Outside, of a cone that holds no vertical.
  if (!kUpright && disc16_high < 0) {
    return CellRange{0, -1};
  }
  // The transducer inside of the column, or hardly outside: rare.
  if (c_q20 < 0 || disc16_high < 16) {
    return plain_cells_otherwise(cone, x, y, deepest);
  }
  const auto root_q20 = static_cast<std::int32_t>(
      root_of_16th(static_cast<std::uint32_t>(disc16_high), static_cast<std::uint32_t>(words)));
  const std::int32_t q_q20 = b_q20 >= 0 ? b_q20 + root_q20 : b_q20 - root_q20;
  const std::int32_t p_q10 = p_q20 >> 10;
  // Of cells_between().
  const std::int32_t up_q10 = cone.origin_q10 + 511;
  const auto at_end =
      static_cast<std::int32_t>(product(cone.range_q10 - p_q10, cone.inverse_down_q12) >> 12);
  CellRange out{0, min_of(deepest, (at_end + up_q10 - 1023) >> 10)};
  if (kUpright && q_q20 < 0) {
    if (cone.inverse_a_q16 == 0) {
      return plain_cells_otherwise(cone, x, y, deepest);
    }
    const auto far_q10 = static_cast<std::int32_t>(product(q_q20 >> 6, cone.inverse_a_q16) >> 20);
    out.first = max_of(0, (far_q10 + up_q10) >> 10);
  } else {
    if (q_q20 <= 0) {
      return plain_cells_otherwise(cone, x, y, deepest);
    }
    out.first = max_of(0, cell_of_root(c_q20, q_q20, up_q10));
    if (!kUpright) {
      if (cone.inverse_a_q16 == 0) {
        return plain_cells_otherwise(cone, x, y, deepest);
      }
      const auto far_q10 = static_cast<std::int32_t>(product(q_q20 >> 6, cone.inverse_a_q16) >> 20);
      // Both roots are one, and rounding parts them.
      if (out.first >= (far_q10 + up_q10) >> 10) {
        return plain_cells_otherwise(cone, x, y, deepest);
      }
      out.last = min_of(out.last, (far_q10 + up_q10 - 1023) >> 10);
    }
  }
  // The cone's beginning: a column forward of the transducer enters it no higher than the transducer stands.
  if (p_q10 < 0) {
    const auto at_start = static_cast<std::int32_t>(product(-p_q10, cone.inverse_down_q12) >> 12);
    out.first = max_of(out.first, (at_start + up_q10) >> 10);
  }
  return out;
}

/// Where a column's runs are in the cone: products of its offset, twice and four times as large (high words).
struct PlainColumn {
  std::int64_t along_q42;  // horizontal x
  std::int64_t off_q42;    // down x
  std::int64_t y2_q20;
};
[[nodiscard]] inline PlainColumn plain_column(const PlainCone& cone, std::int32_t x,
                                              std::int32_t y) {
  return PlainColumn{product(cone.horizontal_q30, x * 4), product(cone.down_q30, x * 4),
                     product(y, y)};
}

/// peak_gain_q8() of growth and share, with share_q16 beyond 65536 (and below 2^18) as 65536.
[[nodiscard]] inline std::uint32_t plain_gain_q8(std::uint32_t growth_q28,
                                                 std::uint32_t share_q16) {
  const std::uint32_t square_q24 = high_word(share_q16 << 12U, share_q16 << 12U);
  const auto rest_q24 = static_cast<std::int32_t>((1U << 24U) - square_q24);
  const auto kept = static_cast<std::uint32_t>(rest_q24 < 0 ? 0 : rest_q24);
  return peak_gain_of_variance_q8((1U << 24U) - high_word(growth_q28, kept << 4U));
}

/// What each voxel gets of a run whose middle is `z_q12` (four times Q10) below the transducer, inside the cone:
/// plain_strength of carve.cpp's general form.
[[nodiscard]] inline std::uint32_t plain_strength_q7(const PlainCone& cone,
                                                     const PlainColumn& column,
                                                     std::int32_t z_q12) {
  const auto slant = static_cast<std::uint32_t>(
      base::max_of(0, high_word_after(column.along_q42, cone.down_q30, z_q12)));
  const std::int32_t off = high_word_after(column.off_q42, cone.minus_horizontal_q30, z_q12);
  const std::uint32_t slant_q22 = slant << 12U;
  const std::uint32_t half_width = kTouch_q10 + high_word(slant_q22, cone.growth_q20);
  // Inside of the cone, whose radius is below 2^17: off^2 + y^2 < 2^36, and the quotient hardly more than the table.
  const auto off2_q20 = static_cast<std::uint64_t>(sum_with_product(column.y2_q20, off, off));
  const std::uint32_t divisor = high_word(half_width << 11U, half_width << 11U);
  const std::uint32_t entry = base::min_of<std::uint32_t>(
      static_cast<std::uint32_t>(off2_q20 >> 4U) / divisor, kBeamWeightSteps);
  const std::uint32_t distance =
      base::min_of(high_word(slant_q22, cone.confidence_scale_q22) >> 2U, 64U);
  // Without growth 256, and the strength the same all along.
  const std::uint32_t gain_q8 =
      plain_gain_q8(cone.variance_growth_q28, high_word(slant_q22, cone.inverse_range_q36));
  const std::uint32_t strength_q7 = base::min_of(
      static_cast<std::uint32_t>((std::uint64_t{cone.end_q14} * of_32_bits(gain_q8)) >> 15U),
      kMostEmpty_q7);
  return (((strength_q7 * cone.pattern_q15[entry]) >> 15U) * kEmptyLogit_q15[distance]) >> 15U;
}

}  // namespace leadline::model
