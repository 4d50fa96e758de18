// Words on the debugger's console, for images that replay and test.
#pragma once

#include <cstdint>

#include "firmware/m7/fault_record.hpp"
#include "hal/m7/semihost.hpp"

namespace leadline::firmware::m7 {

/// `name` and a decimal number.
inline void say_number(const char* name, std::uint64_t value) {
  char digits[21];
  std::size_t at = sizeof digits - 1;
  digits[at] = '\0';
  do {
    --at;
    digits[at] = static_cast<char>('0' + value % 10U);
    value /= 10U;
  } while (value > 0);
  hal::m7::say(name);
  hal::m7::say(digits + at);
}

inline void say_hex(const char* name, std::uint32_t value) {
  char digits[11] = "0x00000000";
  for (unsigned i = 0; i < 8; ++i) {
    digits[2 + i] = "0123456789abcdef"[(value >> (28U - 4U * i)) & 15U];
  }
  hal::m7::say(name);
  hal::m7::say(digits);
}

inline void say_fault(const FaultRecord& record) {
  say_number("a fault: cause ", static_cast<std::uint32_t>(record.cause));
  say_hex(" pc ", record.pc);
  say_hex(" lr ", record.lr);
  say_hex(" sp ", record.sp);
  say_hex(" status ", record.fault_status);
  say_hex(" address ", record.address);
  say_hex(" detail ", record.detail);
  say_number(" cycle ", record.cycle);
  hal::m7::say("\n");
}

}  // namespace leadline::firmware::m7
