// The map as the link told it: coded cells of tiles, by generation. What the vehicle holds and what the
// topside holds are the same when their tile hashes are.
//
// Packets may be lost, repeated or come in another order: every cell remembers the generation that it
// is of, and an older word about it is dropped. A tile that missed something is known by its hash.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "host_tools/raster.hpp"
#include "proto/cell.hpp"
#include "proto/messages.hpp"
#include "proto/tile_coder.hpp"

namespace leadline::host {

/// What became of a delta.
struct DeltaOutcome {
  int new_cells = 0;       ///< cells whose value changed
  int repeated_cells = 0;  ///< said before with the same or an older generation
  bool outside = false;  ///< a tile or a known cell that the grid does not have: nothing was taken
};

/// What came of one tile.
struct TileView {
  std::uint32_t generation;       ///< of the newest delta; modulo 2^32
  std::uint32_t hash32;           ///< what the whole tile should hash to at that generation
  bool complete;                  ///< whether it does
  std::uint64_t sequence;         ///< TileStore::sequence() after its last change
  const proto::CodedCell* cells;  ///< kTileArea_cells, north-major; valid while the store is
};

/// What a TileStore was told of a tile, to be told again (restore).
struct StoredTile {
  std::uint32_t tile = 0;
  std::uint32_t generation = 0;
  std::uint32_t hash32 = 0;
  proto::CodedCell cells[proto::kTileArea_cells] = {};
};

class TileStore {
 public:
  /// An empty map of the grid that the hello describes (decode_hello has checked its ranges). A tile takes
  /// memory when something comes for it: a hello that promises a continent costs a pointer per tile.
  explicit TileStore(const proto::Hello& hello);

  [[nodiscard]] const proto::Hello& hello() const { return hello_; }
  /// A later hello of the same map: what it says of the place counts.
  void take_place(const proto::Hello& later);
  [[nodiscard]] std::uint16_t tag() const { return tag_; }

  /// O(tile).
  DeltaOutcome apply(const proto::TileDelta& delta);
  /// Takes over a tile that another store of the same map held, where nothing came for it yet. False, and
  /// nothing done: something did, or the grid has no such tile or cell. O(tile).
  bool restore(const StoredTile& stored);

  /// Counts the changes of tiles since this store began: whoever remembers it asks what came later.
  /// Begins at 0 with each store. A change: a cell's value, a generation, a tile that became (in)complete.
  [[nodiscard]] std::uint64_t sequence() const { return sequence_; }
  /// Tiles that changed after the store's sequence() was `since` (0: all that ever came), each once, latest
  /// change first. O(tiles returned).
  [[nodiscard]] std::vector<std::uint32_t> changed_since(std::uint64_t since) const;
  /// What came of a tile; nothing when none did. O(1).
  [[nodiscard]] std::optional<TileView> tile(std::uint32_t tile) const;

  [[nodiscard]] std::uint32_t tile_count() const {
    return static_cast<std::uint32_t>(tiles_.size());
  }
  /// Cell (north, east) of the grid, both inside.
  [[nodiscard]] proto::CodedCell cell(std::int32_t north, std::int32_t east) const;
  [[nodiscard]] std::uint64_t known_cells() const { return known_cells_; }
  [[nodiscard]] std::uint64_t grid_cells() const;
  /// Tiles of which something came.
  [[nodiscard]] std::uint32_t known_tiles() const { return known_tiles_; }
  /// 64-bit hash of all coded cells: the cells_hash of proto/cell.hpp. O(grid).
  [[nodiscard]] std::uint64_t cells_hash() const;

  /// hash32 of a tile as it stands here, whether anything came of it or not. O(tile).
  [[nodiscard]] std::uint32_t hash32(std::uint32_t tile) const;

  /// Tiles of which something is known to be missing: the newest delta's hash is not the tile's.
  [[nodiscard]] std::uint32_t tiles_incomplete() const;
  /// Up to proto::kMaxResendRanges ranges of such tiles, ascending; the first `after` tile numbers are
  /// passed over, so that a caller gets round all of them.
  [[nodiscard]] proto::ResendRequest missing(std::uint32_t after) const;
  /// The same for tiles of which nothing has come yet.
  [[nodiscard]] proto::ResendRequest unseen(std::uint32_t after) const;
  /// All tiles of the grid.
  [[nodiscard]] proto::ResendRequest everything() const;

  /// Metres up (minus depth), metres of one sigma; unknown cells have no value. O(grid).
  [[nodiscard]] Raster elevation() const;
  [[nodiscard]] Raster sigma() const;

 private:
  static constexpr std::uint32_t kNoTile = UINT32_MAX;
  struct Tile {
    std::uint32_t generation = 0;  ///< of the newest delta
    std::uint32_t hash32 = 0;      ///< what the whole tile should hash to at that generation
    bool complete = true;
    std::uint64_t sequence = 0;
    // Neighbours in the order of changes.
    std::uint32_t later = kNoTile;
    std::uint32_t earlier = kNoTile;
    proto::CodedCell cells[proto::kTileArea_cells] = {};
    std::uint32_t cell_generation[proto::kTileArea_cells] = {};
  };

  template <typename Wanted>
  [[nodiscard]] proto::ResendRequest request(std::uint32_t after, Wanted wanted) const;
  [[nodiscard]] bool fits(std::uint32_t tile, const proto::CodedCell* cells,
                          const proto::CellMask& taken) const;
  void note_change(std::uint32_t id);
  template <typename Value>
  [[nodiscard]] Raster raster(Value value) const;

  proto::Hello hello_;
  std::uint16_t tag_;
  std::int32_t tiles_east_;
  std::uint64_t known_cells_ = 0;
  std::uint32_t known_tiles_ = 0;
  std::uint64_t sequence_ = 0;
  std::uint32_t latest_ = kNoTile;            ///< the tile that changed last
  std::vector<std::unique_ptr<Tile>> tiles_;  ///< null: nothing came yet
};

}  // namespace leadline::host
