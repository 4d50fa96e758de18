#include "firmware/pipeline/link_map.hpp"

namespace leadline::firmware {

using model::TileId;
using proto::CellMask;
using proto::CodedCell;

namespace {

void add(CellMask& mask, const CellMask& more) {
  for (int row = 0; row < proto::kTileSide_cells; ++row) {
    mask.rows[row] = static_cast<std::uint16_t>(mask.rows[row] | more.rows[row]);
  }
}

void remove(CellMask& mask, const CellMask& fewer) {
  for (int row = 0; row < proto::kTileSide_cells; ++row) {
    mask.rows[row] = static_cast<std::uint16_t>(mask.rows[row] & ~fewer.rows[row]);
  }
}

}  // namespace

void LinkMap::reset(TileId tile_count) {
  tile_count_ = tile_count;
  known_tiles_ = 0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(tile_count) * proto::kTileArea_cells; ++i) {
    cells_[i] = proto::kUnknownCell;
  }
  const std::uint32_t unknown = proto::fold_hash(proto::tile_hash(cells_.data()));
  for (TileId tile = 0; tile < tile_count; ++tile) {
    forced_[tile] = CellMask{};
    hash32_[tile] = unknown;
    under_way_[tile] = 0;
    missed_[tile] = false;
    epochs_[tile] = 0;
    versions_[tile] = 0;
    known_cells_[tile] = 0;
  }
}

void LinkMap::present(const model::Model& model, TileId tile, TileCells& present) const {
  const model::Grid& grid = model.grid();
  const std::int32_t n0 = static_cast<std::int32_t>(tile) / grid.tiles_east() * model::kTileCells;
  const std::int32_t e0 = static_cast<std::int32_t>(tile) % grid.tiles_east() * model::kTileCells;
  const CodedCell* const before = cells(tile);
  for (std::int32_t i = 0; i < proto::kTileArea_cells; ++i) {
    const auto cell = static_cast<std::size_t>(i);
    const std::int32_t n = n0 + i / model::kTileCells;
    const std::int32_t e = e0 + i % model::kTileCells;
    present[cell] = proto::kUnknownCell;
    if (n >= grid.north_cells() || e >= grid.east_cells()) {
      continue;
    }
    const model::ColumnResult& result = model.result(n, e);
    const auto flags =
        static_cast<std::uint8_t>(model.multi_surface(n, e) ? proto::kCellMultiSurface : 0);
    present[cell] = proto::code_cell_near(before[cell], result.depth_q8, result.sigma_q12, flags);
  }
}

CellMask LinkMap::owed(TileId tile, const TileCells& present) const {
  CellMask mask = proto::changed_cells(cells(tile), present.data());
  add(mask, forced_[tile]);
  return mask;
}

void LinkMap::force(TileId tile) {
  for (std::uint16_t& row : forced_[tile].rows) {
    row = UINT16_MAX;
  }
  under_way_[tile] = 0;
  missed_[tile] = false;
  ++epochs_[tile];
}

int LinkMap::sent(TileId tile, const TileCells& present, const CellMask& taken) {
  CodedCell* const told = &cells_[static_cast<std::size_t>(tile) * proto::kTileArea_cells];
  const std::uint16_t known_before = known_cells_[tile];
  std::int32_t known = known_before;
  int changed = 0;
  for (int cell = 0; cell < proto::kTileArea_cells; ++cell) {
    if (!taken.test(cell)) {
      continue;
    }
    const CodedCell value = present[static_cast<std::size_t>(cell)];
    known += (proto::cell_known(value) ? 1 : 0) - (proto::cell_known(told[cell]) ? 1 : 0);
    changed += told[cell] != value ? 1 : 0;
    told[cell] = value;
  }
  remove(forced_[tile], taken);
  versions_[tile] = static_cast<std::uint8_t>(versions_[tile] + (changed > 0 ? 1 : 0));
  hash32_[tile] = proto::fold_hash(proto::tile_hash(told));
  known_cells_[tile] = static_cast<std::uint16_t>(known);
  known_tiles_ += (known != 0 ? 1U : 0U) - (known_before != 0 ? 1U : 0U);
  return changed;
}

void LinkMap::confirm(TileId tile, std::uint8_t epoch) {
  if (epoch != epochs_[tile]) {
    return;
  }
  --under_way_[tile];
}

bool LinkMap::came(TileId tile, std::uint8_t epoch, std::uint8_t version, const CellMask& cells) {
  if (epoch != epochs_[tile] || version != versions_[tile]) {
    return false;
  }
  remove(forced_[tile], cells);
  return true;
}

void LinkMap::lose(TileId tile, std::uint8_t epoch, const CellMask& cells) {
  if (epoch != epochs_[tile]) {
    return;
  }
  --under_way_[tile];
  add(forced_[tile], cells);
}

void LinkMap::give_up(TileId tile, std::uint8_t epoch) {
  if (epoch != epochs_[tile]) {
    return;
  }
  --under_way_[tile];
  missed_[tile] = true;
}

bool LinkMap::blank(TileId tile) const {
  if (known_cells_[tile] == 0) {
    return true;
  }
  std::uint16_t all = UINT16_MAX;
  for (const std::uint16_t row : forced_[tile].rows) {
    all = static_cast<std::uint16_t>(all & row);
  }
  return all == UINT16_MAX;
}

bool LinkMap::owe_missed(TileId tile) {
  const bool missed = missed_[tile];
  if (missed) {
    force(tile);
  }
  return missed;
}

std::uint64_t LinkMap::hash() const {
  std::uint64_t hash = proto::kFnvOffset;
  for (TileId tile = 0; tile < tile_count_; ++tile) {
    hash = proto::add_tile_hash(hash, proto::tile_hash(cells(tile)));
  }
  return hash;
}

}  // namespace leadline::firmware
