// libgpiod 2.x. Compiled where CMake found that; gpio_line_v1.cpp otherwise.
#include <cerrno>

#include <gpiod.h>

#include "hal/linux/gpio_line.hpp"

namespace leadline::hal {
namespace {

constexpr const char* kConsumer = "leadline";
constexpr std::size_t kEvents = 1;

gpiod_line_request* request_of(void* line) { return static_cast<gpiod_line_request*>(line); }
gpiod_edge_event_buffer* buffer_of(void* buffer) {
  return static_cast<gpiod_edge_event_buffer*>(buffer);
}

gpiod_line_request* request(gpiod_chip* chip, std::uint32_t line, bool output) {
  gpiod_line_settings* settings = gpiod_line_settings_new();
  gpiod_line_config* lines = gpiod_line_config_new();
  gpiod_request_config* config = gpiod_request_config_new();
  gpiod_line_request* made = nullptr;
  const unsigned offset = line;
  if (settings != nullptr && lines != nullptr && config != nullptr) {
    gpiod_request_config_set_consumer(config, kConsumer);
    if (output) {
      (void)gpiod_line_settings_set_direction(settings, GPIOD_LINE_DIRECTION_OUTPUT);
      (void)gpiod_line_settings_set_output_value(settings, GPIOD_LINE_VALUE_INACTIVE);
    } else {
      (void)gpiod_line_settings_set_direction(settings, GPIOD_LINE_DIRECTION_INPUT);
      (void)gpiod_line_settings_set_edge_detection(settings, GPIOD_LINE_EDGE_BOTH);
      (void)gpiod_line_settings_set_event_clock(settings, GPIOD_LINE_CLOCK_MONOTONIC);
    }
    if (gpiod_line_config_add_line_settings(lines, &offset, 1, settings) == 0) {
      made = gpiod_chip_request_lines(chip, config, lines);
    }
  }
  const int number = errno;
  gpiod_request_config_free(config);
  gpiod_line_config_free(lines);
  gpiod_line_settings_free(settings);
  errno = number;
  return made;
}

}  // namespace

bool GpioLine::open(const std::string& chip, std::uint32_t line, bool output) {
  close();
  const std::string path = chip.find('/') == std::string::npos ? "/dev/" + chip : chip;
  gpiod_chip* opened = gpiod_chip_open(path.c_str());
  if (opened == nullptr) {
    return false;
  }
  line_ = request(opened, line, output);
  const int number = errno;
  gpiod_chip_close(opened);  // the request lives on without it
  errno = number;
  if (line_ == nullptr) {
    return false;
  }
  offset_ = line;
  sequence_ = 0;
  if (!output) {
    buffer_ = gpiod_edge_event_buffer_new(kEvents);
  }
  if (!output && buffer_ == nullptr) {
    close();
    errno = ENOMEM;
    return false;
  }
  return true;
}

void GpioLine::close() {
  if (buffer_ != nullptr) {
    gpiod_edge_event_buffer_free(buffer_of(buffer_));
    buffer_ = nullptr;
  }
  if (line_ != nullptr) {
    gpiod_line_request_release(request_of(line_));
    line_ = nullptr;
  }
}

bool GpioLine::set(bool high) {
  const auto value = high ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
  return gpiod_line_request_set_value(request_of(line_), offset_, value) == 0;
}

bool GpioLine::get(bool* high) {
  const gpiod_line_value value = gpiod_line_request_get_value(request_of(line_), offset_);
  *high = value == GPIOD_LINE_VALUE_ACTIVE;
  return value != GPIOD_LINE_VALUE_ERROR;
}

int GpioLine::fd() const {
  return line_ != nullptr ? gpiod_line_request_get_fd(request_of(line_)) : -1;
}

bool GpioLine::read_edge(GpioEdge* edge) {
  if (gpiod_line_request_read_edge_events(request_of(line_), buffer_of(buffer_), kEvents) != 1) {
    return false;
  }
  gpiod_edge_event* event = gpiod_edge_event_buffer_get_event(buffer_of(buffer_), 0);
  const unsigned long sequence = gpiod_edge_event_get_line_seqno(event);
  edge->rising = gpiod_edge_event_get_event_type(event) == GPIOD_EDGE_EVENT_RISING_EDGE;
  edge->stamp_ns = static_cast<std::int64_t>(gpiod_edge_event_get_timestamp_ns(event));
  edge->lost = static_cast<std::uint32_t>(sequence - sequence_ - 1);
  sequence_ = sequence;
  return true;
}

}  // namespace leadline::hal
