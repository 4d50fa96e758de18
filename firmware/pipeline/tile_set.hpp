// Tiles that wait for something: most changed first, and none for ever.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/capacity.hpp"
#include "model/grid.hpp"

namespace leadline::firmware {

/// A set of tile numbers with a weight and an age each. Rank = weight + age in cycles: weights end at
/// kMaxWeight, so whoever has waited that many cycles longer than another goes before it, whatever the
/// other's weight. Ties: the smaller number. Static storage, not thread-safe.
class TileSet {
 public:
  static constexpr std::uint32_t kMaxWeight = 255;
  /// What a favour says of a tile that stays.
  static constexpr std::uint32_t kNotNow = UINT32_MAX;

  TileSet() = default;
  TileSet(const TileSet&) = delete;
  TileSet& operator=(const TileSet&) = delete;

  /// Empties it for a grid of `tile_count` <= model::kTileCapacity tiles. O(tiles).
  void reset(model::TileId tile_count);
  /// Adds a tile, or raises the weight of one that is in (its age goes on). O(1).
  void add(model::TileId tile, std::uint32_t weight, std::uint32_t cycle);
  /// O(1); nothing when it is not in.
  void remove(model::TileId tile);
  [[nodiscard]] bool contains(model::TileId tile) const { return place_[tile] != 0; }
  [[nodiscard]] std::size_t size() const { return size_; }
  /// The tile of highest rank among those that are due: with at least that weight, or in for at least that
  /// many cycles. False when there is none. O(size).
  [[nodiscard]] bool best_due(std::uint32_t cycle, std::uint32_t weight, std::uint32_t age,
                              model::TileId& tile) const;
  /// The same with `favour(tile)`, 0 .. kMaxWeight, on top of the rank, or kNotNow.
  template <typename Favour>
  [[nodiscard]] bool best_due(std::uint32_t cycle, std::uint32_t weight, std::uint32_t age,
                              const Favour& favour, model::TileId& tile) const {
    bool found = false;
    std::uint32_t highest = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      const Member& member = members_[i];
      const std::uint32_t waited = cycle - member.since;
      if (member.weight < weight && waited < age) {
        continue;
      }
      const std::uint32_t favoured = favour(member.tile);
      if (favoured == kNotNow) {
        continue;
      }
      const std::uint32_t rank = member.weight + waited + favoured;
      if (!found || rank > highest || (rank == highest && member.tile < tile)) {
        found = true;
        highest = rank;
        tile = member.tile;
      }
    }
    return found;
  }
  /// The tile of highest rank; false when the set is empty. O(size).
  [[nodiscard]] bool best(std::uint32_t cycle, model::TileId& tile) const {
    return best_due(cycle, 0, 0, tile);
  }
  /// The i-th of size() tiles, in no order. O(1).
  [[nodiscard]] model::TileId at(std::size_t i) const { return members_[i].tile; }
  /// Cycles that a tile of the set has waited. O(1).
  [[nodiscard]] std::uint32_t age(model::TileId tile, std::uint32_t cycle) const {
    return cycle - members_[place_[tile] - 1].since;
  }
  /// Cycles that the longest waiting tile has waited; 0 when empty. O(size).
  [[nodiscard]] std::uint32_t oldest_age(std::uint32_t cycle) const;

 private:
  struct Member {
    model::TileId tile;
    std::uint32_t since;  ///< cycle in which it came in
    std::uint32_t weight;
  };
  std::array<Member, model::kTileCapacity> members_{};
  std::array<std::uint32_t, model::kTileCapacity> place_{};  ///< index into members_ + 1; 0: not in
  std::size_t size_ = 0;
};

}  // namespace leadline::firmware
