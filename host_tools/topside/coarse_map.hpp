// Coarse cells that came before the map's own (proto/coarse.hpp): what a topside shows, marked as such, where it knows
// nothing yet. Never part of the map: no hash, export or store has them.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "host_tools/topside/tile_store.hpp"
#include "proto/cell.hpp"
#include "proto/coarse.hpp"
#include "proto/tile_coder.hpp"

namespace leadline::host {

/// Of a tile of the map: 4 x 4 cells, north-major, each for those of 4 x 4 of its own that are not known.
using CoarseCells = std::array<proto::CodedCell, proto::kCoarseOfTile_cells>;

class CoarseMap {
 public:
  /// Takes what a coarse delta says, but for tiles that are whole in `store`, the map beside it. False, and nothing taken: a known
  /// cell lies outside the grid. O(tile log tiles).
  bool apply(const proto::TileDelta& coarse, const TileStore& store);
  /// Something came for a tile of `store`: its coarse cells go once it is whole. O(log tiles).
  void settle(std::uint32_t tile, const TileStore& store);
  void clear();

  /// Of a tile of the map; null: there are none (any more).
  [[nodiscard]] const CoarseCells* tile(std::uint32_t tile) const;
  /// Tiles with coarse cells.
  [[nodiscard]] std::size_t tiles() const { return tiles_.size(); }
  /// Counts tiles to which something came.
  [[nodiscard]] std::uint64_t sequence() const { return sequence_; }
  /// Tiles to which something came after sequence() was `since`, ascending; those that are gone are not among them:
  /// for these the store changed. O(tiles()).
  [[nodiscard]] std::vector<std::uint32_t> changed_since(std::uint64_t since) const;

 private:
  struct Tile {
    std::uint64_t sequence = 0;
    CoarseCells cells{};
  };

  std::map<std::uint32_t, Tile> tiles_;
  std::uint64_t sequence_ = 0;
};

}  // namespace leadline::host
