// Bytes of devices for tests: vectors as the device notes print them, and damage.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/support/test.hpp"

namespace leadline::test {

using Bytes = std::vector<std::uint8_t>;

/// "42 52 0e" to bytes; anything but hex digits is skipped between the pairs.
inline Bytes from_hex(const std::string& text) {
  Bytes bytes;
  std::string pair;
  for (const char c : text) {
    if (std::string("0123456789abcdefABCDEF").find(c) == std::string::npos) {
      continue;
    }
    pair += c;
    if (pair.size() == 2) {
      bytes.push_back(static_cast<std::uint8_t>(std::stoul(pair, nullptr, 16)));
      pair.clear();
    }
  }
  return bytes;
}

inline Bytes from_text(const std::string& text) { return {text.begin(), text.end()}; }

inline Bytes operator+(Bytes left, const Bytes& right) {
  left.insert(left.end(), right.begin(), right.end());
  return left;
}

inline Bytes without(Bytes bytes, std::size_t position) {
  bytes.erase(bytes.begin() + static_cast<std::ptrdiff_t>(position));
  return bytes;
}

inline Bytes random_bytes(Random& random, std::size_t size) {
  Bytes bytes(size);
  for (auto& byte : bytes) {
    byte = static_cast<std::uint8_t>(random.next());
  }
  return bytes;
}

/// Everything a codec makes of `bytes`, all of which arrive at `t_us`. Spans in the records are dead.
template <typename Record, typename Codec>
std::vector<Record> records_of(Codec& codec, const Bytes& bytes, std::int64_t t_us = 0) {
  std::vector<Record> records;
  Record record{};
  for (const std::uint8_t byte : bytes) {
    if (!codec.feed(byte, t_us, record)) {
      continue;
    }
    records.push_back(record);
    while (codec.next(record)) {
      records.push_back(record);
    }
  }
  return records;
}

}  // namespace leadline::test
