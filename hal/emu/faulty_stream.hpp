// A line that loses, changes, repeats, cuts and delays bytes, and breaks: the same way again for the same
// seed and the same calls.
#pragma once

#include <cstdint>
#include <deque>

#include "hal/emu/emulated_device.hpp"

namespace leadline::emu {

struct FaultConfig {
  std::uint64_t seed = 1;
  /// Chance of each fault at each byte, per million.
  std::uint32_t drop_ppm = 0;
  std::uint32_t corrupt_ppm = 0;   ///< one to eight of its bits flip
  std::uint32_t repeat_ppm = 0;    ///< it comes twice
  std::uint32_t truncate_ppm = 0;  ///< it and the rest of this call's bytes are lost
  std::uint32_t delay_ppm = 0;     ///< it and all behind it wait for `delay_us`
  std::int64_t delay_us = 0;
  /// The line breaks before byte number N (from 0, counted over the life of the stream).
  std::uint64_t disconnect_at_byte = UINT64_MAX;
};

/// What was done to the bytes. Never decremented.
struct FaultCounters {
  std::uint64_t bytes_in;
  std::uint64_t bytes_out;
  std::uint64_t dropped;
  std::uint64_t corrupted;
  std::uint64_t repeated;
  std::uint64_t truncated;  ///< bytes
  std::uint64_t delays;
  std::uint64_t lost_unplugged;
  std::uint64_t disconnects;
};

/// One direction of a line.
class FaultyStream {
 public:
  explicit FaultyStream(const FaultConfig& config) : config_(config), state_(config.seed) {}

  /// Sends `in` at `now_us` and appends what arrives by now, late bytes of earlier calls first.
  void pass(base::TimeUs now_us, const Bytes& in, Bytes& out);
  /// False once the line broke; what is sent then is lost, and so is what was late.
  [[nodiscard]] bool connected() const { return connected_; }
  /// Plugs it in again; `disconnect_at_byte` is the next break, UINT64_MAX none.
  void reconnect(std::uint64_t disconnect_at_byte = UINT64_MAX);
  /// When the next late byte arrives; kNever_us when none is under way.
  [[nodiscard]] base::TimeUs next_event_us() const {
    return late_.empty() ? kNever_us : late_.front().t_us;
  }
  [[nodiscard]] const FaultCounters& counters() const { return counters_; }

 private:
  struct LateByte {
    base::TimeUs t_us;
    std::uint8_t byte;
  };

  [[nodiscard]] std::uint64_t random();
  [[nodiscard]] bool strikes(std::uint32_t ppm);
  void carry(std::uint8_t byte);
  void disconnect();

  FaultConfig config_;
  std::uint64_t state_;
  bool connected_ = true;
  base::TimeUs t_free_us_ = 0;  ///< bytes do not overtake each other
  std::deque<LateByte> late_;
  FaultCounters counters_{};
};

}  // namespace leadline::emu
