#include "proto/tile_model.hpp"

#include <array>
#include <cstddef>

namespace leadline::proto {
namespace {

/// Probability of a 1, in 1/256, of every model in the order of TileModel.
constexpr std::array<std::uint8_t, kTileModels> kStart_q8 = {
#include "proto/tile_model_table.inc"
};

}  // namespace

void start_tile_model(TileModel& model) {
  const auto* start = kStart_q8.begin();
  const auto take = [&start](BitModel& bits) {
    const auto one_q15 = static_cast<std::uint16_t>(*start << 7U);
    bits = BitModel{one_q15, one_q15};
    ++start;
  };
  const auto take_row = [&take](auto& row) {
    for (BitModel& bits : row) {
      take(bits);
    }
  };
  const auto take_rows = [&take_row](auto& rows) {
    for (auto& row : rows) {
      take_row(row);
    }
  };
  take_rows(model.mask);
  take_row(model.unknown);
  take_row(model.multi_surface);
  take(model.other_flags);
  take_row(model.sigma_same);
  take_row(model.sigma_up);
  take_rows(model.sigma_more);
  take_rows(model.depth_same);
  take_rows(model.depth_toward);
  take_rows(model.depth_more);
  take_row(model.exponent_more);
}

}  // namespace leadline::proto
