#include "firmware/pipeline/tile_pager.hpp"

#include <cstring>

#include "model/base/fixed.hpp"

namespace leadline::firmware {
namespace {

using base::max_of;
using base::min_of;
using model::Grid;
using model::kTileCells;
using model::TileBox;
using model::TileId;
using model::TileRecord;

enum StoreMessage : std::uint8_t {
  kHas = 1,
  kReady = 2,
  kSaved = 3,
  kPiece = 4,
  kLost = 5,
  kFinish = 6,
};

void put_u32(std::uint8_t* out, std::uint32_t value) {
  for (std::uint32_t i = 0; i < 4; ++i) {
    out[i] = static_cast<std::uint8_t>(value >> (8U * i));
  }
}

std::uint32_t get_u32(const std::uint8_t* data) {
  return static_cast<std::uint32_t>(data[0]) | static_cast<std::uint32_t>(data[1]) << 8U |
         static_cast<std::uint32_t>(data[2]) << 16U | static_cast<std::uint32_t>(data[3]) << 24U;
}

std::int32_t distance(std::int32_t a, std::int32_t b) { return a < b ? b - a : a - b; }

constexpr std::uint32_t kTileColumns = 256;

bool all_fit(const Grid& grid) { return grid.page_count() >= grid.tile_count(); }

bool in_box(const TileBox& box, std::int32_t north, std::int32_t east) {
  return north >= box.north0 && north <= box.north1 && east >= box.east0 && east <= box.east1;
}

bool all_in_memory(const TileBox& box, const Grid& grid) {
  bool all = true;
  for (std::int32_t n = box.north0; n <= box.north1; ++n) {
    for (std::int32_t e = box.east0; e <= box.east1; ++e) {
      all = all && grid.resident(static_cast<TileId>(n * grid.tiles_east() + e));
    }
  }
  return all;
}

// Its depths are up to date: the map is not older than the voxels that leave.
bool is_read(const TileRecord& tile) { return tile.generation_read == tile.generation; }

}  // namespace

std::size_t put_store_has(std::uint8_t* out, TileId tile, std::uint32_t generation) {
  out[0] = kHas;
  put_u32(out + 1, tile);
  put_u32(out + 5, generation);
  return kStoreHas_bytes;
}

std::size_t put_store_ready(std::uint8_t* out) {
  out[0] = kReady;
  return 1;
}

std::size_t put_store_saved(std::uint8_t* out, TileId tile, std::uint32_t generation, bool good) {
  out[0] = kSaved;
  put_u32(out + 1, tile);
  put_u32(out + 5, generation);
  out[9] = good ? 1 : 0;
  return kStoreSaved_bytes;
}

std::size_t put_store_piece_head(std::uint8_t* out, TileId tile, std::uint32_t offset,
                                 std::uint16_t size_bytes) {
  out[0] = kPiece;
  put_u32(out + 1, tile);
  put_u32(out + 5, offset);
  out[9] = static_cast<std::uint8_t>(size_bytes & 255U);
  out[10] = static_cast<std::uint8_t>(size_bytes >> 8U);
  return kStorePieceHead_bytes;
}

std::size_t put_store_lost(std::uint8_t* out, TileId tile) {
  out[0] = kLost;
  put_u32(out + 1, tile);
  return kStoreLost_bytes;
}

std::size_t put_store_finish(std::uint8_t* out) {
  out[0] = kFinish;
  return 1;
}

void TilePager::configure(const Grid& grid, std::int32_t reach_cells, bool has_store) {
  // The pings' reach and a tile more, but so that the boxes here and ahead fit into the window together.
  const auto side =
      static_cast<std::int32_t>(base::sqrt_u64(static_cast<std::uint64_t>(grid.page_count() / 2)));
  radius_tiles_ = max_of(0, min_of(reach_cells / kTileCells + 1, (side - 1) / 2));
  has_store_ = has_store;
  ready_ = !has_store;
  finishing_ = false;
  failing_ = false;
  cycle_ = 0;
  save_due_ = 0;
  save_cursor_ = 0;
  hurried_ = 0;
  saving_ = kNoTile;
  loading_ = kNoTile;
  loaded_bytes_ = 0;
  begun_ = 0;
  saved_.fill(0);
  counters_ = PagerCounters{};
}

// Side records of a page go where they belong as they come: nothing looks at those of a tile that was never in
// memory, and what a broken load has left is taken back.
void TilePager::abandon_load(Grid& grid) {
  for (std::uint32_t i = 0; i < kTileColumns && grid.tile(loading_).generation == 0; ++i) {
    model::ColumnRecord& record = grid.column((loading_ << 8U) + i);
    record = model::ColumnRecord{};
    record.depth_q8 = model::kUnknownDepth;
  }
  grid.give_page(loading_page_);
  loading_ = kNoTile;
}

void TilePager::take_piece(TileId tile, std::uint32_t offset, const std::uint8_t* data,
                           std::uint32_t size_bytes, Grid& grid) {
  const std::uint32_t voxels_bytes =
      grid.tile_voxel_count() * static_cast<std::uint32_t>(sizeof(model::Voxel));
  const std::uint32_t whole_bytes = page_bytes(grid.depth_cells());
  if (tile != loading_ || offset != loaded_bytes_ || size_bytes > whole_bytes - loaded_bytes_) {
    ++counters_.input_rejected;
    if (tile == loading_) {
      abandon_load(grid);  // a piece is missing (a log with a gap): asked for again
    }
    return;
  }
  // A piece may hold the last voxels and the first side records.
  const std::uint32_t of_voxels =
      offset < voxels_bytes ? min_of(size_bytes, voxels_bytes - offset) : 0;
  std::uint8_t* const voxels = static_cast<std::uint8_t*>(grid.page_storage(loading_page_));
  std::memcpy(voxels + offset, data, of_voxels);
  // Of a tile that this run has known its own side records count.
  if (of_voxels < size_bytes && grid.tile(tile).generation == 0) {
    auto* const records = static_cast<std::uint8_t*>(static_cast<void*>(&grid.column(tile << 8U)));
    std::memcpy(records + (offset + of_voxels - voxels_bytes), data + of_voxels,
                size_bytes - of_voxels);
  }
  loaded_bytes_ += size_bytes;
  if (loaded_bytes_ < whole_bytes) {
    return;
  }
  loading_ = kNoTile;
  grid.adopt_page(tile, loading_page_);
  TileRecord& record = grid.tile(tile);
  if (record.generation == 0) {
    // Of an earlier run: its depths are still to be read.
    record.generation = saved_[tile];
    grid.list_touched(tile);
  }
  ++counters_.tiles_loaded;
}

void TilePager::take_saved(TileId tile, std::uint32_t generation, bool good, Grid& grid) {
  saving_ = kNoTile;
  failing_ = !good;
  if (good) {
    saved_[tile] = generation;
    ++counters_.tiles_saved;
    return;
  }
  ++counters_.saves_failed;
  grid.tile(tile).flags |= model::kTileSideChanged;
}

// Bytes of the message at the start; 0: none that makes sense.
std::size_t TilePager::take_message(const std::uint8_t* message, std::size_t left_bytes,
                                    Grid& grid) {
  if (message[0] == kReady || message[0] == kFinish) {
    ready_ = ready_ || message[0] == kReady;
    finishing_ = finishing_ || message[0] == kFinish;
    return 1;
  }
  if (left_bytes < kStoreLost_bytes || get_u32(message + 1) >= grid.tile_count()) {
    return 0;
  }
  const TileId tile = get_u32(message + 1);
  if (message[0] == kHas && left_bytes >= kStoreHas_bytes) {
    saved_[tile] = ready_ ? saved_[tile] : get_u32(message + 5);
    return kStoreHas_bytes;
  }
  if (message[0] == kSaved && left_bytes >= kStoreSaved_bytes && tile == saving_) {
    take_saved(tile, get_u32(message + 5), message[9] != 0, grid);
    return kStoreSaved_bytes;
  }
  if (message[0] == kPiece && left_bytes >= kStorePieceHead_bytes) {
    const std::uint32_t size =
        static_cast<std::uint32_t>(message[9]) | static_cast<std::uint32_t>(message[10]) << 8U;
    if (size > left_bytes - kStorePieceHead_bytes) {
      return 0;
    }
    take_piece(tile, get_u32(message + 5), message + kStorePieceHead_bytes, size, grid);
    return kStorePieceHead_bytes + size;
  }
  if (message[0] == kLost) {
    if (tile == loading_) {
      abandon_load(grid);
      saved_[tile] = 0;
      ++counters_.pages_lost;
    }
    return kStoreLost_bytes;
  }
  return 0;
}

void TilePager::take(const std::uint8_t* data, std::size_t size_bytes, Grid& grid) {
  std::size_t at = 0;
  while (at < size_bytes) {
    const std::size_t used = take_message(data + at, size_bytes - at, grid);
    if (used == 0) {
      // Nothing says where the next message begins.
      ++counters_.input_rejected;
      return;
    }
    at += used;
  }
}

bool TilePager::fits(const TileBox& box, const Grid& grid) {
  const std::int64_t north = max_of(box.north1 - box.north0 + 1, 0);
  const std::int64_t east = max_of(box.east1 - box.east0 + 1, 0);
  return north * east <= static_cast<std::int64_t>(grid.page_count());
}

bool TilePager::is_dirty(const Grid& grid, TileId tile) const {
  return grid.resident(tile) && (grid.tile(tile).generation != saved_[tile] ||
                                 (grid.tile(tile).flags & model::kTileSideChanged) != 0);
}

TileBox TilePager::box_around(std::int32_t north_cells, std::int32_t east_cells,
                              const Grid& grid) const {
  // Shifts of negative values are arithmetic: places outside the grid have their tile numbers too.
  const std::int32_t n = north_cells >> 4;
  const std::int32_t e = east_cells >> 4;
  return TileBox{max_of(n - radius_tiles_, 0), min_of(n + radius_tiles_, grid.tiles_north() - 1),
                 max_of(e - radius_tiles_, 0), min_of(e + radius_tiles_, grid.tiles_east() - 1)};
}

// False when there is no room for it.
bool TilePager::bring(TileId tile, Grid& grid, StoreOutput& output) {
  if (grid.resident(tile) || tile == loading_) {
    return true;
  }
  if (saved_[tile] == 0) {
    if (begun_ >= kBegunPerCycle) {
      return true;
    }
    if (!grid.page_in(tile)) {
      return false;
    }
    ++begun_;
    ++counters_.tiles_begun;
    return true;
  }
  if (loading_ != kNoTile) {
    return true;  // its turn comes
  }
  if (!grid.take_page(loading_page_)) {
    return false;
  }
  loading_ = tile;
  loaded_bytes_ = 0;
  output.load = true;
  output.load_tile = tile;
  return true;
}

bool TilePager::bring_box(const TileBox& box, Grid& grid, StoreOutput& output) {
  bool room = true;
  for (std::int32_t n = box.north0; n <= box.north1; ++n) {
    for (std::int32_t e = box.east0; e <= box.east1; ++e) {
      room = bring(static_cast<TileId>(n * grid.tiles_east() + e), grid, output) && room;
    }
  }
  return room;
}

void TilePager::save(TileId tile, Grid& grid, StoreOutput& output) {
  output.save = true;
  output.save_tile = tile;
  output.save_generation = grid.tile(tile).generation;
  output.voxels = grid.tile_voxels(tile);
  output.voxels_bytes = grid.tile_voxel_count() * sizeof(model::Voxel);
  output.records = &grid.column(tile << 8U);
  output.records_bytes = kTileColumns * sizeof(model::ColumnRecord);
  grid.tile(tile).flags &= static_cast<std::uint8_t>(~model::kTileSideChanged);
  saving_ = tile;
  save_due_ = cycle_ + kSaveEvery;
}

// Of an earlier run, and not looked at in this one: the link cannot tell what is in it yet.
bool TilePager::is_unseen(const Grid& grid, TileId tile) const {
  return saved_[tile] != 0 && grid.tile(tile).generation == 0;
}

bool TilePager::any_unseen(const Grid& grid) const {
  bool unseen = false;
  for (TileId id = 0; id < grid.tile_count(); ++id) {
    unseen = unseen || is_unseen(grid, id);
  }
  return unseen;
}

TilePager::Leaving TilePager::farthest_tiles(const PagerSituation& situation, const Grid& grid,
                                             bool pressed) const {
  const TileBox here = box_around(situation.north_cells, situation.east_cells, grid);
  const TileBox ahead = box_around(situation.ahead_north_cells, situation.ahead_east_cells, grid);
  Leaving leaving{};
  for (TileId id = 0; id < grid.tile_count(); ++id) {
    const std::int32_t n = static_cast<std::int32_t>(id) / grid.tiles_east();
    const std::int32_t e = static_cast<std::int32_t>(id) % grid.tiles_east();
    if (!grid.resident(id) || id == saving_ || in_box(situation.wanted, n, e) ||
        (!pressed && (in_box(here, n, e) || in_box(ahead, n, e)))) {
      continue;
    }
    Farthest& kind = is_dirty(grid, id)       ? leaving.dirty
                     : is_read(grid.tile(id)) ? leaving.ready
                                              : leaving.unread;
    const std::int32_t far =
        max_of(distance(n, situation.north_cells >> 4), distance(e, situation.east_cells >> 4));
    if (far > kind.away) {
      kind = Farthest{id, far};
    }
  }
  return leaving;
}

// Sends the farthest tiles away while less than an eighth of the window is free; while there are tiles of an earlier
// run to be looked at, more than a quarter.
void TilePager::make_room(const PagerSituation& situation, Grid& grid, StoreOutput& output) {
  if (!has_store_ || !situation.placed || all_fit(grid)) {
    return;
  }
  const bool unseen = any_unseen(grid);
  const bool awaited = !all_in_memory(situation.wanted, grid);
  const std::uint32_t free_wanted =
      unseen ? grid.page_count() / 4 + 1 : max_of<std::uint32_t>(1, grid.page_count() / 8);
  for (int round = 0; round < kEvictedPerCycle; ++round) {
    const std::uint32_t free_now = grid.free_pages();
    if (free_now >= free_wanted) {
      return;
    }
    Leaving leaving = farthest_tiles(situation, grid, false);
    if (awaited && free_now == 0 && saving_ == kNoTile && leaving.nothing()) {
      leaving = farthest_tiles(situation, grid, true);
    }
    if (leaving.ready.tile == kNoTile) {
      output.read = (free_now == 0 || unseen) && leaving.unread.tile != kNoTile;
      output.read_tile = leaving.unread.tile;
      if (leaving.dirty.tile != kNoTile && saving_ == kNoTile) {
        save(leaving.dirty.tile, grid, output);
      }
      return;
    }
    grid.page_out(leaving.ready.tile);
    ++counters_.tiles_evicted;
  }
}

// Round and round: every tile that changed is saved in its turn.
void TilePager::save_something(Grid& grid, StoreOutput& output) {
  const bool due = finishing_ || hurried_ > 0 || static_cast<std::int32_t>(cycle_ - save_due_) >= 0;
  if (!has_store_ || !ready_ || saving_ != kNoTile || output.save || !due) {
    return;
  }
  for (TileId step = 0; step < grid.tile_count(); ++step) {
    const TileId id = save_cursor_;
    save_cursor_ = save_cursor_ + 1 < grid.tile_count() ? save_cursor_ + 1 : 0;
    hurried_ -= hurried_ > 0 ? 1U : 0U;
    if (is_dirty(grid, id)) {
      save(id, grid, output);
      return;
    }
  }
}

void TilePager::cycle(const PagerSituation& situation, Grid& grid, StoreOutput& output) {
  output = StoreOutput{};
  ++cycle_;
  begun_ = 0;
  if (!ready_) {
    return;
  }
  if (!finishing_) {
    bool room = bring_box(situation.wanted, grid, output);
    // What a ping waits for comes first; what lies here and ahead may not take its room.
    if (situation.placed && all_in_memory(situation.wanted, grid)) {
      room = room &&
             bring_box(box_around(situation.north_cells, situation.east_cells, grid), grid, output);
      room = room &&
             bring_box(box_around(situation.ahead_north_cells, situation.ahead_east_cells, grid),
                       grid, output);
    }
    counters_.cycles_full += room ? 0U : 1U;
    // The rest of the map of an earlier run, one tile looked at a cycle; where it has to leave again, once.
    const TileId other = cycle_ % grid.tile_count();
    if (room && is_unseen(grid, other) &&
        (all_fit(grid) || grid.free_pages() > grid.page_count() / 4)) {
      static_cast<void>(bring(other, grid, output));
    }
    make_room(situation, grid, output);
  }
  save_something(grid, output);
}

bool TilePager::settled(const Grid& grid) const {
  if (!has_store_) {
    return true;
  }
  bool settled = saving_ == kNoTile;
  for (TileId id = 0; id < grid.tile_count(); ++id) {
    settled = settled && !is_dirty(grid, id);
  }
  return settled;
}

}  // namespace leadline::firmware
