// What the program around the vehicle knows and the status message tells: ports that are gone, records
// that were lost, how long cycles take. It reaches the vehicle as one more chunk of input, port
// kHostPort, so that it stands in the log as every input does and a replay repeats it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/pipeline/config.hpp"

namespace leadline::firmware {

/// Port number of host reports in InputChunk::port.
inline constexpr std::uint8_t kHostPort = 254;

struct HostReport {
  std::uint32_t alarms;         ///< proto::Alarm bits that only the host can know
  std::uint32_t recorder_lost;  ///< records that the recorder lost since its start
  std::uint32_t cycle_last_us;  ///< time that the last cycle took; 0 where nobody measures
  std::uint32_t cycle_max_us;
  std::uint8_t port_count;                 ///< 0 .. kMaxPorts
  std::uint8_t port_open[kMaxPorts];       ///< 0 closed, 1 open
  std::uint32_t dropped_bytes[kMaxPorts];  ///< for want of room, both directions, low 32 bits
  std::uint16_t opens[kMaxPorts];  ///< times that it was opened, low 16 bits; 0: not said, or never
  std::uint16_t errors[kMaxPorts];  ///< errno of why it is closed; 0: open, or no reason known
};

/// Little-endian: version u8 = 1, port_count u8, reserved u16 = 0, the four numbers u32, then per port
/// open u8 and dropped_bytes u32, then per port opens u16 and error u16 (early versions end before these).
inline constexpr std::size_t kMaxHostReport_bytes = 20 + 9 * kMaxPorts;

/// Bytes written; 0 when `capacity` is too small or port_count out of range. O(1).
[[nodiscard]] std::size_t encode_host_report(const HostReport& report, std::uint8_t* out,
                                             std::size_t capacity);
/// Whether the port was closed and opened again between two reports, `before` being the older one (its
/// port_count is 0 where there was none). O(1).
[[nodiscard]] bool reopened(const HostReport& before, const HostReport& now, int port);
/// False when the bytes are no report: `report` is left alone. Bytes behind the last port are a newer
/// version's and ignored. O(1).
[[nodiscard]] bool decode_host_report(const std::uint8_t* data, std::size_t size_bytes,
                                      HostReport& report);

}  // namespace leadline::firmware
