#include "firmware/pipeline/driver_codecs.hpp"

namespace leadline::firmware {

hal::Ping1dConfig ping1d_config(const PortConfig& port, const DeviceSetup& setup) {
  hal::Ping1dConfig head;
  head.mount = port.mount;
  head.profile = port.profile != 0;
  head.poll_interval_us = port.ping_interval_us;
  head.min_range_um = port.min_range_um;
  head.max_range_um = port.max_range_um;
  head.sound_speed_mm_s = setup.sound_speed_mm_s;
  return head;
}

hal::Ping360Config ping360_config(const PortConfig& port, const DeviceSetup& setup) {
  hal::Ping360Config head;
  head.mount = port.mount;
  head.poll_interval_us = port.ping_interval_us;
  head.scan_first_grad = port.scan_first_grad;
  head.scan_last_grad = port.scan_last_grad;
  head.scan_step_grad = port.scan_step_grad;
  head.min_range_um = port.min_range_um;
  head.max_range_um = port.max_range_um;
  head.sound_speed_mm_s = setup.sound_speed_mm_s;
  return head;
}

hal::NmeaConfig nmea_config(const PortConfig& /*port*/, const DeviceSetup& /*setup*/) {
  return hal::NmeaConfig{};
}

hal::R2SonicConfig r2sonic_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  hal::R2SonicConfig head;
  head.mount = port.mount;
  head.device_clock = false;  // of the day, which the vehicle's clock is not
  return head;
}

hal::KellerConfig keller_config(const PortConfig& /*port*/, const DeviceSetup& /*setup*/) {
  return hal::KellerConfig{};
}

hal::Nmea2000Config nmea2000_config(const PortConfig& /*port*/, const DeviceSetup& /*setup*/) {
  return hal::Nmea2000Config{};
}

hal::MavlinkConfig mavlink_config(const PortConfig& /*port*/, const DeviceSetup& /*setup*/) {
  return hal::MavlinkConfig{};
}

}  // namespace leadline::firmware
