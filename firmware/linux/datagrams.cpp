#include "firmware/linux/datagrams.hpp"

#include "proto/framing.hpp"

namespace leadline::host {
namespace {

/// One frame with the delimiters around it.
std::size_t frame_bytes(const std::uint8_t* data, std::size_t size_bytes) {
  std::size_t at = 0;
  while (at < size_bytes && data[at] == proto::kDelimiter) {
    at += 1;
  }
  while (at < size_bytes && data[at] != proto::kDelimiter) {
    at += 1;
  }
  return at < size_bytes ? at + 1 : at;
}

}  // namespace

std::size_t next_datagram_bytes(const std::uint8_t* frames, std::size_t size_bytes,
                                std::size_t mtu_bytes) {
  std::size_t taken = 0;
  while (taken < size_bytes) {
    const std::size_t frame = frame_bytes(frames + taken, size_bytes - taken);
    if (taken > 0 && taken + frame > mtu_bytes) {
      break;
    }
    taken += frame;
  }
  return taken;
}

}  // namespace leadline::host
