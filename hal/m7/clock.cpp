#include "hal/m7/clock.hpp"

#include "hal/m7/registers.hpp"

namespace leadline::hal::m7 {
namespace {

// CMSDK timer.
constexpr std::uint32_t kControl = 0x0U;
constexpr std::uint32_t kValue = 0x4U;
constexpr std::uint32_t kReload = 0x8U;
constexpr std::uint32_t kEnable = 1U;
constexpr std::uint32_t kTicks_per_us = kClock_hz / 1'000'000U;

void start_timer(std::uint32_t base) {
  reg(base + kControl) = 0;
  reg(base + kReload) = 0xFFFFFFFFU;
  reg(base + kValue) = 0xFFFFFFFFU;
  reg(base + kControl) = kEnable;
}

}  // namespace

void Clock::start() {
  start_timer(kTimer1);
  ticks_ = 0;
  last_ = 0xFFFFFFFFU;
}

base::TimeUs Clock::now_us() {
  const InterruptsOff off;
  const std::uint32_t value = reg(kTimer1 + kValue);
  ticks_ += static_cast<std::uint32_t>(last_ - value);
  last_ = value;
  return static_cast<base::TimeUs>(ticks_ / kTicks_per_us);
}

// NOLINTBEGIN(readability-convert-member-functions-to-static): whoever counts has a counter
void InstructionCounter::start() { start_timer(kTimer0); }

std::uint32_t InstructionCounter::ticks() const { return 0xFFFFFFFFU - reg(kTimer0 + kValue); }
// NOLINTEND(readability-convert-member-functions-to-static)

}  // namespace leadline::hal::m7
