#include "model/plain_cone.hpp"

namespace leadline::model {

PlainCone make_plain_cone(const Frustum& frustum, const Scale& scale,
                          const LocalizationTable& table, std::uint32_t end_q14,
                          std::uint32_t variance_growth_q24, std::uint32_t inverse_range_q36) {
  const Cone& from = frustum.cone;
  PlainCone cone{};
  cone.frustum = &frustum;
  cone.horizontal_q30 = from.horizontal_q30;
  cone.down_q30 = from.down_q30;
  cone.origin_q10 = frustum.origin_q10[2];
  if (from.down_q30 > 0 && from.inverse_down_q12 != 0 && from.growth_q20 < (1 << 22)) {
    cone.form = from.a_q24 < 0 ? ConeForm::kUpright : ConeForm::kSlanted;
    cone.growth_q29 = from.growth_q20 * (1 << 9);
  }
  cone.touch_growth_q20 = from.touch_growth_q20;
  cone.even_down_q30 = from.down_q30 & ~63;
  cone.minus_a_q24 = -from.a_q24;
  cone.inverse_a_q16 = from.inverse_a_q16;
  cone.inverse_down_q12 = from.inverse_down_q12;
  cone.range_q10 = from.range_q10;
  cone.growth_q20 = static_cast<std::uint32_t>(from.growth_q20);
  cone.confidence_scale_q22 = scale.confidence_scale_q22;
  cone.inverse_range_q36 = inverse_range_q36;
  cone.pattern_q15 = table.beam_weight_q15[0];
  cone.end_q14 = end_q14;
  cone.minus_horizontal_q30 = -from.horizontal_q30;
  cone.variance_growth_q28 = variance_growth_q24 << 4U;
  return cone;
}

CellRange plain_cells_otherwise(const PlainCone& cone, std::int32_t x, std::int32_t y,
                                std::int32_t deepest) {
  CellRange cells = narrow_cells(cone.frustum->cone, x, y, cone.origin_q10, kMaxDepthCells);
  cells.last = base::min_of(cells.last, deepest);
  return cells;
}

}  // namespace leadline::model
