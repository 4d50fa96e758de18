#include <cmath>
#include <vector>

#include "estimator/refraction.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Status;
using leadline::estimator::RayEnd;
using leadline::estimator::RayLaunch;
using leadline::estimator::SoundSpeedPoint;
using leadline::estimator::SoundSpeedProfile;
using leadline::estimator::straight_ray;
using leadline::estimator::StraightRay;
using leadline::estimator::trace_ray;

constexpr double kTurn = 6.283185307179586;

leadline::base::Bam32 bam(double angle_rad) {
  return static_cast<leadline::base::Bam32>(angle_rad / kTurn * 4294967296.0 + 0.5);
}

SoundSpeedProfile profile_of(const std::vector<SoundSpeedPoint>& points) {
  SoundSpeedProfile profile;
  assert_true(profile.set(points.data(), points.size()) == Status::kOk);
  return profile;
}

struct Point {
  double across_m;
  double down_m;
};

/// The ray's equation integrated in small steps of time (midpoint rule), double precision:
///   dx/dt = c sin, dz/dt = c cos, sin = p c
Point integrate(const SoundSpeedProfile& profile, double head_m, double slowness, double time_s) {
  const auto speed_at = [&profile](double depth_m) {
    const std::size_t count = profile.size();
    const auto depth_of = [&profile](std::size_t i) {
      return 1e-6 * static_cast<double>(profile.point(i).depth_um);
    };
    const auto speed_of = [&profile](std::size_t i) { return 1e-3 * profile.point(i).speed_mm_s; };
    if (depth_m <= depth_of(0)) {
      return speed_of(0);
    }
    for (std::size_t i = 1; i < count; ++i) {
      if (depth_m < depth_of(i)) {
        return speed_of(i - 1) + (speed_of(i) - speed_of(i - 1)) * (depth_m - depth_of(i - 1)) /
                                     (depth_of(i) - depth_of(i - 1));
      }
    }
    return speed_of(count - 1);
  };
  const int steps = 20'000;
  const double dt = time_s / steps;
  Point at{0, 0};
  for (int i = 0; i < steps; ++i) {
    const double here = speed_at(head_m + at.down_m);
    const double half =
        at.down_m + 0.5 * dt * here * std::sqrt(1 - slowness * slowness * here * here);
    const double c = speed_at(head_m + half);
    at.across_m += dt * c * slowness * c;
    at.down_m += dt * c * std::sqrt(1 - slowness * slowness * c * c);
  }
  return at;
}

}  // namespace

TEST(a_uniform_water_is_a_straight_line) {
  SoundSpeedProfile profile;
  assert_true(profile.set_uniform(1'500'000) == Status::kOk);
  for (const double angle : {0.0, 0.3, 0.7, 1.0, 1.3}) {
    const auto end = trace_ray(profile, {2'000'000, bam(angle), 1'500'000, 40'000'000});
    assert_true(end.ok());
    assert_near(end.value().across_um, 30e6 * std::sin(angle), 60);
    assert_near(end.value().down_um, 30e6 * std::cos(angle), 60);
    const StraightRay straight = straight_ray(end.value());
    assert_near(straight.range_um, 30e6, 60);
    assert_near(straight.from_down_bam32, bam(angle), 4000);  // 6e-6 rad
  }
}

TEST(one_gradient_is_an_arc_of_a_circle) {
  // c = 1500 + 0.5 z down to 200 m: the centre lies where c would be 0, 3000 m above the head.
  const SoundSpeedProfile profile = profile_of({{0, 1'500'000}, {200'000'000, 1'600'000}});
  const double angle = 0.8;
  const double radius = 3000.0 / std::sin(angle);
  const auto end = trace_ray(profile, {0, bam(angle), 0, 200'000'000});
  assert_true(end.ok());
  const double x = 1e-6 * static_cast<double>(end.value().across_um);
  const double z = 1e-6 * static_cast<double>(end.value().down_um);
  const double from_centre = std::hypot(x - radius * std::cos(angle), z + 3000.0);
  assert_near(from_centre, radius, 5e-4);
  // Time along the arc: tan(angle / 2) grows by exp(g t).
  const double last = 2 * std::atan(std::tan(angle / 2) * std::exp(0.5 * 0.1));
  assert_near(x, radius * (std::cos(angle) - std::cos(last)), 4e-4);
}

TEST(a_ray_through_many_layers_agrees_with_its_integral) {
  leadline::test::Random random;
  double worst = 0;
  for (int trial = 0; trial < 60; ++trial) {
    std::vector<SoundSpeedPoint> points;
    double depth_m = random.uniform() * 5.0;
    const int count = 2 + static_cast<int>(random.uniform() * 14);
    for (int i = 0; i < count; ++i) {
      points.push_back({static_cast<std::int64_t>(depth_m * 1e6),
                        1'480'000 + static_cast<std::int32_t>(random.uniform() * 40'000)});
      depth_m += 1.0 + 10.0 * random.uniform();
    }
    const SoundSpeedProfile profile = profile_of(points);
    const double angle = 1.15 * random.uniform();
    const double head_m = 6.0 * random.uniform();
    const std::int32_t told = 1'470'000 + static_cast<std::int32_t>(random.uniform() * 60'000);
    const double time_s = 0.01 + 0.09 * random.uniform();
    const auto end = trace_ray(profile, {static_cast<std::int64_t>(head_m * 1e6), bam(angle), told,
                                         static_cast<std::int64_t>(2e9 * time_s)});
    assert_true(end.ok());
    const Point exact = integrate(profile, head_m, std::sin(angle) / (1e-3 * told), time_s);
    const double error =
        std::hypot(1e-6 * static_cast<double>(end.value().across_um) - exact.across_m,
                   1e-6 * static_cast<double>(end.value().down_um) - exact.down_m);
    worst = std::max(worst, error / (1500.0 * time_s));
  }
  print_message("worst error %.2g of the range\n", worst);
  assert_true(worst < 2e-6);
}

TEST(the_head_s_wrong_speed_is_what_snell_makes_of_it) {
  SoundSpeedProfile profile;
  assert_true(profile.set_uniform(1'480'000) == Status::kOk);
  const double steered = 1.0;  // with 1500 m/s
  const auto end = trace_ray(profile, {0, bam(steered), 1'500'000, 20'000'000});
  assert_true(end.ok());
  const double real = std::asin(std::sin(steered) * 1480.0 / 1500.0);
  assert_near(end.value().across_um, 14.8e6 * std::sin(real), 40);
  assert_near(end.value().down_um, 14.8e6 * std::cos(real), 40);
}

TEST(the_head_may_be_anywhere) {
  const SoundSpeedProfile profile =
      profile_of({{5'000'000, 1'500'000}, {10'000'000, 1'510'000}, {20'000'000, 1'490'000}});
  assert_int_equal(profile.speed_at_mm_s(0), 1'500'000);
  assert_int_equal(profile.speed_at_mm_s(7'500'000), 1'505'000);
  assert_int_equal(profile.speed_at_mm_s(10'000'000), 1'510'000);
  assert_int_equal(profile.speed_at_mm_s(99'000'000), 1'490'000);
  for (const double head_m : {-3.0, 0.0, 5.0, 7.5, 10.0, 20.0, 25.0}) {
    const auto end = trace_ray(
        profile, {static_cast<std::int64_t>(head_m * 1e6), bam(0.9), 1'500'000, 30'000'000});
    assert_true(end.ok());
    const Point exact = integrate(profile, head_m, std::sin(0.9) / 1500.0, 0.015);
    assert_near(1e-6 * static_cast<double>(end.value().across_um), exact.across_m, 6e-5);
    assert_near(1e-6 * static_cast<double>(end.value().down_um), exact.down_m, 6e-5);
  }
}

TEST(the_stated_sigmas_are_those_of_a_shifted_profile) {
  for (const double angle : {0.0, 0.4, 0.7853981633974483, 1.1}) {
    SoundSpeedProfile profile;
    assert_true(profile.set_uniform(1'500'000) == Status::kOk);
    profile.set_sigma(1'500);
    const RayLaunch launch{0, bam(angle), 1'500'000, 80'000'000};
    const RayEnd end = trace_ray(profile, launch).value();
    assert_true(profile.set_uniform(1'501'500) == Status::kOk);
    const RayEnd shifted = trace_ray(profile, launch).value();
    assert_near(std::fabs(static_cast<double>(shifted.down_um - end.down_um)), end.sigma_down_um,
                600);
    assert_near(std::fabs(static_cast<double>(shifted.across_um - end.across_um)),
                end.sigma_across_um, 600);
  }
}

TEST(rays_that_turn_are_refused) {
  // Speed grows fast: a flat ray bends up.
  const SoundSpeedProfile profile = profile_of({{0, 1'450'000}, {10'000'000, 1'600'000}});
  assert_true(trace_ray(profile, {0, bam(1.3), 0, 60'000'000}).status() == Status::kOutOfRange);
  assert_true(trace_ray(profile, {0, bam(0.2), 0, 60'000'000}).ok());
  // Flat from the start, and flat by the head's wrong speed.
  assert_true(trace_ray(profile, {0, bam(1.5), 0, 1'000'000}).status() == Status::kOutOfRange);
  assert_true(trace_ray(profile, {20'000'000, bam(1.3), 1'450'000, 1'000'000}).status() ==
              Status::kOutOfRange);
  // A bend that the series do not serve.
  const SoundSpeedProfile long_gradient = profile_of({{0, 1'300'000}, {1'000'000, 1'700'000}});
  assert_true(trace_ray(long_gradient, {0, bam(0.0), 0, 3'000'000}).ok());
  assert_true(trace_ray(long_gradient, {0, bam(0.85), 0, 3'000'000}).status() ==
              Status::kOutOfRange);
}

TEST(arguments_out_of_their_limits) {
  SoundSpeedProfile profile;
  assert_true(trace_ray(profile, {0, 0, 0, 0}).status() == Status::kNotReady);
  assert_int_equal(profile.speed_at_mm_s(0), 0);
  assert_true(profile.set_uniform(1'200'000) == Status::kOutOfRange);
  const SoundSpeedPoint twice[] = {{5, 1'500'000}, {5, 1'500'000}};
  assert_true(profile.set(twice, 2) == Status::kInvalidArgument);
  assert_true(profile.set(twice, 0) == Status::kInvalidArgument);
  assert_true(profile.set(nullptr, 1) == Status::kInvalidArgument);
  const std::vector<SoundSpeedPoint> many(65, {0, 1'500'000});
  assert_true(profile.set(many.data(), many.size()) == Status::kInvalidArgument);
  const SoundSpeedPoint deep[] = {{30'000'000'000, 1'500'000}};
  assert_true(profile.set(deep, 1) == Status::kOutOfRange);
  assert_int_equal(profile.size(), 0);
  assert_true(profile.set_uniform(1'500'000) == Status::kOk);
  assert_true(trace_ray(profile, {0, 0, 0, -1}).status() == Status::kInvalidArgument);
  assert_true(trace_ray(profile, {0, 0, 0, 41'000'000'000}).status() == Status::kInvalidArgument);
  assert_true(trace_ray(profile, {0, bam(1.6), 0, 1}).status() == Status::kInvalidArgument);
  assert_true(trace_ray(profile, {0, 0, 900'000, 1}).status() == Status::kInvalidArgument);
  assert_int_equal(trace_ray(profile, {0, 0, 0, 0}).value().down_um, 0);
}
