// The other end of a port: a device that speaks its protocol, with time passed in and no I/O. Who runs it
// carries the bytes: through a pty, a datagram, or a vector in a test.
//
// Written from the protocols' descriptions, not from the codecs, and shares with them nothing but the
// checksum: an error in one does not hide in the other. Host code.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <limits>
#include <vector>

#include "model/base/units.hpp"

namespace leadline::emu {

using Bytes = std::vector<std::uint8_t>;

/// "Nothing to come": later than any time.
inline constexpr base::TimeUs kNever_us = std::numeric_limits<base::TimeUs>::max();

class EmulatedDevice {
 public:
  EmulatedDevice() = default;
  EmulatedDevice(const EmulatedDevice&) = delete;
  EmulatedDevice& operator=(const EmulatedDevice&) = delete;
  virtual ~EmulatedDevice() = default;

  /// Bytes that reach the device at `now_us`. Times of all calls must not go back.
  virtual void take(base::TimeUs now_us, const std::uint8_t* data, std::size_t size_bytes) = 0;
  /// Lets time pass and appends what has left the device by `now_us` to `out`.
  virtual void advance(base::TimeUs now_us, Bytes& out) = 0;
  /// The next instant at which advance() has something to do or to send; kNever_us: only when asked. A
  /// caller that steps from one to the next sees every byte at its own time.
  [[nodiscard]] virtual base::TimeUs next_event_us() const = 0;
};

/// A transmitter that needs `byte_time_ns` for each byte; 0: all at once.
class SendQueue {
 public:
  explicit SendQueue(std::int64_t byte_time_ns = 0) : byte_time_ns_(byte_time_ns) {}

  /// Queues `bytes`, the first of which begins at `t_start_us` or when the line is free.
  void send(base::TimeUs t_start_us, const Bytes& bytes);
  void take_until(base::TimeUs now_us, Bytes& out);
  void clear();
  [[nodiscard]] base::TimeUs next_us() const {
    return queue_.empty() ? kNever_us : queue_.front().t_us;
  }

 private:
  struct TimedByte {
    base::TimeUs t_us;  ///< its last bit has left
    std::uint8_t byte;
  };

  std::int64_t byte_time_ns_;
  std::int64_t free_ns_ = std::numeric_limits<std::int64_t>::min();
  std::deque<TimedByte> queue_;
};

}  // namespace leadline::emu
