// A survey multibeam that sends R2Sonic bathymetry packets: at its rate, unasked.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "hal/emu/emulated_device.hpp"

namespace leadline::emu {

/// Everything that one packet says.
struct R2SonicPacket {
  std::uint32_t seconds = 0;  ///< of the transmission, since 1970
  std::uint32_t nanoseconds = 0;
  std::uint32_t ping_number = 0;
  float sound_speed_m_s = 1500.0F;
  float range_scale_s = 1e-6F;
  std::vector<std::uint16_t> ranges;
  bool equidistant = false;  ///< A2 with `steps` instead of A0
  float first_angle_rad = -1.0F;
  float last_angle_rad = 1.0F;   ///< A0
  float step_scale_rad = 1e-6F;  ///< A2
  std::vector<std::uint16_t> steps;
  std::vector<std::uint16_t> intensities;  ///< empty: no I1
  std::vector<std::uint8_t> flags;         ///< empty: no Q0
};

/// The packet's bytes.
[[nodiscard]] Bytes write_r2sonic_packet(const R2SonicPacket& packet);

struct EmulatedR2SonicSettings {
  base::TimeUs period_us = 50'000;
  std::size_t beams = 256;
  float opening_rad = 2.0F;  ///< first to last beam, equi-angular
  float sound_speed_m_s = 1500.0F;
  /// Added to vehicle time to make the head's clock.
  std::int64_t clock_offset_us = 1'436'399'535'000'000;
  /// Two-way time, seconds, of the beam at `angle_rad` (starboard positive) of the ping at `t_us`; 0:
  /// nothing found.
  std::function<double(base::TimeUs t_us, double angle_rad)> two_way_s;
};

class EmulatedR2Sonic final : public EmulatedDevice {
 public:
  explicit EmulatedR2Sonic(EmulatedR2SonicSettings settings);
  void take(base::TimeUs now_us, const std::uint8_t* data, std::size_t size_bytes) override;
  void advance(base::TimeUs now_us, Bytes& out) override;
  [[nodiscard]] base::TimeUs next_event_us() const override { return next_ping_us_; }

 private:
  [[nodiscard]] Bytes ping_at(base::TimeUs t_us);

  EmulatedR2SonicSettings settings_;
  base::TimeUs next_ping_us_ = 0;
  std::uint32_t ping_number_ = 0;
};

}  // namespace leadline::emu
