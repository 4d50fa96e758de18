// Checksums of devices' protocols, bit by bit: frames are short and no table takes up flash.
//
// All are constexpr, O(size), without state. Where a CRC takes `crc`, it is the start value, or the
// result for the bytes before. Check values are those for the nine characters "123456789".
#pragma once

#include <cstddef>
#include <cstdint>

namespace leadline::hal {

/// One byte more of a CRC of 16 bits, polynomial 0x1021, highest bit first.
[[nodiscard]] constexpr std::uint16_t crc16_msb_step(std::uint16_t crc, std::uint8_t byte) {
  std::uint32_t rest = crc ^ (static_cast<std::uint32_t>(byte) << 8U);
  for (int bit = 0; bit < 8; ++bit) {
    rest = (rest & 0x8000U) != 0 ? (rest << 1U) ^ 0x1021U : rest << 1U;
  }
  return static_cast<std::uint16_t>(rest);
}

/// Polynomial 0x1021, highest bit first. Start 0 is XMODEM (check 0x31C3: VectorNav, PNI), start
/// 0xFFFF is "CCITT-FALSE" (check 0x29B1: CAN bootloaders, UAVCAN).
[[nodiscard]] constexpr std::uint16_t crc16_xmodem(const std::uint8_t* data, std::size_t size_bytes,
                                                   std::uint16_t crc = 0) {
  for (std::size_t i = 0; i < size_bytes; ++i) {
    crc = crc16_msb_step(crc, data[i]);
  }
  return crc;
}

/// One byte more of a CRC of 16 bits, lowest bit first; `reversed` is the polynomial read backwards.
[[nodiscard]] constexpr std::uint16_t crc16_lsb_step(std::uint16_t crc, std::uint8_t byte,
                                                     std::uint16_t reversed) {
  std::uint32_t rest = crc ^ static_cast<std::uint32_t>(byte);
  for (int bit = 0; bit < 8; ++bit) {
    rest = (rest & 1U) != 0 ? (rest >> 1U) ^ reversed : rest >> 1U;
  }
  return static_cast<std::uint16_t>(rest);
}

/// Modbus RTU and the Keller bus: polynomial 0x8005, lowest bit first, start 0xFFFF (check 0x4B37).
[[nodiscard]] constexpr std::uint16_t crc16_modbus(const std::uint8_t* data, std::size_t size_bytes,
                                                   std::uint16_t crc = 0xFFFF) {
  for (std::size_t i = 0; i < size_bytes; ++i) {
    crc = crc16_lsb_step(crc, data[i], 0xA001);
  }
  return crc;
}

/// MAVLink ("X.25" without its final inversion): polynomial 0x1021, lowest bit first, start 0xFFFF
/// (check 0x6F91).
[[nodiscard]] constexpr std::uint16_t crc16_mcrf4xx(const std::uint8_t* data,
                                                    std::size_t size_bytes,
                                                    std::uint16_t crc = 0xFFFF) {
  for (std::size_t i = 0; i < size_bytes; ++i) {
    crc = crc16_lsb_step(crc, data[i], 0x8408);
  }
  return crc;
}

/// Polynomial 0x07, highest bit first, start 0 (check 0xF4: Water Linked).
[[nodiscard]] constexpr std::uint8_t crc8(const std::uint8_t* data, std::size_t size_bytes,
                                          std::uint8_t crc = 0) {
  for (std::size_t i = 0; i < size_bytes; ++i) {
    std::uint32_t rest = static_cast<std::uint32_t>(crc) ^ data[i];
    for (int bit = 0; bit < 8; ++bit) {
      rest = (rest & 0x80U) != 0 ? (rest << 1U) ^ 0x07U : rest << 1U;
    }
    crc = static_cast<std::uint8_t>(rest);
  }
  return crc;
}

/// XOR of all bytes (NMEA, VectorNav; check 0x31).
[[nodiscard]] constexpr std::uint8_t xor8(const std::uint8_t* data, std::size_t size_bytes) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < size_bytes; ++i) {
    sum ^= data[i];
  }
  return static_cast<std::uint8_t>(sum);
}

/// Sum of all bytes, modulo 2^16 (PD0, PD4; check 0x01DD). Its low byte is the sum modulo 256 (Xsens).
[[nodiscard]] constexpr std::uint16_t sum16(const std::uint8_t* data, std::size_t size_bytes) {
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i < size_bytes; ++i) {
    sum += data[i];
  }
  return static_cast<std::uint16_t>(sum);
}

}  // namespace leadline::hal
