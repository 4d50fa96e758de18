#include "hal/linux/bus_ports.hpp"

#include <ctime>

#include "hal/linux/can_port.hpp"
#include "hal/linux/gpio_port.hpp"
#include "hal/linux/modbus_port.hpp"

namespace leadline::hal {

base::TimeUs kernel_stamp_us(base::TimeUs now_us, int clock, std::int64_t stamp_ns) {
  constexpr std::int64_t kOldest_us = 1'000'000;
  timespec time{};
  (void)::clock_gettime(clock, &time);
  const std::int64_t clock_ns = std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
  const std::int64_t age_us = (clock_ns - stamp_ns) / 1000;
  return age_us > 0 && age_us <= kOldest_us ? now_us - age_us : now_us;
}

PortResult make_bus_port(const UriSpec& spec) {
  if (spec.scheme == UriScheme::kCan) {
    return {std::make_unique<CanPort>(spec), ""};
  }
  if (spec.scheme == UriScheme::kGpio) {
    return {std::make_unique<GpioPort>(spec), ""};
  }
  return make_modbus_port(spec);
}

}  // namespace leadline::hal
