// Navigation samples that a sonar head sends beside its pings (attitude, water temperature).
//
// A head's feed() and next() yield base::Ping. A codec whose head also knows something of the vehicle has
//   bool take_sample(base::NavSample& sample);
// beside them: the samples of all bytes fed so far, oldest first, false when there are no more. It never
// parses, so the caller drains it after feed() and next(), whatever these returned:
//   if (codec.feed(byte, t, ping)) { do { use(ping); } while (codec.next(ping)); }
//   while (codec.take_sample(sample)) { use(sample); }
#pragma once

#include <array>
#include <cstddef>

#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"

namespace leadline::hal {

/// The last kCapacity samples. A caller that does not drain it loses the oldest, nothing else. Copyable.
class NavQueue {
 public:
  static constexpr std::size_t kCapacity = 8;

  void push(const base::NavSample& sample) {
    if (count_ == kCapacity) {
      first_ = (first_ + 1) % kCapacity;
      --count_;
    }
    samples_[(first_ + count_) % kCapacity] = sample;
    ++count_;
  }
  [[nodiscard]] bool take(base::NavSample& sample) {
    if (count_ == 0) {
      return false;
    }
    sample = samples_[first_];
    first_ = (first_ + 1) % kCapacity;
    --count_;
    return true;
  }

 private:
  std::array<base::NavSample, kCapacity> samples_{};
  std::size_t first_ = 0;
  std::size_t count_ = 0;
};

}  // namespace leadline::hal
