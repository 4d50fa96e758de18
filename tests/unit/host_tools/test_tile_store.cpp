#include <algorithm>
#include <cmath>
#include <vector>

#include "host_tools/raster.hpp"
#include "host_tools/topside/tile_store.hpp"
#include "tests/support/proto_samples.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::DeltaOutcome;
using leadline::host::Raster;
using leadline::host::TileStore;
using leadline::proto::cell_known;
using leadline::proto::code_cell;
using leadline::proto::CodedCell;
using leadline::proto::fold_hash;
using leadline::proto::Hello;
using leadline::proto::kTileArea_cells;
using leadline::proto::ResendRequest;
using leadline::proto::tile_hash;
using leadline::proto::TileDelta;
using leadline::test::Random;

// 40 x 20 cells: 3 x 2 tiles, the outer ones cut.
Hello small_grid() {
  Hello hello = leadline::test::grid_hello(40, 20);
  hello.origin_mm[0] = 10'000;
  hello.origin_mm[1] = -3'000;
  hello.origin_mm[2] = 20'000;
  return hello;
}

/// The vehicle's side of one tile: it changes cells and tells them.
class Sender {
 public:
  explicit Sender(std::uint32_t tile, std::uint32_t generation = 0)
      : tile_(tile), generation_(generation), cells_(kTileArea_cells, 0) {}

  TileDelta set(const std::vector<int>& which, std::int32_t depth_q8) {
    TileDelta delta{};
    generation_ += 1;
    for (const int k : which) {
      cells_[static_cast<std::size_t>(k)] = code_cell(depth_q8, 2048, 0);
      delta.changed.set(k);
      delta.cells[k] = cells_[static_cast<std::size_t>(k)];
      delta.cell_count += 1;
    }
    delta.tile = tile_;
    delta.generation = generation_;
    delta.hash32 = fold_hash(tile_hash(cells_.data()));
    return delta;
  }
  [[nodiscard]] const std::vector<CodedCell>& cells() const { return cells_; }

 private:
  std::uint32_t tile_;
  std::uint32_t generation_;
  std::vector<CodedCell> cells_;
};

TEST(cells_arrive_where_they_belong) {
  TileStore store(small_grid());
  assert_int_equal(store.tile_count(), 6);
  assert_int_equal(store.grid_cells(), 800);
  Sender sender(3);  // second row of tiles, second column
  const DeltaOutcome outcome = store.apply(sender.set({0, 17, 2}, 5120));
  assert_int_equal(outcome.new_cells, 3);
  assert_int_equal(store.known_cells(), 3);
  assert_int_equal(store.known_tiles(), 1);
  assert_true(cell_known(store.cell(16, 16)));
  assert_true(cell_known(store.cell(17, 17)));
  assert_true(cell_known(store.cell(16, 18)));
  assert_false(cell_known(store.cell(16, 17)));
  // Depth 20 cells below the top at 20 m: 30 m. Row 0 of a raster is the north.
  const Raster elevation = store.elevation();
  assert_near(elevation.at(40 - 1 - 16, 16), -30.0, 1e-12);
  assert_near(elevation.south_m, 10.0, 0.0);
  assert_near(elevation.west_m, -3.0, 0.0);
  assert_int_equal(elevation.known_count(), 3);
  assert_near(store.sigma().at(40 - 1 - 16, 16), 0.25, 0.05);
}

TEST(any_order_and_any_repetition_give_the_same_map) {
  Random random;
  for (int round = 0; round < 200; ++round) {
    // Generations that wrap on the way.
    Sender sender(0, 0xFFFFFFF0U);
    std::vector<TileDelta> deltas;
    for (int step = 0; step < 30; ++step) {
      std::vector<int> which;
      for (int k = 0; k < 8; ++k) {
        const int cell = static_cast<int>(random.between(0, kTileArea_cells - 1));
        if (std::find(which.begin(), which.end(), cell) == which.end()) {
          which.push_back(cell);
        }
      }
      deltas.push_back(sender.set(which, static_cast<std::int32_t>(random.between(1, 15000))));
    }
    std::vector<TileDelta> sent = deltas;
    for (std::size_t k = 0; k < deltas.size(); ++k) {
      sent.push_back(deltas[static_cast<std::size_t>(random.between(0, 29))]);
    }
    for (std::size_t k = sent.size() - 1; k > 0; --k) {
      std::swap(sent[k],
                sent[static_cast<std::size_t>(random.between(0, static_cast<std::int64_t>(k)))]);
    }
    TileStore store(small_grid());
    for (const TileDelta& delta : sent) {
      (void)store.apply(delta);
    }
    for (int k = 0; k < kTileArea_cells; ++k) {
      assert_int_equal(store.cell(k >> 4, k & 15), sender.cells()[static_cast<std::size_t>(k)]);
    }
    assert_int_equal(store.tiles_incomplete(), 0);
  }
}

TEST(a_lost_delta_is_noticed_asked_for_and_healed) {
  TileStore store(small_grid());
  Sender sender(4);
  Sender other(1);
  (void)store.apply(sender.set({1, 2, 3}, 2000));
  const TileDelta lost = sender.set({4, 5}, 2100);
  (void)store.apply(sender.set({6}, 2200));
  (void)store.apply(other.set({6}, 2200));
  assert_int_equal(store.tiles_incomplete(), 1);
  const ResendRequest request = store.missing(0);
  assert_int_equal(request.range_count, 1);
  assert_int_equal(request.ranges[0].first, 4);
  assert_int_equal(request.ranges[0].count, 1);
  assert_int_equal(request.survey_tag, store.tag());
  assert_int_equal(store.missing(5).range_count, 0);
  // The vehicle sends what it has now, of the newest generation.
  const DeltaOutcome outcome = store.apply(sender.set({1, 2, 3, 4, 5, 6}, 2300));
  assert_int_equal(outcome.new_cells, 6);
  assert_int_equal(store.tiles_incomplete(), 0);
  // The lost one, late after all, changes nothing.
  assert_int_equal(store.apply(lost).new_cells, 0);
  assert_int_equal(store.tiles_incomplete(), 0);
}

TEST(neighbouring_tiles_become_one_range) {
  TileStore store(small_grid());
  for (const std::uint32_t tile : {0U, 1U, 2U, 5U}) {
    Sender sender(tile);
    (void)sender.set({1}, 1000);  // lost
    (void)store.apply(sender.set({2}, 1000));
  }
  const ResendRequest request = store.missing(0);
  assert_int_equal(request.range_count, 2);
  assert_int_equal(request.ranges[0].count, 3);
  assert_int_equal(request.ranges[1].first, 5);
}

TEST(what_the_grid_does_not_have_is_refused_whole) {
  TileStore store(small_grid());
  assert_true(store.apply(Sender(6).set({0}, 1000)).outside);
  // Tile 5 has 8 rows and 4 columns.
  assert_true(store.apply(Sender(5).set({0, 4}, 1000)).outside);
  assert_true(store.apply(Sender(5).set({0, 8 * 16}, 1000)).outside);
  assert_int_equal(store.known_cells(), 0);
  assert_false(store.apply(Sender(5).set({0, 3, 7 * 16 + 3}, 1000)).outside);
  assert_int_equal(store.known_cells(), 3);
}

TEST(a_cell_may_become_unknown_again) {
  TileStore store(small_grid());
  Sender sender(0);
  (void)store.apply(sender.set({0, 1}, 1000));
  (void)store.apply(sender.set({1}, leadline::proto::kUnknownDepth_q8));
  assert_int_equal(store.known_cells(), 1);
  assert_true(std::isnan(store.elevation().at(39, 1)));
}

TEST(the_hash_is_that_of_all_tiles) {
  TileStore store(small_grid());
  const std::vector<CodedCell> nothing(kTileArea_cells, 0);
  std::uint64_t hash = leadline::proto::kFnvOffset;
  for (int tile = 0; tile < 6; ++tile) {
    hash = leadline::proto::add_tile_hash(hash, tile_hash(nothing.data()));
  }
  assert_true(store.cells_hash() == hash);
  (void)store.apply(Sender(2).set({0}, 1000));
  assert_true(store.cells_hash() != hash);
}

TEST(changes_are_told_latest_first_and_each_tile_once) {
  TileStore store(small_grid());
  assert_int_equal(store.changed_since(0).size(), 0);
  Sender zero(0);
  Sender three(3);
  const leadline::proto::TileDelta first = zero.set({0}, 1000);
  (void)store.apply(first);
  (void)store.apply(three.set({1}, 2000));
  const std::uint64_t seen = store.sequence();
  assert_true(store.changed_since(0) == (std::vector<std::uint32_t>{3, 0}));
  assert_int_equal(store.changed_since(seen).size(), 0);
  (void)store.apply(Sender(5).set({0}, 2000));
  (void)store.apply(zero.set({1}, 1000));
  (void)store.apply(zero.set({2}, 1000));
  assert_true(store.changed_since(seen) == (std::vector<std::uint32_t>{0, 5}));
  assert_true(store.changed_since(0) == (std::vector<std::uint32_t>{0, 5, 3}));
  // An old word that says nothing new, and one for no tile, are no changes.
  const std::uint64_t last = store.sequence();
  (void)store.apply(first);
  (void)store.apply(Sender(6).set({0}, 1000));
  assert_true(store.sequence() == last);
  (void)store.apply(three.set({2}, 2000));
  assert_true(store.changed_since(0) == (std::vector<std::uint32_t>{3, 0, 5}));
}

TEST(random_changes_are_told_as_a_plain_list_has_them) {
  TileStore store(small_grid());
  std::vector<Sender> senders;
  for (std::uint32_t tile = 0; tile < 6; ++tile) {
    senders.emplace_back(tile);
  }
  Random random(3);
  std::vector<std::uint32_t> order;  // latest first
  for (int step = 0; step < 500; ++step) {
    const auto tile = static_cast<std::uint32_t>(random.between(0, 5));
    (void)store.apply(senders[tile].set({0}, static_cast<std::int32_t>(1000 + 512 * (step % 7))));
    order.erase(std::remove(order.begin(), order.end(), tile), order.end());
    order.insert(order.begin(), tile);
    assert_true(store.changed_since(0) == order);
  }
}

TEST(a_tile_is_restored_as_it_was) {
  TileStore store(small_grid());
  Sender sender(2, 0xFFFFFFFFU);  // its first generation is 0
  (void)store.apply(sender.set({0, 7}, 1000));
  const auto view = store.tile(2);
  assert_true(view.has_value());
  assert_true(view->complete);
  assert_int_equal(view->generation, 0);
  assert_false(store.tile(1).has_value());
  assert_false(store.tile(6).has_value());

  leadline::host::StoredTile stored;
  stored.tile = 2;
  stored.generation = view->generation;
  stored.hash32 = view->hash32;
  std::copy(view->cells, view->cells + kTileArea_cells, stored.cells);
  TileStore later(small_grid());
  assert_true(later.restore(stored));
  assert_false(later.restore(stored));
  assert_true(later.cells_hash() == store.cells_hash());
  assert_int_equal(later.known_cells(), 2);
  assert_true(later.changed_since(0) == std::vector<std::uint32_t>{2});
  assert_int_equal(later.tiles_incomplete(), 0);
  // The link goes on where it was.
  (void)later.apply(sender.set({9}, 1000));
  assert_int_equal(later.tiles_incomplete(), 0);
  assert_int_equal(later.known_cells(), 3);

  stored.tile = 5;
  stored.cells[4] = code_cell(1000, 2048, 0);  // outside the grid
  assert_false(later.restore(stored));
  stored.cells[4] = 0x20;  // no cell at all
  assert_false(later.restore(stored));
}

TEST(a_tile_that_missed_something_is_restored_incomplete_and_mended) {
  TileStore store(small_grid());
  Sender sender(1);
  (void)sender.set({3}, 4000);
  (void)store.apply(sender.set({2}, 4000));
  const auto view = store.tile(1);
  assert_false(view->complete);
  leadline::host::StoredTile stored;
  stored.tile = 1;
  stored.generation = view->generation;
  stored.hash32 = view->hash32;
  std::copy(view->cells, view->cells + kTileArea_cells, stored.cells);
  TileStore later(small_grid());
  assert_true(later.restore(stored));
  assert_int_equal(later.tiles_incomplete(), 1);
  (void)later.apply(sender.set({3}, 4000));
  assert_int_equal(later.tiles_incomplete(), 0);
}

}  // namespace
