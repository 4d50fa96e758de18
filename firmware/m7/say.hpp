// Between an image and who runs it in QEMU: words on the console, the argument, a failure. Not for what flies.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "firmware/m7/fault_record.hpp"
#include "hal/m7/semihost.hpp"

namespace leadline::firmware::m7 {

/// A number in decimal digits.
class Decimal {
 public:
  explicit Decimal(std::uint64_t value) {
    do {
      --at_;
      digits_[at_] = static_cast<char>('0' + value % 10U);
      value /= 10U;
    } while (value > 0);
  }
  [[nodiscard]] const char* text() const { return digits_ + at_; }

 private:
  char digits_[21] = {};
  std::size_t at_ = sizeof digits_ - 1;
};

/// `name` and a decimal number.
inline void say_number(const char* name, std::uint64_t value) {
  hal::m7::say(name);
  hal::m7::say(Decimal(value).text());
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

/// For the begin of an image that nothing restarts: one that was restarted by a failure says so and ends
/// with `status`.
inline void end_after_fault(std::uint32_t status) {
  const FaultRecord before = take_kept_state();
  if (before.cause != FaultCause::kNone) {
    say_fault(before);
    hal::m7::exit(status);
  }
}

/// What stands behind the image's own name on its command line, blanks included; null: nothing, or it is longer
/// than a path. Stays.
inline const char* command_argument() {
  static char words[512];
  if (!hal::m7::command_line(words, sizeof words)) {
    return nullptr;
  }
  const char* const blank = std::strchr(words, ' ');
  return blank != nullptr && blank[1] != '\0' ? blank + 1 : nullptr;
}

}  // namespace leadline::firmware::m7
