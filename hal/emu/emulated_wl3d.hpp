// A Sonar 3D-15 from the outside: range images, grey images in between, as Range Image Protocol packets.
// From waterlinked/wlsonar: the .proto, the packing, and the meaning of the pixels.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "hal/emu/free_running_head.hpp"

namespace leadline::emu {

struct Wl3dShot {
  base::TimeUs t_us;
  double yaw_deg;    ///< to the right
  double pitch_deg;  ///< upwards
};

struct EmulatedWl3dConfig {
  int width = 256;
  int height = 64;
  double fov_horizontal_deg = 90;
  double fov_vertical_deg = 40;
  double range_m = 15;
  double sound_speed_m_s = 1491;
  std::int64_t interval_us = 200'000;
  bool compressed = true;  ///< RIP2; false: RIP1
};

/// A packet around a message of this type, as the sonar packs it.
[[nodiscard]] Bytes wl3d_packet(const std::string& type, const Bytes& message, bool compressed);
/// A RangeImage of these pixels (row by row), in counts of `scale_m`.
[[nodiscard]] Bytes wl3d_range_image(const EmulatedWl3dConfig& config, std::uint32_t sequence_id,
                                     const std::vector<std::uint32_t>& pixels, double scale_m);

class EmulatedWl3d final : public FreeRunningHead {
 public:
  /// Distance in metres along a direction; 0: nothing.
  using Range = std::function<double(const Wl3dShot&)>;

  EmulatedWl3d(const EmulatedWl3dConfig& config, Range range);

 private:
  void ping(base::TimeUs t_us) override;

  EmulatedWl3dConfig config_;
  Range range_;
  std::uint32_t sequence_id_ = 4448;
};

}  // namespace leadline::emu
