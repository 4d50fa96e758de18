// A ring between exactly one producer and one consumer, each in its own thread or interrupt.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "model/base/status.hpp"

namespace leadline::base {

/// Holds up to `kCapacity` elements (a power of two). Lock-free and wait-free: push() belongs to the
/// producer, pop() to the consumer, size() to either (a snapshot). A full ring refuses the new element
/// and counts it: what is already queued is older and stays. O(1), no heap.
template <typename T, std::size_t kCapacity>
class SpscRing {
  static_assert(std::is_trivially_copyable_v<T>, "records are copied as bytes");
  static_assert(kCapacity > 1 && (kCapacity & (kCapacity - 1)) == 0, "indices wrap by masking");

 public:
  SpscRing() = default;
  SpscRing(const SpscRing&) = delete;
  SpscRing& operator=(const SpscRing&) = delete;

  /// Producer: kFull when there is no room (counted in dropped()).
  [[nodiscard]] Status push(const T& value) {
    const std::uint32_t head = head_.load(std::memory_order_relaxed);
    if (head - tail_.load(std::memory_order_acquire) == kCapacity) {
      dropped_.store(dropped_.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
      return Status::kFull;
    }
    items_[head & (kCapacity - 1)] = value;
    head_.store(head + 1, std::memory_order_release);
    return Status::kOk;
  }

  /// Consumer: the oldest element, or kEmpty.
  [[nodiscard]] Status pop(T& value) {
    const std::uint32_t tail = tail_.load(std::memory_order_relaxed);
    if (head_.load(std::memory_order_acquire) == tail) {
      return Status::kEmpty;
    }
    value = items_[tail & (kCapacity - 1)];
    tail_.store(tail + 1, std::memory_order_release);
    return Status::kOk;
  }

  [[nodiscard]] std::size_t size() const {
    return head_.load(std::memory_order_acquire) - tail_.load(std::memory_order_acquire);
  }
  [[nodiscard]] static constexpr std::size_t capacity() { return kCapacity; }
  /// Elements refused since construction.
  [[nodiscard]] std::uint32_t dropped() const { return dropped_.load(std::memory_order_relaxed); }

 private:
  std::array<T, kCapacity> items_{};
  // Counters run freely and wrap; their difference is the fill.
  std::atomic<std::uint32_t> head_{0};
  std::atomic<std::uint32_t> tail_{0};
  std::atomic<std::uint32_t> dropped_{0};
};

}  // namespace leadline::base
