// A single line (GPIO): a pulse per second, a head's ping sync, a leak switch. One byte an edge or level, as
// hal/linux/gpio_port.hpp makes them, at the instant of the edge:
//
//   'R' rising edge   'F' falling edge   'H' 'L' high or low when the line was opened, which is no edge
//
// | role | becomes |
// |---|---|
// | pps, ping_sync | kNavPulse for the edge that counts (`rising`); the other one is `ignored` |
// | leak | kNavLeak: wet while the line is high (`rising`) or low, also when it was opened so |
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

enum class LineRole : std::uint8_t { kPps = 0, kPingSync = 1, kLeak = 2 };

inline constexpr std::uint8_t kLineRising = 'R';
inline constexpr std::uint8_t kLineFalling = 'F';
inline constexpr std::uint8_t kLineHigh = 'H';
inline constexpr std::uint8_t kLineLow = 'L';

struct LineConfig {
  LineRole role = LineRole::kPps;
  bool rising = true;  ///< the rising edge counts, or high is wet
};

/// Bytes to samples. One object per port; not reentrant. No heap, no clock.
class LineCodec {
 public:
  explicit LineCodec(const LineConfig& config) : config_(config) {}

  /// Takes one byte; true when it is a record. O(1).
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample);
  /// The port was closed and opened again: nothing is half done.
  void restart() {}
  [[nodiscard]] const CodecCounters& counters() const { return counters_; }

 private:
  LineConfig config_;
  CodecCounters counters_{};
};

}  // namespace leadline::hal
