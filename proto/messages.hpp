// What frames say. Every message is one frame's payload: type, then fields, little-endian. Bit by bit in
// proto/SPEC.md; sizes and limits here.
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/base/status.hpp"
#include "model/base/units.hpp"
#include "proto/cell.hpp"

namespace leadline::proto {

/// Version of the messages. A peer of another major refuses; a minor adds fields at the end or types.
inline constexpr std::uint8_t kProtocolMajor = 1;
inline constexpr std::uint8_t kProtocolMinor = 0;

/// First byte of every payload. 0x01..0x3f downlink, 0x40..0x7f uplink, 0x80..0xff log only.
enum class MessageType : std::uint8_t {
  kHello = 0x01,
  kTileDelta = 0x02,
  kStatus = 0x03,
  kText = 0x04,
  kResendRequest = 0x40,
  kLogHeader = 0x80,
  kLogConfig = 0x81,
  kLogTable = 0x82,
  kLogChunk = 0x83,
  kLogCycle = 0x84,
  kLogGap = 0x85,
  kLogEnd = 0x86,
};

}  // namespace leadline::proto
