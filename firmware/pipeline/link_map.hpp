// What the link was told: every column's coded cell as last queued. The difference to what the model says
// now is what remains to be sent.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/capacity.hpp"
#include "model/model.hpp"
#include "proto/cell.hpp"
#include "proto/tile_coder.hpp"

namespace leadline::firmware {

static_assert(proto::kTileSide_cells == model::kTileCells, "the link's tiles are the model's");
static_assert(proto::kUnknownDepth_q8 == model::kUnknownDepth, "unknown is the same number");

using TileCells = std::array<proto::CodedCell, proto::kTileArea_cells>;

/// What a whole tile usually takes of a frame.
inline constexpr std::size_t kTypicalTile_bytes = 96;

/// 4 bytes a column and 45 a tile. Static storage, not thread-safe.
class LinkMap {
 public:
  LinkMap() = default;
  LinkMap(const LinkMap&) = delete;
  LinkMap& operator=(const LinkMap&) = delete;

  /// All unknown, nothing forced. O(tiles).
  void reset(model::TileId tile_count);
  /// The 256 cells as last queued, north-major.
  [[nodiscard]] const proto::CodedCell* cells(model::TileId tile) const {
    return &cells_[static_cast<std::size_t>(tile) * proto::kTileArea_cells];
  }
  /// What they would be by the model's present results: coded, keeping the value that the link has where it
  /// still says the same (proto::code_cell_near). O(tile).
  void present(const model::Model& model, model::TileId tile, TileCells& present) const;
  /// Cells to send: those that differ from `present`, and those of a resend that are still owed.
  [[nodiscard]] proto::CellMask owed(model::TileId tile, const TileCells& present) const;
  /// All cells of the tile are owed, changed or not; what became of its earlier frames does not matter any
  /// more.
  void force(model::TileId tile);
  /// Changes with force(), modulo 256: a frame's fate counts while it is what it was when the frame left.
  [[nodiscard]] std::uint8_t epoch(model::TileId tile) const { return epochs_[tile]; }
  /// `taken` cells of `present` are in the downlink. Returns how many of them had changed.
  int sent(model::TileId tile, const TileCells& present, const proto::CellMask& taken);
  /// Changes with the told cells of the tile, modulo 256.
  [[nodiscard]] std::uint8_t version(model::TileId tile) const { return versions_[tile]; }
  /// A frame that sent() spoke of is noted to be under way; is so no more; was lost (its cells are owed again).
  void note_under_way(model::TileId tile) { ++under_way_[tile]; }
  void confirm(model::TileId tile, std::uint8_t epoch);
  /// These cells came: whatever was lost of them later, they are owed no more. False when they are old.
  bool came(model::TileId tile, std::uint8_t epoch, std::uint8_t version,
            const proto::CellMask& cells);
  void lose(model::TileId tile, std::uint8_t epoch, const proto::CellMask& cells);
  /// Nobody will say what became of it: the whole tile is owed once somebody reports again (owe_missed).
  void give_up(model::TileId tile, std::uint8_t epoch);
  /// Whether frames of the tile are under way.
  [[nodiscard]] bool under_way(model::TileId tile) const { return under_way_[tile] != 0; }
  /// Whether who listens knows nothing of the tile: no cell of it was told, or all of it is owed again.
  [[nodiscard]] bool blank(model::TileId tile) const;
  /// Whether the tile had been given up: it is owed now.
  [[nodiscard]] bool owe_missed(model::TileId tile);
  /// hash32 of the tile as last queued.
  [[nodiscard]] std::uint32_t hash32(model::TileId tile) const { return hash32_[tile]; }
  /// proto/cell.hpp's hash over all tiles. O(grid).
  [[nodiscard]] std::uint64_t hash() const;
  /// Tiles with a known cell.
  [[nodiscard]] std::uint32_t known_tiles() const { return known_tiles_; }

 private:
  std::array<proto::CodedCell, model::kColumnCapacity> cells_{};
  std::array<proto::CellMask, model::kTileCapacity> forced_{};
  std::array<std::uint32_t, model::kTileCapacity> hash32_{};
  std::array<std::uint16_t, model::kTileCapacity> under_way_{};  ///< frames
  std::array<std::uint8_t, model::kTileCapacity> epochs_{};
  std::array<std::uint8_t, model::kTileCapacity> versions_{};
  std::array<bool, model::kTileCapacity> missed_{};
  std::array<std::uint16_t, model::kTileCapacity> known_cells_{};
  model::TileId tile_count_ = 0;
  std::uint32_t known_tiles_ = 0;
};

}  // namespace leadline::firmware
