// Pages of a map on a block device: fixed slots, each write to a free one, so that the page before stays until
// the new one is safe. After any cut of power a page is the old one or the new one, never a mixture.
//
// A slot holds a header (kPageHeader_bytes) and a payload of fixed size:
//   magic "LLPG", version 1, layout (of the payload: who mounts with another one finds nothing), tile,
//   generation, payload bytes, sequence (of all writes of this device), CRC-32C of the payload, CRC-32C of the header
// Of several whole pages of one tile the one of the highest sequence counts. Nothing is written at mount.
//
// No heap, no clock, no I/O of its own: the device is handed in. Not thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/base/status.hpp"
#include "model/capacity.hpp"
#include "model/grid.hpp"

namespace leadline::firmware {

/// What pages are kept on. Functions return false when the medium failed; what a failed or a cut write leaves
/// in its slot is undefined. Writes may reach the medium in any order until sync() has returned true.
struct PageDevice {
  void* context;
  std::uint32_t slot_count;
  std::uint32_t slot_bytes;
  bool (*read)(void* context, std::uint32_t slot, std::uint32_t offset, void* out,
               std::uint32_t size_bytes);
  /// Before a slot is programmed anew; nothing to do where media are overwritten.
  bool (*erase)(void* context, std::uint32_t slot);
  bool (*program)(void* context, std::uint32_t slot, std::uint32_t offset, const void* data,
                  std::uint32_t size_bytes);
  bool (*sync)(void* context);
};

inline constexpr std::uint32_t kPageHeader_bytes = 48;

/// Slots beyond one per tile that a store needs to write at all; more spread the wear.
inline constexpr std::uint32_t kSpareSlots = 2;

/// Never decremented.
struct PageStoreCounters {
  std::uint32_t pages_written;
  std::uint32_t pages_read;
  std::uint32_t write_failures;  ///< the page before is still the one
  std::uint32_t read_failures;   ///< the medium failed, or what it gave is not what was written
  std::uint32_t slots_damaged;   ///< at mount: begun and not whole
  std::uint32_t slots_foreign;   ///< at mount: whole, of another layout
};

class PageStore {
 public:
  static constexpr std::uint32_t kSlotCapacity = model::kTileCapacity + 256;

  PageStore() = default;
  PageStore(const PageStore&) = delete;
  PageStore& operator=(const PageStore&) = delete;

  /// Reads every slot and finds the pages. O(device).
  /// * kOutOfRange: a tile count beyond the capacity, slots too small for the payload
  /// * kOverCapacity: too few slots for the tiles, or more than kSlotCapacity
  [[nodiscard]] base::Status mount(const PageDevice& device, std::uint32_t layout,
                                   std::uint32_t tile_count, std::uint32_t payload_bytes);

  /// Generation of the tile's page; 0 when it has none (pages have generations from 1 on). O(1).
  [[nodiscard]] std::uint32_t generation(model::TileId tile) const { return generations_[tile]; }
  [[nodiscard]] std::uint32_t tile_count() const { return tile_count_; }

  /// Writes payload_bytes as the tile's page and brings them to the medium. False: the medium failed, the page
  /// before is still there. O(payload + slots).
  bool write(model::TileId tile, std::uint32_t generation, const void* payload);
  /// Reads the tile's page. False: it has none, or the medium does not give it back. O(payload).
  bool read(model::TileId tile, void* payload);

  [[nodiscard]] const PageStoreCounters& counters() const { return counters_; }

 private:
  struct Header;
  [[nodiscard]] bool read_header(std::uint32_t slot, Header& header) const;
  [[nodiscard]] bool payload_whole(std::uint32_t slot, const Header& header) const;
  [[nodiscard]] bool find_free(std::uint32_t& slot);

  static constexpr std::uint32_t kNoSlot = UINT32_MAX;

  PageDevice device_{};
  std::uint32_t layout_ = 0;
  std::uint32_t tile_count_ = 0;
  std::uint32_t payload_bytes_ = 0;
  std::uint64_t sequence_ = 0;  ///< of the last write
  std::uint32_t cursor_ = 0;    ///< where the search for a free slot goes on
  std::array<std::uint32_t, model::kTileCapacity> slots_{};
  std::array<std::uint32_t, model::kTileCapacity> generations_{};
  std::array<std::uint64_t, model::kTileCapacity> sequences_{};
  std::array<bool, kSlotCapacity> taken_{};
  PageStoreCounters counters_{};
};

}  // namespace leadline::firmware
