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

/// What a parser has seen since it was made. Never decremented; wraps at 2^32. At any time
/// bytes = bytes of delivered frames + skipped_bytes + buffered_bytes().
struct PingCounters {
  std::uint32_t bytes;          ///< fed
  std::uint32_t frames;         ///< delivered
  std::uint32_t skipped_bytes;  ///< belong to no delivered frame
  std::uint32_t bad_checksum;   ///< complete, but the sum does not match
  std::uint32_t bad_length;     ///< the device's message, with a length that it never has
  std::uint32_t unknown_id;     ///< no message of this device
  std::uint32_t gaps;           ///< the line fell silent inside a frame
};

/// A frame inside the parser's buffer: valid until the next call of feed(), next() or reset().
struct PingFrame {
  std::uint16_t id;
  std::uint8_t source;
  std::uint8_t destination;
  const std::uint8_t* payload;
  std::uint16_t payload_bytes;
  base::TimeUs t_arrival_us;  ///< of the frame's last byte
};

/// Finds frames in a stream that may lose, repeat or change any byte. A start that turns out wrong
/// costs one byte: the search goes on behind it over what is already there, so a damaged frame takes
/// no intact one with it. A frame found late keeps the arrival time of its own last byte.
///
/// Use: feed() a byte, then take frames with next() until it returns false.
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

  /// Takes one byte. Arrival times should not go back; where they do, a frame found late may carry a
  /// wrong one, nothing else. When the caller has let the buffer fill up without asking next(), the
  /// oldest byte is skipped.
  void feed(std::uint8_t byte, base::TimeUs t_arrival_us);
  /// The next complete frame, if there is one; `frame` is left alone otherwise.
  [[nodiscard]] bool next(PingFrame& frame);
  /// Forgets what is buffered (port closed and opened again); counted as skipped.
  void reset();

  [[nodiscard]] std::size_t buffered_bytes() const { return end_ - begin_; }
  [[nodiscard]] const PingCounters& counters() const { return counters_; }

 private:
  enum class Verdict : std::uint8_t { kIncomplete, kFrame, kReject };

  [[nodiscard]] Verdict judge();
  [[nodiscard]] const PingMessage* find(std::uint16_t id) const;
  [[nodiscard]] base::TimeUs arrival_of(std::size_t index) const;
  [[nodiscard]] Verdict incomplete(bool paused, bool looked_right);
  void skip(std::size_t count);
  void make_room();

  PingTable table_;
  std::array<std::uint8_t, kMaxPingFrame_bytes> bytes_{};
  std::array<std::uint32_t, kMaxPingFrame_bytes> arrival_low_us_{};  ///< modulo 2^32
  base::TimeUs last_arrival_us_ = 0;
  std::size_t begin_ = 0;  ///< first byte not yet delivered or skipped
  std::size_t end_ = 0;
  std::size_t pause_at_ = 0;  ///< the line was silent before this byte: no frame reaches across
  PingCounters counters_{};
};

}  // namespace leadline::hal
