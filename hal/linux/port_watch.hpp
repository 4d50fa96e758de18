// What a program says of a port, once per change: of its state, and of the reason why it is closed.
#pragma once

#include <string>

#include "hal/linux/linux_port.hpp"

namespace leadline::hal {

class PortWatch {
 public:
  /// "open", "lost: No such device; tried again until it is", .. when that differs from what the last call
  /// found (the first call always says something); else empty. Call after service().
  [[nodiscard]] std::string change(const LinuxPort& port);

 private:
  PortState state_ = PortState::kClosed;
  int number_ = 0;
  bool ever_ = false;
};

}  // namespace leadline::hal
