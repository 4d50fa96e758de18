// Angle of a vector, in integers: the inverse of sin_q30 / cos_q30.
#pragma once

#include <cstdint>

#include "model/base/units.hpp"

namespace leadline::base {

/// Largest |x|, |y| of atan2_bam32(). Inclusive.
inline constexpr std::int64_t kMaxAtan2Argument = std::int64_t{1} << 61U;

/// Worst error of atan2_bam32 in units of 2^-32 turn, for vectors of any length of at least 2^20 (swept
/// by a test); a shorter vector has the angle that its whole numbers have, with the same error.
inline constexpr std::int32_t kAtan2Error_bam32 = 4;

/// Angle of the vector (x, y), from the x axis towards the y axis; 0 for the null vector. |x|, |y| <=
/// kMaxAtan2Argument. 32 steps of shift and add, the same bits on every target.
[[nodiscard]] Bam32 atan2_bam32(std::int64_t y, std::int64_t x);

}  // namespace leadline::base
