// What every emulated device of the Ping protocol does: find requests in bytes, answer the common ones,
// be silent, reboot.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "hal/emu/emulated_device.hpp"
#include "model/base/units.hpp"

namespace leadline::emu {

struct PingIdentity {
  std::uint8_t device_id;
  std::uint8_t device_type;
  std::uint8_t revision;
  std::array<std::uint8_t, 3> firmware;
  std::array<std::uint8_t, 3> protocol;
};

/// Payload under construction, little-endian.
class PayloadWriter {
 public:
  PayloadWriter& u8(unsigned value);
  PayloadWriter& u16(unsigned value);
  PayloadWriter& u32(std::uint32_t value);
  PayloadWriter& bytes(const Bytes& more);
  [[nodiscard]] const Bytes& payload() const { return payload_; }

 private:
  Bytes payload_;
};

[[nodiscard]] std::uint32_t payload_u16(const Bytes& payload, std::size_t at);
[[nodiscard]] std::uint32_t payload_u32(const Bytes& payload, std::size_t at);

/// A frame of the Ping protocol.
[[nodiscard]] Bytes ping_frame(unsigned id, unsigned source, unsigned destination,
                               const Bytes& payload);

class PingDeviceEmulator : public EmulatedDevice {
 public:
  PingDeviceEmulator(const PingIdentity& identity, std::int64_t byte_time_ns,
                     std::int64_t answer_delay_us)
      : identity_(identity), line_(byte_time_ns), answer_delay_us_(answer_delay_us) {}

  void take(base::TimeUs now_us, const std::uint8_t* data, std::size_t size_bytes) final;
  void advance(base::TimeUs now_us, Bytes& out) final;
  [[nodiscard]] base::TimeUs next_event_us() const final;

  /// Power gone for `boot_us`: settings and counts are lost, half a frame stays on the line.
  void reboot(base::TimeUs now_us, std::int64_t boot_us);
  /// From now on nothing is sent (true) or all is well again (false). Time goes on inside.
  void set_silent(bool silent) { silent_ = silent; }

  [[nodiscard]] std::uint64_t requests() const { return requests_; }
  [[nodiscard]] std::uint64_t bad_requests() const { return bad_requests_; }

 protected:
  /// One intact frame for this device. False: no such message here (answered by a nack).
  virtual bool handle(base::TimeUs now_us, unsigned id, const Bytes& payload) = 0;
  /// A "get" message was asked for by general_request. False: unknown.
  virtual bool answer_request(base::TimeUs now_us, unsigned id) = 0;
  /// Own events up to and including `now_us`, in order.
  virtual void run(base::TimeUs now_us) = 0;
  [[nodiscard]] virtual base::TimeUs own_event_us() const = 0;
  /// Settings of power-on; `now_us` is when the device is up.
  virtual void power_on(base::TimeUs now_us) = 0;

  void send(base::TimeUs t_us, unsigned id, const Bytes& payload);
  void ack(base::TimeUs now_us, unsigned id);
  void nack(base::TimeUs now_us, unsigned id, const std::string& reason);

 private:
  void handle_frame(base::TimeUs now_us, unsigned id, const Bytes& payload);
  [[nodiscard]] std::size_t take_frame(base::TimeUs now_us);

  PingIdentity identity_;
  SendQueue line_;
  std::int64_t answer_delay_us_;
  Bytes inbox_;
  base::TimeUs t_up_us_ = std::numeric_limits<base::TimeUs>::min();
  bool silent_ = false;
  std::uint64_t requests_ = 0;
  std::uint64_t bad_requests_ = 0;
};

}  // namespace leadline::emu
