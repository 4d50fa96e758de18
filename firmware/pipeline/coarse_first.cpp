#include "firmware/pipeline/coarse_first.hpp"

namespace leadline::firmware {

using model::TileId;
using proto::CoarsePlace;
using proto::kCoarseOfTile_cells;
using proto::kCoarseStep;

namespace {

/// each(tile, bits) for the tiles under a coarse tile of which cells are in the mask, a bit for each.
template <typename Each>
void each_tile(const model::Grid& grid, std::uint32_t coarse_tile, const proto::CellMask& cells,
               Each each) {
  for (int i = 0; i < kCoarseStep * kCoarseStep; ++i) {
    TileId tile = 0;
    if (!CoarseFirst::tile_under(grid, coarse_tile, i, tile)) {
      continue;
    }
    const CoarsePlace place = proto::coarse_place(tile, grid.east_cells());
    std::uint16_t bits = 0;
    for (int index = 0; index < kCoarseOfTile_cells; ++index) {
      const unsigned in = cells.test(place.cell(index)) ? 1U : 0U;
      bits = static_cast<std::uint16_t>(bits | (in << static_cast<unsigned>(index)));
    }
    if (bits != 0) {
      each(tile, bits);
    }
  }
}

}  // namespace

void CoarseFirst::reset(TileId tile_count) {
  for (TileId tile = 0; tile < tile_count; ++tile) {
    forget(tile);
  }
}

void CoarseFirst::begin(const model::Grid& grid, TileId tile) {
  coarse_ = proto::CoarseTile{};
  tile_ = proto::coarse_place(tile, grid.east_cells()).tile;
}

bool CoarseFirst::tile_under(const model::Grid& grid, std::uint32_t coarse_tile, int i,
                             TileId& tile) {
  const auto across = static_cast<std::uint32_t>(proto::coarse_tiles(grid.east_cells()));
  const auto tiles_east = static_cast<std::uint32_t>(grid.tiles_east());
  const auto at = static_cast<std::uint32_t>(i);
  const std::uint32_t row = coarse_tile / across * kCoarseStep + at / kCoarseStep;
  const std::uint32_t column = coarse_tile % across * kCoarseStep + at % kCoarseStep;
  tile = row * tiles_east + column;
  return column < tiles_east && tile < grid.tile_count();
}

void CoarseFirst::add(const model::Model& model, TileId tile) {
  const model::Grid& grid = model.grid();
  const CoarsePlace place = proto::coarse_place(tile, grid.east_cells());
  const std::int32_t n0 = static_cast<std::int32_t>(tile) / grid.tiles_east() * model::kTileCells;
  const std::int32_t e0 = static_cast<std::int32_t>(tile) % grid.tiles_east() * model::kTileCells;
  for (int index = 0; index < kCoarseOfTile_cells; ++index) {
    const auto bit = static_cast<std::uint16_t>(1U << static_cast<unsigned>(index));
    if ((told_[tile] & bit) != 0) {
      continue;
    }
    proto::CoarseSum sum;
    for (int k = 0; k < kCoarseStep * kCoarseStep; ++k) {
      const std::int32_t n = n0 + index / kCoarseStep * kCoarseStep + k / kCoarseStep;
      const std::int32_t e = e0 + index % kCoarseStep * kCoarseStep + k % kCoarseStep;
      if (n < grid.north_cells() && e < grid.east_cells()) {
        const model::ColumnResult& result = model.result(n, e);
        sum.add(result.depth_q8, result.sigma_q12);
      }
    }
    coarse_.set(place.cell(index), sum);
    if (!sum.known()) {
      told_[tile] = static_cast<std::uint16_t>(told_[tile] | bit);
    }
  }
}

void CoarseFirst::sent(const model::Grid& grid, const proto::CellMask& taken) {
  each_tile(grid, tile_, taken, [this](TileId tile, std::uint16_t cells) {
    told_[tile] = static_cast<std::uint16_t>(told_[tile] | cells);
    ++times_[tile];
  });
}

void CoarseFirst::lose(const model::Grid& grid, std::uint32_t coarse_tile,
                       const proto::CellMask& cells) {
  each_tile(grid, coarse_tile, cells, [this](TileId tile, std::uint16_t lost) {
    if (times_[tile] < kMostTimes) {
      told_[tile] = static_cast<std::uint16_t>(told_[tile] & ~lost);
    }
  });
}

}  // namespace leadline::firmware
