// The tide: how high the water stands over the survey's zero of depth, by the vehicle's time. Depths that
// sensors state are below the surface; positions are below the zero: down = depth - level.
#pragma once

#include <cstdint>

#include "firmware/pipeline/config.hpp"
#include "model/base/units.hpp"

namespace leadline::firmware {

/// Points in order of time, at most 31 days apart, heights within +-100 m. O(points).
[[nodiscard]] bool tide_sound(const WaterConfig& water);

/// Linear between the points; before the first and behind the last it stays. 0 without points. Of a tide that
/// is sound. O(points).
[[nodiscard]] std::int64_t water_level_um(const WaterConfig& water, base::TimeUs t_us);

}  // namespace leadline::firmware
