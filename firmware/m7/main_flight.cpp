// The image that flies: real time, no files, nothing but lines.
#include "firmware/m7/entry_points.hpp"
#include "firmware/m7/flight_loop.hpp"
#include "hal/m7/registers.hpp"
#include "hal/m7/watchdog.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::firmware::m7::board_clock;
using leadline::firmware::m7::FaultRecord;

[[gnu::section(".bss.leadline.lines")]] leadline::firmware::m7::FlightLoop loop;

// Cycles may be late by whole ones; a vehicle that completes none for so long starts over.
constexpr std::uint32_t kWatchdog_ms = 2000;
constexpr std::uint32_t kTick_hz = 1000;

// Wakes the processor from its sleep a thousand times a second.
void start_tick() {
  constexpr std::uint32_t kControl = 0xE000E010U;
  constexpr std::uint32_t kReload = 0xE000E014U;
  constexpr std::uint32_t kValue = 0xE000E018U;
  constexpr std::uint32_t kRunWithInterrupt = 7;
  using leadline::hal::m7::reg;
  reg(kReload) = leadline::hal::m7::kClock_hz / kTick_hz - 1U;
  reg(kValue) = 0;
  reg(kControl) = kRunWithInterrupt;
}

}  // namespace

void leadline_main() {
  const FaultRecord before = leadline::firmware::m7::take_kept_state();
  leadline::hal::m7::start_watchdog(kWatchdog_ms);
  board_clock.start();
  start_tick();
  const auto& block =
      leadline::firmware::m7::configure_from_flash(leadline::firmware::m7::starts());
  loop.open(block, before);
  leadline::hal::m7::feed_watchdog();
  TimeUs next_us = board_clock.now_us();
  std::uint32_t took_us = 0;
  for (;;) {
    next_us += block.cycle_us;
    while (board_clock.now_us() < next_us) {
      asm volatile("wfi");
    }
    const TimeUs now_us = board_clock.now_us();
    loop.buffer().clear();
    loop.gather(loop.input().t_us, now_us);
    loop.run(now_us, took_us);
    leadline::hal::m7::feed_watchdog();
    const TimeUs end_us = board_clock.now_us();
    took_us = static_cast<std::uint32_t>(end_us - now_us);
    if (end_us - next_us >= block.cycle_us) {
      next_us = end_us;  // late: what was missed is not made up
    }
  }
}
