#include "hal/angles.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::hal;  // NOLINT: the file tests one header
using leadline::base::Attitude;
using leadline::base::Bam32;
using leadline::test::Random;

constexpr double kPi = 3.14159265358979323846;
constexpr double kBamPerRadian = 4294967296.0 / (2.0 * kPi);

/// Difference of two angles in units of 2^-32 turn.
double apart(Bam32 a, double radians) {
  const double turns = radians / (2.0 * kPi);
  const double expected = (turns - std::floor(turns)) * 4294967296.0;
  return std::fabs(std::remainder(a - expected, 4294967296.0));
}

Bam32 bam(double degrees) { return bam_of_e9deg(std::llround(degrees * 1e9)); }

std::array<std::int64_t, 4> q30(double w, double x, double y, double z) {
  const auto part = [](double v) { return std::llround(v * 1073741824.0); };
  return {part(w), part(x), part(y), part(z)};
}

void check_attitude(const Attitude& actual, double roll, double pitch, double heading,
                    double slack) {
  assert_near(apart(actual.roll_bam32, roll * kPi / 180), 0, slack);
  assert_near(apart(actual.pitch_bam32, pitch * kPi / 180), 0, slack);
  assert_near(apart(actual.heading_bam32, heading * kPi / 180), 0, slack);
}

}  // namespace

TEST(degrees_to_binary_angles) {
  assert_int_equal(bam(90), 0x40000000U);
  assert_int_equal(bam(-90), 0xC0000000U);
  assert_int_equal(bam(360), 0);
  assert_int_equal(bam(540), 0x80000000U);
  assert_int_equal(bam_of_e9deg(84), 1);  // 83.8 nanodegrees a unit
  assert_int_equal(urad_of_e9deg(180'000'000'000), 3'141'593);
  assert_int_equal(urad_of_e9deg(-57'295'779'513), -1'000'000);
}

TEST(square_roots_are_exact) {
  static_assert(isqrt_u64(15) == 3 && isqrt_u64(16) == 4, "usable at compile time");
  assert_int_equal(isqrt_u64(0), 0);
  assert_int_equal(isqrt_u64(UINT64_MAX), UINT32_MAX);
  Random random(1);
  for (int i = 0; i < 20'000; ++i) {
    const std::uint64_t value = random.next() >> random.between(0, 63);
    const std::uint64_t root = isqrt_u64(value);
    assert_true(root * root <= value);
    assert_true(root == UINT32_MAX || (root + 1) * (root + 1) > value);
  }
}

TEST(directions_of_any_length) {
  assert_int_equal(atan2_bam32(0, 0), 0);
  assert_int_equal(atan2_bam32(0, 5), 0);
  assert_int_equal(atan2_bam32(7, 0), 0x40000000U);
  assert_int_equal(atan2_bam32(0, -9), 0x80000000U);
  assert_int_equal(atan2_bam32(-1, 0), 0xC0000000U);
  assert_int_equal(atan2_bam32(INT64_MAX, INT64_MAX), 0x20000000U);
  Random random(2);
  for (int i = 0; i < 50'000; ++i) {
    const int shift = static_cast<int>(random.between(0, 62));
    const std::int64_t y = static_cast<std::int64_t>(random.next()) >> shift;
    const std::int64_t x = static_cast<std::int64_t>(random.next()) >> shift;
    if (y == INT64_MIN || x == INT64_MIN) {
      continue;
    }
    const double radians = std::atan2(static_cast<double>(y), static_cast<double>(x));
    if (x != 0 || y != 0) {
      assert_near(apart(atan2_bam32(y, x), radians), 0, 2.0);
    }
  }
}

TEST(arc_sine) {
  for (int i = -1000; i <= 1000; ++i) {
    const std::int64_t sine_q30 = std::llround(i / 1000.0 * 1073741824.0);
    // Next to 90 degrees half a unit of the sine is much of the angle.
    const double slack = 2.0 + kBamPerRadian * 2e-9 / std::sqrt(1.0 - i * i / 1e6 + 1e-9);
    assert_near(apart(asin_bam32(sine_q30), std::asin(i / 1000.0)), 0, slack);
  }
  assert_int_equal(asin_bam32(std::int64_t{3} << 30), 0x40000000U);
  assert_int_equal(asin_bam32(-(std::int64_t{3} << 30)), 0xC0000000U);
}

// pose.hpp: v_NED = Rz(heading) Ry(pitch) Rx(roll) v_FRD; the worked cases by hand.
TEST(rotation_by_hand) {
  const auto row = [](const Rotation& r, std::size_t i, double a, double b, double c) {
    assert_near(r[i][0] / 1073741824.0, a, 1e-6);
    assert_near(r[i][1] / 1073741824.0, b, 1e-6);
    assert_near(r[i][2] / 1073741824.0, c, 1e-6);
  };
  // Heading east: the bow points east, starboard points south.
  const Rotation east = rotation_of({0, 0, bam(90)});
  row(east, 0, 0, -1, 0);
  row(east, 1, 1, 0, 0);
  row(east, 2, 0, 0, 1);
  // Bow up by 30 degrees: the bow's down component is -1/2.
  row(rotation_of({0, bam(30), 0}), 2, -0.5, 0, std::sqrt(0.75));
  // Starboard down by 30 degrees: starboard's down component is 1/2.
  row(rotation_of({bam(30), 0, 0}), 2, 0, 0.5, std::sqrt(0.75));
}

TEST(attitudes_survive_their_matrix) {
  Random random(3);
  for (int i = 0; i < 2'000; ++i) {
    const double roll = static_cast<double>(random.between(-179, 179)) + 0.3;
    const double pitch = static_cast<double>(random.between(-85, 85)) + 0.1;
    const double heading = static_cast<double>(random.between(0, 359)) + 0.7;
    const Attitude back = attitude_of(rotation_of({bam(roll), bam(pitch), bam(heading)}));
    check_attitude(back, roll, pitch, heading, 20'000);  // 0.0017 degrees next to the zenith
  }
}

TEST(vectors_turn_forth_and_back) {
  const Rotation r = rotation_of({bam(10), bam(-20), bam(300)});
  const Vector3 v{1'000'000, -2'000'000, 500'000};
  const Vector3 back = rotated_back(r, rotated(r, v));
  for (std::size_t i = 0; i < 3; ++i) {
    assert_near(back[i], v[i], 5);
  }
  // Bow up by 90 degrees: forward is up.
  const Vector3 up = rotated(rotation_of({0, bam(90), 0}), {1'000'000, 0, 0});
  assert_near(up[2], -1'000'000, 2);
}

TEST(quaternions) {
  const double h = std::sqrt(0.5);
  Rotation r{};
  assert_true(rotation_of_quaternion(q30(1, 0, 0, 0), r));
  check_attitude(attitude_of(r), 0, 0, 0, 2);
  // A quarter turn about down (right-handed: clockwise from above), right and forward.
  assert_true(rotation_of_quaternion(q30(h, 0, 0, h), r));
  check_attitude(attitude_of(r), 0, 0, 90, 2);
  assert_true(rotation_of_quaternion(q30(std::cos(kPi / 12), 0, std::sin(kPi / 12), 0), r));
  check_attitude(attitude_of(r), 0, 30, 0, 4);
  assert_true(rotation_of_quaternion(q30(std::cos(kPi / 12), std::sin(kPi / 12), 0, 0), r));
  check_attitude(attitude_of(r), 30, 0, 0, 4);
  // The same attitude with the other sign, and half a percent too long.
  assert_true(rotation_of_quaternion(q30(-h * 1.005, 0, 0, -h * 1.005), r));
  check_attitude(attitude_of(r), 0, 0, 90, 4);
}

TEST(no_quaternions) {
  Rotation r{};
  assert_false(rotation_of_quaternion(q30(0, 0, 0, 0), r));
  assert_false(rotation_of_quaternion(q30(1.02, 0, 0, 0), r));
  assert_false(rotation_of_quaternion(q30(0.98, 0, 0, 0), r));
  assert_false(rotation_of_quaternion(q30(40, 0, 0, 0), r));
  assert_false(rotation_of_quaternion({INT64_MAX, 0, 0, INT64_MIN}, r));
}

// Axes forward-left-up in east-north-up: the identity is a bow to the east, level.
TEST(other_worlds) {
  Rotation r{};
  assert_true(rotation_of_quaternion(q30(1, 0, 0, 0), r));
  check_attitude(attitude_of(ned_of_enu(r)), 0, 0, 90, 2);
  check_attitude(attitude_of(ned_of_nwu(r)), 0, 0, 0, 2);
  // 30 degrees to the left (about up): less heading.
  assert_true(rotation_of_quaternion(q30(std::cos(kPi / 12), 0, 0, std::sin(kPi / 12)), r));
  check_attitude(attitude_of(ned_of_enu(r)), 0, 0, 60, 4);
  check_attitude(attitude_of(ned_of_nwu(r)), 0, 0, 330, 4);
  // About left: the bow goes down.
  assert_true(rotation_of_quaternion(q30(std::cos(kPi / 12), 0, std::sin(kPi / 12), 0), r));
  check_attitude(attitude_of(ned_of_enu(r)), 0, -30, 90, 4);
  check_attitude(attitude_of(ned_of_nwu(r)), 0, -30, 0, 4);
  // About forward: left goes up, starboard down.
  assert_true(rotation_of_quaternion(q30(std::cos(kPi / 12), std::sin(kPi / 12), 0, 0), r));
  check_attitude(attitude_of(ned_of_enu(r)), 30, 0, 90, 4);
  check_attitude(attitude_of(ned_of_nwu(r)), 30, 0, 0, 4);
}
