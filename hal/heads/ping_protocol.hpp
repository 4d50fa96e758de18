// Frames of the Ping protocol (Blue Robotics, Cerulean): found in a byte stream, checked, written.
//
//   'B' 'R'  u16 payload length N  u16 message id  u8 source  u8 destination  N bytes  u16 checksum
//
// All little-endian; the checksum is the sum of all bytes before it, modulo 65536. That sum is weak
// (it misses swapped bytes and one double bit error in sixteen), so a frame must also be one that its
// device can send: id and length are checked against a table. Facts: bluerobotics/ping-protocol
// docs/index.md and src/definitions/*.json.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/codec.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

inline constexpr std::size_t kPingHeader_bytes = 8;
inline constexpr std::size_t kPingOverhead_bytes = 10;  ///< header and checksum
/// Most intensities in one message: Ping360's limit; Ping1D sends 200. Inclusive.
inline constexpr std::size_t kMaxPingSamples = 1200;
/// Longest payload that any table may let through (1300 with all its samples). Inclusive.
inline constexpr std::size_t kMaxPingPayload_bytes = 26 + kMaxPingSamples;
inline constexpr std::size_t kMaxPingFrame_bytes = kMaxPingPayload_bytes + kPingOverhead_bytes;

/// Values of device_information.device_type. Message ids mean different things to different devices,
/// so every table belongs to one.
enum class PingDevice : std::uint8_t { kUnknown = 0, kPing1d = 1, kPing360 = 2 };

/// Message ids of all devices.
inline constexpr std::uint16_t kPingAck = 1;
inline constexpr std::uint16_t kPingNack = 2;
inline constexpr std::uint16_t kPingAsciiText = 3;
inline constexpr std::uint16_t kPingDeviceInformation = 4;
inline constexpr std::uint16_t kPingProtocolVersion = 5;
inline constexpr std::uint16_t kPingGeneralRequest = 6;

/// One row of a device's table: a message and the lengths that it may have.
struct PingMessage {
  std::uint16_t id;
  std::uint16_t min_bytes;
  std::uint16_t max_bytes;
  /// Offset of the u16 that counts the bytes behind it; 0: the message has none.
  std::uint16_t count_offset;
};

/// Messages of one device, both directions (a half-duplex line may echo). Points to static storage.
struct PingTable {
  const PingMessage* messages;
  std::size_t message_count;
};

/// Tables of the supported devices, the common messages included.
[[nodiscard]] PingTable ping1d_table();
[[nodiscard]] PingTable ping360_table();

/// Sum of the bytes, modulo 65536. O(size).
[[nodiscard]] std::uint16_t ping_checksum(const std::uint8_t* bytes, std::size_t size_bytes);

/// Writes one frame to `out`; returns its size, or 0 when it is larger than `capacity_bytes` or than
/// kMaxPingFrame_bytes. `payload` may be null when `payload_bytes` is 0. O(payload).
[[nodiscard]] std::size_t write_ping_frame(std::uint16_t id, std::uint8_t source,
                                           std::uint8_t destination, const std::uint8_t* payload,
                                           std::size_t payload_bytes, std::uint8_t* out,
                                           std::size_t capacity_bytes);

/// A frame inside the parser's buffer: valid until the next call of feed(), next() or reset().
struct PingFrame {
  std::uint16_t id;
  std::uint8_t source;
  std::uint8_t destination;
  const std::uint8_t* payload;
  std::uint16_t payload_bytes;
  base::TimeUs t_arrival_us;  ///< of the frame's last byte
};

/// A hal::Framer with the protocol's rules, for one device's table.
///
/// O(1) per byte for a clean stream. Each wrong start that looks right (both letters, id and length)
/// costs one sum over at most kMaxPingFrame_bytes; such starts are six bytes apart or more, so that is
/// below 210 additions per byte fed, whatever is fed. Not reentrant; no heap; about 6.1 KiB.
class PingParser {
 public:
  /// A pause this long inside a frame ends it: the heads send a frame in one piece, and a serial line
  /// of 115200 baud needs 0.1 s for the longest.
  static constexpr base::TimeUs kMaxGap_us = 500'000;

  explicit PingParser(PingTable table) : table_(table) {}

  /// As Framer's.
  void feed(std::uint8_t byte, base::TimeUs t_arrival_us) {
    framer_.feed(byte, t_arrival_us, counters_);
  }
  [[nodiscard]] bool next(PingFrame& frame);
  void pause() { framer_.pause(); }
  void reset() { framer_.reset(counters_); }
  [[nodiscard]] std::size_t buffered_bytes() const { return framer_.buffered_bytes(); }
  [[nodiscard]] FrameView last_frame() const { return framer_.last_frame(); }

  /// The framer's; whoever takes the frames counts what becomes of them in here, too.
  [[nodiscard]] CodecCounters& counters() { return counters_; }
  [[nodiscard]] const CodecCounters& counters() const { return counters_; }

 private:
  [[nodiscard]] Judgement judge(const std::uint8_t* bytes, std::size_t available) const;
  [[nodiscard]] const PingMessage* find(std::uint16_t id) const;

  PingTable table_;
  Framer<kMaxPingFrame_bytes> framer_{kMaxGap_us};
  CodecCounters counters_{};
};

}  // namespace leadline::hal
