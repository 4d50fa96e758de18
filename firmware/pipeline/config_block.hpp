// All that a vehicle without files starts from, in one block of bytes: configuration, localization tables,
// the period of the cycle, speeds of the lines. It lies in flash, or is loaded to a fixed address; made on
// the host by `leadline config compile`. Byte for byte in firmware/README.md, "Configuration block".
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/pipeline/config.hpp"
#include "firmware/pipeline/config_codec.hpp"
#include "firmware/pipeline/vehicle.hpp"
#include "model/base/status.hpp"

namespace leadline::firmware {

inline constexpr std::uint16_t kConfigBlockVersion = 1;
/// Room for table sizes in the header of every block, whatever one build's kMaxTables is.
inline constexpr std::size_t kConfigBlockTables = 8;
inline constexpr std::size_t kConfigBlockHeader_bytes = 104;
/// Where parts of a block begin is a multiple of this, and so is the address that a block must have.
inline constexpr std::size_t kConfigBlockAlignment_bytes = 8;

struct ConfigBlock {
  VehicleConfig config;
  std::int32_t cycle_us;  ///< 1000 .. 1'000'000
  std::uint32_t
      port_baud[kMaxPorts];  ///< of the line of each port, bits a second; 0: the board's default
  std::uint32_t link_baud;   ///< the same of the link
  std::size_t table_count;
  TableBlock tables[kMaxTables];  ///< reading: spans into the block
};

/// Size of the block that encode_config_block() makes, 0 when there are over kConfigBlockTables tables.
[[nodiscard]] std::size_t config_block_bytes(const ConfigBlock& block);

/// Bytes written. Values of the configuration are not checked: Vehicle::configure() does that.
/// * kOutOfRange: cycle_us or table_count; kFull: `capacity_bytes` is too small; nothing written
/// O(bytes).
[[nodiscard]] base::Result<std::size_t> encode_config_block(const ConfigBlock& block,
                                                            std::uint8_t* out,
                                                            std::size_t capacity_bytes);

/// Checks and reads the block at `bytes`, in a region of `capacity_bytes` (what is behind the block is not
/// looked at). Tables are checked as bytes only, their values by Vehicle::configure().
/// * kInvalidArgument: no block (wrong magic, or the address is not aligned)
/// * kTruncated: it says that it is longer than the region, or shorter than its parts
/// * kBadVersion: another version of the block or of the configuration
/// * kBadChecksum: bytes changed
/// * kOutOfRange: cycle_us, or an enumerator of the configuration
/// * kOverCapacity: more tables than this build takes
/// `out` is only good after kOk. O(bytes).
[[nodiscard]] base::Status read_config_block(const std::uint8_t* bytes, std::size_t capacity_bytes,
                                             ConfigBlock& out);

}  // namespace leadline::firmware
