// What ports of whole messages have in common: a descriptor that comes and goes, without a queue in front of it. Inside of
// hal/linux; users take linux_port.hpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/linux/stream_port.hpp"

namespace leadline::hal {

/// A derived class opens, reads and writes the descriptor.
class DatagramPort : public LinuxPort {
 public:
  ~DatagramPort() override;

  [[nodiscard]] PortState state() const override {
    return fd_ >= 0 ? PortState::kOpen : PortState::kClosed;
  }
  [[nodiscard]] const PortCounters& counters() const override { return counters_; }
  [[nodiscard]] std::size_t pending_out_bytes() const override { return 0; }
  [[nodiscard]] int poll_fd() const override { return fd_; }
  [[nodiscard]] short poll_events() const override;
  [[nodiscard]] int last_errno() const override { return errno_; }
  [[nodiscard]] std::uint32_t kernel_drops() const override { return kernel_drops_; }
  [[nodiscard]] bool datagrams() const override { return true; }

 protected:
  int fd_ = -1;
  int errno_ = 0;
  std::uint32_t kernel_drops_ = 0;
  Backoff backoff_;
  PortCounters counters_{};
};

}  // namespace leadline::hal
