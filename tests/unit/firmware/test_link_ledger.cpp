// Frames under way: who came, who was lost, who nobody knows of.
#include <vector>

#include "firmware/pipeline/link_ledger.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::firmware::FrameTile;
using leadline::firmware::LinkLedger;
using leadline::test::Random;

LinkLedger ledger;

constexpr TimeUs kSecond_us = 1'000'000;

void send(std::uint16_t tag, TimeUs t_us, std::vector<std::uint32_t> tiles = {7}) {
  std::vector<FrameTile> carried;
  for (const std::uint32_t tile : tiles) {
    carried.push_back({tile, 0, 0, {{1}}});
  }
  assert_true(ledger.has_room(carried.size()));
  ledger.sent(tag, carried.data(), carried.size(), t_us);
}

std::vector<std::uint32_t> named(LinkLedger::Word wanted, std::uint16_t tag, TimeUs t_us) {
  std::vector<std::uint32_t> tiles;
  const LinkLedger::Word word = ledger.confirm(tag, t_us);
  FrameTile tile{};
  while (ledger.next_confirmed(tile)) {
    if (word == wanted) {
      tiles.push_back(tile.tile);
    }
  }
  return tiles;
}

std::vector<std::uint32_t> confirmed(std::uint16_t tag, TimeUs t_us) {
  return named(LinkLedger::Word::kCame, tag, t_us);
}

std::vector<std::uint32_t> came_late(std::uint16_t tag, TimeUs t_us) {
  return named(LinkLedger::Word::kCameLate, tag, t_us);
}

std::vector<std::uint32_t> lost(TimeUs t_us, bool idle = false) {
  std::vector<std::uint32_t> tiles;
  FrameTile tile{};
  while (ledger.next_lost(t_us, idle, tile)) {
    tiles.push_back(tile.tile);
  }
  return tiles;
}

TEST(a_frame_that_three_overtook_is_lost) {
  ledger.reset(5 * kSecond_us);
  for (std::uint16_t tag = 0; tag < 5; ++tag) {
    send(tag, tag * 1000, {tag, 100U + tag});
  }
  assert_true(lost(5000).empty());  // nobody reports
  ledger.note_report(6000);
  assert_true(confirmed(3, 6000) == (std::vector<std::uint32_t>{3, 103}));
  assert_true(lost(6000) == (std::vector<std::uint32_t>{0, 100}));
  assert_true(confirmed(3, 6000).empty());  // once
  assert_true(came_late(0, 6000) == (std::vector<std::uint32_t>{0, 100}));
  assert_true(came_late(0, 6000).empty());
  assert_true(confirmed(99, 6000).empty());
  assert_int_equal(ledger.under_way_frames(), 3);
  assert_true(confirmed(1, 7000).size() == 2);
}

// Frames' numbers begin two rings before they wrap.
TEST(three_overtake_across_number_0) {
  for (std::uint32_t before = 1; before <= 3; ++before) {
    ledger.reset(5 * kSecond_us);
    TimeUs t_us = 0;
    for (std::uint32_t k = 0; k < 2 * LinkLedger::kFrames - before; ++k) {
      send(static_cast<std::uint16_t>(1000 + k), ++t_us);
      ledger.note_report(t_us);
      assert_int_equal(confirmed(static_cast<std::uint16_t>(1000 + k), t_us).size(), 1);
    }
    assert_int_equal(ledger.under_way_frames(), 0);
    for (std::uint16_t tag = 1; tag <= 4; ++tag) {
      send(tag, ++t_us, {tag});
    }
    ledger.note_report(t_us);
    assert_int_equal(confirmed(3, t_us).size(), 1);
    assert_true(lost(t_us).empty());
    assert_int_equal(confirmed(4, t_us).size(), 1);
    assert_true(lost(t_us) == std::vector<std::uint32_t>{1});
    assert_int_equal(confirmed(2, t_us).size(), 1);
    assert_int_equal(ledger.under_way_frames(), 0);
  }
}

TEST(silence_takes_patience_and_in_the_end_nobody_listens) {
  ledger.reset(5 * kSecond_us);
  send(1, 0);
  ledger.note_report(100'000);
  (void)confirmed(1, 100'000);
  assert_true(ledger.heard());
  TimeUs t_us = kSecond_us;
  send(2, t_us);
  const TimeUs patience_us = ledger.patience_us();
  assert_true(lost(t_us + 2 * patience_us).empty());  // a report may be lost itself
  assert_int_equal(lost(t_us + 20 * patience_us).size(), 1);
  t_us += 20 * patience_us;
  int rounds = 0;
  while (ledger.heard()) {
    t_us += kSecond_us;
    if (ledger.under_way_frames() == 0) {
      send(3, t_us);
    }
    (void)lost(t_us);
    rounds += 1;
    assert_true(rounds < 600);
  }
  // What is under way then stays: it is given up when its room is needed.
  send(4, t_us + 1, {42});
  assert_true(lost(t_us + 3600 * kSecond_us).empty());
}

TEST(a_report_that_passes_over_a_frame_is_its_loss) {
  ledger.reset(5 * kSecond_us);
  send(1, 0);
  ledger.note_report(50'000);
  (void)confirmed(1, 50'000);
  send(2, 60'000, {9});
  send(3, 400'000, {10});
  ledger.note_report(450'000);
  assert_int_equal(confirmed(3, 450'000).size(), 1);
  // It may have been overtaken on the way: not before a report that could name what did.
  assert_true(lost(450'000).empty());
  ledger.note_report(490'000);
  assert_true(lost(490'000) == std::vector<std::uint32_t>{9});
}

TEST(the_oldest_makes_room) {
  ledger.reset(5 * kSecond_us);
  for (std::uint32_t k = 0; k < LinkLedger::kFrames; ++k) {
    send(static_cast<std::uint16_t>(k), k, {k});
  }
  assert_false(ledger.has_room(1));
  FrameTile tile{};
  assert_true(ledger.give_up_oldest(tile));
  assert_int_equal(tile.tile, 0);
  assert_false(ledger.give_up_oldest(tile));
  assert_true(ledger.has_room(1));
  assert_int_equal(ledger.under_way_frames(), LinkLedger::kFrames - 1);
}

// A line that loses and has nothing else to carry carries again what nobody has named, for so many bytes.
TEST(an_idle_line_repeats_within_its_means) {
  ledger.reset(5 * kSecond_us);
  for (std::uint16_t tag = 0; tag < 40; ++tag) {
    send(tag, tag * 1000, {tag});
  }
  ledger.note_report(45'000);
  for (std::uint16_t tag = 4; tag < 30; ++tag) {
    (void)confirmed(tag, 45'000);
  }
  assert_int_equal(lost(45'000).size(), 4);  // overtaken
  for (std::uint16_t tag = 0; tag < 4; ++tag) {
    send(static_cast<std::uint16_t>(100 + tag), 46'000, {tag});
  }
  assert_true(lost(60'000).empty());
  const std::vector<std::uint32_t> again = lost(60'000, true);
  assert_true(!again.empty() && again.front() == 30);
  for (const std::uint32_t tile : again) {
    send(static_cast<std::uint16_t>(200 + tile), 61'000, {tile});
  }
  // 40 cells in all, a loss of some 15 %: 1.2 x 40 / 0.85 is all that it may cost.
  std::size_t sent = 44 + again.size();
  for (TimeUs t_us = 62'000; t_us < 80'000; t_us += 1000) {
    for (const std::uint32_t tile : lost(t_us, true)) {
      send(static_cast<std::uint16_t>(1000 + sent), t_us, {tile});
      sent += 1;
    }
  }
  assert_true(sent > 46 && sent < 60);
  assert_true(ledger.next_loss_us() > 80'000 && ledger.next_loss_us() != INT64_MAX);
  // The first copies come after all.
  ledger.note_report(81'000);
  assert_true(came_late(30, 81'000) == std::vector<std::uint32_t>{30});
}

TEST(what_came_in_one_frame_is_not_lost_with_another) {
  ledger.reset(5 * kSecond_us);
  send(1, 0, {7, 8});
  send(2, 1000, {7});
  for (std::uint16_t tag = 3; tag < 7; ++tag) {
    send(tag, 2000, {tag});
  }
  ledger.note_report(10'000);
  assert_true(ledger.confirm(1, 10'000) == LinkLedger::Word::kCame);
  FrameTile tile{};
  while (ledger.next_confirmed(tile)) {
    ledger.cover(tile);
  }
  assert_int_equal(confirmed(6, 10'000).size(), 1);
  int cells = 0;
  bool told = false;
  while (ledger.next_lost(10'000, false, tile)) {
    told = told || tile.tile == 7;
    cells += tile.tile == 7 ? tile.cells.count() : 0;
  }
  assert_true(told);
  assert_int_equal(cells, 0);
}

// A lost frame's name comes again: the report means the later one.
TEST(a_name_used_again_revives_no_lost_frame) {
  ledger.reset(5 * kSecond_us);
  for (std::uint16_t tag = 1; tag < 6; ++tag) {
    send(tag, tag * 1000, {tag});
  }
  ledger.note_report(10'000);
  assert_int_equal(confirmed(5, 10'000).size(), 1);
  assert_true(lost(10'000) == (std::vector<std::uint32_t>{1, 2}));
  send(1, 11'000, {30});
  assert_true(ledger.confirm(1, 30'000) == LinkLedger::Word::kNone);
}

// One name, two frames: a report that names it may mean either, so neither counts as come.
TEST(frames_that_share_a_name_both_go_again) {
  ledger.reset(5 * kSecond_us);
  send(7, 0, {1});
  send(8, 1000, {2});
  send(7, 2000, {3});
  for (std::uint16_t tag = 20; tag < 24; ++tag) {
    send(tag, 3000 + tag, {tag});
  }
  ledger.note_report(10'000);
  assert_true(confirmed(7, 10'000).empty());
  assert_true(confirmed(8, 10'000) == std::vector<std::uint32_t>{2});
  assert_true(confirmed(23, 10'000) == std::vector<std::uint32_t>{23});
  assert_true(lost(10'000) == (std::vector<std::uint32_t>{1, 3, 20}));
}

// A frame whose name a report has told already: to tell it once more is not the news of another that bears it.
TEST(a_name_told_before_confirms_no_later_frame) {
  ledger.reset(5 * kSecond_us);
  send(7, 0, {1});
  ledger.note_report(1000);
  assert_true(confirmed(7, 1000) == std::vector<std::uint32_t>{1});
  send(7, 2000, {2});
  ledger.note_report(3000);
  assert_true(confirmed(7, 3000).empty());
}

TEST(loss_is_estimated) {
  ledger.reset(5 * kSecond_us);
  Random random(5);
  std::uint32_t sum = 0;
  for (int k = 0; k < 4000; ++k) {
    const auto tag = static_cast<std::uint16_t>(k);
    const TimeUs t_us = k * TimeUs{10'000};
    send(tag, t_us);
    ledger.note_report(t_us + 5000);
    if (random.uniform() >= 0.3) {
      (void)confirmed(tag, t_us + 5000);
    }
    (void)lost(t_us + 5000);
    sum += k >= 2000 ? ledger.loss_q16() / 2000 : 0;
  }
  assert_true(sum > 0.25 * 65536 && sum < 0.35 * 65536);
}

// Any order of sending, reporting and losing: every tile of every frame ends in exactly one way.
TEST(every_frame_has_one_fate) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    ledger.reset(5 * kSecond_us);
    Random random(seed);
    std::vector<int> fates;
    TimeUs t_us = 0;
    const auto settle = [&fates](const std::vector<std::uint32_t>& tiles) {
      for (const std::uint32_t tile : tiles) {
        fates[tile] += 1;
      }
    };
    for (int k = 0; k < 600; ++k) {
      t_us += random.between(0, 40'000);
      const std::int64_t what = random.between(0, 9);
      if (what < 5) {
        const auto tiles = static_cast<std::size_t>(random.between(0, 32));
        while (!ledger.has_room(tiles)) {
          FrameTile tile{};
          while (ledger.give_up_oldest(tile)) {
            settle({tile.tile});
          }
        }
        std::vector<std::uint32_t> carried;
        for (std::size_t i = 0; i < tiles; ++i) {
          carried.push_back(static_cast<std::uint32_t>(fates.size()));
          fates.push_back(0);
        }
        send(static_cast<std::uint16_t>(k), t_us, carried);
      } else if (what < 9) {
        ledger.note_report(t_us);
        for (std::int64_t n = random.between(0, 8); n > 0; --n) {
          settle(
              confirmed(static_cast<std::uint16_t>(random.between(k > 40 ? k - 40 : 0, k)), t_us));
        }
      } else {
        settle(lost(t_us, random.between(0, 1) == 1));
      }
    }
    ledger.note_report(t_us);
    for (int k = 0; k < 600; ++k) {
      settle(confirmed(static_cast<std::uint16_t>(k), t_us));
    }
    assert_int_equal(ledger.under_way_frames(), 0);
    for (const int fate : fates) {
      assert_int_equal(fate, 1);
    }
  }
}

}  // namespace
