// Senders on an NMEA 2000 bus: CAN frames as bytes (hal/can_frame.hpp).
#pragma once

#include <cstdint>

#include "hal/emu/emulated_device.hpp"
#include "hal/emu/motion.hpp"

namespace leadline::emu {

/// What the bus says besides the motion.
struct N2kTruth {
  Motion motion;
  double latitude_deg = 0;
  double longitude_deg = 0;
  double pressure_pa = 101325;
  double speed_through_water_m_s = 0;
  double speed_over_ground_m_s = 0;
  double course_deg = 0;
  double unix_s = 0;
  int gnss_method = 1;
};

/// One message of up to 223 bytes from `source`: one frame, or the frames of a fast packet with `sequence`
/// (0 .. 7) when `fast` or longer than 8.
[[nodiscard]] Bytes n2k_message(std::uint32_t pgn, std::uint8_t source, const Bytes& data,
                                bool fast = false, unsigned sequence = 0);
/// The same for one of the PGNs 126992 127250 127251 127252 127257 128259 128267 129025 129026 129029
/// 130314; empty for others.
[[nodiscard]] Bytes n2k_truth(std::uint32_t pgn, std::uint8_t source, const N2kTruth& truth,
                              unsigned sequence = 0);

}  // namespace leadline::emu
