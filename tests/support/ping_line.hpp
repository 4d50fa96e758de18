// A head's codec and its emulated device, with a line between them that may be bad.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "hal/emu/emulated_device.hpp"
#include "hal/emu/emulated_ping1d.hpp"
#include "hal/emu/emulated_ping360.hpp"
#include "hal/emu/faulty_stream.hpp"
#include "model/base/ping.hpp"
#include "tests/support/device_bytes.hpp"

namespace leadline::test {

using base::Ping;
using base::TimeUs;
using emu::EmulatedDevice;
using emu::FaultConfig;
using emu::FaultyStream;
using emu::Ping1dEcho;
using emu::Ping1dShot;
using emu::Ping360Shot;

/// A codec and a device with a line each way between them, stepped by `step_us`. The device's bytes carry
/// the step of their arrival.
template <typename Codec>
class Line {
 public:
  Line(Codec& codec, EmulatedDevice& device, const FaultConfig& down = {},
       const FaultConfig& up = {}, TimeUs step_us = 1000)
      : codec_(codec), device_(device), down_(down), up_(up), step_us_(step_us) {}

  void run_until(TimeUs t_end_us, const std::function<void(const Ping&)>& use) {
    for (; now_us_ < t_end_us; now_us_ += step_us_) {
      std::uint8_t out[Codec::kMaxRequest_bytes];
      const std::size_t size = codec_.request(now_us_, out, sizeof out);
      sent_ += size;
      Bytes heard;
      up_.pass(now_us_, Bytes(out, out + size), heard);
      device_.take(now_us_, heard.data(), heard.size());
      Bytes bytes;
      device_.advance(now_us_, bytes);
      Bytes arrived;
      down_.pass(now_us_, bytes, arrived);
      Ping ping{};
      for (const std::uint8_t byte : arrived) {
        if (codec_.feed(byte, now_us_, ping)) {
          do {
            use(ping);
          } while (codec_.next(ping));
        }
      }
    }
  }
  std::size_t count_until(TimeUs t_end_us) {
    std::size_t count = 0;
    run_until(t_end_us, [&count](const Ping&) { ++count; });
    return count;
  }
  [[nodiscard]] TimeUs now_us() const { return now_us_; }
  [[nodiscard]] std::size_t sent() const { return sent_; }
  FaultyStream& down() { return down_; }

 private:
  Codec& codec_;
  EmulatedDevice& device_;
  FaultyStream down_;
  FaultyStream up_;
  TimeUs step_us_;
  TimeUs now_us_ = 0;
  std::size_t sent_ = 0;
};

/// A bottom that sinks by 10 mm/s from 10 m, in water of 1500 m/s.
inline Ping1dEcho sinking(const Ping1dShot& shot) {
  const std::int64_t distance_um = 10'000'000 + shot.t_transmit_us / 100;
  Ping1dEcho echo;
  echo.two_way_ns = distance_um * 4 / 3;
  echo.confidence_percent = 80;
  echo.intensity.assign(static_cast<std::size_t>(shot.samples), 10);
  const std::int64_t width_ns = (shot.listen_to_ns - shot.listen_from_ns) / shot.samples;
  const std::int64_t bin = (echo.two_way_ns - shot.listen_from_ns) / width_ns;
  if (bin >= 0 && bin < shot.samples) {
    echo.intensity[static_cast<std::size_t>(bin)] = 250;
  }
  return echo;
}

/// A wall 5 m in front: x = 5 in the head's plane, sound at 1500 m/s.
inline Bytes wall(const Ping360Shot& shot) {
  Bytes data(static_cast<std::size_t>(shot.samples), 5);
  const double angle = (shot.angle_grad - 200) * 3.14159265358979 / 200.0;
  const double range_m = 5.0 / std::cos(angle);
  const auto sample =
      static_cast<std::int64_t>(range_m / 750.0 * 1e9 / static_cast<double>(shot.sample_period_ns));
  if (range_m > 0 && sample < shot.samples) {
    data[static_cast<std::size_t>(sample)] = 200;
  }
  return data;
}

}  // namespace leadline::test
