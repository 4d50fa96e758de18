// The window of a map that is larger than memory: which tiles have their voxels in memory, which go to the
// store and which come back, with look-ahead along the track and bounded work a cycle.
//
// The pager does no I/O. It says what is to be saved and loaded (StoreOutput); what the store answers comes
// as bytes (take()), recorded like everything else that the vehicle hears: a log replays without the store.
//   has    1, tile u32, generation u32      at the start, for each page that the store has
//   ready  2                                 that was all
//   saved  3, tile u32, generation u32, 0|1  the page is safe, or could not be written
//   piece  4, tile u32, offset u32, size u16, bytes  of a page that was asked for, in order, all of it
//   lost   5, tile u32                       the page that was asked for cannot be read
//   finish 6                                 the survey ends: save everything
// A page is the tile's voxels (4 bytes each) and its 256 side records (24 bytes each), as memory has them.
//
// Policy. A tile leaves when room is short: of those away from vehicle and track the farthest one that is saved and
// whose depths were read: nothing needs its voxels until it comes back. After a start every tile of the run before
// comes once, so that its depths are known and the link can hand them over. A tile that was never written costs
// nothing to bring. Who needs a tile that is not there waits (Vehicle), and what it needs goes before everything else:
// nothing is brought beside it, and where all that is away has left, tiles at the vehicle and ahead leave too. A page
// that cannot be read back stays lost and counted, the tile starts anew.
//
// No heap, no clock. Not thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/capacity.hpp"
#include "model/grid.hpp"
#include "model/model.hpp"

namespace leadline::firmware {

/// Spans into the grid, to be copied before the next cycle.
struct StoreOutput {
  bool save;
  model::TileId save_tile;
  std::uint32_t save_generation;
  const model::Voxel* voxels;
  std::size_t voxels_bytes;
  const model::ColumnRecord* records;
  std::size_t records_bytes;
  bool load;
  model::TileId load_tile;
  /// A tile that is to leave, and whose depths are not up to date: to be read now (Model::read_touched_tile).
  bool read;
  model::TileId read_tile;
};

/// Bytes of a page of `depth_cells` voxels a column.
[[nodiscard]] constexpr std::uint32_t page_bytes(std::int32_t depth_cells) {
  return static_cast<std::uint32_t>(model::kTileCells * model::kTileCells) *
         (static_cast<std::uint32_t>(depth_cells) *
              static_cast<std::uint32_t>(sizeof(model::Voxel)) +
          static_cast<std::uint32_t>(sizeof(model::ColumnRecord)));
}

/// Head of a piece on the wire; bytes of other messages.
inline constexpr std::size_t kStorePieceHead_bytes = 11;
inline constexpr std::size_t kStoreHas_bytes = 9;
inline constexpr std::size_t kStoreSaved_bytes = 10;
inline constexpr std::size_t kStoreLost_bytes = 5;
/// What a store answers with. Each writes its message and returns its bytes; `out` has the room named above.
std::size_t put_store_has(std::uint8_t* out, model::TileId tile, std::uint32_t generation);
std::size_t put_store_ready(std::uint8_t* out);
std::size_t put_store_saved(std::uint8_t* out, model::TileId tile, std::uint32_t generation,
                            bool good);
std::size_t put_store_piece_head(std::uint8_t* out, model::TileId tile, std::uint32_t offset,
                                 std::uint16_t size_bytes);
std::size_t put_store_lost(std::uint8_t* out, model::TileId tile);
std::size_t put_store_finish(std::uint8_t* out);

/// Where the vehicle is, for a cycle.
struct PagerSituation {
  bool placed;  ///< the two places are known
  std::int32_t north_cells, east_cells;
  std::int32_t ahead_north_cells, ahead_east_cells;  ///< where it will be after the look-ahead
  /// Tiles that a ping waits for (fits()); empty: none does.
  model::TileBox wanted;
};

/// Never decremented.
struct PagerCounters {
  std::uint32_t tiles_begun;  ///< brought in without a page: nothing was known of them
  std::uint32_t tiles_loaded;
  std::uint32_t tiles_evicted;
  std::uint32_t tiles_saved;
  std::uint32_t saves_failed;
  std::uint32_t pages_lost;      ///< asked for, and not to be read
  std::uint32_t input_rejected;  ///< messages that make no sense
  std::uint32_t cycles_full;     ///< cycles in which a tile was wanted and no room could be made
};

class TilePager {
 public:
  /// Tiles brought in without a page, and tiles sent away, in one cycle at most.
  static constexpr int kBegunPerCycle = 4;
  static constexpr int kEvictedPerCycle = 4;
  /// Cycles between two background saves.
  static constexpr std::uint32_t kSaveEvery = 5;

  TilePager() = default;
  TilePager(const TilePager&) = delete;
  TilePager& operator=(const TilePager&) = delete;

  /// For a windowed grid, freshly configured. `reach_cells`: how far from the vehicle pings write.
  /// `has_store`: without one nothing is saved, and nothing leaves.
  void configure(const model::Grid& grid, std::int32_t reach_cells, bool has_store);

  /// Answers of the store, whole messages. Writes loaded voxels into the grid. O(bytes).
  void take(const std::uint8_t* data, std::size_t size_bytes, model::Grid& grid);
  /// The store has said what it has (or there is none): tiles may come in.
  [[nodiscard]] bool ready() const { return ready_; }

  /// Whether so many tiles can be in memory together at all: a ping that needs more cannot be mapped. O(1).
  [[nodiscard]] static bool fits(const model::TileBox& box, const model::Grid& grid);
  /// The last page that was to be saved could not be.
  [[nodiscard]] bool failing() const { return failing_; }

  /// Every tile that has changed is saved in the cycles to come, one behind the other: once round.
  void hurry(const model::Grid& grid) { hurried_ = grid.tile_count(); }

  /// One cycle's decisions. O(tiles of the grid).
  void cycle(const PagerSituation& situation, model::Grid& grid, StoreOutput& output);
  /// Everything is saved, and nothing is under way: power may go. O(tiles).
  [[nodiscard]] bool settled(const model::Grid& grid) const;

  [[nodiscard]] const PagerCounters& counters() const { return counters_; }

 private:
  static constexpr model::TileId kNoTile = UINT32_MAX;

  struct Farthest {
    model::TileId tile = kNoTile;
    std::int32_t away = -1;
  };
  /// Of the tiles away from vehicle and track: free to leave, not read yet, not saved yet.
  struct Leaving {
    Farthest ready, unread, dirty;
    [[nodiscard]] bool nothing() const {
      return ready.tile == kNoTile && unread.tile == kNoTile && dirty.tile == kNoTile;
    }
  };
  [[nodiscard]] bool is_dirty(const model::Grid& grid, model::TileId tile) const;
  [[nodiscard]] bool is_unseen(const model::Grid& grid, model::TileId tile) const;
  [[nodiscard]] bool any_unseen(const model::Grid& grid) const;
  /// `pressed`: only what is wanted has to stay.
  [[nodiscard]] Leaving farthest_tiles(const PagerSituation& situation, const model::Grid& grid,
                                       bool pressed) const;
  [[nodiscard]] bool bring(model::TileId tile, model::Grid& grid, StoreOutput& output);
  [[nodiscard]] bool bring_box(const model::TileBox& box, model::Grid& grid, StoreOutput& output);
  void make_room(const PagerSituation& situation, model::Grid& grid, StoreOutput& output);
  void save_something(model::Grid& grid, StoreOutput& output);
  void save(model::TileId tile, model::Grid& grid, StoreOutput& output);
  [[nodiscard]] std::size_t take_message(const std::uint8_t* message, std::size_t left_bytes,
                                         model::Grid& grid);
  void take_saved(model::TileId tile, std::uint32_t generation, bool good, model::Grid& grid);
  void take_piece(model::TileId tile, std::uint32_t offset, const std::uint8_t* data,
                  std::uint32_t size_bytes, model::Grid& grid);
  void abandon_load(model::Grid& grid);
  [[nodiscard]] model::TileBox box_around(std::int32_t north_cells, std::int32_t east_cells,
                                          const model::Grid& grid) const;

  std::int32_t radius_tiles_ = 0;
  bool has_store_ = false;
  bool ready_ = false;
  bool finishing_ = false;
  bool failing_ = false;
  std::uint32_t cycle_ = 0;
  std::uint32_t save_due_ = 0;
  model::TileId save_cursor_ = 0;
  model::TileId hurried_ = 0;       ///< tiles that are still to be looked at without a pause
  model::TileId saving_ = kNoTile;  ///< handed over, no answer yet
  model::TileId loading_ = kNoTile;
  std::uint32_t loading_page_ = 0;
  std::uint32_t loaded_bytes_ = 0;
  int begun_ = 0;  ///< in this cycle
  std::array<std::uint32_t, model::kTileCapacity> saved_{};
  PagerCounters counters_{};
};

}  // namespace leadline::firmware
