#include "host_tools/monitor/track.hpp"

#include <cmath>
#include <limits>

#include "model/base/pose.hpp"

namespace leadline::host {

void Track::add(const TrackPoint& point, double step_m) {
  if (!interrupted_ && !points_.empty()) {
    const TrackPoint& last = points_.back();
    const double north_m = double{point.north_m} - double{last.north_m};
    const double east_m = double{point.east_m} - double{last.east_m};
    const double down_m = double{point.down_m} - double{last.down_m};
    if (std::sqrt(north_m * north_m + east_m * east_m + down_m * down_m) < step_m * thinning_) {
      return;
    }
  }
  if (points_.size() + 2 > kMaxPoints) {
    std::vector<TrackPoint> kept;
    for (std::size_t k = 0; k < points_.size(); ++k) {
      if (k % 2 == 0 || std::isnan(points_[k].north_m)) {
        kept.push_back(points_[k]);
      }
    }
    // Nothing but gaps: those that are oldest go.
    if (kept.size() * 4 > kMaxPoints * 3) {
      kept.erase(kept.begin(), kept.begin() + static_cast<std::ptrdiff_t>(kept.size() / 2));
    }
    points_ = std::move(kept);
    thinning_ *= 2.0;
    revision_ += 1;
  }
  if (interrupted_) {
    constexpr float kGap = std::numeric_limits<float>::quiet_NaN();
    points_.push_back({kGap, kGap, kGap, point.t_s});
    interrupted_ = false;
  }
  points_.push_back(point);
}

void Track::follow(const proto::Status& status, double step_m) {
  if ((status.pose_validity & base::kPoseHorizontal) == 0) {
    interrupt();
    return;
  }
  const bool alarm = (status.alarms & proto::kAlarmPoseEpoch) != 0;
  if (status.pose_epoch != pose_epoch_ || (alarm && !epoch_alarm_) ||
      status.t_us - known_us_ > kGap_us || status.t_us < known_us_) {
    interrupt();
  }
  pose_epoch_ = status.pose_epoch;
  epoch_alarm_ = alarm;
  known_us_ = status.t_us;
  const auto metres = [&status](int axis) {
    return static_cast<float>(status.position_mm[axis]) / 1000.0F;
  };
  add({metres(0), metres(1), metres(2),
       static_cast<float>(static_cast<double>(status.t_us) * 1e-6)},
      step_m);
}

void Track::clear() {
  points_.clear();
  thinning_ = 1.0;
  interrupted_ = false;
  revision_ += 1;
}

}  // namespace leadline::host
