// A byte port as the rest of the vehicle sees it. Implementations: hal/linux, hal/m7.
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/base/units.hpp"

namespace leadline::hal {

enum class PortState : std::uint8_t {
  kClosed = 0,  ///< gone or never opened; service() tries to (re)open it, backed off
  kOpen = 1,
};

/// What a port has seen since it was made. Never decremented.
struct PortCounters {
  std::uint64_t bytes_in;
  std::uint64_t bytes_out;
  std::uint64_t bytes_dropped_in;   ///< arrived, but there was no room for them
  std::uint64_t bytes_dropped_out;  ///< asked to be written while closed or without room
  std::uint32_t opens;
  std::uint32_t losses;  ///< open port that went away (unplugged, peer gone)
  std::uint32_t errors;  ///< calls that failed otherwise
};

/// Nothing here blocks, and nothing allocates after the port was made. One owner, one thread.
class BytePort {
 public:
  BytePort() = default;
  BytePort(const BytePort&) = delete;
  BytePort& operator=(const BytePort&) = delete;
  virtual ~BytePort() = default;

  /// Takes up to `capacity` bytes that have arrived; `t_arrival_us` is the arrival of the last of them
  /// on the caller's time base. 0: none, or closed.
  virtual std::size_t read(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity,
                           base::TimeUs& t_arrival_us) = 0;
  /// Queues `size` bytes; all or as many as there is room for (the rest is counted as dropped). A
  /// datagram port sends one datagram per call.
  virtual std::size_t write(const std::uint8_t* data, std::size_t size) = 0;
  /// To be called once per cycle: reconnects, flushes.
  virtual void service(base::TimeUs now_us) = 0;

  [[nodiscard]] virtual PortState state() const = 0;
  [[nodiscard]] virtual const PortCounters& counters() const = 0;
};

}  // namespace leadline::hal
