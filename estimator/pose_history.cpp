#include "estimator/pose_history.hpp"

#include <algorithm>

namespace leadline::estimator {
namespace {

using base::Pose;
using base::Status;
using base::TimeUs;

constexpr bool within(std::int64_t value, std::int64_t limit) {
  return value >= -limit && value <= limit;
}

/// difference * elapsed / gap, rounded to nearest, halves away from zero; 0 <= elapsed < gap.
///
/// Overflow: with difference = q * gap + r the result is q * elapsed + r * elapsed / gap. The first
/// product is smaller than |difference|, the second than gap^2 <= (2e9)^2 < 2^62.
std::int64_t scaled(std::int64_t difference, std::int64_t elapsed, std::int64_t gap) {
  const bool negative = difference < 0;
  const std::int64_t magnitude = negative ? -difference : difference;
  const std::int64_t whole = magnitude / gap * elapsed;
  const std::int64_t rest = (magnitude % gap * elapsed + gap / 2) / gap;
  return negative ? -(whole + rest) : whole + rest;
}

std::int64_t interpolate_um(std::int64_t from, std::int64_t to, TimeUs elapsed, TimeUs gap) {
  return from + scaled(to - from, elapsed, gap);
}

base::Bam32 interpolate_bam32(base::Bam32 from, base::Bam32 to, TimeUs elapsed, TimeUs gap) {
  // Modulo one turn the difference is already the arc upwards; from half a turn on, down is shorter.
  const std::uint32_t arc_up = to - from;
  const std::int64_t arc = arc_up >= base::kBam32HalfTurn
                               ? static_cast<std::int64_t>(arc_up) - (std::int64_t{1} << 32U)
                               : static_cast<std::int64_t>(arc_up);
  return from + static_cast<base::Bam32>(scaled(arc, elapsed, gap));
}

base::PoseCovariance combine(const base::PoseCovariance& nearer,
                             const base::PoseCovariance& other) {
  // Correlations from one pose only: those of two different matrices need not belong to any.
  base::PoseCovariance result = nearer;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    result.sigma_position_mm[axis] =
        std::max(nearer.sigma_position_mm[axis], other.sigma_position_mm[axis]);
    result.sigma_attitude_urad16[axis] =
        std::max(nearer.sigma_attitude_urad16[axis], other.sigma_attitude_urad16[axis]);
  }
  return result;
}

Pose interpolate(const Pose& before, const Pose& behind, TimeUs t_us) {
  const TimeUs gap = behind.t_us - before.t_us;
  const TimeUs elapsed = t_us - before.t_us;
  Pose pose{};
  pose.t_us = t_us;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    pose.position_um[axis] =
        interpolate_um(before.position_um[axis], behind.position_um[axis], elapsed, gap);
  }
  const base::Attitude& from = before.attitude;
  const base::Attitude& to = behind.attitude;
  pose.attitude.roll_bam32 = interpolate_bam32(from.roll_bam32, to.roll_bam32, elapsed, gap);
  pose.attitude.pitch_bam32 = interpolate_bam32(from.pitch_bam32, to.pitch_bam32, elapsed, gap);
  pose.attitude.heading_bam32 =
      interpolate_bam32(from.heading_bam32, to.heading_bam32, elapsed, gap);
  pose.covariance = elapsed <= gap - elapsed ? combine(before.covariance, behind.covariance)
                                             : combine(behind.covariance, before.covariance);
  pose.epoch = before.epoch;
  pose.validity = static_cast<std::uint8_t>(before.validity & behind.validity);
  return pose;
}

/// Valid or not: beyond these limits the differences in interpolate() could overflow.
bool in_range(const Pose& pose) {
  return within(pose.t_us, kMaxTime_us) &&
         within(pose.position_um[base::kNorth], base::kMaxHorizontal_um) &&
         within(pose.position_um[base::kEast], base::kMaxHorizontal_um) &&
         within(pose.position_um[base::kDown], base::kMaxVertical_um);
}

}  // namespace

PoseHistory::PoseHistory(Pose* storage, std::size_t capacity_count, TimeUs max_gap_us)
    : storage_(storage),
      capacity_(capacity_count),
      max_gap_us_(std::clamp<TimeUs>(max_gap_us, 0, kMaxGapLimit_us)) {}

const Pose& PoseHistory::from_oldest(std::size_t i) const {
  const std::size_t index = oldest_ + i;
  return storage_[index < capacity_ ? index : index - capacity_];
}

Status PoseHistory::push(const Pose& pose) {
  if (!in_range(pose)) {
    ++counters_.out_of_range;
    return Status::kOutOfRange;
  }
  if (size_ > 0 && pose.t_us <= from_oldest(size_ - 1).t_us) {
    ++counters_.stale;
    ++stale_in_a_row_;
    return Status::kStale;
  }
  if (size_ == capacity_) {
    oldest_ = oldest_ + 1 == capacity_ ? 0 : oldest_ + 1;
    --size_;
    ++counters_.overwritten;
  }
  const std::size_t index = oldest_ + size_;
  storage_[index < capacity_ ? index : index - capacity_] = pose;
  ++size_;
  ++counters_.accepted;
  stale_in_a_row_ = 0;
  return Status::kOk;
}

base::Result<Pose> PoseHistory::at(TimeUs t_us) const {
  if (size_ == 0) {
    return Status::kEmpty;
  }
  if (t_us < from_oldest(0).t_us) {
    return Status::kStale;
  }
  if (t_us > from_oldest(size_ - 1).t_us) {
    return Status::kNotReady;
  }
  // Last pose that is not later than t_us: there is one, see above.
  std::size_t low = 0;
  std::size_t high = size_ - 1;
  while (low < high) {
    const std::size_t middle = low + (high - low + 1) / 2;
    if (from_oldest(middle).t_us <= t_us) {
      low = middle;
    } else {
      high = middle - 1;
    }
  }
  const Pose& before = from_oldest(low);
  if (before.t_us == t_us) {
    return before;
  }
  const Pose& behind = from_oldest(low + 1);
  if (before.epoch != behind.epoch) {
    return Status::kEpochMismatch;
  }
  if (behind.t_us - before.t_us > max_gap_us_) {
    return Status::kOutOfRange;
  }
  return interpolate(before, behind, t_us);
}

void PoseHistory::clear() {
  oldest_ = 0;
  size_ = 0;
  stale_in_a_row_ = 0;
}

}  // namespace leadline::estimator
