// The real clocks, for the two threads of the program. Vehicle code never sees them: time is passed in.
#pragma once

#include <cstdint>

namespace leadline::host {

/// Microseconds of CLOCK_MONOTONIC.
[[nodiscard]] std::int64_t monotonic_us();
/// Microseconds since 1970, UTC.
[[nodiscard]] std::int64_t utc_us();

}  // namespace leadline::host
