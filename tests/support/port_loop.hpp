// Ports in real time: the two ends of a line, and waiting for what has to come of it.
#pragma once

#include <ctime>
#include <functional>
#include <memory>
#include <string>

#include <poll.h>

#include "hal/linux/linux_port.hpp"
#include "tests/support/device_bytes.hpp"

namespace leadline::test {

inline base::TimeUs monotonic_us() {
  timespec time{};
  (void)::clock_gettime(CLOCK_MONOTONIC, &time);
  return std::int64_t{time.tv_sec} * 1'000'000 + time.tv_nsec / 1000;
}

inline std::unique_ptr<hal::LinuxPort> port_of(const std::string& uri) {
  const auto parsed = hal::parse_uri(uri);
  assert_string_equal(parsed.error.c_str(), "");
  hal::PortResult made = hal::make_port(parsed.spec);
  assert_string_equal(made.error.c_str(), "");
  return std::move(made.port);
}

struct Arrival {
  Bytes bytes;
  base::TimeUs t_us = 0;
};

/// One service() and one read().
inline Arrival read_once(hal::LinuxPort& port) {
  Arrival arrival;
  arrival.bytes.resize(4096);
  port.service(monotonic_us());
  arrival.bytes.resize(
      port.read(monotonic_us(), arrival.bytes.data(), arrival.bytes.size(), arrival.t_us));
  return arrival;
}

/// Calls `step` every millisecond until it says true; fails after ten seconds without.
inline void until(const std::function<bool()>& step, const char* what) {
  for (int i = 0; i < 10'000; ++i) {
    if (step()) {
      return;
    }
    (void)::poll(nullptr, 0, 1);
  }
  fail_msg("never: %s", what);
}

inline void wait_open(hal::LinuxPort& port) {
  until(
      [&] {
        port.service(monotonic_us());
        return port.state() == hal::PortState::kOpen;
      },
      "open");
}

}  // namespace leadline::test
