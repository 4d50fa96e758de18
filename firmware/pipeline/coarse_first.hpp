// Which coarse cells (proto/coarse.hpp) the link was told, and the next coarse tile to tell.
#pragma once

#include <array>
#include <cstdint>

#include "firmware/pipeline/link_map.hpp"
#include "model/capacity.hpp"
#include "model/model.hpp"
#include "proto/coarse.hpp"
#include "proto/tile_coder.hpp"

namespace leadline::firmware {

/// Three bytes a tile, and one coarse tile. Static storage, not thread-safe.
class CoarseFirst {
 public:
  CoarseFirst() = default;
  CoarseFirst(const CoarseFirst&) = delete;
  CoarseFirst& operator=(const CoarseFirst&) = delete;

  /// Nothing was told. O(tiles).
  void reset(model::TileId tile_count);
  /// Nothing was told of this tile: who listens may be another.
  void forget(model::TileId tile) { told_[tile] = times_[tile] = 0; }
  /// Whether all coarse cells of a tile were told, as far as anything was known there at the time.
  [[nodiscard]] bool told(model::TileId tile) const { return told_[tile] == kAll; }

  /// Begins the coarse tile over `tile`, empty.
  void begin(const model::Grid& grid, model::TileId tile);
  [[nodiscard]] std::uint32_t tile() const { return tile_; }
  /// The i-th tile of the map under a coarse tile, i < 16; false: the grid ends before.
  [[nodiscard]] static bool tile_under(const model::Grid& grid, std::uint32_t coarse_tile, int i,
                                       model::TileId& tile);
  /// Puts what was not told of such a tile into it. O(tile).
  void add(const model::Model& model, model::TileId tile);
  /// What there is to tell, valid until the next add(); `changed` may be empty. O(tile).
  [[nodiscard]] proto::TileUpdate update(std::uint32_t generation) {
    coarse_.code(cells_.data());
    return {tile_, generation, cells_.data(), coarse_.known()};
  }
  /// `taken` of update() is in the downlink.
  void sent(const model::Grid& grid, const proto::CellMask& taken);
  /// A frame with these cells of a coarse tile was lost: they were not told, unless they were often enough.
  void lose(const model::Grid& grid, std::uint32_t coarse_tile, const proto::CellMask& cells);

 private:
  static constexpr std::uint16_t kAll = UINT16_MAX;
  /// Whoever does not understand coarse cells never says that they came: this many times at most.
  static constexpr std::uint8_t kMostTimes = 3;
  static_assert(proto::kCoarseOfTile_cells == 16, "a bit for each");

  std::array<std::uint16_t, model::kTileCapacity> told_{};
  std::array<std::uint8_t, model::kTileCapacity> times_{};  ///< that cells of it were told
  std::uint32_t tile_ = 0;                                  ///< coarse tile
  proto::CoarseTile coarse_{};
  TileCells cells_{};  ///< coarse_, coded
};

}  // namespace leadline::firmware
