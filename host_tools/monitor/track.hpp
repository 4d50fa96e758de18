// Where the vehicle was, thinned to a bounded number of points.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "model/base/units.hpp"
#include "proto/messages.hpp"

namespace leadline::host {

/// Metres of the survey's frame, and the vehicle's time. A point that is not a number separates two pieces.
struct TrackPoint {
  float north_m;
  float east_m;
  float down_m;
  float t_s;
};

class Track {
 public:
  static constexpr std::size_t kMaxPoints = 16384;

  /// Adds a point where the vehicle went `step_m` or more since the last one. When kMaxPoints are there, every
  /// second one goes and the distance doubles: revision() changes. O(1) amortized.
  void add(const TrackPoint& point, double step_m);
  /// The vehicle's newest word about where it is. Not joined to what was before: a position after one that is not
  /// known, after a navigation that jumped (a new pose epoch), and after longer than kGap_us without a word.
  void follow(const proto::Status& status, double step_m);
  static constexpr base::TimeUs kGap_us = 20'000'000;
  /// What comes next does not join what was.
  void interrupt() { interrupted_ = !points_.empty(); }
  void clear();

  [[nodiscard]] const std::vector<TrackPoint>& points() const { return points_; }
  /// Within one revision points are only added.
  [[nodiscard]] std::uint32_t revision() const { return revision_; }

 private:
  std::vector<TrackPoint> points_;
  double thinning_ = 1.0;
  bool interrupted_ = false;
  std::uint32_t revision_ = 0;
  std::uint16_t pose_epoch_ = 0;
  bool epoch_alarm_ = false;   ///< a brief says a new epoch by its alarm only
  base::TimeUs known_us_ = 0;  ///< vehicle's time of the last known position
};

}  // namespace leadline::host
