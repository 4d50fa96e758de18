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
#include "hal/linux/datagram_port.hpp"

namespace leadline::hal {

/// Never decremented.
struct CanCounters {
  std::uint32_t error_frames;
  std::uint32_t bus_offs;
  std::uint32_t restarts;   ///< the controller said that it is back
  std::uint32_t overflows;  ///< of the controller's own buffers
  std::uint32_t tx_timeouts;
};

class CanPort final : public DatagramPort {
 public:
  explicit CanPort(const UriSpec& spec);

  std::size_t read(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity,
                   base::TimeUs& t_arrival_us) override;
  /// Whole frames; what is left over, malformed or not taken by the interface is dropped and counted.
  std::size_t write(const std::uint8_t* data, std::size_t size) override;
  void service(base::TimeUs now_us) override;
  [[nodiscard]] const CanCounters& can_counters() const { return can_counters_; }
  [[nodiscard]] std::size_t write_room() const override;

 private:
  [[nodiscard]] bool open_now();
  [[nodiscard]] bool set_up(int fd, int interface_index);
  void ask_for_restart();
  void lose(int number);
  void take_error(const CanFrame& frame);
  [[nodiscard]] bool send_frame(const std::uint8_t* bytes);

  std::string interface_;
  std::vector<CanFilter> filters_;
  int interface_index_ = 0;
  bool bus_off_ = false;  ///< until a frame comes
  base::TimeUs now_us_ = 0;
  CanCounters can_counters_{};
};

}  // namespace leadline::hal
