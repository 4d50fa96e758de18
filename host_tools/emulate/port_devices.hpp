// What is at the ends of a vehicle's ports, in the vehicle's time: an emulated fleet, or recordings.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "hal/emu/emulated_device.hpp"
#include "model/base/units.hpp"

namespace leadline::host {

class PortDevices {
 public:
  PortDevices() = default;
  PortDevices(const PortDevices&) = delete;
  PortDevices& operator=(const PortDevices&) = delete;
  virtual ~PortDevices() = default;

  [[nodiscard]] virtual std::size_t port_count() const = 0;
  /// All is over.
  [[nodiscard]] virtual base::TimeUs t_end_us() const = 0;
  /// Until when time may run before advance() is due, > now_us: bytes are stamped with the time of the call
  /// that brings them.
  [[nodiscard]] virtual base::TimeUs next_us(base::TimeUs now_us) const = 0;
  /// Lets the devices run until `now_us` (from 0, never back) and appends what reaches port p by then to
  /// bytes[p]; `bytes` is given one entry per port.
  virtual void advance(base::TimeUs now_us, std::vector<emu::Bytes>* bytes) = 0;
  /// Bytes of the vehicle reach the device of `port`.
  virtual void take(std::size_t port, base::TimeUs now_us, const std::uint8_t* data,
                    std::size_t size_bytes) = 0;
};

}  // namespace leadline::host
