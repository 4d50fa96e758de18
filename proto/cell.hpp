// One cell of the depth map as the link carries it: the unit of tile deltas, tile hashes and of the
// question whether topside and vehicle agree. Rule of coarsening: proto/SPEC.md, "Cells".
//
// A cell says its depth no finer than its own uncertainty deserves: sigma is rounded to half octaves,
// depth to a power of two of 1/256 cell between 0.35 and 0.5 sigma. What that costs is in README.md.
// Everything here is total, O(1) unless stated, and reentrant.
#pragma once

#include <cstddef>
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
inline constexpr std::uint8_t kCellFlagMask = 7;

/// Sigma code k stands for a sigma of 2^(k/2) / 64 cell: 0 = 1/64 cell .. 30 = 512 cells. Values beyond
/// either end take the code at that end.
inline constexpr int kSigmaCodes = 31;
/// Deepest depth_q8 that any cell of the link may carry (the model's tallest column, twice). Inclusive.
inline constexpr std::int32_t kMaxCellDepth_q8 = 2048 * 256;
/// A depth that is not known, in the model's own terms (model/grid.hpp has the same).
inline constexpr std::int32_t kUnknownDepth_q8 = INT32_MIN;

/// Code of the half octave that is nearest to `sigma_q12` (1/4096 cell) in its logarithm.
[[nodiscard]] int sigma_code(std::uint32_t sigma_q12);
/// Depth step of a sigma code, 1/256 cell: 2^(1 + code / 2). `code` in 0 .. kSigmaCodes - 1.
[[nodiscard]] constexpr int depth_step_shift(int code) { return 1 + code / 2; }

/// The cell for a depth (1/256 cell from the top of the grid; clamped to 0 .. kMaxCellDepth_q8), its
/// sigma (1/4096 cell) and flags (those beyond kCellFlagMask are dropped). kUnknownDepth_q8 gives
/// kUnknownCell, whatever the rest.
[[nodiscard]] CodedCell code_cell(std::int32_t depth_q8, std::uint32_t sigma_q12,
                                  std::uint8_t flags);

/// The same, but keeps `previous` while it still says the same: flags equal, sigma code at most one
/// half octave off, and depth within 3/4 of previous' step. So a value that trembles about the border
/// of two steps (it would take the other code at 1/2) is sent once and not every cycle.
[[nodiscard]] CodedCell code_cell_near(CodedCell previous, std::int32_t depth_q8,
                                       std::uint32_t sigma_q12, std::uint8_t flags);

[[nodiscard]] constexpr bool cell_known(CodedCell cell) { return (cell & 31U) != 0; }
/// 0 .. 30; -1 for an unknown cell.
[[nodiscard]] constexpr int cell_sigma_code(CodedCell cell) {
  return static_cast<int>(cell & 31U) - 1;
}
[[nodiscard]] constexpr std::uint8_t cell_flags(CodedCell cell) {
  return static_cast<std::uint8_t>((cell >> 5U) & kCellFlagMask);
}
/// 1/256 cell from the top of the grid, or kUnknownDepth_q8.
[[nodiscard]] constexpr std::int32_t cell_depth_q8(CodedCell cell) {
  return cell_known(cell) ? static_cast<std::int32_t>(cell >> 8U) : kUnknownDepth_q8;
}
/// 1/4096 cell; 0 for an unknown cell.
[[nodiscard]] std::uint32_t cell_sigma_q12(CodedCell cell);

/// Whether a cell that came from outside is one that code_cell can make.
[[nodiscard]] bool cell_valid(CodedCell cell);

// --- Hashes

/// 64-bit FNV-1a, the start and one byte.
inline constexpr std::uint64_t kFnvOffset = 14695981039346656037U;
inline constexpr std::uint64_t kFnvPrime = 1099511628211U;

/// FNV-1a over the 256 cells of a tile, north-major ((n & 15) * 16 + (e & 15)), each as four bytes,
/// least significant first. Cells outside the grid are kUnknownCell. O(tile).
[[nodiscard]] std::uint64_t tile_hash(const CodedCell* cells);
/// 32 bits of it for packets: upper half XOR lower half.
[[nodiscard]] constexpr std::uint32_t fold_hash(std::uint64_t hash) {
  return static_cast<std::uint32_t>(hash >> 32U) ^ static_cast<std::uint32_t>(hash & 0xFFFFFFFFU);
}
/// `cells_hash` of a map: start with kFnvOffset, then add the tile_hash of every tile of the grid in
/// order of tile number (tiles never touched too: their cells are unknown), eight bytes each, least
/// significant first.
[[nodiscard]] std::uint64_t add_tile_hash(std::uint64_t cells_hash, std::uint64_t tile_hash);

}  // namespace leadline::proto
