// A serial adapter that is pulled and put back a thousand times: no descriptor is left behind, every byte of
// every life arrives, and how long it takes until the port is open again.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <string>

#include <unistd.h>

#include "hal/linux/pty_pair.hpp"
#include "tests/support/port_loop.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::hal::PortState;
using leadline::hal::PtyPair;
using leadline::test::Bytes;
using leadline::test::port_of;
using leadline::test::Random;

constexpr int kCycles = 1000;
constexpr TimeUs kCycle_us = 20'000;  // how often a vehicle serves its ports

long descriptors() {
  const std::filesystem::directory_iterator all("/proc/self/fd");
  return std::distance(begin(all), end(all));
}

TEST(a_thousand_pulled_plugs_leave_nothing_behind) {
  const std::string name = "/tmp/leadline-unplug-" + std::to_string(::getpid());
  PtyPair pty(name);
  assert_string_equal(pty.error().c_str(), "");
  const auto port = port_of("serial:" + name + ":115200");
  // Ports take the time from who serves them: the waits are those of a vehicle, and none is waited for.
  TimeUs now_us = 0;
  Bytes heard(4096);
  const auto serve = [&] {
    now_us += kCycle_us;
    port->service(now_us);
    pty.port().service(now_us);
    TimeUs t_us = 0;
    return port->read(now_us, heard.data(), heard.size(), t_us);
  };
  serve();
  assert_int_equal(port->state(), PortState::kOpen);
  const long before = descriptors();
  Random random(1);
  TimeUs longest_us = 0;
  TimeUs sum_us = 0;
  TimeUs longest_after_short_us = 0;
  for (int cycle = 0; cycle < kCycles; ++cycle) {
    const Bytes said(static_cast<std::size_t>(random.between(1, 200)),
                     static_cast<std::uint8_t>(cycle));
    assert_int_equal(pty.port().write(said.data(), said.size()), said.size());
    std::size_t got = 0;
    for (int i = 0; i < 1000 && got < said.size(); ++i) {
      got += serve();
      assert_true(got == 0 || heard[0] == said[0]);
    }
    assert_int_equal(got, said.size());
    pty.unplug();
    const TimeUs out_us =
        random.between(0, 1) == 0 ? random.between(0, 50'000) : random.between(0, 20'000'000);
    for (const TimeUs end_us = now_us + out_us; now_us < end_us;) {
      serve();
    }
    assert_true(pty.plug());
    const TimeUs plugged_us = now_us;
    int tries = 0;
    while (port->state() != PortState::kOpen || port->counters().losses != cycle + 1U) {
      serve();
      assert_true(++tries < 1000);
    }
    const TimeUs took_us = now_us - plugged_us;
    longest_us = std::max(longest_us, took_us);
    if (out_us < 50'000) {
      longest_after_short_us = std::max(longest_after_short_us, took_us);
    }
    sum_us += took_us;
  }
  std::printf(
      "%d cycles; open again after at most %.2f s, %.2f s on average, %.2f s where it was out for "
      "less than "
      "50 ms; descriptors %ld -> %ld\n",
      kCycles, 1e-6 * static_cast<double>(longest_us), 1e-6 * static_cast<double>(sum_us) / kCycles,
      1e-6 * static_cast<double>(longest_after_short_us), before, descriptors());
  assert_int_equal(descriptors(), before);
  assert_int_equal(port->counters().losses, kCycles);
  assert_int_equal(port->counters().opens, kCycles + 1);
  // The longest wait between two tries, and the cycle in which it ends.
  assert_true(longest_us <= leadline::hal::LinuxPort::kLongestRetry_us + 2 * kCycle_us);
  assert_true(longest_after_short_us <= 400'000);
}

}  // namespace
