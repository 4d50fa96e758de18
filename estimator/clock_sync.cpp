#include "estimator/clock_sync.hpp"

#include "estimator/wide.hpp"
#include "model/base/fixed.hpp"

namespace leadline::estimator {
namespace {

using base::max_of;
using base::min_of;
using base::TimeUs;

constexpr std::int64_t kBlock_us = 1'000'000;
// Silence beyond this says nothing of the clock in between: start anew.
constexpr std::int64_t kLongestGap_us = 600'000'000;
constexpr TimeUs kFarthest_us = std::int64_t{1} << 60U;
constexpr int kEarlyAgree = 3;
constexpr int kLateAgree = 8;
constexpr TimeUs kLateFor_us = 2'000'000;
constexpr int kHighBlocks = 4;
// A best pair this many stated errors above the line is not latency.
constexpr std::int64_t kHighErrors = 8;

bool within(std::int64_t value, std::int64_t limit) { return value >= -limit && value <= limit; }

}  // namespace

void ClockSync::restart() {
  any_ = false;
  block_count_ = 0;
  high_blocks_ = 0;
  late_in_a_row_ = 0;
  early_ = 0;
  stamp_newest_us_ = INT64_MIN;
}

void ClockSync::begin(TimeUs t_device_us, TimeUs t_arrival_us) {
  restart();
  any_ = true;
  device_0_us_ = t_device_us;
  arrival_0_us_ = t_arrival_us;
  device_newest_us_ = t_device_us;
  arrival_newest_us_ = t_arrival_us;
  block_from_x_ = 0;
  best_ = Point{0, 0};
  best_above_us_ = 0;
  anchor_ = Point{0, 0};
  slope_dy_ = 0;
  slope_dx_ = 1;
  error_us_ = config_.max_latency_us;
  ++counters_.merged;
}

std::int64_t ClockSync::line_at(std::int64_t x) const {
  return add_limited(anchor_.y, mul_div(x - anchor_.x, slope_dy_, slope_dx_));
}

std::int64_t ClockSync::drift_ppb() const { return mul_div(slope_dy_, 1'000'000'000, slope_dx_); }

bool ClockSync::sure() const {
  return any_ && block_count_ >= kSureBlocks && error_us_ <= config_.max_error_us &&
         high_blocks_ == 0 && late_in_a_row_ == 0 && early_ == 0;
}

ClockReading ClockSync::at(TimeUs t_device_us) const {
  if (!any_ || !within(t_device_us, kFarthest_us)) {
    return {0, config_.max_latency_us, false};
  }
  const std::int64_t x = t_device_us - device_0_us_;
  // The line is known where there were pairs.
  const bool near = x <= device_newest_us_ - device_0_us_ + kLongestGap_us &&
                    (block_count_ == 0 || x >= blocks_[0].x);
  return {add_limited(arrival_0_us_, add_limited(x, line_at(x))), error_us_, sure() && near};
}

bool ClockSync::add(TimeUs t_device_us, TimeUs t_arrival_us) {
  if (!within(t_device_us, kFarthest_us) || !within(t_arrival_us, kFarthest_us)) {
    return false;
  }
  if (!any_ || t_arrival_us - arrival_newest_us_ > kLongestGap_us) {
    begin(t_device_us, t_arrival_us);
    return true;
  }
  if (t_arrival_us < arrival_newest_us_) {
    ++counters_.backwards;
    return false;
  }
  arrival_newest_us_ = t_arrival_us;
  const std::int64_t x = t_device_us - device_0_us_;
  const Point point{x, t_arrival_us - arrival_0_us_ - x};
  const std::int64_t above_us = point.y - line_at(x);
  if (above_us > config_.max_latency_us) {
    return take_late(t_device_us, t_arrival_us);
  }
  // Before there is a line, drift may look like a step.
  const std::int64_t drift_us =
      block_count_ < 2 ? mul_div(max_of<std::int64_t>(x, 0), config_.max_drift_ppm, 1'000'000) : 0;
  if (above_us < -config_.step_us - drift_us) {
    return take_early(t_device_us, t_arrival_us);
  }
  late_in_a_row_ = 0;
  if (t_device_us < device_newest_us_) {
    ++counters_.backwards;
    return false;
  }
  device_newest_us_ = t_device_us;
  ++counters_.merged;
  merge(point, above_us);
  return true;
}

bool ClockSync::take_late(TimeUs t_device_us, TimeUs t_arrival_us) {
  ++counters_.late;
  late_since_us_ = late_in_a_row_ == 0 ? t_arrival_us : late_since_us_;
  ++late_in_a_row_;
  if (late_in_a_row_ < kLateAgree || t_arrival_us - late_since_us_ < kLateFor_us) {
    return false;
  }
  ++counters_.steps;
  begin(t_device_us, t_arrival_us);
  return true;
}

bool ClockSync::take_early(TimeUs t_device_us, TimeUs t_arrival_us) {
  if (block_count_ < 2) {
    // No line yet: what came before was late, all of it.
    begin(t_device_us, t_arrival_us);
    return true;
  }
  ++counters_.early;
  const std::int64_t offset_us = t_arrival_us - t_device_us;
  const bool agrees =
      early_ > 0 && within(offset_us - early_offset_us_, config_.max_latency_us / 2);
  early_ = agrees ? early_ + 1 : 1;
  early_offset_us_ = agrees ? min_of(early_offset_us_, offset_us) : offset_us;
  if (early_ < kEarlyAgree) {
    return false;
  }
  ++counters_.steps;
  begin(t_device_us, t_arrival_us);
  return true;
}

void ClockSync::merge(const Point& point, std::int64_t above_us) {
  if (point.x >= block_from_x_ + kBlock_us) {
    close_block(point.x);
    best_ = point;
    best_above_us_ = point.y - line_at(point.x);
    return;
  }
  if (above_us < best_above_us_) {
    best_ = point;
    best_above_us_ = above_us;
  }
}

void ClockSync::close_block(std::int64_t x) {
  block_from_x_ = x;
  early_ = 0;
  if (block_count_ == kBlocks) {
    for (std::size_t i = 1; i < blocks_.size(); ++i) {
      blocks_[i - 1] = blocks_[i];
    }
    --block_count_;
  }
  blocks_[static_cast<std::size_t>(block_count_)] = best_;
  ++block_count_;
  const std::int64_t high_us = max_of(config_.step_us, kHighErrors * error_us_);
  const bool high = block_count_ > kSureBlocks && best_above_us_ > high_us;
  high_blocks_ = high ? high_blocks_ + 1 : 0;
  if (high && high_blocks_ < kHighBlocks) {
    return;  // a fit with these in it would call them usual
  }
  if (high_blocks_ == kHighBlocks) {
    // A clock that was set back by less than a line may delay: what it says since is all that counts.
    for (std::size_t i = 0; i < kHighBlocks; ++i) {
      blocks_[i] = blocks_[static_cast<std::size_t>(block_count_ - kHighBlocks) + i];
    }
    block_count_ = kHighBlocks;
    high_blocks_ = 0;
    stamp_newest_us_ = INT64_MIN;
    ++counters_.steps;
  }
  fit();
}

void ClockSync::fit() {
  if (block_count_ < 2) {
    anchor_ = blocks_[0];
    return;
  }
  // Lower hull, left to right; the edge above which the middle lies.
  std::array<std::size_t, kBlocks> hull{};
  std::size_t hull_count = 0;
  std::int64_t sum_x = 0;
  const auto count = static_cast<std::size_t>(block_count_);
  for (std::size_t i = 0; i < count; ++i) {
    const Point& p = blocks_[i];
    sum_x += p.x - blocks_[0].x;
    while (hull_count >= 2) {
      const Point& a = blocks_[hull[hull_count - 2]];
      const Point& b = blocks_[hull[hull_count - 1]];
      // Spans of 32 gaps of 600 s by what 1000 ppm and latencies make of them: below 2^59.
      if ((b.x - a.x) * (p.y - a.y) > (p.x - a.x) * (b.y - a.y)) {
        break;
      }
      --hull_count;
    }
    hull[hull_count] = i;
    ++hull_count;
  }
  const std::int64_t middle_x = blocks_[0].x + sum_x / block_count_;
  std::size_t edge = 0;
  while (edge + 2 < hull_count && blocks_[hull[edge + 1]].x <= middle_x) {
    ++edge;
  }
  anchor_ = blocks_[hull[edge]];
  slope_dx_ = max_of<std::int64_t>(blocks_[hull[edge + 1]].x - anchor_.x, 1);
  const std::int64_t most = mul_div(slope_dx_, config_.max_drift_ppm, 1'000'000);
  slope_dy_ = base::clamp(blocks_[hull[edge + 1]].y - anchor_.y, -most, most);
  // How far the best pairs of a second lie from the line says how well they hold it.
  std::int64_t sum_us = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::int64_t off_us = blocks_[i].y - line_at(blocks_[i].x);
    sum_us += off_us < 0 ? -off_us : off_us;
  }
  error_us_ = 2 + 2 * sum_us / max_of(block_count_ - 2, 1);
}

TimeUs ClockSync::stamp(TimeUs t_device_us, TimeUs t_arrival_us) {
  const bool merged = add(t_device_us, t_arrival_us);
  const ClockReading reading = at(t_device_us);
  if (!merged || !reading.sure) {
    return t_arrival_us;
  }
  stamp_newest_us_ = max_of(stamp_newest_us_, min_of(reading.t_us, t_arrival_us));
  return stamp_newest_us_;
}

}  // namespace leadline::estimator
