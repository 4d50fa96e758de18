// What is left of a vehicle that failed, in memory that outlives the restart.
#pragma once

#include <cstdint>

#include "model/base/status.hpp"

namespace leadline::firmware::m7 {

enum class FaultCause : std::uint32_t {
  kNone = 0,
  kNmi = 2,  ///< the number of the exception: 2 is the watchdog here
  kHard = 3,
  kMemory = 4,
  kBus = 5,
  kUsage = 6,
  kNoConfiguration = 0x100,  ///< detail: base::Status of the block
  kRefused = 0x101,          ///< the vehicle refuses the configuration; detail: base::Status
  kUnrecorded = 0x102,  ///< memory outlived a restart, and nobody wrote why: the watchdog's second
                        ///< bite (the handler of the first hung), or the reset line
};

/// `cause` may also be the number of any other exception that nobody expects. Registers are those of the
/// interrupted code. 64 bytes, little-endian, frozen: toolchain/m7_record.py reads it from a dump of memory.
struct FaultRecord {
  std::uint32_t magic;  ///< kFaultMagic; all its bits inverted once a start has taken the record
  FaultCause cause;
  std::uint32_t r0;
  std::uint32_t r1;
  std::uint32_t r2;
  std::uint32_t r3;
  std::uint32_t r12;
  std::uint32_t lr;
  std::uint32_t pc;
  std::uint32_t psr;
  std::uint32_t sp;
  std::uint32_t fault_status;  ///< CFSR
  std::uint32_t address;  ///< that could not be reached, where the status says that it is known
  std::uint32_t detail;   ///< HFSR; of causes without registers: why
  std::uint32_t cycle;    ///< completed before
  std::uint32_t crc;      ///< CRC-32C of the fields before
};
static_assert(sizeof(FaultRecord) == 64, "the layout is frozen");
inline constexpr std::uint32_t kFaultMagic = 0x31464C4CU;  // "LLF1" in file order

/// Lives through a restart; garbage after power-on, when its CRC does not hold.
struct KeptState {
  FaultRecord fault;     ///< of the last failure
  std::uint32_t starts;  ///< since power-on
  std::uint32_t faults;  ///< of these, after a failure
  std::uint32_t crc;     ///< CRC-32C of the two
};

/// To be called once at the start: makes sense of what was kept, counts this start. The record of the failure
/// that led here has cause kNone when there was none.
[[nodiscard]] FaultRecord take_kept_state();
/// Starts since power-on, this one included: 1 and up. Faults among them.
[[nodiscard]] std::uint32_t starts();
[[nodiscard]] std::uint32_t faults();

/// For the record: cycles completed. O(1).
void note_cycle(std::uint32_t cycle);

/// Leaves a record without registers and restarts.
[[noreturn]] void fail(FaultCause cause, base::Status status);

/// Memory, bus and usage faults reach their own handlers.
void enable_fault_handlers();

}  // namespace leadline::firmware::m7

extern "C" {
/// Every exception that is a failure.
void leadline_fault_entry();
}
