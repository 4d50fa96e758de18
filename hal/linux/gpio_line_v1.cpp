// libgpiod 1.6. Compiled where CMake found that; gpio_line_v2.cpp otherwise.
#include <cerrno>

#include <gpiod.h>

#include "hal/linux/gpio_line.hpp"

namespace leadline::hal {
namespace {

constexpr const char* kConsumer = "leadline";

gpiod_chip* chip_of(void* chip) { return static_cast<gpiod_chip*>(chip); }
gpiod_line* line_of(void* line) { return static_cast<gpiod_line*>(line); }

}  // namespace

bool GpioLine::open(const std::string& chip, std::uint32_t line, bool output) {
  close();
  chip_ = gpiod_chip_open_lookup(chip.c_str());
  if (chip_ == nullptr) {
    return false;
  }
  gpiod_line* found = gpiod_chip_get_line(chip_of(chip_), line);
  const int result = found == nullptr ? -1
                     : output         ? gpiod_line_request_output(found, kConsumer, 0)
                                      : gpiod_line_request_both_edges_events(found, kConsumer);
  if (result != 0) {
    const int number = errno;
    close();
    errno = number;
    return false;
  }
  line_ = found;
  return true;
}

void GpioLine::close() {
  if (line_ != nullptr) {
    gpiod_line_release(line_of(line_));
    line_ = nullptr;
  }
  if (chip_ != nullptr) {
    gpiod_chip_close(chip_of(chip_));
    chip_ = nullptr;
  }
}

bool GpioLine::set(bool high) { return gpiod_line_set_value(line_of(line_), high ? 1 : 0) == 0; }

bool GpioLine::get(bool* high) {
  const int value = gpiod_line_get_value(line_of(line_));
  *high = value > 0;
  return value >= 0;
}

int GpioLine::fd() const { return line_ != nullptr ? gpiod_line_event_get_fd(line_of(line_)) : -1; }

bool GpioLine::read_edge(GpioEdge* edge) {
  gpiod_line_event event{};
  if (gpiod_line_event_read(line_of(line_), &event) != 0) {
    return false;
  }
  edge->rising = event.event_type == GPIOD_LINE_EVENT_RISING_EDGE;
  edge->stamp_ns = std::int64_t{event.ts.tv_sec} * 1'000'000'000 + event.ts.tv_nsec;
  edge->lost = 0;
  return true;
}

}  // namespace leadline::hal
