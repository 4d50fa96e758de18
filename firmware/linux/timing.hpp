// How long cycles took and how late they began, counted in classes. What it shows is the largest that was
// observed in one run on one machine: never a bound of what can happen.
#pragma once

#include <array>
#include <cstdint>
#include <string>

namespace leadline::host {

/// Counts of times by powers of two: class i holds [2^(i-1), 2^i) microseconds, class 0 what is below one.
class TimeHistogram {
 public:
  static constexpr std::size_t kClasses = 32;  ///< the last one has no end: 18 minutes and up

  /// Negative times count as 0. O(1), no heap.
  void add(std::int64_t time_us);
  [[nodiscard]] std::uint64_t count(std::size_t index) const { return counts_[index]; }
  [[nodiscard]] std::uint64_t total() const;
  [[nodiscard]] std::int64_t largest_us() const { return largest_us_; }
  /// End of a class, which is not in it.
  [[nodiscard]] static constexpr std::int64_t end_us(std::size_t index) {
    return std::int64_t{1} << index;
  }

 private:
  std::array<std::uint64_t, kClasses> counts_{};
  std::int64_t largest_us_ = 0;
};

struct LoopTiming {
  TimeHistogram cycle;  ///< from the first chunk taken to the last byte queued for the link
  TimeHistogram slip;   ///< a cycle's beginning behind its time
};

/// A table for a person.
[[nodiscard]] std::string timing_text(const LoopTiming& timing);
/// {"cycle": {"largest_observed_us": ..., "below_us": [[64, 10], ...]}, "slip": ...}: classes that have any.
[[nodiscard]] std::string timing_json(const LoopTiming& timing);

}  // namespace leadline::host
