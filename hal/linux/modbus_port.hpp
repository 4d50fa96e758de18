// A Modbus slave as a port: RTU frames with their CRC go in and out, whether the wire is serial or TCP, so
// that a codec and a log see the same bytes. Inside of hal/linux; users take linux_port.hpp.
//
// libmodbus does the talking, as a master only, on a thread of its own: nothing here waits for a slave. One
// request at a time: one that is written while another is under way is dropped and counted. The answer, or
// the slave's refusal, is one read(). Silence, a bad CRC or a broken line make no bytes: they are counted, the
// line is flushed, and the codec's own timeout asks again.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string>
#include <thread>

#include "hal/linux/linux_port.hpp"

struct _modbus;  // libmodbus

namespace leadline::hal {

/// Never decremented.
struct ModbusCounters {
  std::uint32_t requests;
  std::uint32_t answers;
  std::uint32_t timeouts;      ///< nothing, or not all of an answer, came
  std::uint32_t bad_answers;   ///< CRC, length or header wrong
  std::uint32_t bad_requests;  ///< written here: no frame, or of another slave
};

class ModbusPort final : public LinuxPort {
 public:
  static constexpr std::size_t kMaxFrame_bytes = 256;
  /// From the request to the first byte of the answer; between two of its bytes.
  static constexpr std::int64_t kAnswer_us = 250'000;
  static constexpr std::int64_t kByte_us = 50'000;

  /// `context` is a libmodbus context not yet connected; owned from here on. Starts the thread.
  ModbusPort(_modbus* context, std::uint8_t unit, bool tcp);
  /// Waits for the thread: kAnswer_us at most, and a TCP connection under way.
  ~ModbusPort() override;

  std::size_t read(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity,
                   base::TimeUs& t_arrival_us) override;
  std::size_t write(const std::uint8_t* data, std::size_t size) override;
  void service(base::TimeUs now_us) override;
  [[nodiscard]] PortState state() const override { return state_; }
  [[nodiscard]] const PortCounters& counters() const override { return counters_; }
  [[nodiscard]] ModbusCounters modbus_counters() const;
  [[nodiscard]] std::size_t write_room() const override;
  [[nodiscard]] std::size_t pending_out_bytes() const override { return 0; }
  [[nodiscard]] int poll_fd() const override { return answer_event_; }
  [[nodiscard]] short poll_events() const override;
  [[nodiscard]] int last_errno() const override { return last_errno_.load(); }
  [[nodiscard]] bool datagrams() const override { return true; }

 private:
  /// Passed from one thread to the other and back: whoever finds `full` as it wants it owns the rest.
  struct Mailbox {
    std::atomic<bool> full{false};
    std::size_t size_bytes = 0;
    std::int64_t stamp_ns = 0;  ///< CLOCK_MONOTONIC
    std::array<std::uint8_t, kMaxFrame_bytes> bytes{};
  };

  void run();
  [[nodiscard]] bool wait_for_request(int timeout_ms);
  [[nodiscard]] bool connected();
  void disconnect(int number);
  void serve();
  [[nodiscard]] bool send_request();
  void deliver(const std::uint8_t* bytes, std::size_t size_bytes);

  _modbus* context_;
  std::uint8_t unit_;
  bool tcp_;
  int request_event_ = -1;  ///< wakes the thread
  int answer_event_ = -1;   ///< readable while an answer waits
  Mailbox request_;
  Mailbox answer_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> up_{false};
  std::atomic<int> last_errno_{0};
  std::atomic<std::uint32_t> sent_{0};
  std::atomic<std::uint32_t> answered_{0};
  std::atomic<std::uint32_t> timeouts_{0};
  std::atomic<std::uint32_t> bad_answers_{0};
  std::uint32_t bad_requests_ = 0;
  PortState state_ = PortState::kClosed;
  PortCounters counters_{};
  std::thread thread_;
};

/// Of kModbusRtu or kModbusTcp. Looks the host up (this may block).
[[nodiscard]] PortResult make_modbus_port(const UriSpec& spec);

}  // namespace leadline::hal
