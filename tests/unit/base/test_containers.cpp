#include <cstring>
#include <thread>
#include <type_traits>

#include "model/base/fixed_vector.hpp"
#include "model/base/spsc_ring.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::FixedVector;
using leadline::base::SpscRing;
using leadline::base::Status;

TEST(vector_holds_its_capacity_and_refuses_one_more) {
  FixedVector<int, 3> vector;
  assert_true(vector.empty());
  for (int i = 0; i < 3; ++i) {
    assert_int_equal(vector.push_back(10 + i), Status::kOk);
  }
  assert_true(vector.full());
  assert_int_equal(vector.push_back(99), Status::kFull);
  assert_int_equal(vector.size(), 3);
  int expected = 10;
  for (const int value : vector) {
    assert_int_equal(value, expected);
    ++expected;
  }
}

TEST(vector_pops_clears_and_never_reads_outside) {
  FixedVector<int, 2> vector;
  assert_int_equal(vector.pop_back(), Status::kEmpty);
  assert_int_equal(vector.push_back(1), Status::kOk);
  assert_int_equal(vector.push_back(2), Status::kOk);
  assert_int_equal(vector.pop_back(), Status::kOk);
  assert_int_equal(vector.size(), 1);
  vector[0] = 7;
  assert_int_equal(vector[0], 7);
  assert_int_equal(vector[1000], 2);  // the last slot's bytes, not memory beyond
  vector.clear();
  assert_true(vector.empty());
}

TEST(vector_is_copied_as_bytes) {
  using Vector = FixedVector<int, 4>;
  assert_true(std::is_trivially_copyable_v<Vector>);
  Vector from;
  assert_int_equal(from.push_back(5), Status::kOk);
  Vector to;
  std::memcpy(&to, &from, sizeof(to));
  assert_int_equal(to.size(), 1);
  assert_int_equal(to[0], 5);
}

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
