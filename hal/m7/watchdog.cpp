#include "hal/m7/watchdog.hpp"

#include "hal/m7/registers.hpp"

namespace leadline::hal::m7 {
namespace {

constexpr std::uint32_t kLoad = 0x0U;
constexpr std::uint32_t kControl = 0x8U;
constexpr std::uint32_t kInterruptClear = 0xCU;
constexpr std::uint32_t kLock = 0xC00U;
constexpr std::uint32_t kUnlocked = 0x1ACCE551U;
constexpr std::uint32_t kInterruptAndReset = 3U;

}  // namespace

void start_watchdog(std::uint32_t period_ms) {
  reg(kWatchdog + kLock) = kUnlocked;
  reg(kWatchdog + kLoad) = period_ms * (kClock_hz / 1000U);
  reg(kWatchdog + kControl) = kInterruptAndReset;
  reg(kWatchdog + kLock) = 0;
}

void feed_watchdog() {
  reg(kWatchdog + kLock) = kUnlocked;
  reg(kWatchdog + kInterruptClear) = 1;  // and counts from the load value again
  reg(kWatchdog + kLock) = 0;
}

}  // namespace leadline::hal::m7
