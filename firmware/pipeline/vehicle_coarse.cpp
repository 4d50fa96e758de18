// Vehicle: coarse first. Where tiles of which the topside knows nothing would have to wait long, a sixteenth of their
// cells goes before them.
#include "firmware/pipeline/vehicle.hpp"

namespace leadline::firmware {

using model::TileId;

// Whole tiles take most of the link's bytes: how long so many of them take the line tells the wait.
bool Vehicle::wait_is_long(std::size_t tiles) const {
  return config_.link.coarse_wait_us != 0 &&
         line_time_us(tiles * kTypicalTile_bytes) > config_.link.coarse_wait_us;
}

// One coarse tile a cycle, the one under which the tile of highest rank waits: a sixteenth of its cells is looked at
// for every tile that a frame of cells may carry, so the work stays that of such a frame.
void Vehicle::send_coarse() {
  if (frame_waits_ || !wait_is_long(unsent_.size()) || !frame_may_begin()) {
    return;
  }
  const auto waits = [this](TileId tile) {
    return unsent_.contains(tile) && link_map_.blank(tile) && !pass_.half_done(tile);
  };
  std::size_t blank = 0;
  const auto favoured = [this, &blank](TileId tile) {
    const std::uint32_t favour_now = link_map_.blank(tile) ? favour(tile) : TileSet::kNotNow;
    blank += favour_now != TileSet::kNotNow ? 1U : 0U;
    return coarse_.told(tile) ? TileSet::kNotNow : favour_now;
  };
  TileId first = 0;
  if (!unsent_.best_due(tick_, 0, 0, favoured, first) || !wait_is_long(blank)) {
    return;
  }
  const model::Grid& grid = model_.grid();
  coarse_.begin(grid, first);
  for (int i = 0; i < proto::kCoarseStep * proto::kCoarseStep; ++i) {
    TileId tile = 0;
    if (CoarseFirst::tile_under(grid, coarse_.tile(), i, tile) && waits(tile)) {
      coarse_.add(model_, tile);
    }
  }
  proto::TilePacketEncoder packet(payload_.data(), downlink_.free_payload_bytes(), survey_tag_,
                                  proto::TileScale::kCoarse);
  proto::CellMask taken{};
  const proto::TileUpdate update = coarse_.update(ledger_.next_number());
  if (!packet.add(update, taken).ok()) {
    return;
  }
  frame_tiles_[0] = FrameTile{update.tile, 0, 0, taken, true};
  if (put_frame(packet.finish(), 1)) {
    coarse_.sent(grid, taken);
    ++counters_.coarse_deltas;
  }
}

}  // namespace leadline::firmware
