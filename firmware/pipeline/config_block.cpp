#include "firmware/pipeline/config_block.hpp"

#include <cstring>

#include "model/base/crc32c.hpp"

namespace leadline::firmware {
namespace {

using base::Result;
using base::Status;

constexpr std::uint32_t kMagic = 0x31424C4CU;  // "LLB1" in file order
// What the CRC covers begins here.
constexpr std::size_t kChecked_bytes = 16;
constexpr std::size_t kSize_at = 8;
constexpr std::size_t kCrc_at = 12;
constexpr std::size_t kCycle_at = 16;
constexpr std::size_t kConfigBytes_at = 20;
constexpr std::size_t kTableCount_at = 24;
constexpr std::size_t kTableBytes_at = 32;
constexpr std::size_t kPortBaud_at = kTableBytes_at + 4 * kConfigBlockTables;
constexpr std::size_t kLinkBaud_at = kPortBaud_at + 4 * std::size_t{kMaxPorts};
static_assert(kConfigBlockHeader_bytes == kLinkBaud_at + 8, "README.md states the layout");
static_assert(kConfigBlockHeader_bytes % kConfigBlockAlignment_bytes == 0, "parts are aligned");
static_assert(kMaxTables <= kConfigBlockTables, "every table has a size in the header");

constexpr std::int32_t kShortestCycle_us = 1'000;
constexpr std::int32_t kLongestCycle_us = 1'000'000;

std::uint32_t get_u32(const std::uint8_t* at) {
  std::uint32_t value = 0;
  for (unsigned i = 0; i < 4; ++i) {
    value |= std::uint32_t{at[i]} << (8U * i);
  }
  return value;
}

std::uint32_t get_u16(const std::uint8_t* at) {
  return at[0] | (static_cast<std::uint32_t>(at[1]) << 8U);
}

void put_u32(std::uint8_t* at, std::uint32_t value) {
  for (unsigned i = 0; i < 4; ++i) {
    at[i] = static_cast<std::uint8_t>((value >> (8U * i)) & 0xFFU);
  }
}

constexpr std::size_t padded(std::size_t size_bytes) {
  constexpr std::size_t kMask = kConfigBlockAlignment_bytes - 1;
  return (size_bytes + kMask) & ~kMask;
}

bool cycle_sound(std::int32_t cycle_us) {
  return cycle_us >= kShortestCycle_us && cycle_us <= kLongestCycle_us;
}

// Takes the next part of the block; false when it reaches beyond the end.
bool take_part(std::size_t part_bytes, std::size_t size_bytes, std::size_t& at_bytes,
               std::size_t& next_bytes) {
  at_bytes = next_bytes;
  if (part_bytes > size_bytes - at_bytes || padded(part_bytes) > size_bytes - at_bytes) {
    return false;
  }
  next_bytes = at_bytes + padded(part_bytes);
  return true;
}

Status check_header(const std::uint8_t* bytes, std::size_t capacity_bytes) {
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-reinterpret-cast): the address as a number
  const auto address = reinterpret_cast<std::uintptr_t>(bytes);
  if (bytes == nullptr || address % kConfigBlockAlignment_bytes != 0) {
    return Status::kInvalidArgument;
  }
  if (capacity_bytes < kConfigBlockHeader_bytes) {
    return Status::kTruncated;
  }
  if (get_u32(bytes) != kMagic) {
    return Status::kInvalidArgument;
  }
  if (get_u16(bytes + 4) != kConfigBlockVersion) {
    return Status::kBadVersion;
  }
  const std::size_t size_bytes = get_u32(bytes + kSize_at);
  if (size_bytes < kConfigBlockHeader_bytes || size_bytes > capacity_bytes) {
    return Status::kTruncated;
  }
  const std::uint32_t crc = base::crc32c(bytes + kChecked_bytes, size_bytes - kChecked_bytes);
  return crc == get_u32(bytes + kCrc_at) ? Status::kOk : Status::kBadChecksum;
}

}  // namespace

std::size_t config_block_bytes(const ConfigBlock& block) {
  if (block.table_count > kMaxTables) {
    return 0;
  }
  std::size_t size_bytes = kConfigBlockHeader_bytes + padded(config_blob_bytes(block.config));
  for (std::size_t i = 0; i < block.table_count; ++i) {
    size_bytes += padded(block.tables[i].size_bytes);
  }
  return size_bytes;
}

Result<std::size_t> encode_config_block(const ConfigBlock& block, std::uint8_t* out,
                                        std::size_t capacity_bytes) {
  const std::size_t size_bytes = config_block_bytes(block);
  if (size_bytes == 0 || !cycle_sound(block.cycle_us)) {
    return Status::kOutOfRange;
  }
  if (size_bytes > capacity_bytes) {
    return Status::kFull;
  }
  std::memset(out, 0, size_bytes);
  const Result<std::size_t> blob_bytes =
      encode_config(block.config, out + kConfigBlockHeader_bytes, config_blob_bytes(block.config));
  if (!blob_bytes.ok()) {
    return blob_bytes.status();
  }
  put_u32(out, kMagic);
  out[4] = static_cast<std::uint8_t>(kConfigBlockVersion);
  put_u32(out + kSize_at, static_cast<std::uint32_t>(size_bytes));
  put_u32(out + kCycle_at, static_cast<std::uint32_t>(block.cycle_us));
  put_u32(out + kConfigBytes_at, static_cast<std::uint32_t>(blob_bytes.value()));
  out[kTableCount_at] = static_cast<std::uint8_t>(block.table_count);
  std::size_t at_bytes = kConfigBlockHeader_bytes + padded(blob_bytes.value());
  for (std::size_t i = 0; i < block.table_count; ++i) {
    const TableBlock& table = block.tables[i];
    put_u32(out + kTableBytes_at + 4 * i, static_cast<std::uint32_t>(table.size_bytes));
    std::memcpy(out + at_bytes, table.bytes, table.size_bytes);
    at_bytes += padded(table.size_bytes);
  }
  for (std::size_t i = 0; i < std::size_t{kMaxPorts}; ++i) {
    put_u32(out + kPortBaud_at + 4 * i, block.port_baud[i]);
  }
  put_u32(out + kLinkBaud_at, block.link_baud);
  put_u32(out + kCrc_at, base::crc32c(out + kChecked_bytes, size_bytes - kChecked_bytes));
  return size_bytes;
}

Status read_config_block(const std::uint8_t* bytes, std::size_t capacity_bytes, ConfigBlock& out) {
  const Status status = check_header(bytes, capacity_bytes);
  if (status != Status::kOk) {
    return status;
  }
  const std::size_t size_bytes = get_u32(bytes + kSize_at);
  out.cycle_us = static_cast<std::int32_t>(get_u32(bytes + kCycle_at));
  out.table_count = get_u16(bytes + kTableCount_at);
  if (!cycle_sound(out.cycle_us)) {
    return Status::kOutOfRange;
  }
  if (out.table_count > kMaxTables) {
    return Status::kOverCapacity;
  }
  std::size_t at_bytes = 0;
  std::size_t next_bytes = kConfigBlockHeader_bytes;
  const std::size_t config_bytes = get_u32(bytes + kConfigBytes_at);
  if (!take_part(config_bytes, size_bytes, at_bytes, next_bytes)) {
    return Status::kTruncated;
  }
  const Result<VehicleConfig> config = decode_config(bytes + at_bytes, config_bytes);
  if (!config.ok()) {
    return config.status();
  }
  out.config = config.value();
  for (std::size_t i = 0; i < out.table_count; ++i) {
    const std::size_t table_bytes = get_u32(bytes + kTableBytes_at + 4 * i);
    if (!take_part(table_bytes, size_bytes, at_bytes, next_bytes)) {
      return Status::kTruncated;
    }
    out.tables[i] = {bytes + at_bytes, table_bytes};
  }
  for (std::size_t i = 0; i < std::size_t{kMaxPorts}; ++i) {
    out.port_baud[i] = get_u32(bytes + kPortBaud_at + 4 * i);
  }
  out.link_baud = get_u32(bytes + kLinkBaud_at);
  return Status::kOk;
}

}  // namespace leadline::firmware
