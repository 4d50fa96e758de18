// Ports of buses and lines. Inside of hal/linux; users take linux_port.hpp.
#pragma once

#include "hal/linux/linux_port.hpp"

namespace leadline::hal {

/// Of kCan, kModbusRtu, kModbusTcp, kGpio. Everything that allocates is done here.
[[nodiscard]] PortResult make_bus_port(const UriSpec& spec);

/// When something happened, on the caller's time base: `now_us` less the age of a stamp of the kernel's
/// clock `clock`. An age below 0 or above a second (a clock that was set) counts as 0.
[[nodiscard]] base::TimeUs kernel_stamp_us(base::TimeUs now_us, int clock, std::int64_t stamp_ns);

}  // namespace leadline::hal
