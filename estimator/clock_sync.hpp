// A device's clock against the vehicle's: when did it measure, in vehicle time, to better than what its bytes
// took to come.
//
// Each pair (device time, arrival) lies on the line "vehicle = offset + rate * device" or above it: latency is
// never negative. The least late pair of every second is kept, the last 32 of them; the line is the edge of
// their lower convex hull below their middle: no line with no pair beneath it lies closer to them (Moon, Skelly
// and Towsley, "Estimation and Removal of Clock Skew from Network Delay Measurements", INFOCOM 1999). A latency
// that every pair has in full looks like an offset: it is for who knows the device to take it off.
//
// A clock that is set forward makes pairs that are too early, which nothing else does: three that agree start
// anew. One that is set back makes late ones: two seconds of pairs later than any line delays start anew; less
// than that, four seconds whose best is late. Until then, and until eight seconds are known, nothing is sure.
//
// Integers, no heap, no clock of its own. The result depends on the sequence of calls alone.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/base/units.hpp"

namespace leadline::estimator {

struct ClockSyncConfig {
  base::TimeUs max_latency_us =
      600'000;                        ///< of a line, beyond its least; later is a clock set back
  base::TimeUs step_us = 20'000;      ///< a pair that much too early is a clock set forward
  base::TimeUs max_error_us = 5'000;  ///< less certain than this is not sure
  std::int32_t max_drift_ppm = 500;   ///< of crystals; steeper lines are not believed
};

struct ClockReading {
  base::TimeUs t_us;  ///< vehicle time
  /// That it holds, but for the latency that all pairs share, and for the device's own tick.
  base::TimeUs error_us;
  bool sure;  ///< false: take the arrival
};

/// Never decremented; wraps at 2^32.
struct ClockSyncCounters {
  std::uint32_t merged;
  std::uint32_t backwards;  ///< arrival or device time went back: not merged
  std::uint32_t early;      ///< not merged, nor late ones
  std::uint32_t late;
  std::uint32_t steps;  ///< clocks that were set
};

/// About 800 bytes.
class ClockSync {
 public:
  static constexpr int kBlocks = 32;
  static constexpr int kSureBlocks = 8;

  explicit ClockSync(const ClockSyncConfig& config = {}) : config_(config) {}

  /// The port was opened again, or the device restarted: nothing is known. Counters stay.
  void restart();
  /// One pair. False: not merged, for the reason counted. O(1); once a second O(kBlocks).
  bool add(base::TimeUs t_device_us, base::TimeUs t_arrival_us);
  /// Vehicle time of an instant of the device's clock. O(1).
  [[nodiscard]] ClockReading at(base::TimeUs t_device_us) const;
  /// add(), and the vehicle time of the measurement: at() of it where that is sure, never later than the
  /// arrival, and never earlier than the last one that was sure; otherwise the arrival.
  [[nodiscard]] base::TimeUs stamp(base::TimeUs t_device_us, base::TimeUs t_arrival_us);

  [[nodiscard]] bool sure() const;
  /// Rate of vehicle time against the device's, less 1.
  [[nodiscard]] std::int64_t drift_ppb() const;
  [[nodiscard]] const ClockSyncCounters& counters() const { return counters_; }

 private:
  /// x: device time since the first pair; y: how much more of vehicle time than that has passed.
  struct Point {
    std::int64_t x;
    std::int64_t y;
  };

  void begin(base::TimeUs t_device_us, base::TimeUs t_arrival_us);
  [[nodiscard]] std::int64_t line_at(std::int64_t x) const;
  bool take_late(base::TimeUs t_device_us, base::TimeUs t_arrival_us);
  bool take_early(base::TimeUs t_device_us, base::TimeUs t_arrival_us);
  void merge(const Point& point, std::int64_t above_us);
  void close_block(std::int64_t x);
  void fit();

  ClockSyncConfig config_;
  bool any_ = false;
  base::TimeUs device_0_us_ = 0;
  base::TimeUs arrival_0_us_ = 0;
  base::TimeUs device_newest_us_ = 0;
  base::TimeUs arrival_newest_us_ = 0;
  base::TimeUs stamp_newest_us_ = INT64_MIN;
  std::int64_t block_from_x_ = 0;
  Point best_{};  ///< of the second under way
  std::int64_t best_above_us_ = 0;
  std::array<Point, kBlocks> blocks_{};  ///< oldest first
  int block_count_ = 0;
  int high_blocks_ = 0;  ///< in a row whose best is too late for the line
  Point anchor_{};
  std::int64_t slope_dy_ = 0;  ///< dy / dx
  std::int64_t slope_dx_ = 1;
  std::int64_t error_us_ = 0;
  int late_in_a_row_ = 0;
  base::TimeUs late_since_us_ = 0;
  int early_ = 0;  ///< pairs that agree on a clock set forward
  std::int64_t early_offset_us_ = 0;
  ClockSyncCounters counters_{};
};

}  // namespace leadline::estimator
