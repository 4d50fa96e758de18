#include "firmware/pipeline/device_port.hpp"

namespace leadline::firmware {
namespace {

std::uint32_t rejected_by_head(const hal::PingHeadCounters& counters) {
  return counters.frames.bad_checksum + counters.frames.bad_length + counters.frames.unknown_id +
         counters.frames.gaps + counters.bad_values + counters.wrong_device;
}

}  // namespace

void DevicePort::configure(const PortConfig& config, std::int32_t sound_speed_mm_s) {
  driver_ = config.driver;
  if (driver_ == Driver::kPing1d) {
    hal::Ping1dConfig head;
    head.mount = config.mount;
    head.profile = config.profile != 0;
    head.poll_interval_us = config.ping_interval_us;
    head.min_range_um = config.min_range_um;
    head.max_range_um = config.max_range_um;
    head.sound_speed_mm_s = sound_speed_mm_s;
    ping1d_ = hal::Ping1dCodec(head);
  }
  if (driver_ == Driver::kPing360) {
    hal::Ping360Config head;
    head.mount = config.mount;
    head.poll_interval_us = config.ping_interval_us;
    head.scan_first_grad = config.scan_first_grad;
    head.scan_last_grad = config.scan_last_grad;
    head.scan_step_grad = config.scan_step_grad;
    head.min_range_um = config.min_range_um;
    head.max_range_um = config.max_range_um;
    head.sound_speed_mm_s = sound_speed_mm_s;
    ping360_ = hal::Ping360Codec(head);
  }
  if (driver_ == Driver::kNmea) {
    nmea_ = hal::NmeaCodec(hal::NmeaConfig{});
  }
}

RecordKind DevicePort::feed(std::uint8_t byte, base::TimeUs t_arrival_us, DeviceRecord& record) {
  bool complete = false;
  switch (driver_) {
    case Driver::kPing1d:
      complete = ping1d_.feed(byte, t_arrival_us, record.ping);
      break;
    case Driver::kPing360:
      complete = ping360_.feed(byte, t_arrival_us, record.ping);
      break;
    case Driver::kNmea:
      return nmea_.feed(byte, t_arrival_us, record.sample) ? RecordKind::kSample
                                                           : RecordKind::kNone;
    case Driver::kNone:
      break;
  }
  return complete ? RecordKind::kPing : RecordKind::kNone;
}

RecordKind DevicePort::next(DeviceRecord& record) {
  if (driver_ == Driver::kPing1d) {
    return ping1d_.next(record.ping) ? RecordKind::kPing : RecordKind::kNone;
  }
  if (driver_ == Driver::kPing360) {
    return ping360_.next(record.ping) ? RecordKind::kPing : RecordKind::kNone;
  }
  return RecordKind::kNone;
}

std::size_t DevicePort::request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity) {
  if (driver_ == Driver::kPing1d) {
    return ping1d_.request(now_us, out, capacity);
  }
  if (driver_ == Driver::kPing360) {
    return ping360_.request(now_us, out, capacity);
  }
  return 0;
}

std::uint32_t DevicePort::rejected() const {
  switch (driver_) {
    case Driver::kPing1d:
      return rejected_by_head(ping1d_.counters());
    case Driver::kPing360:
      return rejected_by_head(ping360_.counters());
    case Driver::kNmea: {
      const hal::NmeaCounters& counters = nmea_.counters();
      return counters.bad_checksum + counters.no_checksum + counters.bad_field + counters.bad_byte +
             counters.too_long + counters.unfinished;
    }
    case Driver::kNone:
      break;
  }
  return 0;
}

}  // namespace leadline::firmware
