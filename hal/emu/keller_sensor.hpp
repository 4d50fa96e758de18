// A Keller pressure transmitter on RS-485: answers Modbus RTU and its maker's bus on one line.
#pragma once

#include <functional>

#include "hal/emu/emulated_device.hpp"

namespace leadline::emu {

struct KellerTruth {
  double pressure_bar = 1.01325;
  double temperature_degc = 12;
};

struct KellerSensorConfig {
  std::uint8_t address = 1;
  bool echo = false;               ///< requests come back, as RS-485 adapters may have it
  std::int64_t answer_us = 2'000;  ///< from the end of a request to the first byte of the answer
  std::int64_t byte_time_ns = 0;
};

class KellerSensor final : public EmulatedDevice {
 public:
  using Measure = std::function<KellerTruth(base::TimeUs)>;

  KellerSensor(const KellerSensorConfig& config, Measure measure);

  void take(base::TimeUs now_us, const std::uint8_t* data, std::size_t size_bytes) override;
  void advance(base::TimeUs now_us, Bytes& out) override;
  [[nodiscard]] base::TimeUs next_event_us() const override { return line_.next_us(); }
  /// Its power was off: the maker's bus wants function 48 again.
  void reboot() { started_ = false; }
  void set_silent(bool silent) { silent_ = silent; }

 private:
  [[nodiscard]] Bytes answer(base::TimeUs now_us);
  [[nodiscard]] Bytes answer_modbus(base::TimeUs now_us, std::size_t from) const;
  [[nodiscard]] Bytes answer_keller(base::TimeUs now_us, std::size_t from, std::size_t size);

  KellerSensorConfig config_;
  Measure measure_;
  SendQueue line_;
  Bytes heard_;
  bool started_ = false;
  bool silent_ = false;
};

/// What a device with address `address` answers; seals of both kinds.
[[nodiscard]] Bytes modbus_sealed(const Bytes& body);
[[nodiscard]] Bytes keller_sealed(const Bytes& body);

}  // namespace leadline::emu
