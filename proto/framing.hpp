// Frames on a byte link: COBS with a zero byte as delimiter, CRC-32C inside. Bit by bit in proto/SPEC.md.
//
// A frame carries one payload of 0 .. kMaxPayload_bytes bytes. The link may lose, repeat or change any
// byte: the decoder then drops whole frames, counts why, and is in step again at the next delimiter.
// A damaged frame passes for a good one with probability 2^-32. (The Hamming distance of the CRC says
// no more here: one flipped bit in a COBS code changes the bytes on both sides of it.)
//
// All buffers belong to the caller. No heap, no state outside the objects, no clock.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/base/status.hpp"

namespace leadline::proto {

/// Ends every frame, and appears nowhere inside one.
inline constexpr std::uint8_t kDelimiter = 0x00;
/// CRC-32C of the payload, least significant byte first, behind the payload.
inline constexpr std::size_t kCrc_bytes = 4;
/// Longest payload of a frame. Inclusive. A record that is longer is cut by the layer above.
inline constexpr std::size_t kMaxPayload_bytes = 4096;

/// COBS adds one byte, and one more for each full run of 254 bytes without a zero.
constexpr std::size_t cobs_bound_bytes(std::size_t raw_bytes) {
  return raw_bytes + raw_bytes / 254 + 1;
}
/// Largest frame of a payload of that size, both delimiters included.
constexpr std::size_t frame_bound_bytes(std::size_t payload_bytes) {
  return cobs_bound_bytes(payload_bytes + kCrc_bytes) + 2;
}
/// Largest payload whose frame is never longer than `mtu_bytes`; 0 when not even an empty one fits.
constexpr std::size_t max_payload_bytes(std::size_t mtu_bytes) {
  constexpr std::size_t kEmpty_bytes = frame_bound_bytes(0);
  if (mtu_bytes <= kEmpty_bytes) {
    return 0;
  }
  // raw + raw / 254 + 1 <= mtu - 2, solved for raw.
  const std::size_t body = mtu_bytes - 3;
  const std::size_t payload = body - (body + 1) / 255 - kCrc_bytes;
  return payload < kMaxPayload_bytes ? payload : kMaxPayload_bytes;
}

/// Writes one frame (delimiter, COBS of payload and CRC, delimiter) to `out`.
///
/// The leading delimiter ends whatever half frame noise or a reset left on the link, so that it does
/// not take this frame with it; an empty frame between two delimiters is silence, not an error.
/// `payload` may be null when `payload_bytes` is 0; it must not overlap `out`.
///
/// O(payload_bytes). Reentrant. Returns the number of bytes written, or
/// * kOutOfRange: payload_bytes > kMaxPayload_bytes; nothing written
/// * kFull: out_capacity_bytes < frame_bound_bytes(payload_bytes); nothing written
[[nodiscard]] base::Result<std::size_t> encode_frame(const std::uint8_t* payload,
                                                     std::size_t payload_bytes, std::uint8_t* out,
                                                     std::size_t out_capacity_bytes);

/// What the decoder has seen since it was made. Never decremented; wraps at 2^32.
struct FrameCounters {
  std::uint32_t frames;         ///< delivered
  std::uint32_t bad_crc;        ///< complete, but the CRC does not match
  std::uint32_t bad_code;       ///< a COBS code points behind the delimiter
  std::uint32_t too_short;      ///< fewer bytes than a CRC
  std::uint32_t too_long;       ///< more bytes than the buffer holds
  std::uint32_t dropped_bytes;  ///< encoded bytes of all frames not delivered, delimiters excluded

  /// Frames dropped, for whatever reason.
  [[nodiscard]] std::uint32_t bad_frames() const {
    return bad_crc + bad_code + too_short + too_long;
  }
};

/// A payload inside the decoder's buffer: valid until the next call of feed() or reset().
struct FrameView {
  const std::uint8_t* payload;
  std::size_t payload_bytes;
};

/// Incremental decoder over a buffer of the caller. See FrameDecoderBuffer for one with its own.
///
/// The first bytes fed may start inside a frame: that one ends as an error in one of the counters.
/// Not reentrant: one object per link, fed from one thread.
class FrameDecoder {
 public:
  /// `buffer` takes payload and CRC, decoded: payloads up to buffer_bytes - kCrc_bytes are received,
  /// longer ones are counted as too_long. It must outlive the decoder.
  FrameDecoder(std::uint8_t* buffer, std::size_t buffer_bytes)
      : buffer_(buffer), buffer_bytes_(buffer_bytes) {}

  /// Takes one byte. Returns true when it completed a frame; `frame` is then set, otherwise it is
  /// left alone. O(1), and O(payload) at the byte that ends a frame (its CRC).
  [[nodiscard]] bool feed(std::uint8_t byte, FrameView& frame);

  /// Takes bytes until a frame is complete or they are used up; `consumed_bytes` tells how many were
  /// taken, so that the caller goes on behind them:
  ///   while (size > 0) { if (decoder.feed(data, size, used, frame)) use(frame); data += used; ... }
  [[nodiscard]] bool feed(const std::uint8_t* data, std::size_t size_bytes,
                          std::size_t& consumed_bytes, FrameView& frame);

  /// Forgets the frame under way (link closed and opened again). Counters stay.
  void reset();

  [[nodiscard]] const FrameCounters& counters() const { return counters_; }
  /// Whether the bytes so far end inside a frame.
  [[nodiscard]] bool mid_frame() const { return encoded_bytes_ != 0; }

 private:
  enum class Fault : std::uint8_t { kNone, kTooLong };

  [[nodiscard]] bool finish(FrameView& frame);
  void append(std::uint8_t byte);

  std::uint8_t* buffer_;
  std::size_t buffer_bytes_;
  std::size_t size_bytes_ = 0;        ///< decoded bytes of the frame under way
  std::uint32_t encoded_bytes_ = 0;   ///< encoded bytes of the frame under way
  std::uint8_t block_remaining_ = 0;  ///< bytes up to the next code
  bool zero_pending_ = false;  ///< the block under way ends with a zero, unless it is the last
  Fault fault_ = Fault::kNone;
  FrameCounters counters_{};
};

/// A FrameDecoder that owns room for the longest payload of the protocol. Neither copied nor moved:
/// the decoder points into the object.
template <std::size_t kPayloadCapacity_bytes = kMaxPayload_bytes>
class FrameDecoderBuffer {
  static_assert(kPayloadCapacity_bytes <= kMaxPayload_bytes, "no frame is longer");

 public:
  FrameDecoderBuffer() : decoder_(storage_.data(), storage_.size()) {}
  FrameDecoderBuffer(const FrameDecoderBuffer&) = delete;
  FrameDecoderBuffer& operator=(const FrameDecoderBuffer&) = delete;

  [[nodiscard]] FrameDecoder& decoder() { return decoder_; }
  [[nodiscard]] const FrameDecoder& decoder() const { return decoder_; }

 private:
  std::array<std::uint8_t, kPayloadCapacity_bytes + kCrc_bytes> storage_{};
  FrameDecoder decoder_;
};

}  // namespace leadline::proto
