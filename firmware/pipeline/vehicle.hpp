// The whole vehicle between its ports: device bytes in, link frames out. See firmware/README.md.
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/pipeline/config.hpp"
#include "model/base/status.hpp"
#include "model/base/units.hpp"
#include "model/model.hpp"

namespace leadline::firmware {

/// Port number of the link's uplink in InputChunk::port; device ports are 0 .. port_count - 1.
inline constexpr std::uint8_t kUplinkPort = 255;

/// Bytes of one port that arrived together.
struct InputChunk {
  base::TimeUs t_arrival_us;  ///< of the last byte
  const std::uint8_t* data;
  std::uint16_t size_bytes;
  std::uint8_t port;
};

struct CycleInput {
  base::TimeUs t_us;
  const InputChunk* chunks;
  std::size_t chunk_count;
  /// Bytes that the link can take now (queue room of the transmitter); the configured rate holds
  /// besides.
  std::uint32_t downlink_room_bytes;
};

/// Spans into the vehicle, valid until the next cycle.
struct OutputSpan {
  const std::uint8_t* data;
  std::size_t size_bytes;
};

struct CycleOutput {
  OutputSpan downlink;                 ///< whole frames, back to back
  OutputSpan device_requests[kMaxPorts];
};

}  // namespace leadline::firmware
