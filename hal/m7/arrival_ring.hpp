// Bytes of a line between its interrupt and the cycle, with the times of their arrival.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/base/units.hpp"

namespace leadline::hal::m7 {

/// A pause this long on the line ends a burst: about ten bytes at 115200 baud.
inline constexpr base::TimeUs kBurstPause_us = 1000;

/// Holds bytes in bursts: what follows without a pause is one burst, with the arrival of its last byte. A
/// full ring refuses new bytes, counted: what is queued is older and stays. When the bursts' own ring is full
/// a burst goes on over a pause. Not safe between threads: who calls take() keeps the interrupt off.
template <std::size_t kBytes, std::size_t kBursts>
class ArrivalRing {
  static_assert((kBytes & (kBytes - 1)) == 0 && (kBursts & (kBursts - 1)) == 0,
                "indices wrap by masking");
  static_assert(kBursts >= 2, "one is filled while another is taken");

 public:
  /// O(1). False: no room, counted in dropped().
  bool push(std::uint8_t byte, base::TimeUs t_us) {
    if (head_ - tail_ == kBytes) {
      ++dropped_;
      return false;
    }
    bytes_[head_ & (kBytes - 1)] = byte;
    ++head_;
    const bool none = burst_head_ == burst_tail_;
    const bool full = burst_head_ - burst_tail_ == kBursts;
    if (none || (!full && t_us - newest().t_us > kBurstPause_us)) {
      ++burst_head_;
      newest().size_bytes = 0;
    }
    newest().t_us = t_us;
    ++newest().size_bytes;
    return true;
  }

  /// Up to `capacity` bytes of the oldest burst, and when its last byte (so far) arrived; 0: none. O(bytes).
  std::size_t take(std::uint8_t* out, std::size_t capacity, base::TimeUs& t_us) {
    if (burst_head_ == burst_tail_) {
      return 0;
    }
    Burst& burst = bursts_[burst_tail_ & (kBursts - 1)];
    const std::size_t size = burst.size_bytes < capacity ? burst.size_bytes : capacity;
    for (std::size_t i = 0; i < size; ++i) {
      out[i] = bytes_[tail_ & (kBytes - 1)];
      ++tail_;
    }
    t_us = burst.t_us;
    burst.size_bytes -= static_cast<std::uint32_t>(size);
    if (burst.size_bytes == 0) {
      ++burst_tail_;
    }
    return size;
  }

  [[nodiscard]] std::size_t size_bytes() const { return head_ - tail_; }
  /// Bytes refused since construction.
  [[nodiscard]] std::uint32_t dropped() const { return dropped_; }

 private:
  struct Burst {
    base::TimeUs t_us;
    std::uint32_t size_bytes;
  };
  [[nodiscard]] Burst& newest() { return bursts_[(burst_head_ - 1U) & (kBursts - 1)]; }

  std::array<std::uint8_t, kBytes> bytes_{};
  std::array<Burst, kBursts> bursts_{};
  // Counters run freely and wrap; their difference is the fill.
  std::uint32_t head_ = 0;
  std::uint32_t tail_ = 0;
  std::uint32_t burst_head_ = 0;
  std::uint32_t burst_tail_ = 0;
  std::uint32_t dropped_ = 0;
};

}  // namespace leadline::hal::m7
