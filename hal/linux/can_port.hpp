// A CAN interface (SocketCAN) as a port of frames (hal/can_frame.hpp): one frame a read, with the time that
// the kernel saw it. Inside of hal/linux; users take linux_port.hpp.
//
// Interfaces are made and set up outside (`ip link`, `slcand`): this program needs no rights for it. An
// interface that is not there, not up or that goes away is a closed port, tried again like any other.
//
// Error frames of the controller are delivered (flag kCanError) and counted. At a bus-off the port closes and
// tries again, backed off; no `restart-ms` is taken for granted: each try asks the kernel for a restart (which
// needs CAP_NET_ADMIN; without it somebody else has to, and the tries go on). Only a frame from the bus ends
// the backing off.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "hal/can_frame.hpp"
#include "hal/linux/stream_port.hpp"

namespace leadline::hal {

/// Never decremented.
struct CanCounters {
  std::uint32_t error_frames;
  std::uint32_t bus_offs;
  std::uint32_t restarts;   ///< the controller said that it is back
  std::uint32_t overflows;  ///< of the controller's own buffers
  std::uint32_t tx_timeouts;
};

class CanPort final : public LinuxPort {
 public:
  explicit CanPort(const UriSpec& spec);
  ~CanPort() override;

  std::size_t read(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity,
                   base::TimeUs& t_arrival_us) override;
  /// Whole frames; what is left over, malformed or not taken by the interface is dropped and counted.
  std::size_t write(const std::uint8_t* data, std::size_t size) override;
  void service(base::TimeUs now_us) override;
  [[nodiscard]] PortState state() const override {
    return fd_ >= 0 ? PortState::kOpen : PortState::kClosed;
  }
  [[nodiscard]] const PortCounters& counters() const override { return counters_; }
  [[nodiscard]] const CanCounters& can_counters() const { return can_counters_; }
  [[nodiscard]] std::size_t write_room() const override;
  [[nodiscard]] std::size_t pending_out_bytes() const override { return 0; }
  [[nodiscard]] int poll_fd() const override { return fd_; }
  [[nodiscard]] short poll_events() const override;
  [[nodiscard]] int last_errno() const override { return errno_; }
  [[nodiscard]] std::uint32_t kernel_drops() const override { return kernel_drops_; }
  [[nodiscard]] bool datagrams() const override { return true; }

 private:
  [[nodiscard]] bool open_now();
  [[nodiscard]] bool set_up(int fd, int interface_index);
  void ask_for_restart();
  void lose(int number);
  void take_error(const CanFrame& frame);
  [[nodiscard]] bool send_frame(const std::uint8_t* bytes);

  std::string interface_;
  std::vector<CanFilter> filters_;
  int fd_ = -1;
  int errno_ = 0;
  int interface_index_ = 0;
  bool bus_off_ = false;  ///< until a frame comes
  std::uint32_t kernel_drops_ = 0;
  base::TimeUs now_us_ = 0;
  Backoff backoff_;
  PortCounters counters_{};
  CanCounters can_counters_{};
};

}  // namespace leadline::hal
