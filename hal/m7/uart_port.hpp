// A serial line of the board: CMSDK APB UART, driven by its interrupts, eight data bits, no parity. The calls of
// a BytePort (hal/ports.hpp), but bound when compiled: no call through a table, no destructor that could ask
// for a heap. The hardware holds one byte each way: a byte is lost (and counted) when the receive interrupt is
// kept waiting for longer than a byte takes, 87 us at 115200 baud.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/m7/arrival_ring.hpp"
#include "hal/m7/clock.hpp"
#include "hal/m7/registers.hpp"
#include "hal/ports.hpp"
#include "model/base/units.hpp"

namespace leadline::hal::m7 {

inline constexpr std::uint32_t kDefaultBaud = 115'200;
/// Received bytes that wait: a third of a second at 115200 baud.
inline constexpr std::size_t kReceiveRing_bytes = 4096;
inline constexpr std::size_t kSendRing_bytes = 4096;

/// One object for one line, at namespace scope; its interrupts call on_receive() and on_sent().
class UartPort {
 public:
  UartPort() = default;
  UartPort(const UartPort&) = delete;
  UartPort& operator=(const UartPort&) = delete;

  /// Sets the line up and lets its interrupts in. `baud` 0: kDefaultBaud. Rates that the divider cannot make
  /// become the nearest that it can (16 clocks a bit at least).
  void open(const UartPlace& place, std::uint32_t baud, Clock& clock);

  /// Up to `capacity` bytes of the oldest burst, `t_arrival_us` that of the last of them; 0: none.
  std::size_t read(std::uint8_t* out, std::size_t capacity, base::TimeUs& t_arrival_us);
  /// Queues all, or as many as there is room for; the rest is counted as dropped.
  std::size_t write(const std::uint8_t* data, std::size_t size);
  [[nodiscard]] const PortCounters& counters() const { return counters_; }

  /// Bytes that write() takes now.
  [[nodiscard]] std::size_t write_room() const;
  /// Whether a byte is under way.
  [[nodiscard]] bool sending() const { return sending_; }
  /// Bytes that have arrived, read or not, those dropped not among them. Changes under the caller.
  [[nodiscard]] std::uint32_t received() const { return received_; }

  void on_receive();
  void on_sent();

 private:
  void send_next();

  Clock* clock_ = nullptr;
  std::uint32_t base_ = 0;
  ArrivalRing<kReceiveRing_bytes, 64> received_ring_;
  std::array<std::uint8_t, kSendRing_bytes> send_ring_{};
  volatile std::uint32_t send_head_ = 0;  ///< written by write()
  volatile std::uint32_t send_tail_ = 0;  ///< written by the interrupt, or with it kept off
  volatile bool sending_ = false;
  volatile std::uint32_t received_ = 0;
  std::uint32_t overruns_ = 0;  ///< of the hardware
  PortCounters counters_{};
};

}  // namespace leadline::hal::m7
