// How an emulated vehicle really moves: a lawn mower flown by a helmsman with finite speed, acceleration
// and turn rate, in a current that varies, over ground that rises and falls. The true pose exists at
// every instant: between two steps of the simulated motion it is a smooth curve, not a jump.
//
// Only exact arithmetic (sim/exact_math.hpp): the same plan over the same terrain gives the same bits on
// every host.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "host_tools/sim/simulator.hpp"
#include "host_tools/sim/terrain.hpp"
#include "host_tools/sim/vec3.hpp"

namespace leadline::host {

/// Lines along north over the surveyed rectangle, `line_spacing_m` apart, flown alternately north and
/// south, with a turn of `run_out_m` beyond each end.
struct MotionPlan {
  // The rectangle: NED metres. The vehicle leaves it in its turns.
  double south_m = 0.0;
  double north_m = 32.0;
  double west_m = 0.0;
  double east_m = 32.0;
  double line_spacing_m = 2.0;  ///< the first line runs half of it from the west edge
  double run_out_m = 1.5;       ///< beyond the ends of a line before the turn begins

  double altitude_m = 4.0;            ///< above the mean of the ground around
  double altitude_smoothing_m = 2.0;  ///< how far ahead and astern that mean reaches

  // What the vehicle can do.
  double speed_m_s = 1.0;       ///< through the water, on a line
  double turn_speed_m_s = 0.5;  ///< through the water, in a turn
  double acceleration_m_s2 = 0.2;
  double turn_rate_deg_s = 25.0;
  double turn_acceleration_deg_s2 = 30.0;
  double climb_rate_m_s = 0.4;
  double climb_acceleration_m_s2 = 0.25;

  // What the water does: a steady current and one that swings.
  double current_north_m_s = 0.04;
  double current_east_m_s = -0.06;
  double current_swing_m_s = 0.05;
  double current_period_s = 140.0;

  // The hull's own motion about its course.
  Swing roll{4.0, 6.3, 0.0};
  Swing pitch{3.0, 4.7, 1.0};
  Swing yaw{2.0, 9.1, 2.0};
};

/// The vehicle's reference point and attitude, as they are.
struct TruePose {
  Vec3 position_m;  ///< NED
  Vec3 velocity_m_s;
  Attitude attitude;
};

class Trajectory {
 public:
  /// Flies the plan once. Throws std::invalid_argument naming the field for a value out of its range,
  /// and where the vehicle would come within a fifth of its altitude of the ground.
  Trajectory(const Terrain& terrain, const MotionPlan& plan);

  /// Length of the survey.
  [[nodiscard]] double duration_s() const { return duration_s_; }
  [[nodiscard]] std::int64_t duration_us() const;

  /// The true pose at `time_us` after the start; clamped to the survey's begin and end, where the
  /// vehicle stands still. O(1).
  [[nodiscard]] TruePose at(std::int64_t time_us) const;

 private:
  struct Step {
    Vec3 position_m;
    Vec3 velocity_m_s;
    double course_deg;  ///< heading without the hull's own motion; continuous, not wrapped
    double turn_rate_deg_s;
  };

  MotionPlan plan_;
  std::vector<Step> steps_;
  double duration_s_ = 0.0;
};

}  // namespace leadline::host
