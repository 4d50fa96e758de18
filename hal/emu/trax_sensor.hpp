// A PNI TRAX: answers, polled and continuous output.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "hal/emu/emulated_device.hpp"
#include "hal/emu/motion.hpp"

namespace leadline::emu {

/// A whole frame: size, id, payload, CRC.
[[nodiscard]] Bytes trax_frame(unsigned id, const Bytes& payload);
/// GetDataResp of `components`: 5 heading, 24 pitch, 25 roll, 8 distortion, 7 temperature, 74 .. 76 rates.
[[nodiscard]] Bytes trax_data(const Motion& motion, const std::vector<unsigned>& components,
                              bool distorted = false);

struct TraxSensorConfig {
  std::int64_t answer_delay_us = 3'000;
  std::int64_t byte_time_ns = 0;  ///< 38400 baud: 260417
  std::int64_t boot_us = 200'000;
};

class EmulatedTrax final : public EmulatedDevice {
 public:
  using Measure = std::function<Motion(base::TimeUs)>;

  EmulatedTrax(const TraxSensorConfig& config, Measure measure);

  void take(base::TimeUs now_us, const std::uint8_t* data, std::size_t size_bytes) override;
  void advance(base::TimeUs now_us, Bytes& out) override;
  [[nodiscard]] base::TimeUs next_event_us() const override;

  /// Power gone: settings are lost, and junk comes before the first answer.
  void reboot(base::TimeUs now_us);
  void set_silent(bool silent) { silent_ = silent; }
  [[nodiscard]] const std::vector<unsigned>& components() const { return components_; }
  [[nodiscard]] std::uint64_t requests() const { return requests_; }

 private:
  void handle(base::TimeUs now_us, unsigned id, const Bytes& payload);

  TraxSensorConfig config_;
  Measure measure_;
  SendQueue line_;
  Bytes inbox_;
  std::vector<unsigned> components_;
  std::int64_t interval_us_ = 0;
  base::TimeUs t_next_us_ = kNever_us;
  base::TimeUs t_up_us_ = 0;
  bool silent_ = false;
  std::uint64_t requests_ = 0;
};

}  // namespace leadline::emu
