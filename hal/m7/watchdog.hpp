// CMSDK watchdog: unfed for one period it raises the NMI, for two it restarts the system.
#pragma once

#include <cstdint>

namespace leadline::hal::m7 {

/// Starts it. 1 <= period_ms <= 171'000. It cannot be stopped but by a restart.
void start_watchdog(std::uint32_t period_ms);
/// To be called once in a period at least.
void feed_watchdog();

}  // namespace leadline::hal::m7
