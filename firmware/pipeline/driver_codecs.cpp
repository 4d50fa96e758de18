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
  head.a2_inclusive = !has(port, kPortOtherSense);
  return head;
}

hal::CeruleanConfig cerulean_config(const PortConfig& port, const DeviceSetup& setup) {
  auto head = head_of<hal::CeruleanConfig>(port);
  set(head.head, port.variant_plus_1 - 1, port.variant_plus_1 != 0);
  set(head.device_id, port.address, true);
  set(head.gain_index, port.gain_plus_1 - 1, port.gain_plus_1 != 0);
  set(head.ping_interval_ms, port.ping_interval_us / 1000, port.ping_interval_us != 0);
  head.profile = port.profile != 0;
  head.atof_positive_to_port = !has(port, kPortOtherSense);
  head.bow_up_is_positive_x = !has(port, kPortOtherPitch);
  head.min_range_um = port.min_range_um;
  head.max_range_um = port.max_range_um;
  head.sound_speed_mm_s = setup.sound_speed_mm_s;
  return head;
}

hal::ImagenexConfig imagenex_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  auto head = head_of<hal::ImagenexConfig>(port);
  set(head.model, port.variant_plus_1 - 1, port.variant_plus_1 != 0);
  set(head.head_id, port.address, true);
  set(head.gain_db, port.gain_plus_1 - 1, port.gain_plus_1 != 0);
  head.profile = port.profile != 0;
  head.clockwise = !has(port, kPortOtherSense);
  head.roll_positive = !has(port, kPortOtherRoll);
  head.pitch_positive = !has(port, kPortOtherPitch);
  head.poll_interval_us = port.ping_interval_us;
  // 10 gradians of 400 a turn are 9 degrees.
  const std::int32_t turned_grad = port.scan_last_grad - port.scan_first_grad;
  const std::int32_t span_grad =
      turned_grad < 0 ? turned_grad + hal::kPing360Turn_grad : turned_grad;
  const bool full = span_grad + port.scan_step_grad >= hal::kPing360Turn_grad;
  head.sector_deg = full ? 360 : span_grad * 9 / 10;
  head.train_deg = full ? 0 : (port.scan_first_grad * 9 + span_grad * 9 / 2) / 10 % 360;
  set(head.step_ddeg, port.scan_step_grad * 9, port.scan_step_grad != 0);
  head.min_range_um = port.min_range_um;
  head.max_range_um = port.max_range_um;
  head.byte_time_ns = port.byte_time_ns;
  return head;
}

hal::KongsbergConfig kongsberg_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  auto head = head_of<hal::KongsbergConfig>(port);
  head.device_clock = false;  // of the day, which the vehicle's clock is not
  return head;
}

hal::TritechConfig tritech_config(const PortConfig& port, const DeviceSetup& setup) {
  auto head = head_of<hal::TritechConfig>(port);
  set(head.head, port.variant_plus_1 - 1, port.variant_plus_1 != 0);
  set(head.gain, port.gain_plus_1 - 1, port.gain_plus_1 != 0);
  set(head.frequency_hz, port.frequency_khz * 1000, port.frequency_khz != 0);
  head.clockwise = !has(port, kPortOtherSense);
  // Sixteenths of a gradian; the last one counts.
  constexpr std::int32_t kPerGrad = 16;
  head.left = port.scan_first_grad * kPerGrad;
  set(head.right, port.scan_last_grad * kPerGrad + kPerGrad - 1, port.scan_last_grad != 0);
  set(head.step, port.scan_step_grad * kPerGrad, port.scan_step_grad != 0);
  head.max_range_um = port.max_range_um;
  head.sound_speed_mm_s = setup.sound_speed_mm_s;
  head.byte_time_ns = port.byte_time_ns;
  return head;
}

hal::Wl3dConfig wl3d_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  auto head = head_of<hal::Wl3dConfig>(port);
  head.columns_to_the_right = !has(port, kPortOtherSense);
  head.rows_upwards = !has(port, kPortOtherPitch);
  return head;
}

hal::TraxConfig trax_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  hal::TraxConfig sensor;
  sensor.true_heading = has(port, kPortOtherNorth);
  sensor.keep_distorted = has(port, kPortIgnoreStatus);
  set(sensor.interval_us, port.ping_interval_us, port.ping_interval_us != 0);
  sensor.byte_time_ns = port.byte_time_ns;
  return sensor;
}

hal::Deltat83pConfig deltat83p_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  auto head = head_of<hal::Deltat83pConfig>(port);
  head.positive_to_starboard = !has(port, kPortOtherSense);
  head.roll_positive = !has(port, kPortOtherRoll);
  head.pitch_positive = !has(port, kPortOtherPitch);
  head.heading_is_true = has(port, kPortOtherNorth);
  return head;
}

hal::Tss1Config tss1_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  hal::Tss1Config sensor;
  sensor.euler_roll = has(port, kPortEulerAngles);
  sensor.byte_time_ns = port.byte_time_ns;
  return sensor;
}

hal::VectorNavConfig vectornav_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  hal::VectorNavConfig sensor;
  sensor.true_heading = has(port, kPortOtherNorth);
  sensor.accept_unchecked = has(port, kPortAcceptUnchecked);
  sensor.byte_time_ns = port.byte_time_ns;
  return sensor;
}

hal::XsensConfig xsens_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  hal::XsensConfig sensor;
  sensor.true_heading = has(port, kPortOtherNorth);
  sensor.body_frd = has(port, kPortOtherAxes);
  sensor.check_status = !has(port, kPortIgnoreStatus);
  sensor.use_pressure = has(port, kPortUsePressure);
  sensor.byte_time_ns = port.byte_time_ns;
  return sensor;
}

hal::WlDvlConfig wldvl_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  hal::WlDvlConfig sensor;
  sensor.require_checksum = !has(port, kPortAcceptUnchecked);
  sensor.pd4_ship_axes = has(port, kPortOtherAxes);
  sensor.byte_time_ns = port.byte_time_ns;
  return sensor;
}

hal::Pd0Config pd0_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  hal::Pd0Config sensor;
  sensor.true_heading = has(port, kPortOtherNorth);
  sensor.velocity_of_bottom = !has(port, kPortOtherSense);
  sensor.euler_pitch = has(port, kPortEulerAngles);
  sensor.byte_time_ns = port.byte_time_ns;
  return sensor;
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
  if (has(port, kPortSend)) {
    sensor.take &= ~hal::kTakeDistance;  // an autopilot passes on what it was sent: our own echo
  }
  set(sensor.system, port.address, port.address != 0);
  sensor.heading_true = !has(port, kPortOtherNorth);
  sensor.byte_time_ns = port.byte_time_ns;
  return sensor;
}

hal::LineConfig line_config(const PortConfig& port, const DeviceSetup& /*setup*/) {
  hal::LineConfig line;
  set(line.role, port.variant_plus_1 - 1, port.variant_plus_1 != 0);
  line.rising = !has(port, kPortOtherSense);
  return line;
}

}  // namespace leadline::firmware
