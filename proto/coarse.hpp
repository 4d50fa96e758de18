// The coarse picture of a map: a sixteenth of its cells, for whoever would have to wait long for them all. Normative:
// proto/SPEC.md, "Coarse delta"; why so in DESIGN.md.
//
// A coarse cell stands for 4 x 4 cells, a coarse tile of 16 x 16 coarse cells for 4 x 4 tiles. It is never part of the
// map: no hash covers it, nobody owes or stores it.
#pragma once

#include <cstdint>

#include "proto/cell.hpp"
#include "proto/tile_coder.hpp"

namespace leadline::proto {

/// Cells of the map along the side of a coarse cell, and tiles along the side of a coarse tile.
inline constexpr int kCoarseStep = 4;
/// Coarse cells of one tile, bit 4 row + column of a mask.
inline constexpr int kCoarseOfTile_cells =
    (kTileSide_cells / kCoarseStep) * (kTileSide_cells / kCoarseStep);

/// Coarse tiles along an axis of `size_cells` cells of the map.
[[nodiscard]] constexpr std::int32_t coarse_tiles(std::int32_t size_cells) {
  constexpr std::int32_t kSide = kCoarseStep * kTileSide_cells;
  return (size_cells + kSide - 1) / kSide;
}

/// Where the coarse cells of a tile of the map lie.
struct CoarsePlace {
  std::uint32_t tile;  ///< coarse tile
  int first_cell;      ///< in it, of the tile's 4 x 4 coarse cells; rows are kTileSide_cells apart

  /// The coarse cell `index` (0 .. kCoarseOfTile_cells - 1, north-major) of the tile.
  [[nodiscard]] constexpr int cell(int index) const {
    return first_cell + index / kCoarseStep * kTileSide_cells + index % kCoarseStep;
  }
};
/// `east_cells`: of the map, > 0; `tile` is one of its tiles. O(1).
[[nodiscard]] constexpr CoarsePlace coarse_place(std::uint32_t tile, std::int32_t east_cells) {
  const auto tiles_east =
      static_cast<std::uint32_t>((east_cells + kTileSide_cells - 1) / kTileSide_cells);
  const std::uint32_t row = tile / tiles_east;
  const std::uint32_t column = tile % tiles_east;
  return {
      row / kCoarseStep * static_cast<std::uint32_t>(coarse_tiles(east_cells)) +
          column / kCoarseStep,
      static_cast<int>((row % kCoarseStep * kTileSide_cells + column % kCoarseStep) * kCoarseStep)};
}

/// Sums of up to 16 cells, for one coarse cell.
class CoarseSum {
 public:
  /// A cell's depth (1/256 cell; kUnknownDepth_q8 adds nothing, others are limited as code_cell does it) and sigma
  /// (1/4096 cell).
  void add(std::int32_t depth_q8, std::uint32_t sigma_q12);
  [[nodiscard]] bool known() const { return count_ > 0; }
  /// Of what was added, which must be something. Mean depth, 1/256 cell.
  [[nodiscard]] std::int32_t depth_q8() const;
  /// How far a cell may be off that, squared, 1/2^24 cell^2: mean square of the cells' sigmas and of their spread.
  [[nodiscard]] std::uint64_t variance_q24() const;

 private:
  std::uint64_t depth_sum_q8_ = 0;
  std::uint64_t depth_squares_q16_ = 0;
  std::uint64_t sigma_squares_q24_ = 0;
  std::uint32_t count_ = 0;
};

/// One coarse tile in the making: all its cells have one sigma, the root of their mean variance. What a sigma of its
/// own costs a coarse cell buys nothing (DESIGN.md).
class CoarseTile {
 public:
  /// The coarse cell `cell` (0 .. kTileArea_cells - 1), once; nothing where the sum is of nothing.
  void set(int cell, const CoarseSum& sum);
  [[nodiscard]] const CellMask& known() const { return known_; }
  /// All cells set so far, coded: kTileArea_cells of them. O(tile).
  void code(CodedCell* cells) const;

 private:
  std::int32_t depths_q8_[kTileArea_cells] = {};
  CellMask known_{};
  std::uint64_t variances_q24_ = 0;
};

}  // namespace leadline::proto
