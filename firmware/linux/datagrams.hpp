// Cuts a run of whole frames (proto/SPEC.md) into datagrams, so that a lost one costs whole frames only.
#pragma once

#include <cstddef>
#include <cstdint>

namespace leadline::host {

/// Size of the next datagram of `frames`: as many whole frames as fit `mtu_bytes`, but at least one.
/// Bytes that end without a delimiter go as they are. O(size).
[[nodiscard]] std::size_t next_datagram_bytes(const std::uint8_t* frames, std::size_t size_bytes,
                                              std::size_t mtu_bytes);

}  // namespace leadline::host
