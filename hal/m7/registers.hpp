// Registers of the board MPS2 with the FPGA image AN500, and of the Cortex-M7's core. Sources: ARM DAI0385/
// DAI0500 (memory map, interrupts), DDI0479 (CMSDK peripherals), DDI0403 (ARMv7-M).
#pragma once

#include <cstdint>

namespace leadline::hal::m7 {

/// One 32-bit register.
inline volatile std::uint32_t& reg(std::uint32_t address) {
  // NOLINTNEXTLINE(performance-no-int-to-ptr): that is where it is
  return *reinterpret_cast<volatile std::uint32_t*>(address);
}

/// System clock of the AN500; timers and watchdog count it.
inline constexpr std::uint32_t kClock_hz = 25'000'000;

inline constexpr std::uint32_t kTimer0 = 0x40000000U;
inline constexpr std::uint32_t kTimer1 = 0x40001000U;
inline constexpr std::uint32_t kWatchdog = 0x40008000U;

/// A serial line: its registers and interrupts.
struct UartPlace {
  std::uint32_t base;
  std::uint8_t rx_interrupt;
  std::uint8_t tx_interrupt;
};
inline constexpr int kUarts = 5;
inline constexpr UartPlace kUartPlaces[kUarts] = {{0x40004000U, 0, 1},
                                                  {0x40005000U, 2, 3},
                                                  {0x40006000U, 4, 5},
                                                  {0x40007000U, 18, 19},
                                                  {0x40009000U, 20, 21}};

// ---- Core ---------------------------------------------------------------------------------------

inline constexpr std::uint32_t kInterruptSetEnable = 0xE000E100U;
inline constexpr std::uint32_t kApplicationReset = 0xE000ED0CU;  ///< AIRCR
inline constexpr std::uint32_t kSystemHandlers = 0xE000ED24U;    ///< SHCSR
inline constexpr std::uint32_t kFaultStatus = 0xE000ED28U;       ///< CFSR
inline constexpr std::uint32_t kHardFaultStatus = 0xE000ED2CU;   ///< HFSR
inline constexpr std::uint32_t kMemoryFaultAddress = 0xE000ED34U;
inline constexpr std::uint32_t kBusFaultAddress = 0xE000ED38U;
inline constexpr std::uint32_t kCoprocessorAccess = 0xE000ED88U;  ///< CPACR

inline void enable_interrupt(unsigned number) {
  reg(kInterruptSetEnable + 4U * (number / 32U)) = 1U << (number % 32U);
}

/// Everything is forgotten but RAM. Does not return.
[[noreturn]] inline void restart_system() {
  asm volatile("dsb" ::: "memory");
  reg(kApplicationReset) = 0x05FA0004U;
  for (;;) {
    asm volatile("wfi");
  }
}

/// No interrupt while one lives; they nest.
class InterruptsOff {
 public:
  InterruptsOff() { asm volatile("mrs %0, primask\n cpsid i" : "=r"(before_)::"memory"); }
  ~InterruptsOff() { asm volatile("msr primask, %0" ::"r"(before_) : "memory"); }
  InterruptsOff(const InterruptsOff&) = delete;
  InterruptsOff& operator=(const InterruptsOff&) = delete;

 private:
  std::uint32_t before_ = 0;
};

}  // namespace leadline::hal::m7
