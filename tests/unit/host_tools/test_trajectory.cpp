#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include "host_tools/emulate/trajectory.hpp"
#include "host_tools/sim/terrain_sources.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::MotionPlan;
using leadline::host::norm;
using leadline::host::PlaneOptions;
using leadline::host::ProceduralOptions;
using leadline::host::Terrain;
using leadline::host::Trajectory;
using leadline::host::TruePose;
using leadline::host::Vec3;

// 44 x 44 m with the surveyed 32 x 32 m in its middle.
Terrain seafloor() {
  ProceduralOptions options;
  options.north_count = 176;
  options.east_count = 176;
  options.cell_m = 0.25;
  options.shallowest_depth_m = 12.0;
  return make_procedural_terrain(options);
}

MotionPlan plan_over_seafloor() {
  MotionPlan plan;
  plan.south_m = plan.west_m = 6.0;
  plan.north_m = plan.east_m = 38.0;
  plan.line_spacing_m = 4.0;
  return plan;
}

double turn_deg(double from_deg, double to_deg) { return std::remainder(to_deg - from_deg, 360.0); }

TEST(motion_is_smooth_and_position_is_the_integral_of_velocity) {
  const Trajectory flight(seafloor(), plan_over_seafloor());
  constexpr std::int64_t kStep_us = 5'000;
  constexpr double kStep_s = 0.005;
  TruePose before = flight.at(0);
  double fastest_m_s = 0.0;
  // The last step may end in between two samples.
  for (std::int64_t t = kStep_us; t < flight.duration_us() - kStep_us; t += kStep_us) {
    const TruePose now = flight.at(t);
    const Vec3 moved = now.position_m - before.position_m;
    const Vec3 mean = 0.5 * (now.velocity_m_s + before.velocity_m_s);
    assert_near(norm(moved - kStep_s * mean), 0.0, 5e-5);
    // Nothing jerks: 2 m/s^2 at most, with the current's own change and the turn in it.
    assert_true(norm(now.velocity_m_s - before.velocity_m_s) < 2.0 * kStep_s);
    const double yaw_deg = turn_deg(before.attitude.heading_deg, now.attitude.heading_deg);
    assert_true(std::fabs(yaw_deg) < 40.0 * kStep_s);
    fastest_m_s = std::max(fastest_m_s, norm(now.velocity_m_s));
    before = now;
  }
  assert_true(fastest_m_s > 0.9);
  assert_true(fastest_m_s < 1.6);
}

TEST(every_line_is_flown_to_and_fro_without_leaving_it) {
  const MotionPlan plan = plan_over_seafloor();
  const Trajectory flight(seafloor(), plan);
  std::vector<int> northward(8, 0);
  std::vector<int> southward(8, 0);
  for (std::int64_t t = 0; t < flight.duration_us(); t += 50'000) {
    const TruePose pose = flight.at(t);
    // Away from the ends, where the turn is over.
    if (pose.position_m.x < plan.south_m + 6.0 || pose.position_m.x > plan.north_m - 6.0) {
      continue;
    }
    const double line = (pose.position_m.y - plan.west_m) / plan.line_spacing_m - 0.5;
    assert_near(line, std::round(line), 0.05);
    const auto number = static_cast<std::size_t>(std::lround(line));
    assert_true(number < 8);
    (pose.velocity_m_s.x > 0.0 ? northward : southward)[number] += 1;
  }
  for (std::size_t k = 0; k < 8; ++k) {
    assert_true((k % 2 == 0 ? northward : southward)[k] > 50);
    assert_int_equal((k % 2 == 0 ? southward : northward)[k], 0);
  }
}

TEST(altitude_is_kept_over_rough_ground) {
  const Terrain ground = seafloor();
  const MotionPlan plan = plan_over_seafloor();
  const Trajectory flight(ground, plan);
  double sum_m = 0.0;
  int count = 0;
  for (std::int64_t t = 0; t < flight.duration_us(); t += 50'000) {
    const Vec3 place = flight.at(t).position_m;
    const double altitude_m = ground.depth_m(place.x, place.y) - place.z;
    assert_true(altitude_m > 0.5 * plan.altitude_m);
    assert_true(altitude_m < 2.0 * plan.altitude_m);
    sum_m += altitude_m;
    count += 1;
  }
  assert_near(sum_m / count, plan.altitude_m, 0.4);
}

TEST(the_current_is_held_up_against) {
  MotionPlan plan = plan_over_seafloor();
  plan.yaw.amplitude_deg = 0.0;
  plan.current_east_m_s = 0.2;
  plan.current_north_m_s = 0.0;
  plan.current_swing_m_s = 0.0;
  const Trajectory flight(seafloor(), plan);
  // On the first line, well after its start: the nose is to the west of the way over ground.
  const TruePose pose = flight.at(20'000'000);
  assert_near(pose.position_m.y, plan.west_m + 2.0, 0.05);
  const double heading_deg = turn_deg(0.0, pose.attitude.heading_deg);
  assert_near(heading_deg, -std::asin(0.2 / 1.0) * 57.29578, 0.5);
}

TEST(hull_motion_has_the_amplitudes_asked_for) {
  MotionPlan plan = plan_over_seafloor();
  plan.roll.amplitude_deg = 6.0;
  plan.pitch.amplitude_deg = 0.0;
  const Trajectory flight(seafloor(), plan);
  double most_deg = 0.0;
  for (std::int64_t t = 0; t < flight.duration_us(); t += 20'000) {
    const TruePose pose = flight.at(t);
    assert_true(pose.attitude.pitch_deg == 0.0);
    most_deg = std::max(most_deg, std::fabs(pose.attitude.roll_deg));
  }
  assert_true(most_deg > 5.0);
  assert_true(most_deg <= 6.0);
}

TEST(before_and_after_the_survey_the_vehicle_stands) {
  const Trajectory flight(seafloor(), plan_over_seafloor());
  assert_near(norm(flight.at(-5).position_m - flight.at(0).position_m), 0.0, 0.0);
  const std::int64_t end_us = flight.duration_us();
  assert_near(norm(flight.at(end_us + 7).position_m - flight.at(end_us).position_m), 0.0, 0.0);
  assert_near(static_cast<double>(end_us) * 1e-6, flight.duration_s(), 1e-9);
}

TEST(the_same_plan_gives_the_same_bits) {
  const Terrain ground = seafloor();
  const Trajectory a(ground, plan_over_seafloor());
  const Trajectory b(ground, plan_over_seafloor());
  assert_int_equal(a.duration_us(), b.duration_us());
  for (std::int64_t t = 0; t < a.duration_us(); t += 777'777) {
    const TruePose x = a.at(t);
    const TruePose y = b.at(t);
    assert_int_equal(std::memcmp(&x, &y, sizeof x), 0);
  }
}

std::string complaint(const MotionPlan& plan) {
  PlaneOptions options;
  options.north_count = options.east_count = 64;
  const Terrain ground = make_plane_terrain(options);
  try {
    const Trajectory flight(ground, plan);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(plans_that_make_no_sense_are_named) {
  struct Case {
    const char* field;
    void (*spoil)(MotionPlan*);
  };
  const Case cases[] = {
      {"line_spacing_m", [](MotionPlan* p) { p->line_spacing_m = 0.0; }},
      {"altitude_m", [](MotionPlan* p) { p->altitude_m = -1.0; }},
      {"speed_m_s", [](MotionPlan* p) { p->speed_m_s = std::nan(""); }},
      {"turn_rate_deg_s", [](MotionPlan* p) { p->turn_rate_deg_s = 1000.0; }},
      {"current", [](MotionPlan* p) { p->current_east_m_s = 0.4; }},
      {"period_s", [](MotionPlan* p) { p->roll.period_s = 0.0; }},
      {"north_m", [](MotionPlan* p) { p->north_m = p->south_m; }},
  };
  for (const Case& each : cases) {
    MotionPlan plan;
    each.spoil(&plan);
    const std::string text = complaint(plan);
    if (text.find(each.field) == std::string::npos) {
      fail_msg("%s: \"%s\"", each.field, text.c_str());
    }
  }
  assert_true(complaint(MotionPlan{}).empty());
}

TEST(a_vehicle_that_cannot_climb_is_not_flown_into_the_ground) {
  PlaneOptions options;
  options.north_count = options.east_count = 64;
  options.slope_deg = 60.0;
  options.dip_azimuth_deg = 180.0;  // deeper to the south: the first line climbs
  MotionPlan plan;
  plan.climb_rate_m_s = 0.05;
  plan.altitude_m = 2.0;
  plan.altitude_smoothing_m = 0.0;
  try {
    const Trajectory flight(make_plane_terrain(options), plan);
    fail_msg("flew through the ground");
  } catch (const std::invalid_argument& error) {
    assert_true(std::string(error.what()).find("raise altitude_m") != std::string::npos);
  }
}

}  // namespace
