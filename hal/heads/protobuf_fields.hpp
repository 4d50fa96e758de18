// Fields of a protobuf message, one after the other, without a schema and without a copy. Vehicle code.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/wire.hpp"

namespace leadline::hal {

/// A base-128 varint at data[at]; moves `at` behind it. False when it does not end within the data or within
/// ten bytes. O(1).
[[nodiscard]] constexpr bool read_varint(const std::uint8_t* data, std::size_t data_bytes,
                                         std::size_t& at, std::uint64_t& value) {
  value = 0;
  for (std::uint32_t shift = 0; shift < 70 && at < data_bytes; shift += 7) {
    const std::uint8_t byte = data[at];
    ++at;
    value |= static_cast<std::uint64_t>(byte & 0x7FU) << shift;
    if ((byte & 0x80U) == 0) {
      return true;
    }
  }
  return false;
}

enum class ProtobufWire : std::uint8_t { kVarint = 0, kFixed64 = 1, kBytes = 2, kFixed32 = 5 };

struct ProtobufField {
  std::uint32_t number;
  ProtobufWire wire;
  std::uint64_t value;       ///< kVarint, kFixed64, kFixed32
  const std::uint8_t* data;  ///< kBytes
  std::size_t size_bytes;    ///< kBytes
};

/// Walks the fields of one message; nothing is read outside of it.
class ProtobufReader {
 public:
  ProtobufReader(const std::uint8_t* data, std::size_t size_bytes)
      : data_(data), size_bytes_(size_bytes) {}

  /// The next field; false at the end and at the first thing that is no field, see ok().
  [[nodiscard]] bool next(ProtobufField& field) {
    std::uint64_t tag = 0;
    if (at_ == size_bytes_ || !ok_) {
      return false;
    }
    ok_ = read_varint(data_, size_bytes_, at_, tag) && tag >= 8 && tag <= 0xFFFFFFFFU;
    if (!ok_) {
      return false;
    }
    field = ProtobufField{};
    field.number = static_cast<std::uint32_t>(tag >> 3U);
    field.wire = static_cast<ProtobufWire>(tag & 7U);
    ok_ = take_value(field);
    return ok_;
  }
  /// True while everything so far was a field.
  [[nodiscard]] bool ok() const { return ok_; }

 private:
  [[nodiscard]] bool take_value(ProtobufField& field) {
    const std::size_t left = size_bytes_ - at_;
    switch (field.wire) {
      case ProtobufWire::kVarint:
        return read_varint(data_, size_bytes_, at_, field.value);
      case ProtobufWire::kFixed64:
        if (left < 8) {
          return false;
        }
        field.value = read_u64_le(data_ + at_);
        at_ += 8;
        return true;
      case ProtobufWire::kFixed32:
        if (left < 4) {
          return false;
        }
        field.value = read_u32_le(data_ + at_);
        at_ += 4;
        return true;
      case ProtobufWire::kBytes: {
        std::uint64_t size = 0;
        if (!read_varint(data_, size_bytes_, at_, size) || size > size_bytes_ - at_) {
          return false;
        }
        field.data = data_ + at_;
        field.size_bytes = static_cast<std::size_t>(size);
        at_ += field.size_bytes;
        return true;
      }
    }
    return false;  // groups
  }

  const std::uint8_t* data_;
  std::size_t size_bytes_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

}  // namespace leadline::hal
