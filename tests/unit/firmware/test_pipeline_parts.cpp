// The small parts of the pipeline: ping queue, tile set, downlink, link map.
#include <deque>
#include <map>
#include <vector>

#include "firmware/pipeline/downlink.hpp"
#include "firmware/pipeline/link_map.hpp"
#include "firmware/pipeline/ping_queue.hpp"
#include "firmware/pipeline/tile_set.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Ping;
using leadline::base::ReturnKind;
using leadline::base::Status;
using leadline::firmware::Downlink;
using leadline::firmware::kDownlinkCapacity_bytes;
using leadline::firmware::LinkMap;
using leadline::firmware::PingQueue;
using leadline::firmware::TileCells;
using leadline::firmware::TileSet;
using leadline::model::TileId;
using leadline::test::Random;

PingQueue queue;
TileSet set;
Downlink downlink;
LinkMap link_map;
leadline::model::Model model;

Ping profile_ping(std::int64_t t_us, std::vector<std::uint16_t>& bins) {
  Ping ping{};
  ping.t_transmit_us = t_us;
  ping.kind = ReturnKind::kProfile;
  ping.profile = {bins.data(), 1000, 500, static_cast<std::uint16_t>(bins.size())};
  return ping;
}

TEST(the_queue_keeps_order_and_intensities) {
  // Against a deque that copies.
  queue.clear();
  Random random(1);
  std::deque<std::pair<Ping, std::vector<std::uint16_t>>> shadow;
  int full = 0;
  for (std::int64_t i = 0; i < 60'000; ++i) {
    const bool push = random.between(0, i / 2000 % 2 == 0 ? 3 : 1) != 0;
    if (push) {
      std::vector<std::uint16_t> bins(static_cast<std::size_t>(random.between(0, 1200)));
      for (std::uint16_t& bin : bins) {
        bin = static_cast<std::uint16_t>(random.next());
      }
      Ping ping{};
      ping.t_transmit_us = i;
      if (!bins.empty()) {
        ping = profile_ping(i, bins);
      }
      const Status status = queue.push(ping, 0);
      if (status == Status::kOk) {
        shadow.emplace_back(ping, bins);
      } else {
        assert_int_equal(status, Status::kFull);
        assert_true(shadow.size() > 40);
        ++full;
      }
    } else if (!shadow.empty()) {
      const Ping& front = queue.front();
      assert_int_equal(front.t_transmit_us, shadow.front().first.t_transmit_us);
      if (front.kind == ReturnKind::kProfile) {
        assert_memory_equal(front.profile.intensity, shadow.front().second.data(),
                            shadow.front().second.size() * 2);
      }
      queue.pop();
      shadow.pop_front();
    }
    assert_int_equal(queue.size(), shadow.size());
    assert_int_equal(queue.empty(), shadow.empty());
  }
  assert_true(full > 100);
}

TEST(the_queue_refuses_what_never_fits) {
  queue.clear();
  queue.pop();
  std::vector<std::uint16_t> none;
  assert_int_equal(queue.push(profile_ping(0, none), 0), Status::kOutOfRange);
  Ping ping{};
  ping.kind = ReturnKind::kProfile;
  ping.profile.bin_count = 10;
  assert_int_equal(queue.push(ping, 0), Status::kOutOfRange);
  ping.kind = ReturnKind::kRange;
  for (std::size_t i = 0; i < PingQueue::kCapacity_count; ++i) {
    assert_int_equal(queue.push(ping, 0), Status::kOk);
  }
  assert_int_equal(queue.push(ping, 0), Status::kFull);
}

TEST(tiles_go_by_weight_and_none_waits_for_ever) {
  set.reset(100);
  TileId tile = 77;
  assert_false(set.best(0, tile));
  set.add(5, 10, 0);
  set.add(9, 200, 0);
  set.add(7, 200, 0);
  assert_true(set.best(0, tile));
  assert_int_equal(tile, 7);
  set.add(5, 4, 3);  // never less, and as old as ever
  set.add(5, 100'000, 3);
  assert_true(set.best(3, tile));
  assert_int_equal(tile, 5);
  assert_true(set.contains(9));
  set.remove(9);
  set.remove(9);
  assert_false(set.contains(9));
  assert_int_equal(set.size(), 2);
  assert_int_equal(set.oldest_age(3), 3);

  // A hundred tiles, of which one is touched every time with full weight: the lightest gets its turn.
  set.reset(100);
  for (TileId id = 0; id < 100; ++id) {
    set.add(id, id == 0 ? 0 : TileSet::kMaxWeight, 0);
  }
  std::uint32_t cycle = 1;
  for (;; ++cycle) {
    assert_true(cycle <= TileSet::kMaxWeight + 101);
    assert_true(set.best(cycle, tile));
    set.remove(tile);
    if (tile == 0) {
      break;
    }
    set.add(tile, TileSet::kMaxWeight, cycle);
  }
  assert_true(cycle > 100);
}

TEST(the_set_agrees_with_a_map) {
  set.reset(64);
  std::map<TileId, std::pair<std::uint32_t, std::uint32_t>> shadow;  // since, weight
  Random random(2);
  for (std::uint32_t cycle = 0; cycle < 20'000; ++cycle) {
    const auto id = static_cast<TileId>(random.between(0, 63));
    const auto weight = static_cast<std::uint32_t>(random.between(0, 255));
    if (random.between(0, 1) == 0) {
      set.add(id, weight, cycle);
      const auto found = shadow.find(id);
      if (found == shadow.end()) {
        shadow[id] = {cycle, weight};
      } else {
        found->second.second = std::max(found->second.second, weight);
      }
    } else if (random.between(0, 2) == 0) {
      set.remove(id);
      shadow.erase(id);
    }
    TileId best = 0;
    assert_int_equal(set.best(cycle, best), !shadow.empty());
    if (!shadow.empty()) {
      std::uint32_t top = 0;
      for (const auto& entry : shadow) {
        top = std::max(top, entry.second.second + cycle - entry.second.first);
      }
      assert_int_equal(shadow[best].second + cycle - shadow[best].first, top);
    }
    assert_int_equal(set.size(), shadow.size());
    // Of those that are due alone.
    const auto heavy = static_cast<std::uint32_t>(random.between(200, 300));
    const auto old = static_cast<std::uint32_t>(random.between(0, 400));
    std::uint32_t top = 0;
    bool any = false;
    for (const auto& [tile, entry] : shadow) {
      assert_int_equal(set.age(tile, cycle), cycle - entry.first);
      if (entry.second >= heavy || cycle - entry.first >= old) {
        any = true;
        top = std::max(top, entry.second + cycle - entry.first);
      }
    }
    assert_int_equal(set.best_due(cycle, heavy, old, best), any);
    if (any) {
      assert_int_equal(shadow[best].second + cycle - shadow[best].first, top);
      assert_true(shadow[best].second >= heavy || cycle - shadow[best].first >= old);
    }
  }
}

TEST(the_downlink_counts_every_byte) {
  downlink.configure(1000, 200);
  assert_int_equal(downlink.burst_bytes(), 262);
  assert_int_equal(downlink.longest_frame_bytes(), 200);
  downlink.begin_cycle(0, 10'000);
  std::uint8_t payload[300] = {1, 2, 3};
  std::vector<std::uint8_t> all;
  // The bucket is full: one frame of 200, and not half another.
  const std::size_t most = downlink.free_payload_bytes();
  assert_int_equal(leadline::proto::frame_bound_bytes(most) <= 200, 1);
  assert_true(downlink.put(payload, most));
  assert_false(downlink.put(payload, most / 2));  // no tokens
  all.insert(all.end(), downlink.data(), downlink.data() + downlink.size_bytes());
  downlink.begin_cycle(10'000, 10'000);  // 10 bytes more
  assert_int_equal(downlink.size_bytes(), 0);
  assert_false(downlink.put(payload, 250));  // longer than the MTU
  assert_true(downlink.put(payload, 1));
  all.insert(all.end(), downlink.data(), downlink.data() + downlink.size_bytes());
  assert_int_equal(downlink.total_bytes(), all.size());
  assert_int_equal(downlink.total_frames(), 2);
  std::uint64_t hash = leadline::proto::kFnvOffset;
  for (const std::uint8_t byte : all) {
    hash = (hash ^ byte) * leadline::proto::kFnvPrime;
  }
  assert_true(downlink.hash() == hash);
  // Room holds besides, and a pause of years fills the bucket once.
  downlink.begin_cycle(std::int64_t{1} << 60U, 9);
  assert_int_equal(downlink.free_bytes(), 9);
  assert_false(downlink.put(payload, 8));
  downlink.begin_cycle(0, UINT32_MAX);
  assert_int_equal(downlink.free_bytes(), 262);
  // A second's worth is the most that goes at once, an eighth where that is more than a frame; but some frame goes
  // over any link.
  downlink.configure(960, 1200);
  assert_int_equal(downlink.longest_frame_bytes(), 960);
  downlink.configure(120, 1200);
  assert_int_equal(downlink.longest_frame_bytes(), leadline::firmware::kLeastBurst_bytes);
  downlink.configure(100'000, 1200);
  assert_int_equal(downlink.longest_frame_bytes(), 1200);
  assert_int_equal(downlink.burst_bytes(), 12'500 + 6'250);
  // And so does the buffer.
  downlink.configure(UINT32_MAX, 1400);
  downlink.begin_cycle(1'000'000, UINT32_MAX);
  std::size_t frames = 0;
  while (downlink.put(payload, 300)) {
    ++frames;
  }
  assert_true(frames >= 50);
  assert_true(downlink.size_bytes() <= kDownlinkCapacity_bytes);
}

TEST(the_link_map_owes_what_changed_and_what_was_asked_for) {
  const auto table = leadline::test::plain_table(leadline::test::PlainBeam{});
  const auto config = leadline::test::plain_config(20, 40, 32);
  assert_int_equal(model.configure(config, &table, sizeof(table)), Status::kOk);
  link_map.reset(model.grid().tile_count());
  const std::uint64_t empty = link_map.hash();
  for (int i = 0; i < 20; ++i) {
    static_cast<void>(
        model.integrate(leadline::test::ping_along(0, 90, 15), leadline::test::pose_at(8, 8, 1)));
  }
  static_cast<void>(model.extract_tile(0));
  TileCells present;
  link_map.present(model, 0, present);
  const auto owed = link_map.owed(0, present);
  assert_true(owed.count() > 0);
  assert_true(owed.test(8 * 16 + 8));
  assert_int_equal(link_map.sent(0, present, owed), owed.count());
  assert_int_equal(link_map.known_tiles(), 1);
  link_map.present(model, 0, present);
  assert_int_equal(link_map.owed(0, present).count(), 0);
  assert_true(link_map.hash() != empty);
  // Asked for: all 256, of which none has changed; in two parts.
  link_map.force(0);
  auto all = link_map.owed(0, present);
  assert_int_equal(all.count(), 256);
  auto half = all;
  for (int row = 8; row < 16; ++row) {
    half.rows[row] = 0;
  }
  assert_int_equal(link_map.sent(0, present, half), 0);
  assert_int_equal(link_map.owed(0, present).count(), 128);
  assert_int_equal(link_map.sent(0, present, link_map.owed(0, present)), 0);
  assert_int_equal(link_map.owed(0, present).count(), 0);
  // Outside the grid everything is unknown: rows 20 .. 31 of the second row of tiles.
  link_map.present(model, 3, present);
  for (std::size_t cell = 4 * 16; cell < 256; ++cell) {
    assert_int_equal(present[cell], leadline::proto::kUnknownCell);
  }
}

}  // namespace
