// VehicleConfig as bytes, for the log: little-endian, packed, with version and CRC. Bit by bit in
// firmware/README.md, "Configuration blob".
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/pipeline/config.hpp"
#include "model/base/status.hpp"

namespace leadline::firmware {

/// Size of the blob of a configuration: that of its version, and what it has beyond.
[[nodiscard]] std::size_t config_blob_bytes(const VehicleConfig& config);
/// At least config_blob_bytes() of any, for buffers.
inline constexpr std::size_t kMaxConfigBlob_bytes = 3072;

/// Bytes written; kFull when `capacity_bytes` is too small, nothing written. Values are not checked:
/// Vehicle::configure() does that. O(bytes).
[[nodiscard]] base::Result<std::size_t> encode_config(const VehicleConfig& config,
                                                      std::uint8_t* out,
                                                      std::size_t capacity_bytes);

/// * kTruncated: shorter than it says; kInvalidArgument: not such a blob, or longer than it says
/// Blobs of version 1 as well, which come back as such with what they lack at 0.
/// * kBadVersion: a newer version; kBadChecksum: bytes changed
/// * kOutOfRange: an enumerator that this program does not know, or optional fields that end with a 0
[[nodiscard]] base::Result<VehicleConfig> decode_config(const std::uint8_t* blob,
                                                        std::size_t size_bytes);

}  // namespace leadline::firmware
