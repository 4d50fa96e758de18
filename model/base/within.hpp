// Whether a value lies in a range whose two ends count. Total, O(1).
#pragma once

#include <cstdint>

namespace leadline::base {

/// low <= value <= high.
[[nodiscard]] constexpr bool within(std::int64_t value, std::int64_t low, std::int64_t high) {
  return low <= value && value <= high;
}

/// -limit <= value <= limit, 0 <= limit.
[[nodiscard]] constexpr bool within(std::int64_t value, std::int64_t limit) {
  return within(value, -limit, limit);
}

}  // namespace leadline::base
