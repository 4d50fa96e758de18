// One cell of the depth map as the link carries it: the unit of tile deltas, tile hashes and of the
// question whether topside and vehicle agree. Rule of coarsening: proto/SPEC.md, "Cells".
#pragma once

#include <cstdint>

namespace leadline::proto {

/// Cells along the side of a tile, and in a tile. The model's tiles (model/capacity.hpp) are the same.
inline constexpr int kTileSide_cells = 16;
inline constexpr int kTileArea_cells = kTileSide_cells * kTileSide_cells;

/// Depth, uncertainty and flags of one cell in 32 bits; all zero = unknown. Fields by the functions below.
///   bits 0..4   sigma code + 1 (1 .. 31); 0 = unknown
///   bits 5..7   flags (CellFlags)
///   bits 8..31  depth_q8, 1/256 cell from the top of the grid, a multiple of the sigma code's step
using CodedCell = std::uint32_t;
inline constexpr CodedCell kUnknownCell = 0;

enum CellFlags : std::uint8_t {
  kCellMultiSurface = 1U << 0U,
  kCellReserved1 = 1U << 1U,
  kCellReserved2 = 1U << 2U,
};

}  // namespace leadline::proto
