#include "firmware/m7/fault_record.hpp"

#include <cstddef>

#include "hal/m7/registers.hpp"
#include "model/base/crc32c.hpp"

extern "C" {
// Of sections.ld: addresses, not objects.
extern std::uint32_t leadline_stack_low;
extern std::uint32_t leadline_stack_top;
}

namespace leadline::firmware::m7 {
namespace {

using hal::m7::reg;

[[gnu::section(".noinit"), gnu::used]] KeptState kept;
std::uint32_t cycles_done;

std::uint32_t crc_of(const FaultRecord& record) {
  return base::crc32c(&record, offsetof(FaultRecord, crc));
}

std::uint32_t crc_of_counts() {
  return base::crc32c(&kept.starts, sizeof kept.starts + sizeof kept.faults);
}

void keep(const FaultRecord& record) {
  kept.fault = record;
  kept.fault.magic = kFaultMagic;
  kept.fault.cycle = cycles_done;
  kept.fault.crc = crc_of(kept.fault);
}

[[noreturn]] void leave(const FaultRecord& record) {
  keep(record);
  hal::m7::restart_system();
}

}  // namespace

FaultRecord take_kept_state() {
  const bool counted = kept.crc == crc_of_counts();
  if (counted && (kept.fault.magic != kFaultMagic || kept.fault.crc != crc_of(kept.fault))) {
    FaultRecord unrecorded{};
    unrecorded.cause = FaultCause::kUnrecorded;
    keep(unrecorded);
  }
  const FaultRecord record = counted ? kept.fault : FaultRecord{};
  const bool failed = record.cause != FaultCause::kNone;
  kept.starts = counted ? kept.starts + 1U : 1U;
  kept.faults = (counted ? kept.faults : 0U) + (failed ? 1U : 0U);
  kept.crc = crc_of_counts();
  // Taken once: the next start without a failure says so. The record stays readable.
  if (failed) {
    kept.fault.magic = ~kFaultMagic;
  }
  return record;
}

std::uint32_t starts() { return kept.starts; }
std::uint32_t faults() { return kept.faults; }

void note_cycle(std::uint32_t cycle) { cycles_done = cycle; }

// An exception that is a failure.
[[noreturn]] void record_exception(const std::uint32_t* frame, std::uint32_t exception) {
  FaultRecord record{};
  record.cause = static_cast<FaultCause>(exception);
  record.sp = static_cast<std::uint32_t>(reinterpret_cast<std::uintptr_t>(frame));
  record.fault_status = reg(hal::m7::kFaultStatus);
  record.detail = reg(hal::m7::kHardFaultStatus);
  constexpr std::uint32_t kMemoryAddressKnown = 1U << 7U;
  constexpr std::uint32_t kBusAddressKnown = 1U << 15U;
  if ((record.fault_status & kMemoryAddressKnown) != 0) {
    record.address = reg(hal::m7::kMemoryFaultAddress);
  } else if ((record.fault_status & kBusAddressKnown) != 0) {
    record.address = reg(hal::m7::kBusFaultAddress);
  }
  // Where the stack ran over there is no frame.
  if (frame >= &leadline_stack_low && frame + 8 <= &leadline_stack_top) {
    record.r0 = frame[0];
    record.r1 = frame[1];
    record.r2 = frame[2];
    record.r3 = frame[3];
    record.r12 = frame[4];
    record.lr = frame[5];
    record.pc = frame[6];
    record.psr = frame[7];
  }
  leave(record);
}

void fail(FaultCause cause, base::Status status) {
  FaultRecord record{};
  record.cause = cause;
  record.detail = static_cast<std::uint32_t>(status);
  leave(record);
}

void enable_fault_handlers() {
  constexpr std::uint32_t kMemoryBusUsage = 7U << 16U;
  reg(hal::m7::kSystemHandlers) = reg(hal::m7::kSystemHandlers) | kMemoryBusUsage;
}

}  // namespace leadline::firmware::m7

extern "C" {

// By the handler below only. `frame`: r0 r1 r2 r3 r12 lr pc psr as the core pushed them.
[[noreturn, gnu::used]] void leadline_fault(const std::uint32_t* frame, std::uint32_t exception) {
  leadline::firmware::m7::record_exception(frame, exception);
}

// The stack may itself be what failed: the handler goes on one of its own.
[[gnu::naked]] void leadline_fault_entry() {
  asm volatile(
      "cpsid i\n"
      "mrs r0, msp\n"
      "mrs r1, ipsr\n"
      "ldr r2, =leadline_fault_stack_top\n"
      "msr msp, r2\n"
      "b leadline_fault\n");
}

}  // extern "C"
