#include "firmware/pipeline/extraction_pass.hpp"

namespace leadline::firmware {

using model::Model;
using model::TileId;

void ExtractionPass::reset() {
  due_.fill(false);
  size_ = 0;
}

void ExtractionPass::begin(TileSet& waiting) {
  while (waiting.size() > 0) {
    const TileId tile = waiting.at(waiting.size() - 1);
    due_[tile] = true;
    waiting.remove(tile);
    ++size_;
  }
  next_ = 0;
  stage_ = Stage::kRead;
}

ExtractionPass::Step ExtractionPass::step(Model& model) {
  const TileId tile_count = model.grid().tile_count();
  for (; stage_ != Stage::kAssess;
       stage_ = stage_ == Stage::kRead ? Stage::kSmooth : Stage::kAssess) {
    while (next_ < tile_count) {
      const TileId tile = next_;
      ++next_;
      std::uint32_t columns = 0;
      if (stage_ == Stage::kSmooth) {
        columns = model.smooth_changed_tile(tile);
      } else if (due_[tile]) {
        columns = model.read_touched_tile(tile);
      }
      if (columns > 0) {
        return Step{columns, false, tile};
      }
    }
    next_ = 0;
  }
  while (next_ < tile_count && !due_[next_]) {
    ++next_;
  }
  if (next_ >= tile_count) {
    size_ = 0;
    return Step{0, false, 0};
  }
  const TileId tile = next_;
  due_[tile] = false;
  --size_;
  return Step{model.assess_changed_tile(tile), true, tile};
}

}  // namespace leadline::firmware
