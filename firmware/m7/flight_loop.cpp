#include "firmware/m7/flight_loop.hpp"

#include <cstring>

#include "firmware/m7/entry_points.hpp"
#include "firmware/pipeline/session_log.hpp"
#include "proto/messages.hpp"

extern "C" {
// Of sections.ld: addresses, not objects.
extern const std::uint8_t leadline_config_begin;
extern const std::uint8_t leadline_config_end;
}

namespace leadline::firmware::m7 {
namespace {

constexpr base::TimeUs kReportInterval_us = 1'000'000;
/// How long the link is told of a restart: a topside that comes late should hear of it.
constexpr base::TimeUs kRestartSaid_us = 600'000'000;

ConfigBlock flown;

}  // namespace

[[gnu::section(".bss.leadline.lines")]] hal::m7::UartPort lines[hal::m7::kUarts];
hal::m7::Clock board_clock;

const ConfigBlock& configure_from_flash(std::uint32_t session) {
  const auto size = static_cast<std::size_t>(&leadline_config_end - &leadline_config_begin);
  base::Status status = read_config_block(&leadline_config_begin, size, flown);
  if (status == base::Status::kOk && flown.config.port_count > kBoardPorts) {
    status = base::Status::kOutOfRange;
  }
  if (status != base::Status::kOk) {
    fail(FaultCause::kNoConfiguration, status);
  }
  flown.config.session += session;
  status = the_vehicle.configure(flown.config, flown.tables, flown.table_count);
  if (status != base::Status::kOk) {
    fail(FaultCause::kRefused, status);
  }
  return flown;
}

// ---- CycleBuffer --------------------------------------------------------------------------------

void CycleBuffer::clear() {
  used_bytes_ = 0;
  count_ = 0;
}

bool CycleBuffer::read(hal::m7::UartPort& line, std::uint8_t number, base::TimeUs earliest_us,
                       base::TimeUs latest_us) {
  if (count_ == kChunks || used_bytes_ == kBytes) {
    return false;
  }
  std::uint8_t* const at = bytes_.data() + used_bytes_;
  base::TimeUs t_us = 0;
  const std::size_t size = line.read(at, kBytes - used_bytes_, t_us);
  if (size == 0) {
    return false;
  }
  t_us = base::clamp(t_us, earliest_us, latest_us);
  used_bytes_ += size;
  if (count_ > 0) {
    InputChunk& last = chunks_[count_ - 1];
    if (last.port == number && last.t_arrival_us == t_us &&
        last.size_bytes + size <= kMaxChunk_bytes) {
      last.size_bytes = static_cast<std::uint16_t>(last.size_bytes + size);
      return true;
    }
  }
  chunks_[count_] = {t_us, at, static_cast<std::uint16_t>(size), number};
  ++count_;
  return true;
}

bool CycleBuffer::add(std::uint8_t number, base::TimeUs t_us, const std::uint8_t* data,
                      std::size_t size_bytes) {
  if (count_ == kChunks || size_bytes > kBytes - used_bytes_) {
    return false;
  }
  std::uint8_t* const at = bytes_.data() + used_bytes_;
  std::memcpy(at, data, size_bytes);
  chunks_[count_] = {t_us, at, static_cast<std::uint16_t>(size_bytes), number};
  ++count_;
  used_bytes_ += size_bytes;
  return true;
}

// ---- FlightLoop ---------------------------------------------------------------------------------

void FlightLoop::open(const ConfigBlock& block, const FaultRecord& restart) {
  port_count_ = block.config.port_count;
  restarted_ = restart.cause != FaultCause::kNone;
  for (int port = 0; port < port_count_; ++port) {
    lines[port].open(hal::m7::kUartPlaces[port], block.port_baud[port], board_clock);
  }
  lines[kLinkUart].open(hal::m7::kUartPlaces[kLinkUart], block.link_baud, board_clock);
}

void FlightLoop::gather(base::TimeUs earliest_us, base::TimeUs latest_us) {
  // Bounded: the buffer takes kBytes and kChunks.
  for (int port = 0; port <= port_count_; ++port) {
    const bool link = port == port_count_;
    const auto number = link ? kUplinkPort : static_cast<std::uint8_t>(port);
    while (buffer_.read(lines[link ? kLinkUart : port], number, earliest_us, latest_us)) {
    }
  }
}

void FlightLoop::report(base::TimeUs t_us, std::uint32_t measured_us) {
  longest_us_ = measured_us > longest_us_ ? measured_us : longest_us_;
  if (reported_ && t_us < report_due_us_) {
    return;
  }
  HostReport report{};
  report.port_count = static_cast<std::uint8_t>(port_count_);
  report.cycle_last_us = measured_us;
  report.cycle_max_us = longest_us_;
  report.alarms = restarted_ && t_us < kRestartSaid_us ? std::uint32_t{proto::kAlarmRestarted} : 0U;
  for (int port = 0; port < port_count_; ++port) {
    const hal::PortCounters& line = lines[port].counters();
    report.port_open[port] = 1;
    report.opens[port] = static_cast<std::uint16_t>(line.opens);
    report.dropped_bytes[port] =
        static_cast<std::uint32_t>(line.bytes_dropped_in + line.bytes_dropped_out);
  }
  std::array<std::uint8_t, kMaxHostReport_bytes> bytes{};
  const std::size_t size = encode_host_report(report, bytes.data(), bytes.size());
  if (buffer_.add(kHostPort, t_us, bytes.data(), size)) {
    reported_ = true;
    report_due_us_ = t_us + kReportInterval_us;
  }
}

void FlightLoop::run(base::TimeUs t_us, std::uint32_t measured_us) {
  report(t_us, measured_us);
  input_ = {t_us, buffer_.chunks(), buffer_.chunk_count(),
            static_cast<std::uint32_t>(lines[kLinkUart].write_room())};
  the_vehicle.cycle(input_, output_);
  send();
  ++cycles_;
  note_cycle(cycles_);
}

void FlightLoop::send() {
  for (int port = 0; port < port_count_; ++port) {
    const OutputSpan& request = output_.device_requests[port];
    if (request.size_bytes > 0) {
      (void)lines[port].write(request.data,
                              request.size_bytes);  // what is dropped is counted there
    }
  }
  (void)lines[kLinkUart].write(output_.downlink.data, output_.downlink.size_bytes);
}

}  // namespace leadline::firmware::m7

extern "C" {

void leadline_tick() {}  // wakes the processor, nothing else

#define LEADLINE_LINE(number)                                                                    \
  void leadline_uart##number##_receive() { leadline::firmware::m7::lines[number].on_receive(); } \
  void leadline_uart##number##_sent() { leadline::firmware::m7::lines[number].on_sent(); }
LEADLINE_LINE(0)
LEADLINE_LINE(1)
LEADLINE_LINE(2)
LEADLINE_LINE(3)
LEADLINE_LINE(4)
#undef LEADLINE_LINE

}  // extern "C"
