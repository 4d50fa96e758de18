// Where the vehicle was at a given instant: the last poses in a ring, and one in between by
// interpolation. A ping is stamped by the sonar, a pose by the navigation; this is where they meet.
//
// Integer arithmetic only, so that a replay gives the same bits on every machine. No heap, no clock.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/base/pose.hpp"
#include "model/base/status.hpp"
#include "model/base/units.hpp"

namespace leadline::estimator {

/// Longest time between two poses that interpolation may be asked to bridge. Inclusive. It keeps every
/// product in 64 bits.
inline constexpr base::TimeUs kMaxGapLimit_us = 2'000'000'000;
/// Earliest and latest instant of a pose: differences of two stay in 64 bits. Inclusive.
inline constexpr base::TimeUs kMaxTime_us = std::int64_t{1} << 61U;

/// What the history has seen since it was made. Never decremented, clear() included; wraps at 2^32.
struct PoseHistoryCounters {
  std::uint32_t accepted;
  std::uint32_t stale;         ///< refused: not later than the newest pose
  std::uint32_t out_of_range;  ///< refused: a time or position beyond its limit
  std::uint32_t overwritten;   ///< oldest poses given up for new ones
};

/// The latest poses, in order of time, in storage of the caller. See PoseHistoryBuffer for one that
/// owns it. Not reentrant: one object, one thread (the vehicle thread).
class PoseHistory {
 public:
  /// `storage` takes `capacity_count` >= 1 poses, must outlive this object and is written by it alone.
  /// `max_gap_us`: poses farther apart than this are not interpolated; clamped to
  /// 0 .. kMaxGapLimit_us, where 0 means exact times only. Choose it so that a * gap^2 / 8 is small
  /// against the position sigma, for accelerations a of the vehicle: the path between two poses is
  /// taken as straight, and what it bends is in no sigma.
  PoseHistory(base::Pose* storage, std::size_t capacity_count, base::TimeUs max_gap_us);

  /// Takes a copy of the pose; when full the oldest one is given up. O(1).
  /// * kOk: taken
  /// * kStale: pose.t_us is not later than the newest pose's; counted, nothing changed. A clock that
  ///   was set back makes every pose stale from then on: whoever watches stale_in_a_row() calls clear()
  /// * kOutOfRange: |t_us| > kMaxTime_us, or a position beyond kMaxHorizontal_um or kMaxVertical_um,
  ///   valid or not (leave zeros in what is not valid); counted, nothing changed
  [[nodiscard]] base::Status push(const base::Pose& pose);

  /// The pose at `t_us`, never extrapolated. O(log n), no state changed.
  ///
  /// At the very time of a pose it is that pose. In between, with a the pose before and b the one behind:
  /// * position: straight line, each axis rounded to the nearest micrometre (halves away from a);
  ///   exact otherwise, no accumulated error
  /// * attitude: each angle on its shorter arc at constant rate, rounded alike; a difference of exactly
  ///   half a turn goes down. Angle by angle: near pitch +-90 degrees, where roll and heading are not
  ///   defined one by one, the result is as good as the angles are
  /// * sigmas: the larger of the two; correlations: of the pose nearer in time (a on a tie)
  /// * validity: the bits that both have. An invalid field is interpolated like any other
  ///
  /// Errors:
  /// * kEmpty: no poses
  /// * kStale: before the oldest pose
  /// * kNotReady: after the newest pose; ask again when a later one has arrived
  /// * kEpochMismatch: navigation jumped between a and b
  /// * kOutOfRange: a and b are more than max_gap_us apart
  [[nodiscard]] base::Result<base::Pose> at(base::TimeUs t_us) const;

  /// Gives up all poses; counters stay. O(1).
  void clear();

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t capacity() const { return capacity_; }
  /// Stale poses since the last accepted one or clear().
  [[nodiscard]] std::uint32_t stale_in_a_row() const { return stale_in_a_row_; }
  [[nodiscard]] const PoseHistoryCounters& counters() const { return counters_; }

 private:
  /// i-th pose from the oldest, i < size_.
  [[nodiscard]] const base::Pose& from_oldest(std::size_t i) const;

  base::Pose* storage_;
  std::size_t capacity_;
  base::TimeUs max_gap_us_;
  std::size_t oldest_ = 0;
  std::size_t size_ = 0;
  std::uint32_t stale_in_a_row_ = 0;
  PoseHistoryCounters counters_{};
};

/// A PoseHistory with its own storage (72 bytes per pose). Neither copied nor moved: the history points
/// into the object.
template <std::size_t kCapacity_count>
class PoseHistoryBuffer {
  static_assert(kCapacity_count >= 2, "interpolation needs two poses");

 public:
  explicit PoseHistoryBuffer(base::TimeUs max_gap_us)
      : history_(storage_.data(), storage_.size(), max_gap_us) {}
  PoseHistoryBuffer(const PoseHistoryBuffer&) = delete;
  PoseHistoryBuffer& operator=(const PoseHistoryBuffer&) = delete;

  [[nodiscard]] PoseHistory& history() { return history_; }
  [[nodiscard]] const PoseHistory& history() const { return history_; }

 private:
  std::array<base::Pose, kCapacity_count> storage_{};
  PoseHistory history_;
};

}  // namespace leadline::estimator
