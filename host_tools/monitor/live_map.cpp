#include "host_tools/monitor/live_map.hpp"

#include <algorithm>

namespace leadline::host {

void LiveMap::restart() {
  hello_.reset();
  tiles_.clear();
  order_.clear();
  change_ = 0;
  followed_ = followed_coarse_ = 0;
}

void LiveMap::follow(const TileStore& store, base::TimeUs now_us, const CoarseMap* coarse) {
  if (!hello_) {
    epoch_ += 1;
    tiles_.resize(store.tile_count());
  }
  hello_ = store.hello();  // a later hello may have learned the place
  const auto now_ds = static_cast<std::uint32_t>(
      std::clamp<base::TimeUs>(now_us / 100'000, 0, std::int64_t{UINT32_MAX}));
  std::vector<std::uint32_t> changed = store.changed_since(followed_);
  followed_ = store.sequence();
  std::reverse(changed.begin(), changed.end());  // the latest last, as in the order
  if (coarse != nullptr) {
    const std::vector<std::uint32_t> more = coarse->changed_since(followed_coarse_);
    changed.insert(changed.end(), more.begin(), more.end());
    followed_coarse_ = coarse->sequence();
  }
  for (const std::uint32_t id : changed) {
    const std::optional<TileView> view = store.tile(id);
    std::unique_ptr<LiveTile>& place = tiles_[id];
    if (!place) {
      place = std::make_unique<LiveTile>();
    }
    bool differs = false;
    for (int k = 0; view && k < proto::kTileArea_cells; ++k) {
      if (place->cells[k] != view->cells[k]) {
        place->cells[k] = view->cells[k];
        place->time_ds[k] = now_ds;
        differs = true;
      }
    }
    const CoarseCells* const under = coarse != nullptr ? coarse->tile(id) : nullptr;
    const CoarseCells stands_in = under != nullptr ? *under : CoarseCells{};
    if (differs || stands_in != place->coarse) {
      place->coarse = stands_in;
      order_.erase(place->change);
      place->change = ++change_;
      order_.emplace_hint(order_.end(), change_, id);
    }
  }
}

void LiveMap::mark_disputed(const std::vector<DisputedCells>& disputed) {
  for (std::size_t id = 0; id < std::min(tiles_.size(), disputed.size()); ++id) {
    for (std::size_t k = 0; tiles_[id] && k < disputed[id].size(); ++k) {
      tiles_[id]->cells[k] |= disputed[id][k] ? kDisputedCell : 0;
    }
  }
}

std::vector<std::uint32_t> LiveMap::changed_after(std::uint64_t after, std::size_t most) const {
  std::vector<std::uint32_t> tiles;
  for (auto it = order_.upper_bound(after); it != order_.end() && tiles.size() < most; ++it) {
    tiles.push_back(it->second);
  }
  return tiles;
}

const LiveTile* LiveMap::tile(std::uint32_t tile) const {
  return tile < tiles_.size() ? tiles_[tile].get() : nullptr;
}

}  // namespace leadline::host
