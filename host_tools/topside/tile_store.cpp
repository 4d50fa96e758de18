#include "host_tools/topside/tile_store.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

namespace leadline::host {
namespace {

std::int32_t tiles_of(std::int32_t cells) {
  return (cells + proto::kTileSide_cells - 1) / proto::kTileSide_cells;
}

/// Generations count modulo 2^32: the half ahead of `b` is newer.
bool newer(std::uint32_t a, std::uint32_t b) { return a != b && a - b < 0x80000000U; }

/// How far behind the first word about a tile its cells of no word are.
constexpr std::uint32_t kLongAgo = 0x40000000U;

}  // namespace

TileStore::TileStore(const proto::Hello& hello)
    : hello_(hello),
      tag_(proto::survey_tag(hello.survey_id, hello.session)),
      tiles_east_(tiles_of(hello.size_cells[1])),
      tiles_(static_cast<std::size_t>(tiles_of(hello.size_cells[0])) *
             static_cast<std::size_t>(tiles_east_)) {}

bool TileStore::fits(std::uint32_t tile, const proto::CodedCell* cells,
                     const proto::CellMask& taken) const {
  if (tile >= tiles_.size()) {
    return false;
  }
  const auto number = static_cast<std::int32_t>(tile);
  const std::int32_t rows = hello_.size_cells[0] - number / tiles_east_ * proto::kTileSide_cells;
  const std::int32_t columns = hello_.size_cells[1] - number % tiles_east_ * proto::kTileSide_cells;
  for (int k = 0; k < proto::kTileArea_cells; ++k) {
    const bool inside = (k >> 4) < rows && (k & 15) < columns;
    if (!inside && taken.test(k) && proto::cell_known(cells[k])) {
      return false;
    }
  }
  return true;
}

// To the end of the order of changes where it is read first.
void TileStore::note_change(std::uint32_t id) {
  Tile& tile = *tiles_[id];
  sequence_ += 1;
  tile.sequence = sequence_;
  if (latest_ == id) {
    return;
  }
  if (tile.later != kNoTile) {
    tiles_[tile.later]->earlier = tile.earlier;
  }
  if (tile.earlier != kNoTile) {
    tiles_[tile.earlier]->later = tile.later;
  }
  tile.later = kNoTile;
  tile.earlier = latest_;
  if (latest_ != kNoTile) {
    tiles_[latest_]->later = id;
  }
  latest_ = id;
}

std::vector<std::uint32_t> TileStore::changed_since(std::uint64_t since) const {
  std::vector<std::uint32_t> changed;
  for (std::uint32_t id = latest_; id != kNoTile && tiles_[id]->sequence > since;
       id = tiles_[id]->earlier) {
    changed.push_back(id);
  }
  return changed;
}

std::optional<TileView> TileStore::tile(std::uint32_t tile) const {
  if (tile >= tiles_.size() || !tiles_[tile]) {
    return std::nullopt;
  }
  const Tile& found = *tiles_[tile];
  return TileView{found.generation, found.hash32, found.complete, found.sequence, found.cells};
}

bool TileStore::restore(const StoredTile& stored) {
  proto::CellMask all{};
  std::fill(std::begin(all.rows), std::end(all.rows), UINT16_MAX);
  const bool sound = std::all_of(std::begin(stored.cells), std::end(stored.cells),
                                 [](proto::CodedCell cell) { return proto::cell_valid(cell); });
  if (!sound || !fits(stored.tile, stored.cells, all) || tiles_[stored.tile]) {
    return false;
  }
  auto tile = std::make_unique<Tile>();
  tile->generation = stored.generation;
  tile->hash32 = stored.hash32;
  std::copy(std::begin(stored.cells), std::end(stored.cells), std::begin(tile->cells));
  tile->complete = proto::fold_hash(proto::tile_hash(tile->cells)) == tile->hash32;
  // Of a tile that misses something nobody knows which cells are old: any word about them counts.
  std::fill(std::begin(tile->cell_generation), std::end(tile->cell_generation),
            tile->complete ? stored.generation : stored.generation - kLongAgo);
  known_cells_ += static_cast<std::uint64_t>(
      std::count_if(std::begin(stored.cells), std::end(stored.cells),
                    [](proto::CodedCell cell) { return proto::cell_known(cell); }));
  known_tiles_ += 1;
  tiles_[stored.tile] = std::move(tile);
  note_change(stored.tile);
  return true;
}

DeltaOutcome TileStore::apply(const proto::TileDelta& delta) {
  DeltaOutcome outcome;
  if (!fits(delta.tile, delta.cells, delta.changed)) {
    outcome.outside = true;
    return outcome;
  }
  std::unique_ptr<Tile>& place = tiles_[delta.tile];
  const bool first = !place;
  if (first) {
    place = std::make_unique<Tile>();
    known_tiles_ += 1;
  }
  Tile& tile = *place;
  if (first) {
    tile.generation = delta.generation - kLongAgo;
    std::fill(std::begin(tile.cell_generation), std::end(tile.cell_generation), tile.generation);
  }
  for (int k = 0; k < proto::kTileArea_cells; ++k) {
    if (!delta.changed.test(k)) {
      continue;
    }
    proto::CodedCell& cell = tile.cells[k];
    if (newer(tile.cell_generation[k], delta.generation) || cell == delta.cells[k]) {
      outcome.repeated_cells += 1;
    } else {
      outcome.new_cells += 1;
      known_cells_ += proto::cell_known(delta.cells[k]) ? 1U : 0U;
      known_cells_ -= proto::cell_known(cell) ? 1U : 0U;
      cell = delta.cells[k];
    }
    if (newer(delta.generation, tile.cell_generation[k])) {
      tile.cell_generation[k] = delta.generation;
    }
  }
  const bool news = newer(delta.generation, tile.generation);
  if (news) {
    tile.generation = delta.generation;
    tile.hash32 = delta.hash32;
  }
  const bool was_complete = tile.complete;
  tile.complete = proto::fold_hash(proto::tile_hash(tile.cells)) == tile.hash32;
  if (first || news || outcome.new_cells > 0 || tile.complete != was_complete) {
    note_change(delta.tile);
  }
  return outcome;
}

proto::CodedCell TileStore::cell(std::int32_t north, std::int32_t east) const {
  const auto tile = static_cast<std::size_t>((north >> 4) * tiles_east_ + (east >> 4));
  const int index = (north & 15) * proto::kTileSide_cells + (east & 15);
  return tiles_[tile] ? tiles_[tile]->cells[index] : proto::kUnknownCell;
}

void TileStore::take_place(const proto::Hello& later) {
  hello_.has_geodetic_origin = later.has_geodetic_origin;
  hello_.latitude_e9deg = later.latitude_e9deg;
  hello_.longitude_e9deg = later.longitude_e9deg;
  hello_.epsg = later.epsg;
}

std::uint64_t TileStore::grid_cells() const {
  return static_cast<std::uint64_t>(hello_.size_cells[0]) *
         static_cast<std::uint64_t>(hello_.size_cells[1]);
}

std::uint64_t TileStore::cells_hash() const {
  const Tile nothing;
  const std::uint64_t unknown = proto::tile_hash(nothing.cells);
  std::uint64_t hash = proto::kFnvOffset;
  for (const std::unique_ptr<Tile>& tile : tiles_) {
    hash = proto::add_tile_hash(hash, tile ? proto::tile_hash(tile->cells) : unknown);
  }
  return hash;
}

std::uint32_t TileStore::hash32(std::uint32_t tile) const {
  static const std::uint32_t unknown = proto::fold_hash(proto::tile_hash(Tile().cells));
  return tiles_[tile] ? proto::fold_hash(proto::tile_hash(tiles_[tile]->cells)) : unknown;
}

std::uint32_t TileStore::tiles_incomplete() const {
  std::uint32_t count = 0;
  for (const std::unique_ptr<Tile>& tile : tiles_) {
    count += tile && !tile->complete ? 1U : 0U;
  }
  return count;
}

template <typename Wanted>
proto::ResendRequest TileStore::request(std::uint32_t after, Wanted wanted) const {
  proto::ResendRequest request{};
  request.survey_tag = tag_;
  for (std::uint32_t id = after; id < tile_count(); ++id) {
    if (!wanted(tiles_[id].get())) {
      continue;
    }
    if (request.range_count > 0) {
      proto::TileRange& last = request.ranges[request.range_count - 1];
      if (last.first + last.count == id) {
        last.count += 1;
        continue;
      }
    }
    if (request.range_count == proto::kMaxResendRanges) {
      break;
    }
    request.ranges[request.range_count] = {id, 1};
    request.range_count += 1;
  }
  return request;
}

proto::ResendRequest TileStore::missing(std::uint32_t after) const {
  return request(after, [](const Tile* tile) { return tile != nullptr && !tile->complete; });
}

proto::ResendRequest TileStore::unseen(std::uint32_t after) const {
  return request(after, [](const Tile* tile) { return tile == nullptr; });
}

proto::ResendRequest TileStore::everything() const {
  return request(0, [](const Tile*) { return true; });
}

template <typename Value>
Raster TileStore::raster(Value value) const {
  Raster raster = make_raster(
      hello_.size_cells[1], hello_.size_cells[0], static_cast<double>(hello_.origin_mm[1]) / 1000.0,
      static_cast<double>(hello_.origin_mm[0]) / 1000.0, hello_.cell_mm / 1000.0);
  for (std::int32_t n = 0; n < hello_.size_cells[0]; ++n) {
    for (std::int32_t e = 0; e < hello_.size_cells[1]; ++e) {
      const proto::CodedCell coded = cell(n, e);
      if (proto::cell_known(coded)) {
        raster.at(hello_.size_cells[0] - 1 - n, e) = value(coded);
      }
    }
  }
  return raster;
}

Raster TileStore::elevation() const {
  // Exact in double: below 2^53 in units of 1/256 mm. One division, so one rounding.
  return raster([this](proto::CodedCell coded) {
    const double depth_256th_mm = static_cast<double>(hello_.origin_mm[2]) * 256.0 +
                                  static_cast<double>(proto::cell_depth_q8(coded)) * hello_.cell_mm;
    return -depth_256th_mm / 256'000.0;
  });
}

Raster TileStore::sigma() const {
  return raster([this](proto::CodedCell coded) {
    return static_cast<double>(proto::cell_sigma_q12(coded)) * hello_.cell_mm / 4'096'000.0;
  });
}

}  // namespace leadline::host
