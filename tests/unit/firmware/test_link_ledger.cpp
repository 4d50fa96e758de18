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

/// Frame number `number`, the next.
void send(std::uint32_t number, TimeUs t_us, const std::vector<std::uint32_t>& tiles = {7}) {
  std::vector<FrameTile> carried;
  for (const std::uint32_t tile : tiles) {
    carried.push_back({tile, 0, 0, {{1}}});
  }
  assert_true(ledger.has_room(carried.size()));
  assert_int_equal(ledger.next_number(), number);
  ledger.sent(carried.data(), carried.size(), t_us, 1000);
}

std::vector<std::uint32_t> named(LinkLedger::Word wanted, std::uint32_t number, TimeUs t_us) {
  std::vector<std::uint32_t> tiles;
  const LinkLedger::Word word = ledger.confirm(static_cast<std::uint16_t>(number), t_us);
  FrameTile tile{};
  while (ledger.next_confirmed(tile)) {
    if (word == wanted) {
      tiles.push_back(tile.tile);
    }
  }
  return tiles;
}

std::vector<std::uint32_t> confirmed(std::uint32_t number, TimeUs t_us) {
  return named(LinkLedger::Word::kCame, number, t_us);
}

std::vector<std::uint32_t> came_late(std::uint32_t number, TimeUs t_us) {
  return named(LinkLedger::Word::kCameLate, number, t_us);
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
  ledger.reset(5 * kSecond_us, 0);
  for (std::uint32_t number = 0; number < 5; ++number) {
    send(number, number * 1000, {number, 100U + number});
  }
  assert_true(lost(5000).empty());  // nobody reports
  ledger.note_report(6000);
  assert_true(confirmed(3, 6000) == (std::vector<std::uint32_t>{3, 103}));
  assert_true(lost(6000) == (std::vector<std::uint32_t>{0, 100}));
  assert_true(confirmed(3, 6000).empty());  // once
  assert_true(came_late(0, 6000) == (std::vector<std::uint32_t>{0, 100}));
  assert_true(came_late(0, 6000).empty());
  assert_true(confirmed(5, 6000).empty());  // has not left
  assert_true(confirmed(UINT16_MAX, 6000).empty());
  assert_int_equal(ledger.under_way_frames(), 3);
  assert_true(confirmed(1, 7000).size() == 2);
}

// Numbers wrap after months, what reports say of them after a day.
TEST(three_overtake_across_number_0) {
  for (const std::uint32_t wrap : {0U, 65'536U}) {
    for (std::uint32_t before = 1; before <= 3; ++before) {
      std::uint32_t number = wrap - 2 * LinkLedger::kFrames;
      ledger.reset(5 * kSecond_us, number);
      TimeUs t_us = 0;
      for (; number != wrap - before; ++number) {
        send(number, ++t_us);
        ledger.note_report(t_us);
        assert_int_equal(confirmed(number, t_us).size(), 1);
      }
      assert_int_equal(ledger.under_way_frames(), 0);
      for (std::uint32_t tile = 1; tile <= 4; ++tile) {
        send(number + tile - 1, ++t_us, {tile});
      }
      ledger.note_report(t_us);
      assert_int_equal(confirmed(number + 2, t_us).size(), 1);
      assert_true(lost(t_us).empty());
      assert_int_equal(confirmed(number + 3, t_us).size(), 1);
      assert_true(lost(t_us) == std::vector<std::uint32_t>{1});
      assert_int_equal(confirmed(number + 1, t_us).size(), 1);
      assert_int_equal(ledger.under_way_frames(), 0);
    }
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
      send(ledger.next_number(), t_us);
    }
    (void)lost(t_us);
    rounds += 1;
    assert_true(rounds < 600);
  }
  // What is under way then stays: it is given up when its room is needed.
  send(ledger.next_number(), t_us + 1, {42});
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
  ledger.reset(5 * kSecond_us, 0);
  for (std::uint32_t k = 0; k < LinkLedger::kFrames; ++k) {
    send(k, k, {k});
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
  ledger.reset(5 * kSecond_us, 0);
  for (std::uint32_t number = 0; number < 40; ++number) {
    send(number, number * 1000, {number});
  }
  ledger.note_report(45'000);
  for (std::uint32_t number = 4; number < 30; ++number) {
    (void)confirmed(number, 45'000);
  }
  assert_int_equal(lost(45'000).size(), 4);  // overtaken
  for (std::uint32_t tile = 0; tile < 4; ++tile) {
    send(40 + tile, 46'000, {tile});
  }
  assert_true(lost(60'000).empty());
  const std::vector<std::uint32_t> again = lost(60'000, true);
  assert_true(!again.empty() && again.front() == 30);
  for (const std::uint32_t tile : again) {
    send(ledger.next_number(), 61'000, {tile});
  }
  // 40 cells in all, a loss of some 15 %: 1.15 x 40 / 0.85 is all that it may cost.
  std::size_t sent = 44 + again.size();
  for (TimeUs t_us = 62'000; t_us < 80'000; t_us += 1000) {
    for (const std::uint32_t tile : lost(t_us, true)) {
      send(ledger.next_number(), t_us, {tile});
      sent += 1;
    }
  }
  assert_true(sent > 46 && sent < 60);
  assert_true(ledger.next_loss_us() != INT64_MAX);
  // The first copies come after all.
  ledger.note_report(81'000);
  assert_true(came_late(30, 81'000) == std::vector<std::uint32_t>{30});
}

TEST(what_came_in_one_frame_is_not_lost_with_another) {
  ledger.reset(5 * kSecond_us);
  send(1, 0, {7, 8});
  send(2, 1000, {7});
  for (std::uint32_t number = 3; number < 7; ++number) {
    send(number, 2000, {number});
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

// An answer tells what of the frames before the question did not come.
TEST(what_an_answer_leaves_out_was_lost) {
  ledger.reset(5 * kSecond_us);
  for (std::uint32_t number = 1; number <= 4; ++number) {
    send(number, number * 1000, {number});
  }
  assert_false(ledger.question_due(5000));  // nobody reports
  ledger.note_report(5000);
  assert_true(ledger.question_due(5000));  // a line of which nothing is known may lose
  ledger.asked(5500);
  assert_false(ledger.question_due(6000));
  send(5, 7000, {5});
  ledger.note_report(8000);
  assert_int_equal(confirmed(3, 8000).size(), 1);
  ledger.answered(4);
  assert_true(lost(8000) == (std::vector<std::uint32_t>{1, 2, 4}));
  ledger.answered(3);  // an older answer
  assert_true(lost(8000).empty());
  assert_int_equal(ledger.under_way_frames(), 1);
  assert_int_equal(came_late(2, 9000).size(), 1);
}

TEST(questions_without_an_answer_become_rare) {
  ledger.reset(kSecond_us);
  send(1, 0);
  ledger.note_report(50'000);
  assert_int_equal(confirmed(1, 50'000).size(), 1);
  send(2, 60'000);
  TimeUs t_us = 60'000;
  int asked = 0;
  while (t_us < 60 * kSecond_us) {
    if (ledger.question_due(t_us)) {
      ledger.asked(t_us);
      assert_true(ledger.next_loss_us() > t_us);
      asked += 1;
    }
    t_us += 10'000;
  }
  assert_true(asked > 4 && asked < 40);
  ledger.note_report(t_us);
  ledger.answered(2);
  assert_true(lost(t_us) == std::vector<std::uint32_t>{7});
  assert_false(ledger.question_due(t_us));  // nothing is under way
}

TEST(loss_is_estimated) {
  ledger.reset(5 * kSecond_us, 0);
  Random random(5);
  std::uint32_t sum = 0;
  for (int k = 0; k < 4000; ++k) {
    const auto number = static_cast<std::uint32_t>(k);
    const TimeUs t_us = k * TimeUs{10'000};
    send(number, t_us);
    ledger.note_report(t_us + 5000);
    if (random.uniform() >= 0.3) {
      (void)confirmed(number, t_us + 5000);
    }
    (void)lost(t_us + 5000);
    sum += k >= 2000 ? ledger.loss_q16() / 2000 : 0;
  }
  assert_true(sum > 0.25 * 65536 && sum < 0.35 * 65536);
}

// Any order of sending, reporting and losing: every tile of every frame ends in exactly one way.
TEST(every_frame_has_one_fate) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    ledger.reset(5 * kSecond_us, 0);
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
        const auto tiles = static_cast<std::size_t>(random.between(1, 32));
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
        send(ledger.next_number(), t_us, carried);
      } else if (what < 9) {
        ledger.note_report(t_us);
        for (std::int64_t n = random.between(0, 8); n > 0; --n) {
          settle(confirmed(ledger.next_number() - static_cast<std::uint32_t>(random.between(0, 40)),
                           t_us));
        }
      } else {
        settle(lost(t_us, random.between(0, 1) == 1));
      }
    }
    ledger.note_report(t_us);
    for (std::uint32_t number = 0; number < 600; ++number) {
      settle(confirmed(number, t_us));
    }
    assert_int_equal(ledger.under_way_frames(), 0);
    for (const int fate : fates) {
      assert_int_equal(fate, 1);
    }
  }
}

}  // namespace
