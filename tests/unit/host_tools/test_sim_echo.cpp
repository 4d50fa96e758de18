#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "host_tools/sim/echo.hpp"
#include "host_tools/sim/exact_math.hpp"
#include "host_tools/sim/terrain_sources.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::EchoModel;
using leadline::host::EchoSpec;
using leadline::host::make_plane_terrain;
using leadline::host::normalized;
using leadline::host::PlaneOptions;
using leadline::host::Terrain;
using leadline::host::TouchedMask;
using leadline::host::Vec3;
using leadline::host::exact::kRadPerDeg;

Terrain plane(double slope_deg, double dip_azimuth_deg) {
  PlaneOptions options;
  options.north_count = 200;
  options.east_count = 200;
  options.shallowest_depth_m = 50.0;
  options.slope_deg = slope_deg;
  options.dip_azimuth_deg = dip_azimuth_deg;
  return make_plane_terrain(options);
}

// On level ground below the transducer the energy inside the angle t is 1 - x^2 with x the weight at t:
// the fraction f has arrived at x = sqrt(1 - f), whatever the beam's width.
TEST(level_ground_is_heard_where_the_integral_says) {
  const Terrain terrain = plane(0.0, 0.0);
  for (const double half_angle_deg : {0.5, 3.0, 12.5, 30.0, 60.0}) {
    for (const double fraction : {0.05, 0.10, 0.50, 0.90}) {
      EchoSpec spec;
      spec.beam_half_angle_deg = half_angle_deg;
      spec.detection_fraction = fraction;
      spec.range_bin_m = 0.001;
      spec.ray_count = 3000;
      EchoModel echo(terrain, spec);
      const std::optional<double> range_m = echo.measure({100.0, 100.0, 30.0}, {0.0, 0.0, 1.0});
      const double edge = std::cos(half_angle_deg * kRadPerDeg);
      const double cos_t = edge + (1.0 - edge) * std::sqrt(1.0 - fraction);
      assert_true(range_m.has_value());
      // One ray more or less, and half a bin.
      const double ray_m = 20.0 / cos_t * (1.0 - edge) / cos_t * 2.0 / 3000.0;
      assert_near(*range_m, 20.0 / cos_t, ray_m + 0.0006);
    }
  }
}

// The shape of the scenes' sensor: 300 rays, bins of an eighth of a cell, centre of the bin reported.
TEST(range_is_the_centre_of_its_bin) {
  const Terrain terrain = plane(0.0, 0.0);
  EchoModel echo(terrain, EchoSpec{});
  for (const double altitude_m : {10.0, 10.06, 10.13, 25.4}) {
    const std::optional<double> range_m =
        echo.measure({100.0, 100.0, 50.0 - altitude_m}, {0.0, 0.0, 1.0});
    assert_true(range_m.has_value());
    const double bins = *range_m / 0.125 - 0.5;
    assert_near(bins, std::round(bins), 1e-9);
    const double edge = std::cos(3.0 * kRadPerDeg);
    assert_near(*range_m, altitude_m / (edge + (1.0 - edge) * std::sqrt(0.9)), 0.064);
  }
}

// On a slope the 10 % point of the echo lies 0.55 beam radii uphill of the axis (for a narrow beam).
TEST(slopes_are_heard_uphill_of_the_axis) {
  for (const double slope_deg : {20.0, 30.0, 45.0}) {
    for (const double dip_deg : {0.0, 77.0, 180.0}) {
      const Terrain terrain = plane(slope_deg, dip_deg);
      EchoSpec spec;
      spec.beam_half_angle_deg = 2.0;
      spec.range_bin_m = 0.001;
      spec.ray_count = 4000;
      EchoModel echo(terrain, spec);
      const Vec3 position{100.0, 100.0, terrain.depth_m(100.0, 100.0) - 20.0};
      // Looks a little aside too, as long as the incidence stays the slope's own order.
      for (const Vec3 look : {Vec3{0.0, 0.0, 1.0}, Vec3{0.1, -0.1, 1.0}}) {
        const Vec3 axis = normalized(look);
        const double fall = std::tan(slope_deg * kRadPerDeg);
        const Vec3 normal = normalized(
            {-fall * std::cos(dip_deg * kRadPerDeg), -fall * std::sin(dip_deg * kRadPerDeg), 1.0});
        const double cos_incidence = dot(axis, normal);
        const double tan_incidence = std::sqrt(1.0 - cos_incidence * cos_incidence) / cos_incidence;
        const std::optional<double> axial_m = terrain.intersect(position, axis, 1000.0);
        const std::optional<double> range_m = echo.measure(position, axis);
        assert_true(axial_m.has_value() && range_m.has_value());
        // A ray s uphill (in beam radii) is shorter by the factor 1 + s T tan(i).
        const double shift = (*axial_m / *range_m - 1.0) / (2.0 * kRadPerDeg * tan_incidence);
        assert_near(shift, 0.55, 0.03);
      }
    }
  }
}

TEST(three_hundred_rays_are_enough) {
  const Terrain terrain = plane(30.0, 10.0);
  EchoSpec spec;
  EchoSpec fine = spec;
  fine.ray_count = 30000;
  EchoModel coarse_echo(terrain, spec);
  EchoModel fine_echo(terrain, fine);
  leadline::test::Random random(1);
  double mean = 0.0;
  const int count = 200;
  for (int k = 0; k < count; ++k) {
    const double x = 60.0 + 80.0 * random.uniform();
    const double y = 60.0 + 80.0 * random.uniform();
    const Vec3 position{x, y, terrain.depth_m(x, y) - 10.0 - 20.0 * random.uniform()};
    const Vec3 axis = normalized({0.4 * random.normal(), 0.4 * random.normal(), 1.0});
    const std::optional<double> a = coarse_echo.measure(position, axis);
    const std::optional<double> b = fine_echo.measure(position, axis);
    assert_true(a.has_value() && b.has_value());
    assert_near(*a, *b, 0.2501);
    mean += (*a - *b) / count;
  }
  assert_near(mean, 0.0, 0.02);
}

TEST(rays_mark_the_cells_they_hit) {
  const Terrain terrain = plane(0.0, 0.0);
  EchoModel echo(terrain, EchoSpec{});
  TouchedMask touched(200 * 200, 0);
  assert_true(echo.measure({100.5, 60.5, 10.0}, {0.0, 0.0, 1.0}, &touched).has_value());
  const double radius_m = 40.0 * std::tan(3.0 * kRadPerDeg);
  for (std::size_t i = 0; i < 200; ++i) {
    for (std::size_t j = 0; j < 200; ++j) {
      const double north_m = std::fabs(static_cast<double>(i) + 0.5 - 100.5);
      const double east_m = std::fabs(static_cast<double>(j) + 0.5 - 60.5);
      const bool is_touched = touched[i * 200 + j] != 0;
      if (std::hypot(north_m, east_m) < radius_m - 0.8) {
        assert_true(is_touched);
      }
      if (std::hypot(std::fmax(north_m - 0.5, 0.0), std::fmax(east_m - 0.5, 0.0)) > radius_m) {
        assert_false(is_touched);
      }
    }
  }
}

TEST(beams_past_the_edge_return_nothing) {
  const Terrain terrain = plane(0.0, 0.0);
  EchoModel echo(terrain, EchoSpec{});
  const Vec3 position{2.0, 100.0, 10.0};
  assert_true(echo.measure(position, {0.0, 0.0, 1.0}).has_value());
  // The axis is out, part of the cone is not: what comes back is heard.
  assert_true(echo.measure({-0.5, 100.0, 10.0}, {0.0, 0.0, 1.0}).has_value());
  assert_false(echo.measure({-3.0, 100.0, 10.0}, {0.0, 0.0, 1.0}).has_value());
  assert_false(echo.measure(position, {0.0, 0.0, -1.0}).has_value());
  EchoSpec deaf;
  deaf.max_range_m = 39.0;
  EchoModel deaf_echo(terrain, deaf);
  assert_false(deaf_echo.measure(position, {0.0, 0.0, 1.0}).has_value());
}

std::string complaint(const Terrain& terrain, const EchoSpec& spec) {
  try {
    EchoModel echo(terrain, spec);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(echo_options_are_checked) {
  const Terrain terrain = plane(0.0, 0.0);
  EchoSpec spec;
  spec.beam_half_angle_deg = 0.0;
  assert_true(complaint(terrain, spec).find("beam_half_angle_deg") != std::string::npos);
  spec = EchoSpec{};
  spec.ray_count = 0;
  assert_true(complaint(terrain, spec).find("ray_count") != std::string::npos);
  spec = EchoSpec{};
  spec.detection_fraction = 1.5;
  assert_true(complaint(terrain, spec).find("detection_fraction") != std::string::npos);
  spec = EchoSpec{};
  spec.range_bin_m = std::nan("");
  assert_true(complaint(terrain, spec).find("range_bin_m") != std::string::npos);
  spec = EchoSpec{};
  spec.max_range_m = -1.0;
  assert_true(complaint(terrain, spec).find("max_range_m") != std::string::npos);
}

}  // namespace
