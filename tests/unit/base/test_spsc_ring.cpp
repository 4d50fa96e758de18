#include <thread>

#include "model/base/spsc_ring.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::SpscRing;
using leadline::base::Status;

TEST(ring_keeps_order_and_counts_what_it_refuses) {
  SpscRing<int, 4> ring;
  int value = 0;
  assert_int_equal(ring.pop(value), Status::kEmpty);
  for (int i = 0; i < 4; ++i) {
    assert_int_equal(ring.push(i), Status::kOk);
  }
  assert_int_equal(ring.push(4), Status::kFull);
  assert_int_equal(ring.dropped(), 1);
  assert_int_equal(ring.size(), 4);
  for (int i = 0; i < 4; ++i) {
    assert_int_equal(ring.pop(value), Status::kOk);
    assert_int_equal(value, i);
  }
  assert_int_equal(ring.size(), 0);
}

TEST(ring_passes_every_element_between_two_threads_once_and_in_order) {
  static SpscRing<std::uint32_t, 64> ring;
  constexpr std::uint32_t kCount = 200'000;
  std::thread producer([] {
    for (std::uint32_t i = 0; i < kCount;) {
      if (ring.push(i) == Status::kOk) {
        ++i;
      } else {
        std::this_thread::yield();
      }
    }
  });
  std::uint32_t expected = 0;
  bool in_order = true;
  while (expected < kCount) {
    std::uint32_t value = 0;
    if (ring.pop(value) == Status::kOk) {
      in_order = in_order && value == expected;
      ++expected;
    } else {
      std::this_thread::yield();
    }
  }
  producer.join();
  assert_true(in_order);
  assert_int_equal(ring.size(), 0);
}

}  // namespace
