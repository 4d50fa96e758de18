// A motion sensor that speaks TSS1.
#pragma once

#include "hal/emu/emulated_device.hpp"
#include "hal/emu/motion.hpp"

namespace leadline::emu {

/// One line of 27 bytes. `status`: U, G, H, F, or in lower case while the sensor settles.
[[nodiscard]] Bytes tss1_line(const Motion& motion, char status = 'F');

}  // namespace leadline::emu
