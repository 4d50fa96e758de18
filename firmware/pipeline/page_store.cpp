#include "firmware/pipeline/page_store.hpp"

#include <cstring>

#include "model/base/crc32c.hpp"

namespace leadline::firmware {
namespace {

constexpr std::uint32_t kMagic = 0x47504C4CU;  // "LLPG", little-endian
constexpr std::uint32_t kVersion = 1;
constexpr std::uint32_t kPiece_bytes = 512;
// No device lives that long: a header that says more is none of ours, and writes behind it would begin anew at 0.
constexpr std::uint64_t kMostSequence = UINT64_MAX / 2;

std::uint32_t smaller(std::uint32_t a, std::uint32_t b) { return a < b ? a : b; }

}  // namespace

// As it lies on the medium; all targets are little-endian.
struct PageStore::Header {
  std::uint32_t magic;
  std::uint32_t version;
  std::uint32_t layout;
  std::uint32_t tile;
  std::uint32_t generation;
  std::uint32_t payload_bytes;
  std::uint64_t sequence;
  std::uint32_t payload_crc;
  std::uint32_t reserved[2];
  std::uint32_t header_crc;  // of all before it
};

bool PageStore::read_header(std::uint32_t slot, Header& header) const {
  static_assert(sizeof(Header) == kPageHeader_bytes, "as documented");
  static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "headers lie as memory has them");
  if (!device_.read(device_.context, slot, 0, &header, kPageHeader_bytes)) {
    return false;
  }
  return header.magic == kMagic &&
         base::crc32c(&header, kPageHeader_bytes - sizeof header.header_crc) == header.header_crc;
}

bool PageStore::payload_whole(std::uint32_t slot, const Header& header) const {
  std::uint8_t piece[kPiece_bytes];
  std::uint32_t crc = 0;
  for (std::uint32_t at = 0; at < payload_bytes_; at += kPiece_bytes) {
    const std::uint32_t size = smaller(kPiece_bytes, payload_bytes_ - at);
    if (!device_.read(device_.context, slot, kPageHeader_bytes + at, piece, size)) {
      return false;
    }
    crc = base::crc32c(piece, size, crc);
  }
  return crc == header.payload_crc;
}

base::Status PageStore::mount(const PageDevice& device, std::uint32_t layout,
                              std::uint32_t tile_count, std::uint32_t payload_bytes) {
  tile_count_ = 0;
  if (tile_count == 0 || tile_count > model::kTileCapacity || payload_bytes == 0 ||
      device.slot_bytes < kPageHeader_bytes ||
      device.slot_bytes - kPageHeader_bytes < payload_bytes) {
    return base::Status::kOutOfRange;
  }
  if (device.slot_count < tile_count + kSpareSlots || device.slot_count > kSlotCapacity) {
    return base::Status::kOverCapacity;
  }
  device_ = device;
  layout_ = layout;
  tile_count_ = tile_count;
  payload_bytes_ = payload_bytes;
  sequence_ = 0;
  cursor_ = 0;
  counters_ = PageStoreCounters{};
  slots_.fill(kNoSlot);
  generations_.fill(0);
  sequences_.fill(0);
  taken_.fill(false);
  for (std::uint32_t slot = 0; slot < device_.slot_count; ++slot) {
    Header header{};
    if (!read_header(slot, header)) {
      // Never written, or its header was cut: a magic number alone says that something began.
      counters_.slots_damaged += header.magic == kMagic ? 1U : 0U;
      continue;
    }
    if (header.sequence > kMostSequence) {
      ++counters_.slots_foreign;
      continue;
    }
    // Also of pages that do not count: the next write is after all of them.
    sequence_ = header.sequence > sequence_ ? header.sequence : sequence_;
    if (header.version != kVersion || header.layout != layout_ || header.tile >= tile_count_ ||
        header.payload_bytes != payload_bytes_ || header.generation == 0) {
      ++counters_.slots_foreign;
      continue;
    }
    if (header.sequence <= sequences_[header.tile]) {
      continue;
    }
    if (!payload_whole(slot, header)) {
      ++counters_.slots_damaged;
      continue;
    }
    if (slots_[header.tile] != kNoSlot) {
      taken_[slots_[header.tile]] = false;
    }
    slots_[header.tile] = slot;
    generations_[header.tile] = header.generation;
    sequences_[header.tile] = header.sequence;
    taken_[slot] = true;
  }
  return base::Status::kOk;
}

bool PageStore::find_free(std::uint32_t& slot) {
  for (std::uint32_t step = 0; step < device_.slot_count; ++step) {
    slot = cursor_;
    cursor_ = cursor_ + 1 < device_.slot_count ? cursor_ + 1 : 0;
    if (!taken_[slot]) {
      return true;
    }
  }
  return false;
}

bool PageStore::write(model::TileId tile, std::uint32_t generation, const void* payload) {
  std::uint32_t slot = 0;
  if (tile >= tile_count_ || generation == 0 || !find_free(slot)) {
    return false;
  }
  // Counted whatever becomes of it: a failed write may yet stand whole on the medium.
  ++sequence_;
  Header header{};
  header.magic = kMagic;
  header.version = kVersion;
  header.layout = layout_;
  header.tile = tile;
  header.generation = generation;
  header.payload_bytes = payload_bytes_;
  header.sequence = sequence_;
  header.payload_crc = base::crc32c(payload, payload_bytes_);
  header.header_crc = base::crc32c(&header, kPageHeader_bytes - sizeof header.header_crc);
  const bool written =
      device_.erase(device_.context, slot) &&
      device_.program(device_.context, slot, kPageHeader_bytes, payload, payload_bytes_) &&
      device_.program(device_.context, slot, 0, &header, kPageHeader_bytes) &&
      device_.sync(device_.context);
  if (!written) {
    ++counters_.write_failures;
    return false;
  }
  ++counters_.pages_written;
  if (slots_[tile] != kNoSlot) {
    taken_[slots_[tile]] = false;
  }
  slots_[tile] = slot;
  generations_[tile] = generation;
  sequences_[tile] = sequence_;
  taken_[slot] = true;
  return true;
}

bool PageStore::read(model::TileId tile, void* payload) {
  if (tile >= tile_count_ || slots_[tile] == kNoSlot) {
    return false;
  }
  const std::uint32_t slot = slots_[tile];
  Header header{};
  // The whole header again: the medium may have changed since.
  const bool right =
      read_header(slot, header) && header.tile == tile && header.sequence == sequences_[tile] &&
      device_.read(device_.context, slot, kPageHeader_bytes, payload, payload_bytes_) &&
      base::crc32c(payload, payload_bytes_) == header.payload_crc;
  counters_.pages_read += right ? 1U : 0U;
  counters_.read_failures += right ? 0U : 1U;
  return right;
}

}  // namespace leadline::firmware
