// W(config): the most voxels that one ping can write, in closed form.
#pragma once

#include <cstdint>

#include "model/event.hpp"

namespace leadline::model {

/// The bound and its parts.
struct WorkBound {
  std::uint32_t shell_voxels;  ///< (2 F)^2 columns times the taps of the widest kernel that fits
  std::uint32_t cone_voxels;   ///< volume of the thickened cone up to its longest range
  std::uint32_t total_voxels;  ///< W
};

/// Bound of `scale` (footprint half-width F, cone, grid). The shell's box has at most 2 F columns a
/// side by construction; the cone writes at most the volume of the thickened cone
/// pi * integral over r of (kTouch + growth_along r) (kTouch + growth_across r), a budget that the integrator enforces (a lattice can
/// hold a few more centres than the volume; those are left out and counted). W is the larger of
/// shell(l) + cone(R - reach(l)) over the kernel levels l: a wide kernel ends the cone earlier.
[[nodiscard]] WorkBound work_bound(const Scale& scale);

/// Voxels of a cone of `range_q10` cells, see above.
[[nodiscard]] std::uint32_t cone_volume(const Scale& scale, std::int32_t range_q10);

}  // namespace leadline::model
