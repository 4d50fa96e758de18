// Extraction by tiles against extraction of everything: equal bits wherever the first claims to be current.
#include <cmath>
#include <memory>
#include <vector>

#include "model/model.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::model::ColumnResult;
using leadline::model::DepthMethod;
using leadline::model::Grid;
using leadline::model::kTileCells;
using leadline::model::kUnknownDepth;
using leadline::model::LocalizationTable;
using leadline::model::Model;
using leadline::model::ModelConfig;
using leadline::model::NoReturnPolicy;
using leadline::model::Rule;
using leadline::model::TileId;
using leadline::model::TileWork;
using leadline::test::ping_along;
using leadline::test::plain_config;
using leadline::test::plain_table;
using leadline::test::PlainBeam;
using leadline::test::pose_at;
using leadline::test::Random;

Model tiles;  // extracted tile by tile
Model whole;  // the same pings, extracted whole

void configure(const ModelConfig& config) {
  const LocalizationTable table = plain_table(PlainBeam{});
  assert_int_equal(tiles.configure(config, &table, sizeof(table)), leadline::base::Status::kOk);
  assert_int_equal(whole.configure(config, &table, sizeof(table)), leadline::base::Status::kOk);
}

// One ping of a vehicle that creeps across the grid, over a sloping and rippled bottom.
void ping(Random& random, int i, double side_m) {
  const double north = std::fmod(0.37 * i, side_m);
  const double east = 3.0 + std::fmod(0.021 * i, side_m);
  const double bottom = 14.0 + 0.08 * north + 2.0 * std::sin(east / 5.0);
  const double tilt = 90.0 + 20.0 * (random.uniform() - 0.5);
  auto ping = ping_along(360.0 * random.uniform(), tilt, bottom + 0.3 * random.normal() - 1.0);
  if (i % 17 == 0) {
    ping.kind = leadline::base::ReturnKind::kNoReturn;
  }
  const auto pose = pose_at(north, east, 1.0);
  assert_int_equal(tiles.integrate(ping, pose), whole.integrate(ping, pose));
}

// Number of known columns of the tile; all of its columns compared.
int assert_tile_equal(TileId id) {
  const Grid& grid = tiles.grid();
  const auto n0 = static_cast<std::int32_t>(id) / grid.tiles_east() * kTileCells;
  const auto e0 = static_cast<std::int32_t>(id) % grid.tiles_east() * kTileCells;
  int known = 0;
  for (std::int32_t n = n0; n < n0 + kTileCells && n < grid.north_cells(); ++n) {
    for (std::int32_t e = e0; e < e0 + kTileCells && e < grid.east_cells(); ++e) {
      const ColumnResult& a = tiles.result(n, e);
      const ColumnResult& b = whole.result(n, e);
      if (a.raw_q8 != b.raw_q8 || a.mass != b.mass || a.depth_q8 != b.depth_q8 ||
          a.sigma_q12 != b.sigma_q12 || tiles.multi_surface(n, e) != whole.multi_surface(n, e)) {
        fail_msg("column (%d, %d): raw %d, depth %d, sigma %u by tiles; %d, %d, %u whole", n, e,
                 a.raw_q8, a.depth_q8, a.sigma_q12, b.raw_q8, b.depth_q8, b.sigma_q12);
      }
      known += b.depth_q8 != kUnknownDepth ? 1 : 0;
    }
  }
  return known;
}

TEST(a_tile_has_the_results_of_a_whole_extraction_at_any_time) {
  for (const Rule rule : {Rule::kLogOdds, Rule::kWeightedMean}) {
    ModelConfig config = plain_config(150, 131, 40);
    config.rule = rule;
    config.no_return = NoReturnPolicy::kEmpty;
    config.detect_range_um = 9'000'000;
    configure(config);
    Random random(31);
    int known = 0;
    for (int round = 0; round < 60; ++round) {
      for (int i = 0; i < 60; ++i) {
        ping(random, 60 * round + i, 150.0);
      }
      whole.extract();
      for (int i = 0; i < 3; ++i) {
        const auto id = static_cast<TileId>(random.between(0, tiles.grid().tile_count() - 1));
        const TileWork work = tiles.extract_tile(id);
        assert_true(work.columns_read <= 81 * 256 && work.columns_smoothed <= 49 * 256);
        known += assert_tile_equal(id);
      }
    }
    assert_true(known > 1000);
  }
}

TEST(the_touched_tiles_and_their_surroundings_are_all_that_has_to_be_asked_for) {
  ModelConfig config = plain_config(170, 170, 32);
  configure(config);
  Random random(32);
  std::vector<bool> due(tiles.grid().tile_count());
  TileId id = 0;
  assert_false(tiles.take_touched_tile(id));
  const std::int32_t rows = tiles.grid().tiles_north();
  const std::int32_t side = tiles.grid().tiles_east();
  for (int round = 0; round < 40; ++round) {
    for (int i = 0; i < 25; ++i) {
      ping(random, 25 * round + i, 170.0);
    }
    while (tiles.take_touched_tile(id)) {
      const auto row = static_cast<std::int32_t>(id) / side;
      const auto column = static_cast<std::int32_t>(id) % side;
      for (std::int32_t n = row - Model::kInfluenceTiles; n <= row + Model::kInfluenceTiles; ++n) {
        for (std::int32_t e = column - Model::kInfluenceTiles; e <= column + Model::kInfluenceTiles;
             ++e) {
          if (n >= 0 && e >= 0 && n < rows && e < side) {
            due[static_cast<std::size_t>(n * side + e)] = true;
          }
        }
      }
    }
    for (std::size_t i = 0; i < due.size(); ++i) {
      if (due[i]) {
        static_cast<void>(tiles.extract_tile(static_cast<TileId>(i)));
        due[i] = false;
      }
    }
    whole.extract();
    int known = 0;
    for (TileId i = 0; i < tiles.grid().tile_count(); ++i) {
      known += assert_tile_equal(i);
    }
    assert_true(known > 0);
  }
}

TEST(what_did_not_change_costs_nothing) {
  configure(plain_config(64, 64, 40));
  Random random(33);
  for (int i = 0; i < 100; ++i) {
    ping(random, i, 64.0);
  }
  const TileWork first = tiles.extract_tile(0);
  assert_true(first.columns_read >= 256 && first.columns_smoothed > 0);
  assert_int_equal(first.columns_assessed, 256);
  const TileWork again = tiles.extract_tile(0);
  assert_int_equal(again.columns_read, 0);
  assert_int_equal(again.columns_smoothed, 0);
  assert_int_equal(again.columns_assessed, 0);
  // No such tile, and no configuration at all.
  assert_int_equal(tiles.extract_tile(tiles.grid().tile_count()).columns_read, 0);
}

TEST(another_method_before_does_not_shine_through) {
  configure(plain_config(64, 64, 40));
  Random random(34);
  for (int i = 0; i < 300; ++i) {
    ping(random, i, 64.0);
  }
  tiles.extract(DepthMethod::kFirstMoment);
  static_cast<void>(tiles.extract_tile(0));
  whole.extract();
  assert_true(assert_tile_equal(0) > 0);
}

}  // namespace
