// Time of a vehicle without an operating system: a hardware counter of 32 bits, carried on.
#pragma once

#include <cstdint>

#include "model/base/units.hpp"

namespace leadline::hal::m7 {

/// CMSDK timer 1 at 25 MHz, counting down and round. now_us() must be asked once in 171 s at least, which
/// every cycle does. Safe from interrupts and from below them.
class Clock {
 public:
  /// Starts the counter; time is 0.
  void start();
  /// Since start(), O(1).
  [[nodiscard]] base::TimeUs now_us();

 private:
  std::uint64_t ticks_ = 0;
  std::uint32_t last_ = 0xFFFFFFFFU;  ///< of the counter, when last read
};

/// Counts instructions, exactly, where the machine is QEMU with `-icount shift=7`: an instruction takes
/// 128 ns there, which is 3.2 ticks of CMSDK timer 0. The reading itself (some four instructions) is in it.
class InstructionCounter {
 public:
  void start();
  /// Ticks, counting up; differences wrap at 2^32 (1.3e9 instructions).
  [[nodiscard]] std::uint32_t ticks() const;
  /// Nearest whole number to ticks / 3.2: a difference of two readings is off by less than a tick.
  [[nodiscard]] static constexpr std::uint64_t instructions(std::uint64_t ticks) {
    return (ticks * 5U + 8U) / 16U;
  }
};

}  // namespace leadline::hal::m7
