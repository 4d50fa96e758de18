#include "hal/linux/port_watch.hpp"

#include <cstring>

namespace leadline::hal {

std::string PortWatch::change(const LinuxPort& port) {
  const PortState state = port.state();
  const bool open = state == PortState::kOpen;
  const int number = open ? 0 : port.last_errno();
  if (ever_ && state == state_ && number == number_) {
    return "";
  }
  const bool lost = ever_ && state_ == PortState::kOpen;
  state_ = state;
  number_ = number;
  ever_ = true;
  if (open) {
    return "open";
  }
  const std::string why = number != 0 ? std::string(": ") + std::strerror(number) : "";
  return (lost ? "lost" : "not there yet") + why + "; tried again until it is";
}

}  // namespace leadline::hal
