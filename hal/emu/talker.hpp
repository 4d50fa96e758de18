// A sensor that sends messages at fixed rates and listens to nothing.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "hal/emu/emulated_device.hpp"

namespace leadline::emu {

/// One kind of message: the bytes of what was measured at an instant.
struct TalkerRow {
  std::function<Bytes(base::TimeUs)> message;
  std::int64_t interval_us;
  base::TimeUs first_us;
};

struct TalkerConfig {
  std::int64_t latency_us = 0;    ///< from the measured instant to the first byte
  std::int64_t byte_time_ns = 0;  ///< per byte on the line (115200 baud: 86806)
};

class Talker : public EmulatedDevice {
 public:
  /// The rows' callbacks are called in order of time, once per message.
  Talker(const TalkerConfig& config, std::vector<TalkerRow> rows);

  void take(base::TimeUs now_us, const std::uint8_t* data, std::size_t size_bytes) override;
  void advance(base::TimeUs now_us, Bytes& out) override;
  [[nodiscard]] base::TimeUs next_event_us() const override;
  /// From now on nothing is sent (true) or all is well again (false). Time goes on inside.
  void set_silent(bool silent) { silent_ = silent; }

 private:
  [[nodiscard]] std::size_t earliest() const;

  TalkerConfig config_;
  std::vector<TalkerRow> rows_;
  SendQueue line_;
  bool silent_ = false;
};

}  // namespace leadline::emu
