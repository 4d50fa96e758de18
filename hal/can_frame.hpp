// CAN frames as bytes: what a CAN port reads and writes, so that a bus is a port like any other and a log
// holds its frames as they came.
//
//   u32 identifier, little-endian: bits 0..28 identifier, bit 29 error frame, bit 30 remote request,
//       bit 31 extended (29-bit) identifier
//   u8 length 0 .. 8, three bytes of 0, eight bytes of data (those behind the length are 0)
//
// A port delivers whole frames, each with its own arrival time, and takes whole frames.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/wire.hpp"

namespace leadline::hal {

inline constexpr std::size_t kCanFrame_bytes = 16;
inline constexpr std::uint8_t kMaxCanData_bytes = 8;
inline constexpr std::uint32_t kCanExtended = 0x80000000U;
inline constexpr std::uint32_t kCanRemote = 0x40000000U;
inline constexpr std::uint32_t kCanError = 0x20000000U;

struct CanFrame {
  std::uint32_t id;  ///< 11 or 29 bits, and the flags kCanExtended, kCanRemote, kCanError
  std::uint8_t length_bytes;
  std::array<std::uint8_t, kMaxCanData_bytes> data;
};

/// O(1).
constexpr void write_can_frame(const CanFrame& frame, std::uint8_t* out) {
  write_u32_le(out, frame.id);
  out[4] = frame.length_bytes;
  out[5] = out[6] = out[7] = 0;
  for (std::size_t i = 0; i < kMaxCanData_bytes; ++i) {
    out[8 + i] = i < frame.length_bytes ? frame.data[i] : std::uint8_t{0};
  }
}

/// False, and `frame` left alone, where the bytes cannot be a frame. O(1).
[[nodiscard]] constexpr bool read_can_frame(const std::uint8_t* bytes, CanFrame& frame) {
  if (bytes[4] > kMaxCanData_bytes || bytes[5] != 0 || bytes[6] != 0 || bytes[7] != 0) {
    return false;
  }
  frame.id = read_u32_le(bytes);
  frame.length_bytes = bytes[4];
  for (std::size_t i = 0; i < kMaxCanData_bytes; ++i) {
    frame.data[i] = bytes[8 + i];
  }
  return true;
}

}  // namespace leadline::hal
