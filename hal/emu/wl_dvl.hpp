// A Water Linked DVL in all of its output formats.
#pragma once

#include <string>

#include "hal/emu/emulated_device.hpp"
#include "hal/emu/motion.hpp"

namespace leadline::emu {

struct WlDvlState {
  bool valid = true;
  std::int64_t delay_us = 150'000;  ///< from the reflection to the transmission of its report
};

/// `body`, '*', checksum, CR LF.
[[nodiscard]] Bytes wldvl_line(const std::string& body);
[[nodiscard]] Bytes wldvl_velocity(const Motion& motion, const WlDvlState& state = {});
/// Water track: the velocity is that through the water.
[[nodiscard]] Bytes wldvl_water(const Motion& motion, const WlDvlState& state = {});
[[nodiscard]] Bytes wldvl_old_velocity(const Motion& motion, const WlDvlState& state = {});
[[nodiscard]] Bytes wldvl_position(const Motion& motion, const WlDvlState& state = {});
/// The ten lines of a PD6 report.
[[nodiscard]] Bytes wldvl_pd6(const Motion& motion, const WlDvlState& state = {});
[[nodiscard]] Bytes wldvl_pd4(const Motion& motion, const WlDvlState& state = {});
/// `type`: velocity or velocity_water.
[[nodiscard]] Bytes wldvl_json_velocity(const Motion& motion, const WlDvlState& state = {},
                                        const std::string& type = "velocity");
[[nodiscard]] Bytes wldvl_json_position(const Motion& motion, const WlDvlState& state = {});

}  // namespace leadline::emu
