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

/// 4 bytes a column and 36 a tile. Static storage, not thread-safe.
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
  /// All cells of the tile are owed, changed or not.
  void force(model::TileId tile);
  /// `taken` cells of `present` are in the downlink. Returns how many of them had changed.
  int sent(model::TileId tile, const TileCells& present, const proto::CellMask& taken);
  /// Counts the deltas of the tile: the number of the next.
  [[nodiscard]] std::uint32_t next_generation(model::TileId tile) const {
    return generations_[tile] + 1;
  }
  /// proto/cell.hpp's hash over all tiles. O(grid).
  [[nodiscard]] std::uint64_t hash() const;
  /// Tiles with a known cell.
  [[nodiscard]] std::uint32_t known_tiles() const { return known_tiles_; }

 private:
  std::array<proto::CodedCell, model::kColumnCapacity> cells_{};
  std::array<proto::CellMask, model::kTileCapacity> forced_{};
  std::array<std::uint32_t, model::kTileCapacity> generations_{};
  std::array<std::uint16_t, model::kTileCapacity> known_cells_{};
  model::TileId tile_count_ = 0;
  std::uint32_t known_tiles_ = 0;
};

}  // namespace leadline::firmware
