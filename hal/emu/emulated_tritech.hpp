// Tritech SeaNet heads from the outside: alive once a second, centring after power-up, parameters by
// mtHeadCommand, one step (imaging) or one sweep (profiler) per mtSendData.
// From the frames that rock-drivers/drivers-sonar_tritech and ros-tritech-micron read and write.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "hal/emu/emulated_device.hpp"

namespace leadline::emu {

struct SeanetShot {
  base::TimeUs t_us;
  double right_deg;  ///< of ahead
  double range_m;
  int bins;
  double bin_s;  ///< two-way time of one
};

struct EmulatedTritechConfig {
  bool profiler = false;
  int frames_per_request = 1;  ///< a Micron may send two
  std::int64_t byte_time_ns = 0;
  std::int64_t centring_us = 4'000'000;
};

class EmulatedTritech final : public EmulatedDevice {
 public:
  /// Imaging: intensities of a shot (up to `bins`).
  using Image = std::function<Bytes(const SeanetShot&)>;
  /// Profiler: two-way seconds, 0 for nothing.
  using Range = std::function<double(const SeanetShot&)>;

  EmulatedTritech(const EmulatedTritechConfig& config, Image image, Range range);

  void take(base::TimeUs now_us, const std::uint8_t* data, std::size_t size_bytes) override;
  void advance(base::TimeUs now_us, Bytes& out) override;
  [[nodiscard]] base::TimeUs next_event_us() const override;

  void reboot(base::TimeUs now_us);
  void set_silent(bool silent) { silent_ = silent; }
  [[nodiscard]] const Bytes& parameters() const { return parameters_; }
  [[nodiscard]] std::uint64_t refused() const { return refused_; }

 private:
  void command(base::TimeUs now_us, const Bytes& frame);
  void send_data(base::TimeUs now_us);
  void send_sweep(base::TimeUs now_us);
  void send(base::TimeUs t_us, unsigned type, const Bytes& payload, bool counted = true);
  [[nodiscard]] unsigned node() const { return config_.profiler ? 20 : 2; }

  EmulatedTritechConfig config_;
  Image image_;
  Range range_;
  SendQueue line_;
  Bytes inbox_;
  Bytes parameters_;  ///< the frame of the last mtHeadCommand; empty: none
  base::TimeUs t_alive_us_ = 0;
  base::TimeUs t_centred_us_ = 0;
  base::TimeUs t_free_us_ = 0;
  int bearing_ = 3200;
  bool silent_ = false;
  std::uint64_t refused_ = 0;
};

}  // namespace leadline::emu
