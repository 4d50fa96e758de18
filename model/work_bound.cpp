#include "model/work_bound.hpp"

#include "model/base/fixed.hpp"

namespace leadline::model {

std::uint32_t cone_volume(const Scale& scale, std::int32_t range_q10) {
  if (range_q10 <= 0) {
    return 0;
  }
  // pi * integral of (touch + ta r) (touch + tb r) dr, in cells Q10.
  const std::int64_t range = range_q10;
  const std::int64_t grow_a = base::mul_shift(range, cone_growth_q20(scale.tan_along_q20, range_q10), 20);
  const std::int64_t grow_b = base::mul_shift(range, cone_growth_q20(scale.tan_across_q20, range_q10), 20);
  const std::int64_t touch = kTouch_q10;
  const std::int64_t mean_section_q20 =
      touch * touch + touch * (grow_a + grow_b) / 2 + grow_a * grow_b / 3;
  constexpr std::int64_t kPi_q12 = 12868;
  const std::int64_t volume_q10 =
      base::mul_shift(base::mul_shift(mean_section_q20, kPi_q12, 12), range, 20);
  const std::int64_t cells = static_cast<std::int64_t>(scale.size[0]) * scale.size[1] * scale.size[2];
  return static_cast<std::uint32_t>(base::min_of((volume_q10 >> 10) + 1, cells));
}

WorkBound work_bound(const Scale& scale) {
  const std::uint32_t side_n = static_cast<std::uint32_t>(base::min_of(2 * scale.footprint_cells, scale.size[0]));
  const std::uint32_t side_e = static_cast<std::uint32_t>(base::min_of(2 * scale.footprint_cells, scale.size[1]));
  const auto depth = static_cast<std::uint32_t>(scale.size[2]);
  WorkBound bound{};
  for (std::uint8_t level = 0; level < kKernelLevels; ++level) {
    const std::int32_t reach_q16 = kernel_reach_q16(level);
    // Centres in an open interval of 2 reach: at most ceil(2 reach).
    const auto taps = static_cast<std::uint32_t>((2 * reach_q16 + 0xFFFF) >> 16);
    const std::uint32_t shell = side_n * side_e * base::min_of(taps, depth);
    const std::uint32_t cone = cone_volume(scale, (scale.max_range_q16 - reach_q16) >> 6);
    if (shell + cone > bound.total_voxels) {
      bound = WorkBound{shell, cone, shell + cone};
    }
  }
  return bound;
}

}  // namespace leadline::model
