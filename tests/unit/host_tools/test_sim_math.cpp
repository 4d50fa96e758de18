#include <algorithm>
#include <cmath>

#include "host_tools/sim/exact_math.hpp"
#include "host_tools/sim/random.hpp"
#include "host_tools/sim/vec3.hpp"
#include "tests/support/test.hpp"

namespace {

namespace exact = leadline::host::exact;
using leadline::host::Attitude;
using leadline::host::Basis;
using leadline::host::basis_about;
using leadline::host::beam_angles;
using leadline::host::BeamAngles;
using leadline::host::cross;
using leadline::host::dot;
using leadline::host::norm;
using leadline::host::Vec3;
using leadline::host::vehicle_direction;
using leadline::host::world_from_vehicle;

constexpr double kTolerance = 1e-14;

TEST(exact_functions_agree_with_libm) {
  for (int k = -200000; k <= 200000; ++k) {
    const double x = k * 1.7e-4;
    assert_near(exact::sin(x), std::sin(x), kTolerance);
    assert_near(exact::cos(x), std::cos(x), kTolerance);
  }
  for (int k = -1000; k <= 1000; ++k) {
    const double x = k * 997.123;
    assert_near(exact::sin(x), std::sin(x), 1e-9);
    assert_near(exact::cos(x), std::cos(x), 1e-9);
  }
  for (int k = 1; k <= 100000; ++k) {
    const double x = k * 3.7e-4;
    assert_near(exact::log(x), std::log(x), kTolerance);
    assert_near(exact::exp(-x), std::exp(-x), kTolerance);
  }
  assert_near(exact::log(1e-300) / std::log(1e-300), 1.0, kTolerance);
  assert_near(exact::exp(300.0) / std::exp(300.0), 1.0, 1e-13);
  for (int k = 0; k < 100000; ++k) {
    const double angle = k * 6.3e-5;
    const double x = 3.0 * std::cos(angle);
    const double y = 3.0 * std::sin(angle);
    assert_near(exact::atan2(y, x), std::atan2(y, x), kTolerance);
  }
  assert_near(exact::atan2(0.0, 0.0), 0.0, 0.0);
  assert_near(exact::atan2(0.0, -1.0), exact::kPi, 0.0);
  assert_near(exact::atan2(-2.0, 0.0), -0.5 * exact::kPi, kTolerance);
}

// The sequence is part of the contract: a scene is named by its seed.
TEST(random_is_the_published_xoshiro) {
  // First outputs of xoshiro256** from the state that splitmix64 makes of seed 0; the first four
  // splitmix64 outputs of seed 0 are e220a8397b1dcdaf 6e789e6aa1b965f4 06c45d188009454f
  // f88bb8a8724c81ec (published test vector).
  leadline::host::Random random(0);
  assert_true(random.next_u64() == 0x99EC5F36CB75F2B4ULL);
  assert_true(random.next_u64() == 0xBF6E1F784956452AULL);
  assert_true(random.next_u64() == 0x1A5F849D4933E6E0ULL);
}

TEST(random_streams_differ_and_copies_continue) {
  leadline::host::Random a(7, 1);
  leadline::host::Random b(7, 2);
  assert_true(a.next_u64() != b.next_u64());
  leadline::host::Random copy = a;
  assert_true(a.next_u64() == copy.next_u64());
}

TEST(random_has_the_moments_it_should) {
  leadline::host::Random random(3);
  const int count = 400000;
  double mean = 0.0;
  double square = 0.0;
  double fourth = 0.0;
  double uniform_mean = 0.0;
  double lowest = 1.0;
  double highest = 0.0;
  for (int k = 0; k < count; ++k) {
    const double x = random.normal();
    mean += x;
    square += x * x;
    fourth += x * x * x * x;
    const double u = random.uniform();
    uniform_mean += u;
    lowest = std::min(lowest, u);
    highest = std::max(highest, u);
  }
  // Five sigma each.
  assert_near(mean / count, 0.0, 5.0 / std::sqrt(count));
  assert_near(square / count, 1.0, 5.0 * std::sqrt(2.0 / count));
  assert_near(fourth / count, 3.0, 5.0 * std::sqrt(96.0 / count));
  assert_near(uniform_mean / count, 0.5, 5.0 * std::sqrt(1.0 / 12.0 / count));
  assert_true(lowest >= 0.0 && lowest < 1e-4);
  assert_true(highest < 1.0 && highest > 1.0 - 1e-4);
}

void assert_vector(Vec3 actual, double x, double y, double z) {
  assert_near(actual.x, x, 1e-12);
  assert_near(actual.y, y, 1e-12);
  assert_near(actual.z, z, 1e-12);
}

TEST(heading_turns_clockwise_from_north) {
  assert_vector(world_from_vehicle({0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}), 1.0, 0.0, 0.0);
  // Heading east: forward is east, starboard is south.
  assert_vector(world_from_vehicle({0.0, 0.0, 90.0}, {1.0, 0.0, 0.0}), 0.0, 1.0, 0.0);
  assert_vector(world_from_vehicle({0.0, 0.0, 90.0}, {0.0, 1.0, 0.0}), -1.0, 0.0, 0.0);
}

TEST(pitch_raises_the_nose_and_roll_lowers_starboard) {
  const double c = std::cos(0.1);
  const double s = std::sin(0.1);
  const double angle_deg = 0.1 * exact::kDegPerRad;
  assert_vector(world_from_vehicle({0.0, angle_deg, 0.0}, {1.0, 0.0, 0.0}), c, 0.0, -s);
  assert_vector(world_from_vehicle({angle_deg, 0.0, 0.0}, {0.0, 1.0, 0.0}), 0.0, c, s);
  // The keel beam of a vehicle that rolls to starboard looks to port.
  assert_vector(world_from_vehicle({angle_deg, 0.0, 0.0}, {0.0, 0.0, 1.0}), 0.0, -s, c);
  // Order: roll acts first, heading last.
  const Vec3 v = world_from_vehicle({90.0, 0.0, 90.0}, {0.0, 1.0, 0.0});
  assert_vector(v, 0.0, 0.0, 1.0);
}

TEST(beam_angles_invert_vehicle_direction) {
  assert_vector(vehicle_direction({90.0, 0.0}), 0.0, 1.0, 0.0);
  assert_vector(vehicle_direction({0.0, 90.0}), 0.0, 0.0, 1.0);
  assert_vector(vehicle_direction({0.0, -90.0}), 0.0, 0.0, -1.0);
  for (int azimuth_deg = -179; azimuth_deg <= 180; azimuth_deg += 7) {
    for (int elevation_deg = -89; elevation_deg <= 89; elevation_deg += 3) {
      const BeamAngles angles = beam_angles(vehicle_direction(
          {static_cast<double>(azimuth_deg), static_cast<double>(elevation_deg)}));
      assert_near(angles.azimuth_deg, azimuth_deg, 1e-9);
      assert_near(angles.elevation_deg, elevation_deg, 1e-9);
    }
  }
}

TEST(basis_is_orthonormal_and_right_handed) {
  leadline::test::Random random(1);
  for (int k = 0; k < 10000; ++k) {
    Vec3 axis{random.normal(), random.normal(), random.normal()};
    if (k < 6) {
      axis = {k == 0   ? 1.0
              : k == 1 ? -1.0
                       : 0.0,
              k == 2   ? 1.0
              : k == 3 ? -1.0
                       : 0.0,
              k == 4   ? 1.0
              : k == 5 ? -1.0
                       : 0.0};
    }
    axis = leadline::host::normalized(axis);
    const Basis basis = basis_about(axis);
    assert_near(norm(basis.side), 1.0, 1e-12);
    assert_near(norm(basis.other), 1.0, 1e-12);
    assert_near(dot(basis.side, axis), 0.0, 1e-12);
    assert_near(dot(basis.other, axis), 0.0, 1e-12);
    assert_near(dot(cross(basis.side, basis.other), axis), 1.0, 1e-12);
  }
}

}  // namespace
