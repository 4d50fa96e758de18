// Extraction in passes, pings in between, against extraction of everything.
#include <cmath>
#include <vector>

#include "firmware/pipeline/extraction_pass.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::firmware::ExtractionPass;
using leadline::firmware::TileSet;
using leadline::model::Grid;
using leadline::model::kUnknownDepth;
using leadline::model::LocalizationTable;
using leadline::model::Model;
using leadline::model::ModelConfig;
using leadline::model::TileId;
using leadline::test::ping_along;
using leadline::test::plain_config;
using leadline::test::plain_table;
using leadline::test::PlainBeam;
using leadline::test::pose_at;
using leadline::test::Random;

constexpr double kSide_m = 150.0;

Model stepped;  // by passes
Model whole;    // the same pings, extracted whole
TileSet waiting;
ExtractionPass pass;

void ping(Random& random, int i) {
  const double north = std::fmod(0.37 * i, kSide_m);
  const double east = 3.0 + std::fmod(0.021 * i, kSide_m);
  const double bottom = 13.0 + 0.08 * north + 2.0 * std::sin(east / 5.0);
  const double tilt = 90.0 + 20.0 * (random.uniform() - 0.5);
  const auto heard = ping_along(360.0 * random.uniform(), tilt, bottom + 0.3 * random.normal());
  const auto pose = pose_at(north, east, 1.0);
  assert_int_equal(stepped.integrate(heard, pose), whole.integrate(heard, pose));
}

void note_touched() {
  const Grid& grid = stepped.grid();
  TileId touched = 0;
  while (stepped.take_touched_tile(touched)) {
    for (TileId tile = 0; tile < grid.tile_count(); ++tile) {
      const auto apart = [&](std::int32_t a, std::int32_t b) {
        return std::abs(a - b) <= Model::kInfluenceTiles;
      };
      const std::int32_t east = grid.tiles_east();
      const auto a = static_cast<std::int32_t>(tile);
      const auto b = static_cast<std::int32_t>(touched);
      if (apart(a / east, b / east) && apart(a % east, b % east)) {
        waiting.add(tile, 1, 0);
      }
    }
  }
}

void begin() {
  const ModelConfig config = plain_config(150, 131, 40);
  const LocalizationTable table = plain_table(PlainBeam{});
  assert_int_equal(stepped.configure(config, &table, sizeof table), leadline::base::Status::kOk);
  assert_int_equal(whole.configure(config, &table, sizeof table), leadline::base::Status::kOk);
  waiting.reset(stepped.grid().tile_count());
  pass.reset();
}

int assert_all_equal() {
  whole.extract();
  int known = 0;
  for (std::int32_t n = 0; n < stepped.grid().north_cells(); ++n) {
    for (std::int32_t e = 0; e < stepped.grid().east_cells(); ++e) {
      const auto& a = stepped.result(n, e);
      const auto& b = whole.result(n, e);
      if (a.raw_q8 != b.raw_q8 || a.depth_q8 != b.depth_q8 || a.sigma_q12 != b.sigma_q12 ||
          stepped.multi_surface(n, e) != whole.multi_surface(n, e)) {
        fail_msg("column (%d, %d): raw %d, depth %d, sigma %u in passes; %d, %d, %u whole", n, e,
                 a.raw_q8, a.depth_q8, a.sigma_q12, b.raw_q8, b.depth_q8, b.sigma_q12);
      }
      known += b.depth_q8 != kUnknownDepth ? 1 : 0;
    }
  }
  return known;
}

TEST(passes_with_pings_in_between_end_in_the_whole_extraction) {
  begin();
  Random random(41);
  int number = 0;
  int passes = 0;
  int known = 0;
  for (int round = 0; round < 4; ++round) {
    // Pings and steps in turn; then passes until none is due.
    for (int i = 0; i < 400 || pass.size() > 0 || waiting.size() > 0; ++i) {
      if (i < 400) {
        ping(random, number);
        ++number;
      }
      note_touched();
      if (pass.size() == 0) {
        pass.begin(waiting);
        assert_int_equal(waiting.size(), 0);
        ++passes;
      }
      for (auto steps = random.between(0, 40); steps > 0 && pass.size() > 0; --steps) {
        static_cast<void>(pass.step(stepped));
      }
    }
    known += assert_all_equal();
  }
  assert_true(passes > 25 && known > 500);
}

TEST(every_tile_is_worked_on_once_a_pass) {
  begin();
  Random random(42);
  for (int i = 0; i < 600; ++i) {
    ping(random, i);
  }
  note_touched();
  const std::size_t due = waiting.size();
  assert_true(due > 9);
  pass.begin(waiting);
  const TileId tile_count = stepped.grid().tile_count();
  std::vector<int> finished(tile_count);
  std::size_t done = 0;
  std::uint64_t columns = 0;
  while (pass.size() > 0) {
    assert_int_equal(pass.size(), due - done);
    const ExtractionPass::Step step = pass.step(stepped);
    assert_true(step.columns <= 256);
    columns += step.columns;
    if (step.finished) {
      ++finished[step.tile];
      ++done;
      assert_false(pass.half_done(step.tile));
    }
  }
  assert_int_equal(done, due);
  for (const int times : finished) {
    assert_true(times <= 1);
  }
  assert_true(columns > 256 && columns <= 256U * (3U * due));
  // Nothing has changed: a pass over all of it costs nothing.
  for (TileId tile = 0; tile < tile_count; ++tile) {
    waiting.add(tile, 1, 0);
  }
  pass.begin(waiting);
  while (pass.size() > 0) {
    assert_int_equal(pass.step(stepped).columns, 0);
  }
}

TEST(depths_without_their_sigmas_are_half_done) {
  begin();
  Random random(43);
  for (int i = 0; i < 200; ++i) {
    ping(random, i);
  }
  note_touched();
  pass.begin(waiting);
  bool seen = false;
  while (pass.size() > 0) {
    const ExtractionPass::Step step = pass.step(stepped);
    if (!step.finished && stepped.grid().tile(step.tile).generation != 0 &&
        stepped.result(static_cast<std::int32_t>(step.tile) / stepped.grid().tiles_east() * 16,
                       static_cast<std::int32_t>(step.tile) % stepped.grid().tiles_east() * 16)
                .depth_q8 != kUnknownDepth) {
      seen = seen || pass.half_done(step.tile);
      assert_true(pass.half_done(step.tile));
    }
  }
  assert_true(seen);
}

}  // namespace
