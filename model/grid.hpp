// The voxel grid: storage, addressing, tiles. Voxels are reached only through a page table of tiles,
// so that tiles can be swapped as the vehicle moves without touching the integrator.
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/capacity.hpp"
#include "model/config.hpp"

namespace leadline::model {

/// One voxel: 4 bytes. `hit` is the accumulated weight of the evidence that a surface is here, `miss`
/// that nothing is. Signal and certainty of the method follow: S = hit / (hit + miss), H = hit + miss,
/// log-odds L = hit - miss. Both saturate at 65535, explicitly; unknown is (0, 0).
struct Voxel {
  std::uint16_t hit;
  std::uint16_t miss;
};
static_assert(sizeof(Voxel) == 4, "at most 4 bytes per voxel for signal and certainty together");

/// The vector kernels may read and rewrite (unchanged) up to 16 voxels past a column's end; without them
/// (column_kernels.hpp) nothing is touched there.
#if defined(__ARM_ARCH_7EM__)
inline constexpr std::size_t kVoxelPadding = 0;
#else
inline constexpr std::size_t kVoxelPadding = 64;
#endif

/// A depth that is not known. Depths are in 1/256 cell from the top of the grid, positive down.
inline constexpr std::int32_t kUnknownDepth = INT32_MIN;

/// Bits of ColumnRecord::flags.
enum ColumnFlags : std::uint8_t {
  kColumnTouched = 1U << 0U,       ///< some event wrote into the column
  kColumnMultiSurface = 1U << 1U,  ///< a second, separate surface stands in the column
  kColumnDirty = 1U << 2U,         ///< touched since the last extraction of results
  kColumnLone = 1U << 3U,          ///< its depth rests on fewer than two pings
};

/// Side record of one column, outside the voxels: derived or auxiliary, never the source of a depth.
struct ColumnRecord {
  std::int32_t depth_q8;        ///< cached column depth for the slope feedback, or kUnknownDepth
  std::uint32_t mass;           ///< sum of hit at the time of that extraction
  std::uint32_t gain;           ///< weight added since
  std::uint32_t unchecked;      ///< weight added since the column was last looked at for saturation
  std::uint32_t last_touch_ds;  ///< age: time of the last event, 0.1 s, low 32 bits of t_us / 1e5
  std::uint16_t blur_q8;        ///< running mean of the events' lateral variance, cells^2
  std::uint8_t flags;           ///< ColumnFlags
  std::uint8_t
      slope_weight_q4;  ///< weight of `depth_q8` in the slope feedback, information per cell^2
};
static_assert(sizeof(ColumnRecord) == 24, "side record per column");

/// Tile number: row-major over the tiles of the grid, north first.
using TileId = std::uint32_t;

/// State of one tile.
struct TileRecord {
  std::uint32_t page;        ///< where its voxels lie; Grid::page_count() and beyond: not in memory
  std::uint32_t generation;  ///< counts the pings that wrote into the tile; 0 = never
  std::uint32_t last_ping;   ///< number of the latest of them
  std::uint32_t generation_read;  ///< generation at which the columns' own depths were last read
  std::uint8_t flags;             ///< TileFlags
  /// Columns whose smoothed depth is out of date: bit (e & 15) of row (n & 15).
  std::uint16_t unsmoothed[kTileCells];
};

/// Bits of TileRecord::flags.
enum TileFlags : std::uint8_t {
  kTileListed = 1U << 0U,      ///< in the list of touched tiles
  kTileUnsmoothed = 1U << 1U,  ///< some bit of `unsmoothed` is set
  kTileUnassessed = 1U << 2U,  ///< sigmas are out of date
  kTileSideChanged =
      1U << 3U,  ///< a side record changed without an event; cleared by who saves tiles
};

/// Static storage and index arithmetic. One instance owns everything; not copyable. All functions are
/// O(1) unless stated. Not thread-safe.
///
/// A grid whose voxels do not all fit keeps those of some tiles (a window) and everything else (side
/// records, tile records) of all: the others' voxels read as never observed and must not be written.
/// Who calls page_in() and page_out() brings the voxels and takes them away.
// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): configure() clears what it lays out
class Grid {
 public:
  Grid() = default;
  Grid(const Grid&) = delete;
  Grid& operator=(const Grid&) = delete;

  /// Lays out `size` = {north, east, down} cells and clears everything: O(capacity used).
  /// kOverCapacity when the padded grid does not fit.
  /// `resident_tiles`: at most so many tiles have their voxels in memory, none to begin with; 0: all do.
  [[nodiscard]] base::Status configure(const std::int32_t size[3],
                                       std::uint32_t resident_tiles = 0);

  [[nodiscard]] std::int32_t north_cells() const { return north_; }
  [[nodiscard]] std::int32_t east_cells() const { return east_; }
  [[nodiscard]] std::int32_t depth_cells() const { return depth_; }

  /// Tile that holds column (n, e); the column must be inside the grid.
  [[nodiscard]] TileId tile_of(std::int32_t n, std::int32_t e) const {
    return static_cast<TileId>((n >> 4) * tiles_east_ + (e >> 4));
  }
  [[nodiscard]] TileId tile_count() const { return tile_count_; }
  /// Columns in storage, padding of the last tiles included.
  [[nodiscard]] std::uint32_t column_count() const { return tile_count_ * kTileCells * kTileCells; }
  [[nodiscard]] TileRecord& tile(TileId id) { return tiles_[id]; }
  [[nodiscard]] const TileRecord& tile(TileId id) const { return tiles_[id]; }
  [[nodiscard]] std::int32_t tiles_north() const { return (north_ + kTileCells - 1) / kTileCells; }
  [[nodiscard]] std::int32_t tiles_east() const { return tiles_east_; }

  /// To be called before the voxels of a tile change: counts ping number `ping` (from 1 on) once, and
  /// puts the tile on the list of touched tiles.
  void touch(TileId id, std::uint32_t ping) {
    TileRecord& tile = tiles_[id];
    if (tile.last_ping == ping) {
      return;
    }
    tile.last_ping = ping;
    ++tile.generation;
    list_touched(id);
  }
  /// Puts the tile on the list of touched tiles.
  void list_touched(TileId id) {
    TileRecord& tile = tiles_[id];
    if ((tile.flags & kTileListed) == 0) {
      tile.flags |= kTileListed;
      touched_[touched_count_] = id;
      ++touched_count_;
    }
  }
  /// Takes a tile touched since it was taken last; false when there is none. Last in, first out.
  [[nodiscard]] bool take_touched(TileId& id) {
    if (touched_count_ == 0) {
      return false;
    }
    --touched_count_;
    id = touched_[touched_count_];
    tiles_[id].flags &= static_cast<std::uint8_t>(~kTileListed);
    return true;
  }

  /// Index of column (n, e), tile by tile: tile number and place in the tile.
  [[nodiscard]] std::uint32_t column_index(std::int32_t n, std::int32_t e) const {
    return (tile_of(n, e) << 8U) + static_cast<std::uint32_t>(((n & 15) << 4) | (e & 15));
  }
  /// First voxel (top) of a column; depth_cells() voxels follow, contiguous, and then those of the next
  /// column of the tile.
  [[nodiscard]] Voxel* column_voxels(std::uint32_t column) { return voxels_ + voxel_index(column); }
  [[nodiscard]] const Voxel* column_voxels(std::uint32_t column) const {
    return voxels_ + voxel_index(column);
  }
  /// Voxels of a tile: depth_cells() * 256, column by column.
  [[nodiscard]] Voxel* tile_voxels(TileId id) { return column_voxels(id << 8U); }
  [[nodiscard]] const Voxel* tile_voxels(TileId id) const { return column_voxels(id << 8U); }
  [[nodiscard]] std::uint32_t tile_voxel_count() const {
    return static_cast<std::uint32_t>(depth_) * kTileCells * kTileCells;
  }

  /// Whether some tiles' voxels may be out of memory.
  [[nodiscard]] bool windowed() const { return windowed_; }
  /// Pages, each with room for one tile's voxels, and those that no tile has.
  [[nodiscard]] std::uint32_t page_count() const { return page_count_; }
  [[nodiscard]] std::uint32_t free_pages() const { return free_count_; }
  [[nodiscard]] bool resident(TileId id) const { return tiles_[id].page < page_count_; }
  /// All tiles of the columns n0 .. n1, e0 .. e1 (inside the grid; true when there are none). O(tiles).
  [[nodiscard]] bool resident(std::int32_t n0, std::int32_t n1, std::int32_t e0,
                              std::int32_t e1) const;
  /// Gives the tile room, its voxels never observed. False: it has some, or there is none. O(tile).
  bool page_in(TileId id);
  /// Takes the tile's voxels out of memory. O(1).
  void page_out(TileId id);
  /// To bring voxels piece by piece: a page without a tile (false: there is none), its tile_voxel_count()
  /// voxels, and what ends it: a tile that is not in memory gets it, or it is given back. O(1).
  bool take_page(std::uint32_t& page);
  [[nodiscard]] void* page_storage(std::uint32_t page) {
    return voxels_ + static_cast<std::size_t>(page) * tile_voxel_count();
  }
  void adopt_page(TileId id, std::uint32_t page) { tiles_[id].page = page; }
  void give_page(std::uint32_t page) {
    free_pages_[free_count_] = page;
    ++free_count_;
  }
  [[nodiscard]] ColumnRecord& column(std::uint32_t column) { return columns_[column]; }
  [[nodiscard]] const ColumnRecord& column(std::uint32_t column) const { return columns_[column]; }

  /// Hash of one tile's voxels in (north, east, down) order, independent of paging: O(tile).
  [[nodiscard]] std::uint64_t tile_hash(TileId id) const;
  /// `map_hash`: 64-bit FNV-1a over all voxels of the grid in (north, east, down) order: O(grid).
  [[nodiscard]] std::uint64_t map_hash() const;

 private:
  [[nodiscard]] std::size_t voxel_index(std::uint32_t column) const {
    const std::uint32_t place = (tiles_[column >> 8U].page << 8U) | (column & 255U);
    return static_cast<std::size_t>(place) * static_cast<std::size_t>(depth_);
  }

  std::int32_t north_ = 0;
  std::int32_t east_ = 0;
  std::int32_t depth_ = 0;
  std::int32_t tiles_east_ = 0;
  TileId tile_count_ = 0;
  LEADLINE_BANK("voxels") Voxel voxels_[kVoxelCapacity + kVoxelPadding];
  LEADLINE_BANK("columns") ColumnRecord columns_[kColumnCapacity];
  TileRecord tiles_[kTileCapacity];
  TileId touched_[kTileCapacity];  // each tile at most once: kTileListed
  std::uint32_t touched_count_ = 0;
  bool windowed_ = false;
  std::uint32_t page_count_ =
      0;  // of a window the page after the last is blank, for all absent tiles
  std::uint32_t free_pages_[kTileCapacity];
  std::uint32_t free_count_ = 0;
};

}  // namespace leadline::model
