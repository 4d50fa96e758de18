#include "firmware/pipeline/tile_set.hpp"

#include "model/base/fixed.hpp"

namespace leadline::firmware {

using base::max_of;
using base::min_of;
using model::TileId;

void TileSet::reset(TileId tile_count) {
  for (TileId tile = 0; tile < tile_count; ++tile) {
    place_[tile] = 0;
  }
  size_ = 0;
}

void TileSet::add(TileId tile, std::uint32_t weight, std::uint32_t cycle) {
  const std::uint32_t limited = min_of(weight, kMaxWeight);
  if (place_[tile] != 0) {
    Member& member = members_[place_[tile] - 1];
    member.weight = max_of(member.weight, limited);
    return;
  }
  members_[size_] = Member{tile, cycle, limited};
  ++size_;
  place_[tile] = static_cast<std::uint32_t>(size_);
}

void TileSet::remove(TileId tile) {
  const std::uint32_t place = place_[tile];
  if (place == 0) {
    return;
  }
  // The last one takes the place.
  --size_;
  members_[place - 1] = members_[size_];
  place_[members_[size_].tile] = place;
  place_[tile] = 0;
}

bool TileSet::best_due(std::uint32_t cycle, std::uint32_t weight, std::uint32_t age,
                       TileId& tile) const {
  return best_due(
      cycle, weight, age, [](TileId) { return 0U; }, tile);
}

std::uint32_t TileSet::oldest_age(std::uint32_t cycle) const {
  std::uint32_t oldest = 0;
  for (std::size_t i = 0; i < size_; ++i) {
    oldest = max_of(oldest, cycle - members_[i].since);
  }
  return oldest;
}

}  // namespace leadline::firmware
