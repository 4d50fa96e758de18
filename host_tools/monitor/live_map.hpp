// The map as the page sees it: the cells of a TileStore and when each of them last changed, in the order of
// changes, so that every viewer goes through it at his own pace and nothing is queued for him.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "host_tools/store/survey_store.hpp"
#include "host_tools/topside/coarse_map.hpp"
#include "host_tools/topside/tile_store.hpp"
#include "model/base/units.hpp"

namespace leadline::host {

/// In LiveTile::cells beside the bits of proto/cell.hpp (one that it keeps free): merged surveys contradict each other.
inline constexpr proto::CodedCell kDisputedCell = 1U << 6U;

/// A tile and the times of its cells.
struct LiveTile {
  std::uint64_t change = 0;  ///< LiveMap::change() after its last change
  proto::CodedCell cells[proto::kTileArea_cells] = {};
  /// Vehicle's time of the last change of each cell, 0.1 s, saturating at both ends.
  std::uint32_t time_ds[proto::kTileArea_cells] = {};
  /// What stands in for cells that have not come yet.
  CoarseCells coarse = {};
};

class LiveMap {
 public:
  /// Takes over what changed in `store`, and in the coarse cells beside it (may be null), since the last call;
  /// `now_us` is the vehicle's time of it. Both must be the same as before unless restart() was called. O(changed
  /// tiles log tiles).
  void follow(const TileStore& store, base::TimeUs now_us, const CoarseMap* coarse = nullptr);
  /// Marks cells of a map that is not followed any more. O(cells).
  void mark_disputed(const std::vector<DisputedCells>& disputed);
  /// Forgets the map: what follow() sees next is another one.
  void restart();

  /// Another number for every map: 0 before the first, goes up.
  [[nodiscard]] std::uint32_t epoch() const { return epoch_; }
  /// Of the map that follow() saw; nothing before.
  [[nodiscard]] const std::optional<proto::Hello>& hello() const { return hello_; }
  /// Counts changed tiles; begins at 0 with each map.
  [[nodiscard]] std::uint64_t change() const { return change_; }
  /// Up to `most` tiles whose change is above `after`, in the order of their changes. O(most + log tiles).
  [[nodiscard]] std::vector<std::uint32_t> changed_after(std::uint64_t after,
                                                         std::size_t most) const;
  /// Null: nothing came of it.
  [[nodiscard]] const LiveTile* tile(std::uint32_t tile) const;

 private:
  std::uint32_t epoch_ = 0;
  std::uint64_t change_ = 0;
  std::uint64_t followed_ = 0;         ///< the store's sequence
  std::uint64_t followed_coarse_ = 0;  ///< that of the coarse cells
  std::optional<proto::Hello> hello_;
  std::vector<std::unique_ptr<LiveTile>> tiles_;
  std::map<std::uint64_t, std::uint32_t> order_;  ///< change -> tile
};

}  // namespace leadline::host
