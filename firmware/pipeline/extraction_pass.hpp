// Extraction of all tiles that wait, spread over cycles; why: firmware/DESIGN.md, "Extraction in passes".
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware/pipeline/tile_set.hpp"
#include "model/model.hpp"

namespace leadline::firmware {

/// One after the other: the pass's tiles that pings touched are read, everything that is out of date in the grid is
/// smoothed, the pass's tiles are assessed. So each column is read, smoothed and assessed once a pass, however many
/// tiles look at it. Pings go on meanwhile; what they change after it was read belongs to the next pass.
/// Static storage, not thread-safe.
class ExtractionPass {
 public:
  /// What a step did.
  struct Step {
    std::uint32_t columns;  ///< worked on: a tile's at most
    bool finished;          ///< `tile` has new results
    model::TileId tile;
  };

  ExtractionPass() = default;
  ExtractionPass(const ExtractionPass&) = delete;
  ExtractionPass& operator=(const ExtractionPass&) = delete;

  /// No pass is under way. O(tiles).
  void reset();
  /// Begins a pass with the tiles of `waiting`, and empties that. None may be under way. O(tiles).
  void begin(TileSet& waiting);
  /// Tiles of the pass whose results are still to come; 0: none is under way. O(1).
  [[nodiscard]] std::size_t size() const { return size_; }
  /// The tile's depths may be newer than their sigmas: nothing to be told to anyone. O(1).
  [[nodiscard]] bool half_done(model::TileId tile) const {
    return stage_ != Stage::kRead && due_[tile];
  }
  /// Goes on to the next work, while size() > 0. O(tiles + columns of a tile).
  [[nodiscard]] Step step(model::Model& model);

 private:
  enum class Stage : std::uint8_t { kRead, kSmooth, kAssess };

  std::array<bool, model::kTileCapacity> due_{};
  std::size_t size_ = 0;
  model::TileId next_ = 0;  // of the stage
  Stage stage_ = Stage::kRead;
};

}  // namespace leadline::firmware
