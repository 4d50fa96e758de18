#include "hal/linux/datagram_port.hpp"

#include <poll.h>
#include <unistd.h>

namespace leadline::hal {

DatagramPort::~DatagramPort() {
  if (fd_ >= 0) {
    ::close(fd_);
  }
}

short DatagramPort::poll_events() const { return POLLIN; }

}  // namespace leadline::hal
