#include "hal/heads/snappy.hpp"

#include "hal/heads/protobuf_fields.hpp"

namespace leadline::hal {

namespace {

/// One element: a literal of `length` bytes that follow, or a copy of bytes `offset` back.
struct Element {
  bool literal;
  std::size_t length;
  std::size_t offset;
};

/// `count` bytes, little-endian.
bool take_le(const std::uint8_t* data, std::size_t data_bytes, std::size_t& at, std::size_t count,
             std::uint32_t& value) {
  if (count > data_bytes - at) {
    return false;
  }
  value = 0;
  for (std::size_t i = 0; i < count; ++i) {
    value |= static_cast<std::uint32_t>(data[at + i]) << (8U * static_cast<std::uint32_t>(i));
  }
  at += count;
  return true;
}

bool take_element(const std::uint8_t* data, std::size_t data_bytes, std::size_t& at,
                  Element& element) {
  const std::uint32_t tag = data[at];
  ++at;
  const std::uint32_t high = tag >> 2U;
  std::uint32_t value = 0;
  element.literal = (tag & 3U) == 0;
  switch (tag & 3U) {
    case 0:
      if (high < 60) {
        element.length = high + 1;
        return true;
      }
      if (!take_le(data, data_bytes, at, high - 59, value) || value == 0xFFFFFFFFU) {
        return false;
      }
      element.length = value + 1U;
      return true;
    case 1:
      element.length = (high & 7U) + 4;
      if (!take_le(data, data_bytes, at, 1, value)) {
        return false;
      }
      element.offset = ((tag >> 5U) << 8U) | value;
      return true;
    default:
      element.length = high + 1;
      if (!take_le(data, data_bytes, at, (tag & 3U) == 2 ? 2 : 4, value)) {
        return false;
      }
      element.offset = value;
      return true;
  }
}

}  // namespace

bool snappy_uncompress(const std::uint8_t* data, std::size_t data_bytes, std::uint8_t* out,
                       std::size_t capacity_bytes, std::size_t& size_bytes) {
  size_bytes = 0;
  std::size_t at = 0;
  std::uint64_t total = 0;
  if (!read_varint(data, data_bytes, at, total) || total > capacity_bytes) {
    return false;
  }
  std::size_t made = 0;
  while (at < data_bytes) {
    Element element{};
    if (!take_element(data, data_bytes, at, element) || element.length > total - made) {
      return false;
    }
    if (element.literal) {
      if (element.length > data_bytes - at) {
        return false;
      }
      for (std::size_t i = 0; i < element.length; ++i) {
        out[made + i] = data[at + i];
      }
      at += element.length;
    } else {
      if (element.offset == 0 || element.offset > made) {
        return false;
      }
      // Forwards, byte by byte: a copy may run into what it writes.
      for (std::size_t i = 0; i < element.length; ++i) {
        out[made + i] = out[made + i - element.offset];
      }
    }
    made += element.length;
  }
  if (made != total) {
    return false;
  }
  size_bytes = made;
  return true;
}

}  // namespace leadline::hal
