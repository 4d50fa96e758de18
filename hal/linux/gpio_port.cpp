#include "hal/linux/gpio_port.hpp"

#include <cerrno>
#include <ctime>

#include <poll.h>

#include "hal/linux/bus_ports.hpp"

namespace leadline::hal {

GpioPort::GpioPort(const UriSpec& spec)
    : chip_(spec.path), offset_(spec.line), output_(spec.output) {}

short GpioPort::poll_events() const { return POLLIN; }

void GpioPort::lose(int number) {
  line_.close();
  open_ = false;
  errno_ = number;
  counters_.losses += 1;
  backoff_.failed(now_us_);
}

void GpioPort::service(base::TimeUs now_us) {
  now_us_ = now_us;
  if (open_ || !backoff_.due(now_us)) {
    return;
  }
  open_ = output_ ? line_.open_output(chip_, offset_) : line_.open_input(chip_, offset_);
  if (!open_) {
    errno_ = errno;
    backoff_.failed(now_us);
    return;
  }
  counters_.opens += 1;
  backoff_.succeeded();
  bool high = false;
  level_ = 0;
  if (!output_ && line_.get(&high)) {
    level_ = high ? kHigh : kLow;
  }
}

std::size_t GpioPort::read(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity,
                           base::TimeUs& t_arrival_us) {
  now_us_ = now_us;
  if (!open_ || output_ || capacity == 0) {
    return 0;
  }
  if (level_ != 0) {
    out[0] = level_;
    level_ = 0;
    counters_.bytes_in += 1;
    t_arrival_us = now_us;
    return 1;
  }
  // The library's read waits: only what is there already is read.
  pollfd wait{line_.fd(), POLLIN, 0};
  if (::poll(&wait, 1, 0) <= 0) {
    return 0;
  }
  GpioEdge edge{};
  if ((wait.revents & POLLIN) == 0 || !line_.read_edge(&edge)) {
    counters_.errors += 1;
    lose((wait.revents & POLLIN) == 0 ? ENODEV : errno);
    return 0;
  }
  kernel_drops_ += edge.lost;
  counters_.bytes_dropped_in += edge.lost;
  counters_.bytes_in += 1;
  t_arrival_us = kernel_stamp_us(now_us, CLOCK_MONOTONIC, edge.stamp_ns);
  out[0] = edge.rising ? kRising : kFalling;
  return 1;
}

std::size_t GpioPort::write(const std::uint8_t* data, std::size_t size) {
  std::size_t taken = 0;
  for (std::size_t i = 0; i < size && open_ && output_; ++i) {
    const bool known = data[i] == kRising || data[i] == kFalling;
    if (known && !line_.set(data[i] == kRising)) {
      counters_.errors += 1;
      lose(errno);
      break;
    }
    taken += known ? 1U : 0U;
  }
  counters_.bytes_out += taken;
  counters_.bytes_dropped_out += size - taken;
  return taken;
}

}  // namespace leadline::hal
