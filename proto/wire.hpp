// Fields of messages as bytes: little-endian integers and varints. Internal to proto.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "model/base/status.hpp"

namespace leadline::proto {

/// Bytes of the longest varint of 32 bits.
inline constexpr std::size_t kMaxVarint_bytes = 5;

/// Writes fields one behind the other. What does not fit is not written and leaves full() true.
class ByteWriter {
 public:
  ByteWriter(std::uint8_t* out, std::size_t capacity_bytes)
      : out_(out), capacity_(capacity_bytes) {}

  void u8(std::uint8_t value) { little_endian(value, 1); }
  void u16(std::uint16_t value) { little_endian(value, 2); }
  void u32(std::uint32_t value) { little_endian(value, 4); }
  void u64(std::uint64_t value) { little_endian(value, 8); }
  void i32(std::int32_t value) { u32(static_cast<std::uint32_t>(value)); }
  void i64(std::int64_t value) { u64(static_cast<std::uint64_t>(value)); }
  /// Seven bits a byte, least significant first; the top bit says that more follow.
  void varint(std::uint32_t value) {
    while (value >= 0x80U) {
      u8(static_cast<std::uint8_t>((value & 0x7FU) | 0x80U));
      value >>= 7U;
    }
    u8(static_cast<std::uint8_t>(value));
  }
  /// Signed: d >= 0 as 2d, d < 0 as -2d - 1.
  void zigzag(std::int32_t value) {
    const auto doubled = static_cast<std::uint32_t>(value) << 1U;
    varint(value < 0 ? ~doubled : doubled);
  }
  void bytes(const void* data, std::size_t size_bytes) {
    if (size_bytes > capacity_ - size_) {
      full_ = true;
      return;
    }
    if (size_bytes > 0) {
      std::memcpy(out_ + size_, data, size_bytes);
    }
    size_ += size_bytes;
  }

  [[nodiscard]] std::size_t size_bytes() const { return size_; }
  [[nodiscard]] bool full() const { return full_; }
  /// What an encoder returns.
  [[nodiscard]] base::Result<std::size_t> result() const {
    if (full_) {
      return base::Status::kFull;
    }
    return size_;
  }

 private:
  void little_endian(std::uint64_t value, std::size_t size_bytes) {
    if (size_bytes > capacity_ - size_) {
      full_ = true;
      return;
    }
    for (std::size_t i = 0; i < size_bytes; ++i) {
      out_[size_ + i] = static_cast<std::uint8_t>((value >> (8U * i)) & 0xFFU);
    }
    size_ += size_bytes;
  }

  std::uint8_t* out_;
  std::size_t capacity_;
  std::size_t size_ = 0;
  bool full_ = false;
};

/// Reads fields one behind the other. Beyond the end it reads zeros and leaves truncated() true; a varint
/// that is no shortest form of 32 bits leaves malformed() true.
class ByteReader {
 public:
  ByteReader(const std::uint8_t* data, std::size_t size_bytes) : data_(data), left_(size_bytes) {}

  std::uint8_t u8() { return static_cast<std::uint8_t>(little_endian(1)); }
  std::uint16_t u16() { return static_cast<std::uint16_t>(little_endian(2)); }
  std::uint32_t u32() { return static_cast<std::uint32_t>(little_endian(4)); }
  std::uint64_t u64() { return little_endian(8); }
  std::int32_t i32() { return static_cast<std::int32_t>(u32()); }
  std::int64_t i64() { return static_cast<std::int64_t>(u64()); }
  std::uint32_t varint() {
    std::uint64_t value = 0;
    for (unsigned i = 0; i < kMaxVarint_bytes; ++i) {
      const std::uint32_t byte = u8();
      value |= std::uint64_t{byte & 0x7FU} << (7U * i);
      if (byte < 0x80U) {
        malformed_ = malformed_ || (byte == 0 && i > 0 && !truncated_) || value > 0xFFFFFFFFU;
        return static_cast<std::uint32_t>(value & 0xFFFFFFFFU);
      }
    }
    malformed_ = true;
    return 0;
  }
  /// The next bytes in place; null when there are fewer.
  std::int32_t zigzag() {
    const std::uint32_t code = varint();
    return static_cast<std::int32_t>((code & 1U) != 0 ? ~(code >> 1U) : code >> 1U);
  }
  const std::uint8_t* bytes(std::size_t size_bytes) {
    if (size_bytes > left_) {
      truncated_ = true;
      left_ = 0;
      return nullptr;
    }
    const std::uint8_t* const at = data_;
    data_ += size_bytes;
    left_ -= size_bytes;
    return at;
  }

  [[nodiscard]] const std::uint8_t* at() const { return data_; }
  [[nodiscard]] std::size_t left_bytes() const { return left_; }
  [[nodiscard]] bool truncated() const { return truncated_; }
  [[nodiscard]] bool malformed() const { return malformed_; }
  /// kOk, kTruncated or kOutOfRange (a malformed varint).
  [[nodiscard]] base::Status status() const {
    if (truncated_) {
      return base::Status::kTruncated;
    }
    return malformed_ ? base::Status::kOutOfRange : base::Status::kOk;
  }

 private:
  std::uint64_t little_endian(std::size_t size_bytes) {
    const std::uint8_t* const at = bytes(size_bytes);
    std::uint64_t value = 0;
    for (std::size_t i = 0; at != nullptr && i < size_bytes; ++i) {
      value |= std::uint64_t{at[i]} << (8U * i);
    }
    return value;
  }

  const std::uint8_t* data_;
  std::size_t left_;
  bool truncated_ = false;
  bool malformed_ = false;
};

}  // namespace leadline::proto
