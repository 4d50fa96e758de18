#include "proto/framing.hpp"

#include "model/base/crc32c.hpp"

namespace leadline::proto {
namespace {

/// A code of 0xFF stands for 254 bytes that no zero follows; any smaller one n for n - 1 bytes and a
/// zero.
constexpr std::uint8_t kFullBlockCode = 0xFF;

/// Writes COBS blocks one byte at a time: the code is put in front when its block is complete.
class CobsWriter {
 public:
  explicit CobsWriter(std::uint8_t* out) : out_(out) {}

  void put(std::uint8_t byte) {
    if (byte == 0) {
      close_block();
      return;
    }
    out_[size_++] = byte;
    ++code_;
    if (code_ == kFullBlockCode) {
      close_block();
    }
  }

  /// Closes the last block. The zero that its code implies is the one which the decoder drops; a full
  /// block implies none, so an empty block behind it would say nothing and is taken back.
  std::size_t finish() {
    if (code_ == 1 && after_full_block_) {
      return code_at_;
    }
    out_[code_at_] = code_;
    return size_;
  }

 private:
  void close_block() {
    out_[code_at_] = code_;
    after_full_block_ = code_ == kFullBlockCode;
    code_at_ = size_++;
    code_ = 1;
  }

  std::uint8_t* out_;
  std::size_t code_at_ = 0;
  std::size_t size_ = 1;
  std::uint8_t code_ = 1;
  bool after_full_block_ = false;
};

constexpr std::uint8_t byte_of(std::uint32_t value, unsigned index) {
  return static_cast<std::uint8_t>((value >> (8U * index)) & 0xFFU);
}

}  // namespace

base::Result<std::size_t> encode_frame(const std::uint8_t* payload, std::size_t payload_bytes,
                                       std::uint8_t* out, std::size_t out_capacity_bytes) {
  if (payload_bytes > kMaxPayload_bytes) {
    return base::Status::kOutOfRange;
  }
  if (out_capacity_bytes < frame_bound_bytes(payload_bytes)) {
    return base::Status::kFull;
  }
  const std::uint32_t crc = base::crc32c(payload, payload_bytes);
  out[0] = kDelimiter;
  CobsWriter writer(out + 1);
  for (std::size_t i = 0; i < payload_bytes; ++i) {
    writer.put(payload[i]);
  }
  for (unsigned i = 0; i < kCrc_bytes; ++i) {
    writer.put(byte_of(crc, i));
  }
  const std::size_t body_bytes = writer.finish();
  out[1 + body_bytes] = kDelimiter;
  return body_bytes + 2;
}

void FrameDecoder::reset() {
  size_bytes_ = 0;
  encoded_bytes_ = 0;
  block_remaining_ = 0;
  zero_pending_ = false;
  fault_ = Fault::kNone;
}

void FrameDecoder::append(std::uint8_t byte) {
  if (size_bytes_ == buffer_bytes_) {
    fault_ = Fault::kTooLong;
    return;
  }
  buffer_[size_bytes_++] = byte;
}

bool FrameDecoder::finish(FrameView& frame) {
  if (encoded_bytes_ == 0) {
    return false;  // two delimiters in a row: an idle link
  }
  bool good = false;
  if (fault_ == Fault::kTooLong) {
    ++counters_.too_long;
  } else if (block_remaining_ != 0) {
    ++counters_.bad_code;
  } else if (size_bytes_ < kCrc_bytes) {
    ++counters_.too_short;
  } else {
    const std::size_t payload_bytes = size_bytes_ - kCrc_bytes;
    std::uint32_t received_crc = 0;
    for (unsigned i = 0; i < kCrc_bytes; ++i) {
      received_crc |= static_cast<std::uint32_t>(buffer_[payload_bytes + i]) << (8U * i);
    }
    good = received_crc == base::crc32c(buffer_, payload_bytes);
    if (good) {
      ++counters_.frames;
      frame = FrameView{buffer_, payload_bytes};
    } else {
      ++counters_.bad_crc;
    }
  }
  if (!good) {
    counters_.dropped_bytes += encoded_bytes_;
  }
  reset();
  return good;
}

bool FrameDecoder::feed(std::uint8_t byte, FrameView& frame) {
  if (byte == kDelimiter) {
    return finish(frame);
  }
  ++encoded_bytes_;
  if (fault_ != Fault::kNone) {
    return false;  // nothing of this frame is of use any more; the delimiter ends it
  }
  if (block_remaining_ != 0) {
    --block_remaining_;
    append(byte);
    return false;
  }
  // A code. The zero that the block before it ended with is known to be data only now.
  if (zero_pending_) {
    append(0);
  }
  block_remaining_ = static_cast<std::uint8_t>(byte - 1U);
  zero_pending_ = byte != kFullBlockCode;
  return false;
}

bool FrameDecoder::feed(const std::uint8_t* data, std::size_t size_bytes,
                        std::size_t& consumed_bytes, FrameView& frame) {
  for (std::size_t i = 0; i < size_bytes; ++i) {
    if (feed(data[i], frame)) {
      consumed_bytes = i + 1;
      return true;
    }
  }
  consumed_bytes = size_bytes;
  return false;
}

}  // namespace leadline::proto
