// A survey larger than the memory for its voxels: the pager brings tiles and sends them away, and the map is
// that of one big grid, voxel for voxel.
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <deque>
#include <map>
#include <vector>

#include "firmware/pipeline/tile_pager.hpp"
#include "model/model.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Ping;
using leadline::base::Pose;
using leadline::base::Status;
using leadline::firmware::page_bytes;
using leadline::firmware::PagerSituation;
using leadline::firmware::StoreOutput;
using leadline::firmware::TilePager;
using leadline::model::ColumnRecord;
using leadline::model::Grid;
using leadline::model::Model;
using leadline::model::ModelConfig;
using leadline::model::PingResult;
using leadline::model::TileBox;
using leadline::model::TileId;
using leadline::test::plain_table;
using leadline::test::PlainBeam;
using leadline::test::Random;

constexpr std::int32_t kDepth = 48;
// Of a map that also the smallest target holds twice, and its pages beside it: 49 tiles.
constexpr std::int32_t kSmallSide = 112;

Model big;
Model windowed;
TilePager pager;

ModelConfig config_of(std::int32_t north, std::int32_t east, std::uint32_t resident_tiles) {
  ModelConfig config = leadline::test::plain_config(north, east, kDepth);
  config.max_range_um = 60'000'000;
  config.sigma_position_mm[0] = config.sigma_position_mm[1] = 200;
  config.resident_tiles = resident_tiles;
  return config;
}

// A store that answers late: pages in memory, answers after some cycles.
class SlowStore {
 public:
  explicit SlowStore(int delay_cycles, std::uint32_t piece_bytes)
      : delay_(delay_cycles), piece_bytes_(piece_bytes) {}

  // As after a start: what is there.
  void announce() {
    for (const auto& [tile, page] : pages_) {
      std::vector<std::uint8_t> message(leadline::firmware::kStoreHas_bytes);
      leadline::firmware::put_store_has(message.data(), tile, page.generation);
      answers_.push_back({0, message});
    }
    std::vector<std::uint8_t> ready(1);
    leadline::firmware::put_store_ready(ready.data());
    answers_.push_back({0, ready});
  }

  void ask(const StoreOutput& output, std::int32_t depth) {
    if (output.save) {
      std::vector<std::uint8_t> message(leadline::firmware::kStoreSaved_bytes);
      const bool good = failing_ == 0;
      failing_ -= good ? 0 : 1;
      if (good) {
        Page& page = pages_[output.save_tile];
        page.generation = output.save_generation;
        page.bytes.resize(page_bytes(depth));
        assert_int_equal(output.voxels_bytes + output.records_bytes, page.bytes.size());
        std::memcpy(page.bytes.data(), output.voxels, output.voxels_bytes);
        std::memcpy(page.bytes.data() + output.voxels_bytes, output.records, output.records_bytes);
      }
      leadline::firmware::put_store_saved(message.data(), output.save_tile, output.save_generation,
                                          good);
      answers_.push_back({now_ + delay_, message});
    }
    if (output.load) {
      const Page& page = pages_.at(output.load_tile);
      for (std::size_t at = 0; at < page.bytes.size(); at += piece_bytes_) {
        const auto size = std::min<std::size_t>(piece_bytes_, page.bytes.size() - at);
        std::vector<std::uint8_t> message(leadline::firmware::kStorePieceHead_bytes + size);
        leadline::firmware::put_store_piece_head(message.data(), output.load_tile,
                                                 static_cast<std::uint32_t>(at),
                                                 static_cast<std::uint16_t>(size));
        std::memcpy(message.data() + leadline::firmware::kStorePieceHead_bytes, &page.bytes[at],
                    size);
        answers_.push_back({now_ + delay_ + static_cast<int>(at / piece_bytes_), message});
      }
    }
  }

  void answer(Grid* grid) {
    ++now_;
    while (!answers_.empty() && answers_.front().due <= now_) {
      pager.take(answers_.front().bytes.data(), answers_.front().bytes.size(), *grid);
      answers_.pop_front();
    }
  }

  void fail(int saves) { failing_ = saves; }
  [[nodiscard]] std::size_t pages() const { return pages_.size(); }
  [[nodiscard]] const std::vector<std::uint8_t>& page(TileId tile) const {
    return pages_.at(tile).bytes;
  }
  void forget_answers() { answers_.clear(); }

 private:
  struct Page {
    std::uint32_t generation = 0;
    std::vector<std::uint8_t> bytes;
  };
  struct Answer {
    int due;
    std::vector<std::uint8_t> bytes;
  };
  int delay_;
  std::uint32_t piece_bytes_;
  int now_ = 0;
  int failing_ = 0;
  std::map<TileId, Page> pages_;
  std::deque<Answer> answers_;
};

struct Sounding {
  Ping ping;
  Pose pose;
};

// Lines up and down over the grid, five metres above a bottom of hills; two pings a metre.
std::vector<Sounding> lawn_mower(std::int32_t north, std::int32_t east, std::int32_t spacing,
                                 std::uint64_t stream) {
  Random random(stream);
  std::vector<Sounding> soundings;
  std::int64_t t_us = 1'000'000;
  int line = 0;
  for (std::int32_t e = spacing / 2; e < east; e += spacing, ++line) {
    for (std::int32_t step = 0; step < 2 * north; ++step) {
      const std::int32_t along = line % 2 == 0 ? step : 2 * north - 1 - step;
      Sounding sounding{};
      Pose& pose = sounding.pose;
      pose.t_us = t_us;
      pose.position_um[0] = along * 500'000;
      pose.position_um[1] = e * 1'000'000;
      pose.position_um[2] = 5'000'000;
      pose.validity = leadline::base::kPoseAll;
      for (int axis = 0; axis < 3; ++axis) {
        pose.covariance.sigma_position_mm[axis] = 100;
      }
      Ping& ping = sounding.ping;
      ping.t_transmit_us = t_us;
      ping.kind = leadline::base::ReturnKind::kRange;
      // Down, with a swing to both sides.
      ping.elevation_bam32 = static_cast<leadline::base::Bam32>(
          0x40000000U + static_cast<std::uint32_t>(random.between(-0x08000000, 0x08000000)));
      ping.range_um = 20'000'000 + random.between(-3'000'000, 3'000'000);
      soundings.push_back(sounding);
      t_us += 50'000;
    }
  }
  return soundings;
}

void configure(Model* model, const ModelConfig& config) {
  const std::int64_t voxels = std::int64_t{config.size[0]} * config.size[1] * config.size[2];
  if (config.resident_tiles == 0 && voxels > leadline::model::kVoxelCapacity) {
    leadline::test::skip_test("the map to compare with is larger than this target's memory");
  }
  const auto table = plain_table(PlainBeam{});
  assert_int_equal(model->configure(config, &table, sizeof table), Status::kOk);
}

PagerSituation situation_of(const std::vector<Sounding>& soundings, std::size_t k) {
  const auto cells = [](const Sounding& s, int axis) {
    return static_cast<std::int32_t>(s.pose.position_um[axis] / 1'000'000);
  };
  // Where it will be in some seconds, as from its speed.
  constexpr std::size_t kAhead = 60;
  const std::size_t before = k == 0 ? 0 : k - 1;
  const std::int64_t vn = soundings[k].pose.position_um[0] - soundings[before].pose.position_um[0];
  return PagerSituation{
      true,
      cells(soundings[k], 0),
      cells(soundings[k], 1),
      cells(soundings[k], 0) +
          static_cast<std::int32_t>(vn * static_cast<std::int64_t>(kAhead) / 1'000'000),
      cells(soundings[k], 1),
      TileBox{0, -1, 0, -1}};
}

struct Flight {
  std::uint32_t held_cycles = 0;
  std::uint32_t held_pings = 0;
  std::uint32_t shed = 0;
};

void one_cycle(const PagerSituation& situation, SlowStore* store) {
  StoreOutput output{};
  pager.cycle(situation, windowed.grid(), output);
  if (output.read) {
    windowed.read_touched_tile(output.read_tile);
  }
  store->ask(output, kDepth);
  store->answer(&windowed.grid());
}

// A ping a cycle; one that must wait holds those behind it, up to `patience` cycles.
Flight fly(const std::vector<Sounding>& soundings, SlowStore* store, int patience) {
  Flight flight;
  while (!pager.ready()) {
    store->answer(&windowed.grid());
  }
  for (std::size_t k = 0; k < soundings.size(); ++k) {
    PagerSituation situation = situation_of(soundings, k);
    int waited = 0;
    PingResult result = PingResult::kAbsentTile;
    while (true) {
      result = windowed.integrate(soundings[k].ping, soundings[k].pose);
      if (result != PingResult::kAbsentTile || waited == patience) {
        break;
      }
      situation.wanted = windowed.wanted_tiles();
      one_cycle(situation, store);
      ++waited;
      ++flight.held_cycles;
    }
    flight.held_pings += waited > 0 ? 1U : 0U;
    flight.shed += result == PingResult::kAbsentTile ? 1U : 0U;
    situation.wanted = TileBox{0, -1, 0, -1};
    one_cycle(situation, store);
    // Far too seldom: most tiles leave before their depths were looked at.
    TileId touched = 0;
    if (k % 2000 == 0 && windowed.take_touched_tile(touched)) {
      (void)windowed.extract_tile(touched);
    }
  }
  return flight;
}

void finish(SlowStore* store) {
  std::uint8_t message[1];
  pager.take(message, leadline::firmware::put_store_finish(message), windowed.grid());
  for (int k = 0; k < 100'000 && !pager.settled(windowed.grid()); ++k) {
    one_cycle(PagerSituation{false, 0, 0, 0, 0, TileBox{0, -1, 0, -1}}, store);
  }
  assert_true(pager.settled(windowed.grid()));
}

// Side records but for what extraction notes in them, which follows from the voxels.
std::vector<ColumnRecord> records_of(const void* bytes) {
  std::vector<ColumnRecord> records(256);
  std::memcpy(records.data(), bytes, records.size() * sizeof(ColumnRecord));
  constexpr int kNoted = leadline::model::kColumnMultiSurface | leadline::model::kColumnLone |
                         leadline::model::kColumnDirty;
  for (ColumnRecord& record : records) {
    record.flags = static_cast<std::uint8_t>(record.flags & ~kNoted);
  }
  return records;
}

// Voxels and side records of every tile, as the store has them, are those of the big grid.
std::size_t differing_tiles(const SlowStore& store) {
  std::size_t differing = 0;
  for (TileId id = 0; id < big.grid().tile_count(); ++id) {
    const std::size_t voxels_bytes = big.grid().tile_voxel_count() * 4U;
    if (big.grid().tile(id).generation == 0) {
      continue;
    }
    const std::vector<std::uint8_t>& page = store.page(id);
    const auto stored = records_of(page.data() + voxels_bytes);
    const auto wanted = records_of(&big.grid().column(id << 8U));
    const bool same = std::memcmp(page.data(), big.grid().tile_voxels(id), voxels_bytes) == 0 &&
                      std::memcmp(stored.data(), wanted.data(), 256 * sizeof(ColumnRecord)) == 0;
    differing += same ? 0U : 1U;
  }
  return differing;
}

// Depths and sigmas are those of the big grid, though most voxels are not there any more.
void assert_same_results() {
  big.extract();
  for (TileId id = 0; id < windowed.grid().tile_count(); ++id) {
    (void)windowed.extract_tile(id);
  }
  for (std::int32_t n = 0; n < windowed.grid().north_cells(); ++n) {
    for (std::int32_t e = 0; e < windowed.grid().east_cells(); ++e) {
      assert_int_equal(windowed.result(n, e).depth_q8, big.result(n, e).depth_q8);
      assert_int_equal(windowed.result(n, e).sigma_q12, big.result(n, e).sigma_q12);
    }
  }
}

void report(const char* what, const Flight& flight) {
  const auto& counters = pager.counters();
  std::printf(
      "%s: %u tiles, %u pages; %u begun, %u loaded, %u evicted, %u saved; %u pings held, %u "
      "cycles; %u shed\n",
      what, windowed.grid().tile_count(), windowed.grid().page_count(), counters.tiles_begun,
      counters.tiles_loaded, counters.tiles_evicted, counters.tiles_saved, flight.held_pings,
      flight.held_cycles, flight.shed);
}

TEST(ten_times_the_memory_gives_the_map_of_one_big_grid) {
  constexpr std::int32_t kNorth = 480;
  constexpr std::int32_t kEast = 320;  // 30 x 20 tiles
  constexpr std::uint32_t kWindow = 60;
  const std::vector<Sounding> soundings = lawn_mower(kNorth, kEast, 20, 1);
  configure(&big, config_of(kNorth, kEast, 0));
  configure(&windowed, config_of(kNorth, kEast, kWindow));
  assert_int_equal(windowed.grid().tile_count(), 10 * kWindow);
  for (const Sounding& sounding : soundings) {
    assert_int_equal(big.integrate(sounding.ping, sounding.pose), PingResult::kFused);
  }
  for (const int delay : {1, 40}) {
    configure(&windowed, config_of(kNorth, kEast, kWindow));
    SlowStore store(delay, 8192);
    pager.configure(windowed.grid(), 20, true);
    store.announce();
    const Flight flight = fly(soundings, &store, 10'000);
    finish(&store);
    report(delay == 1 ? "quick store" : "slow store", flight);
    assert_int_equal(flight.shed, 0);
    assert_int_equal(differing_tiles(store), 0);
    assert_true(pager.counters().tiles_evicted > 10 * kWindow / 2);
    assert_true(pager.counters().tiles_loaded > 0);
    assert_int_equal(pager.counters().input_rejected, 0);
    assert_int_equal(windowed.counters().voxel_updates, big.counters().voxel_updates);
    assert_same_results();
    // The blank page, where absent tiles are read from, was never written.
    const auto* const blank = static_cast<const std::uint8_t*>(
        windowed.grid().page_storage(windowed.grid().page_count()));
    assert_true(std::all_of(blank, blank + windowed.grid().tile_voxel_count() * 4U,
                            [](std::uint8_t byte) { return byte == 0; }));
  }
}

// Beams flat to both sides, 50 m each: a ping needs a strip of tiles far outside of what is kept about the vehicle and
// ahead of it, and the window holds that strip only once those give way.
TEST(a_wide_fan_gets_the_room_of_what_lies_ahead) {
  const std::int32_t side = std::min(320, leadline::test::widest_side_cells());
  std::vector<Sounding> soundings = lawn_mower(side, side, 80, 7);
  for (std::size_t k = 0; k < soundings.size(); ++k) {
    Ping& ping = soundings[k].ping;
    const bool starboard = k % 2 == 0;
    ping.azimuth_bam32 = starboard ? 0x40000000U : 0xC0000000U;
    ping.elevation_bam32 = 0x10000000U;  // 22.5 degrees down
    ping.range_um = 50'000'000;
  }
  configure(&big, config_of(side, side, 0));
  std::uint32_t fused = 0;
  for (const Sounding& sounding : soundings) {
    fused += big.integrate(sounding.ping, sounding.pose) == PingResult::kFused ? 1U : 0U;
  }
  configure(&windowed, config_of(side, side, 18));
  SlowStore store(2, 8192);
  pager.configure(windowed.grid(), 20, true);
  store.announce();
  const Flight flight = fly(soundings, &store, 500);
  finish(&store);
  report("wide fan", flight);
  assert_true(fused > soundings.size() / 2);
  assert_int_equal(flight.shed, 0);
  assert_int_equal(differing_tiles(store), 0);
}

TEST(what_never_fits_is_known_at_once) {
  configure(&windowed, config_of(112, 112, 20));
  assert_true(TilePager::fits(TileBox{0, -1, 0, -1}, windowed.grid()));
  assert_true(TilePager::fits(TileBox{0, 3, 0, 4}, windowed.grid()));
  assert_true(!TilePager::fits(TileBox{0, 2, 0, 6}, windowed.grid()));
}

TEST(who_must_wait_too_long_is_shed_and_counted) {
  const std::int32_t side = std::min(320, leadline::test::widest_side_cells());
  const std::vector<Sounding> soundings = lawn_mower(side, side, 40, 2);
  configure(&windowed, config_of(side, side, 36));
  SlowStore store(200, 1024);
  pager.configure(windowed.grid(), 20, true);
  store.announce();
  store.fail(20);
  const Flight flight = fly(soundings, &store, 2);
  // A board's smaller flight ends while saves still fail.
  finish(&store);
  assert_true(!pager.failing());
  report("no patience", flight);
  assert_true(flight.shed > 0);
  assert_int_equal(pager.counters().saves_failed, 20);
  const auto& pings = windowed.counters().pings;
  assert_int_equal(pings[static_cast<int>(PingResult::kFused)] + flight.shed, soundings.size());
}

TEST(a_restarted_vehicle_goes_on_with_its_map) {
  constexpr std::int32_t kSide = kSmallSide;
  constexpr std::uint32_t kTiles = kSide * kSide / 256;
  const std::vector<Sounding> soundings = lawn_mower(kSide, kSide, 20, 3);
  configure(&big, config_of(kSide, kSide, 0));
  for (const Sounding& sounding : soundings) {
    assert_int_equal(big.integrate(sounding.ping, sounding.pose), PingResult::kFused);
  }
  SlowStore store(3, 8192);
  configure(&windowed, config_of(kSide, kSide, kTiles));
  pager.configure(windowed.grid(), 20, true);
  store.announce();
  (void)fly(soundings, &store, 10'000);
  finish(&store);
  assert_int_equal(differing_tiles(store), 0);
  // Power on: an empty model; the store says what it has; tiles come as the vehicle meets them.
  configure(&windowed, config_of(kSide, kSide, kTiles));
  pager.configure(windowed.grid(), 20, true);
  store.announce();
  while (!pager.ready()) {
    store.answer(&windowed.grid());
  }
  for (TileId id = 0; id < kTiles; ++id) {
    const auto n = static_cast<std::int32_t>(id) / windowed.grid().tiles_east();
    const auto e = static_cast<std::int32_t>(id) % windowed.grid().tiles_east();
    for (int k = 0; k < 200 && !windowed.grid().resident(id); ++k) {
      one_cycle(PagerSituation{false, 0, 0, 0, 0, TileBox{n, n, e, e}}, &store);
    }
    assert_true(windowed.grid().resident(id));
  }
  assert_true(windowed.grid().map_hash() == big.grid().map_hash());
  big.extract();
  windowed.extract();
  for (std::int32_t n = 0; n < kSide; ++n) {
    for (std::int32_t e = 0; e < kSide; ++e) {
      assert_int_equal(windowed.result(n, e).depth_q8, big.result(n, e).depth_q8);
      assert_int_equal(windowed.result(n, e).sigma_q12, big.result(n, e).sigma_q12);
    }
  }
  // And the touched list tells the link of all of them.
  TileId tile = 0;
  std::size_t listed = 0;
  while (windowed.take_touched_tile(tile)) {
    ++listed;
  }
  assert_int_equal(listed, store.pages());
}

// What a topside that lost its tether is owed: the vehicle started again meanwhile, and its map does not fit.
TEST(a_restarted_vehicle_hands_over_a_map_larger_than_its_window) {
  constexpr std::int32_t kSide = kSmallSide;
  constexpr std::uint32_t kWindow = 20;
  const std::vector<Sounding> soundings = lawn_mower(kSide, kSide, 20, 6);
  configure(&big, config_of(kSide, kSide, 0));
  for (const Sounding& sounding : soundings) {
    assert_int_equal(big.integrate(sounding.ping, sounding.pose), PingResult::kFused);
  }
  SlowStore store(3, 8192);
  configure(&windowed, config_of(kSide, kSide, kWindow));
  pager.configure(windowed.grid(), 20, true);
  store.announce();
  (void)fly(soundings, &store, 10'000);
  finish(&store);
  configure(&windowed, config_of(kSide, kSide, kWindow));
  pager.configure(windowed.grid(), 20, true);
  store.announce();
  while (!pager.ready()) {
    store.answer(&windowed.grid());
  }
  // It stays where it is; every tile comes, is read and leaves again, once.
  for (int k = 0; k < 10'000 && pager.counters().tiles_loaded < store.pages(); ++k) {
    one_cycle(
        PagerSituation{true, kSide / 2, kSide / 2, kSide / 2, kSide / 2, TileBox{0, -1, 0, -1}},
        &store);
  }
  assert_int_equal(pager.counters().tiles_loaded, store.pages());
  for (int k = 0; k < 2'000; ++k) {
    one_cycle(
        PagerSituation{true, kSide / 2, kSide / 2, kSide / 2, kSide / 2, TileBox{0, -1, 0, -1}},
        &store);
  }
  assert_int_equal(pager.counters().tiles_loaded, store.pages());
  assert_same_results();
}

TEST(what_a_store_says_may_be_garbage) {
  configure(&windowed, config_of(64, 64, 9));
  pager.configure(windowed.grid(), 20, true);
  Random random(4);
  for (int trial = 0; trial < 20'000; ++trial) {
    std::uint8_t bytes[64];
    for (std::uint8_t& byte : bytes) {
      byte =
          static_cast<std::uint8_t>(random.between(0, 3) == 0 ? random.next() : random.next() & 7U);
    }
    pager.take(bytes, static_cast<std::size_t>(random.between(0, 64)), windowed.grid());
    StoreOutput output{};
    pager.cycle(PagerSituation{true, 32, 32, 40, 32, TileBox{0, 1, 0, 1}}, windowed.grid(), output);
  }
  assert_true(pager.counters().input_rejected > 1000);
}

TEST(without_a_store_nothing_leaves) {
  const std::int32_t side = std::min(320, leadline::test::widest_side_cells());
  configure(&windowed, config_of(side, side, 30));
  pager.configure(windowed.grid(), 20, false);
  assert_true(pager.ready());
  SlowStore store(1, 8192);
  const std::vector<Sounding> soundings = lawn_mower(side, side, side / 2, 5);
  const Flight flight = fly(soundings, &store, 1);
  assert_true(flight.shed > 0);
  assert_int_equal(pager.counters().tiles_evicted, 0);
  assert_int_equal(store.pages(), 0);
  assert_true(pager.counters().cycles_full > 0);
}

}  // namespace
