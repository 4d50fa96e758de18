// A GPIO line as a port. In: one byte an edge, 'R' or 'F', at the time that the kernel saw it (PPS, a head's
// ping sync, a leak switch); first of all 'H' or 'L', the level that it was opened at. Out: 'R' and 'F' set
// the line (a head's trigger). Inside of hal/linux; users take linux_port.hpp.
#pragma once

#include <string>

#include "hal/linux/gpio_line.hpp"
#include "hal/linux/stream_port.hpp"

namespace leadline::hal {

class GpioPort final : public LinuxPort {
 public:
  static constexpr std::uint8_t kRising = 'R';
  static constexpr std::uint8_t kFalling = 'F';
  static constexpr std::uint8_t kHigh = 'H';
  static constexpr std::uint8_t kLow = 'L';

  explicit GpioPort(const UriSpec& spec);

  std::size_t read(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity,
                   base::TimeUs& t_arrival_us) override;
  /// Other bytes than the two letters are dropped and counted.
  std::size_t write(const std::uint8_t* data, std::size_t size) override;
  void service(base::TimeUs now_us) override;
  [[nodiscard]] PortState state() const override {
    return open_ ? PortState::kOpen : PortState::kClosed;
  }
  [[nodiscard]] const PortCounters& counters() const override { return counters_; }
  [[nodiscard]] std::size_t write_room() const override { return open_ && output_ ? 64 : 0; }
  [[nodiscard]] std::size_t pending_out_bytes() const override { return 0; }
  [[nodiscard]] int poll_fd() const override { return open_ && !output_ ? line_.fd() : -1; }
  [[nodiscard]] short poll_events() const override;
  [[nodiscard]] int last_errno() const override { return errno_; }
  [[nodiscard]] std::uint32_t kernel_drops() const override { return kernel_drops_; }
  [[nodiscard]] bool datagrams() const override { return true; }

 private:
  void lose(int number);

  std::string chip_;
  std::uint32_t offset_;
  bool output_;
  bool open_ = false;
  std::uint8_t level_ = 0;  ///< at opening, not yet read; 0: it was
  int errno_ = 0;
  std::uint32_t kernel_drops_ = 0;
  base::TimeUs now_us_ = 0;
  GpioLine line_;
  Backoff backoff_;
  PortCounters counters_{};
};

}  // namespace leadline::hal
