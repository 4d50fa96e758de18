#include "firmware/pipeline/host_report.hpp"

#include "hal/wire.hpp"

namespace leadline::firmware {
namespace {

constexpr std::uint8_t kVersion = 1;
constexpr std::size_t kHead_bytes = 20;
constexpr std::size_t kPort_bytes = 5;

constexpr std::size_t kPortHistory_bytes = 4;

/// Without what early versions do not have.
constexpr std::size_t least_size_of(std::uint8_t port_count) {
  return kHead_bytes + kPort_bytes * std::size_t{port_count};
}
constexpr std::size_t size_of(std::uint8_t port_count) {
  return least_size_of(port_count) + kPortHistory_bytes * std::size_t{port_count};
}
static_assert(size_of(kMaxPorts) == kMaxHostReport_bytes, "the header states the layout");

}  // namespace

std::size_t encode_host_report(const HostReport& report, std::uint8_t* out, std::size_t capacity) {
  if (report.port_count > kMaxPorts || capacity < size_of(report.port_count)) {
    return 0;
  }
  out[0] = kVersion;
  out[1] = report.port_count;
  hal::write_u16_le(out + 2, 0);
  hal::write_u32_le(out + 4, report.alarms);
  hal::write_u32_le(out + 8, report.recorder_lost);
  hal::write_u32_le(out + 12, report.cycle_last_us);
  hal::write_u32_le(out + 16, report.cycle_max_us);
  for (std::size_t i = 0; i < report.port_count; ++i) {
    std::uint8_t* const port = out + kHead_bytes + kPort_bytes * i;
    port[0] = report.port_open[i];
    hal::write_u32_le(port + 1, report.dropped_bytes[i]);
    std::uint8_t* const history = out + least_size_of(report.port_count) + kPortHistory_bytes * i;
    hal::write_u16_le(history, report.opens[i]);
    hal::write_u16_le(history + 2, report.errors[i]);
  }
  return size_of(report.port_count);
}

bool decode_host_report(const std::uint8_t* data, std::size_t size_bytes, HostReport& report) {
  if (size_bytes < kHead_bytes || data[0] != kVersion || data[1] > kMaxPorts ||
      size_bytes < least_size_of(data[1])) {
    return false;
  }
  report = HostReport{};
  report.port_count = data[1];
  report.alarms = hal::read_u32_le(data + 4);
  report.recorder_lost = hal::read_u32_le(data + 8);
  report.cycle_last_us = hal::read_u32_le(data + 12);
  report.cycle_max_us = hal::read_u32_le(data + 16);
  for (std::size_t i = 0; i < report.port_count; ++i) {
    const std::uint8_t* const port = data + kHead_bytes + kPort_bytes * i;
    report.port_open[i] = port[0] != 0 ? 1 : 0;
    report.dropped_bytes[i] = hal::read_u32_le(port + 1);
  }
  for (std::size_t i = 0; i < report.port_count && size_bytes >= size_of(report.port_count); ++i) {
    const std::uint8_t* const history =
        data + least_size_of(report.port_count) + kPortHistory_bytes * i;
    report.opens[i] = hal::read_u16_le(history);
    report.errors[i] = hal::read_u16_le(history + 2);
  }
  return true;
}

bool reopened(const HostReport& before, const HostReport& now, int port) {
  if (port >= before.port_count || port >= now.port_count || now.port_open[port] == 0) {
    return false;
  }
  if (now.opens[port] != 0) {
    return before.opens[port] != 0 && before.opens[port] != now.opens[port];
  }
  return before.port_open[port] == 0;
}

}  // namespace leadline::firmware
