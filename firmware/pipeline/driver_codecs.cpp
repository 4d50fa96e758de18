#include "firmware/pipeline/driver_codecs.hpp"

namespace leadline::firmware {
namespace {

bool has(const PortConfig& port, PortSwitch bit) { return (port.switches & bit) != 0; }

/// A setting that keeps the driver's default unless the port has one.
template <class T>
void set(T& setting, std::int32_t value, bool given) {
  if (given) {
    setting = static_cast<T>(value);
  }
}

/// What every codec of a sonar head is told.
template <class Config>
Config head_of(const PortConfig& port) {
  Config head;
  head.mount = port.mount;
  return head;
}

}  // namespace

hal::Ping1dConfig ping1d_config(const PortConfig& port, const DeviceSetup& setup) {
  auto head = head_of<hal::Ping1dConfig>(port);
  head.drop_repeats = true;
  head.profile = port.profile != 0;
  set(head.gain_setting, port.gain_plus_1 - 1, port.gain_plus_1 != 0);
  set(head.device_id, port.address, true);
  head.poll_interval_us = port.ping_interval_us;
  head.min_range_um = port.min_range_um;
  head.max_range_um = port.max_range_um;
  head.sound_speed_mm_s = setup.sound_speed_mm_s;
  head.byte_time_ns = port.byte_time_ns;
  return head;
}

hal::Ping360Config ping360_config(const PortConfig& port, const DeviceSetup& setup) {
  auto head = head_of<hal::Ping360Config>(port);
  set(head.gain_setting, port.gain_plus_1 - 1, port.gain_plus_1 != 0);
  set(head.frequency_khz, port.frequency_khz, port.frequency_khz != 0);
  set(head.device_id, port.address, true);
  head.clockwise = !has(port, kPortOtherSense);
  head.poll_interval_us = port.ping_interval_us;
  head.scan_first_grad = port.scan_first_grad;
  head.scan_last_grad = port.scan_last_grad;
  head.scan_step_grad = port.scan_step_grad;
  head.min_range_um = port.min_range_um;
  head.max_range_um = port.max_range_um;
  head.sound_speed_mm_s = setup.sound_speed_mm_s;
  head.byte_time_ns = port.byte_time_ns;
  return head;
}

hal::NmeaConfig nmea_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  hal::NmeaConfig sensor;
  sensor.require_checksum = !has(port, kPortAcceptUnchecked);
  sensor.use_variation = has(port, kPortUseVariation);
  sensor.prdid_true = has(port, kPortOtherNorth);
  sensor.gauge_pressure = has(port, kPortGaugePressure);
  sensor.byte_time_ns = port.byte_time_ns;
  return sensor;
}

hal::R2SonicConfig r2sonic_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  auto head = head_of<hal::R2SonicConfig>(port);
  head.device_clock = false;  // of the day, which the vehicle's clock is not
  return head;
}

hal::KellerConfig keller_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  hal::KellerConfig sensor;
  set(sensor.bus, port.variant_plus_1 - 1, port.variant_plus_1 != 0);
  set(sensor.address, port.address, port.address != 0);
  set(sensor.poll_interval_us, port.ping_interval_us, port.ping_interval_us != 0);
  sensor.pressure_only = has(port, kPortPressureOnly);
  sensor.gauge_pressure = has(port, kPortGaugePressure);
  sensor.byte_time_ns = port.byte_time_ns;
  return sensor;
}

hal::Nmea2000Config nmea2000_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  hal::Nmea2000Config sensor;
  sensor.pressure_source = hal::kN2kPressureWater;  // a barometer's must not become depth
  set(sensor.source, port.address, port.address != 0);
  sensor.use_variation = has(port, kPortUseVariation);
  sensor.yaw_true = has(port, kPortOtherNorth);
  sensor.heave_up = !has(port, kPortOtherSense);
  return sensor;
}

hal::MavlinkConfig mavlink_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  hal::MavlinkConfig sensor;
  sensor.take = hal::kTakeArduSub;
  set(sensor.system, port.address, port.address != 0);
  sensor.heading_true = !has(port, kPortOtherNorth);
  sensor.byte_time_ns = port.byte_time_ns;
  return sensor;
}

}  // namespace leadline::firmware
