// Pings that wait for their pose, in order of arrival, with the intensities of profiles.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/base/ping.hpp"
#include "model/base/status.hpp"
#include "model/base/units.hpp"
#include "model/capacity.hpp"

namespace leadline::firmware {

/// A bounded queue with its own storage (about 450 KiB as built by default). Not thread-safe; every call is O(1), push()
/// O(bins).
class PingQueue {
 public:
  /// Beams: by default four pings of a head of 1024.
  static constexpr std::size_t kCapacity_count = LEADLINE_QUEUE_PINGS;
  /// Bins of all waiting profiles together: by default 54 of the longest of a Ping360. What does not find room
  /// sheds the oldest, so that targets agree on a log only where they agree on this or nothing is shed.
  static constexpr std::size_t kBinCapacity_count = LEADLINE_QUEUE_BINS;

  PingQueue() = default;
  PingQueue(const PingQueue&) = delete;
  PingQueue& operator=(const PingQueue&) = delete;

  void clear();
  /// Copies the ping and its intensities; `now_us` is when it came. kFull: no room for either now, nothing changed; pop the oldest
  /// and try again. kOutOfRange: a profile without bins, or one that never fits.
  [[nodiscard]] base::Status push(const base::Ping& ping, base::TimeUs now_us);
  [[nodiscard]] bool empty() const { return count_ == 0; }
  [[nodiscard]] std::size_t size() const { return count_; }
  /// The oldest; its span is valid until it is popped. Not to be called when empty.
  [[nodiscard]] const base::Ping& front() const { return pings_[first_]; }
  /// When the oldest came. Not to be called when empty.
  [[nodiscard]] base::TimeUs front_since_us() const { return since_us_[first_]; }
  void pop();

 private:
  std::array<base::Ping, kCapacity_count> pings_{};
  std::array<base::TimeUs, kCapacity_count> since_us_{};
  std::array<std::uint16_t, kBinCapacity_count> bins_{};
  std::size_t first_ = 0;
  std::size_t count_ = 0;
  // Bins in use: from bin_first_ on, round the end, up to bin_end_. A profile never goes round the end.
  std::size_t bin_first_ = 0;
  std::size_t bin_end_ = 0;
  std::size_t profiles_ = 0;
};

}  // namespace leadline::firmware
