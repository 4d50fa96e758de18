#include "host_tools/topside/coarse_map.hpp"

#include <optional>

namespace leadline::host {
namespace {

using proto::kCoarseStep;
using proto::kTileSide_cells;

bool whole(const TileStore& store, std::uint32_t tile) {
  const std::optional<TileView> view = store.tile(tile);
  return view && view->complete;
}

}  // namespace

bool CoarseMap::apply(const proto::TileDelta& coarse, const TileStore& store) {
  const proto::Hello& hello = store.hello();
  const auto across = static_cast<std::uint32_t>(proto::coarse_tiles(hello.size_cells[1]));
  const std::uint32_t row0 = coarse.tile / across * (kCoarseStep * kTileSide_cells);
  const std::uint32_t column0 = coarse.tile % across * (kCoarseStep * kTileSide_cells);
  // By tile of the map.
  const auto tiles_east =
      static_cast<std::uint32_t>((hello.size_cells[1] + kTileSide_cells - 1) / kTileSide_cells);
  std::map<std::uint32_t, CoarseCells> came;
  for (int k = 0; k < proto::kTileArea_cells; ++k) {
    if (!coarse.changed.test(k) || !proto::cell_known(coarse.cells[k])) {
      continue;
    }
    const auto north = row0 + static_cast<std::uint32_t>(k / kTileSide_cells * kCoarseStep);
    const auto east = column0 + static_cast<std::uint32_t>(k % kTileSide_cells * kCoarseStep);
    if (north >= static_cast<std::uint32_t>(hello.size_cells[0]) ||
        east >= static_cast<std::uint32_t>(hello.size_cells[1])) {
      return false;
    }
    const std::uint32_t tile = north / kTileSide_cells * tiles_east + east / kTileSide_cells;
    const std::uint32_t index =
        north % kTileSide_cells / kCoarseStep * kCoarseStep + east % kTileSide_cells / kCoarseStep;
    came[tile][index] = coarse.cells[k];
  }
  for (const auto& [tile, cells] : came) {
    if (whole(store, tile)) {
      continue;
    }
    Tile& kept = tiles_[tile];
    kept.sequence = ++sequence_;
    for (std::size_t index = 0; index < cells.size(); ++index) {
      kept.cells[index] = proto::cell_known(cells[index]) ? cells[index] : kept.cells[index];
    }
  }
  return true;
}

void CoarseMap::settle(std::uint32_t tile, const TileStore& store) {
  const auto found = tiles_.find(tile);
  if (found != tiles_.end() && whole(store, tile)) {
    tiles_.erase(found);
  }
}

void CoarseMap::clear() {
  tiles_.clear();
  sequence_ = 0;
}

const CoarseCells* CoarseMap::tile(std::uint32_t tile) const {
  const auto found = tiles_.find(tile);
  return found == tiles_.end() ? nullptr : &found->second.cells;
}

std::vector<std::uint32_t> CoarseMap::changed_since(std::uint64_t since) const {
  std::vector<std::uint32_t> changed;
  if (since == sequence_) {
    return changed;
  }
  for (const auto& [tile, kept] : tiles_) {
    if (kept.sequence > since) {
      changed.push_back(tile);
    }
  }
  return changed;
}

}  // namespace leadline::host
