#include <algorithm>
#include <deque>
#include <vector>

#include "hal/m7/arrival_ring.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::hal::m7::ArrivalRing;
using leadline::hal::m7::kBurstPause_us;
using leadline::test::Random;

TEST(a_burst_has_the_arrival_of_its_last_byte) {
  ArrivalRing<16, 4> ring;
  std::uint8_t out[16];
  TimeUs t_us = -1;
  assert_int_equal(ring.take(out, sizeof out, t_us), 0);
  assert_true(ring.push('a', 1000));
  assert_true(ring.push('b', 1000 + kBurstPause_us));  // no pause: not longer than the limit
  assert_true(ring.push('c', 1001 + 2 * kBurstPause_us));
  assert_int_equal(ring.take(out, sizeof out, t_us), 2);
  assert_int_equal(t_us, 1000 + kBurstPause_us);
  assert_memory_equal(out, "ab", 2);
  assert_int_equal(ring.take(out, sizeof out, t_us), 1);
  assert_int_equal(t_us, 1001 + 2 * kBurstPause_us);
  assert_int_equal(out[0], 'c');
  assert_int_equal(ring.size_bytes(), 0);
}

TEST(a_burst_can_be_taken_in_pieces_and_while_it_comes) {
  ArrivalRing<16, 4> ring;
  std::uint8_t out[16];
  TimeUs t_us = 0;
  for (int i = 0; i < 5; ++i) {
    assert_true(ring.push(static_cast<std::uint8_t>(i), 100 * i));
  }
  assert_int_equal(ring.take(out, 3, t_us), 3);
  assert_int_equal(t_us, 400);
  assert_true(ring.push(5, 500));
  assert_int_equal(ring.take(out, sizeof out, t_us), 3);
  assert_int_equal(out[0], 3);
  assert_int_equal(out[2], 5);
  assert_int_equal(t_us, 500);
}

TEST(what_does_not_fit_is_refused_and_counted_and_what_is_there_stays) {
  ArrivalRing<8, 2> ring;
  for (int i = 0; i < 11; ++i) {
    assert_int_equal(ring.push(static_cast<std::uint8_t>(i), i), i < 8);
  }
  assert_int_equal(ring.dropped(), 3);
  std::uint8_t out[16];
  TimeUs t_us = 0;
  assert_int_equal(ring.take(out, sizeof out, t_us), 8);
  assert_int_equal(out[7], 7);
  assert_int_equal(t_us, 7);
}

TEST(random_traffic_is_a_queue_whose_times_never_go_back) {
  ArrivalRing<64, 4> ring;
  Random random(5);
  std::deque<std::pair<std::uint8_t, TimeUs>> expected;
  TimeUs now_us = 0;
  TimeUs before_us = 0;
  std::uint32_t dropped = 0;
  for (int step = 0; step < 200'000; ++step) {
    now_us += random.between(0, 3 * kBurstPause_us);
    if (random.between(0, 31) != 0) {
      const auto byte = static_cast<std::uint8_t>(random.next());
      if (ring.push(byte, now_us)) {
        expected.emplace_back(byte, now_us);
      } else {
        ++dropped;
      }
      continue;
    }
    std::uint8_t out[64];
    TimeUs t_us = 0;
    const std::size_t size = ring.take(out, static_cast<std::size_t>(random.between(1, 64)), t_us);
    assert_int_equal(size == 0, expected.empty());
    for (std::size_t i = 0; i < size; ++i) {
      assert_int_equal(out[i], expected.front().first);
      assert_true(expected.front().second <= t_us);  // never stamped before it came
      expected.pop_front();
    }
    if (size > 0) {
      assert_true(t_us >= before_us);
      before_us = t_us;
    }
  }
  assert_int_equal(ring.size_bytes(), expected.size());
  assert_int_equal(ring.dropped(), dropped);
  assert_true(dropped > 0);
}

}  // namespace
