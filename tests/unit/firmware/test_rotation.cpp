#include <cmath>

#include "firmware/pipeline/rotation.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Attitude;
using leadline::base::Bam32;
using leadline::base::Pose;
using leadline::firmware::atan2_bam32;
using leadline::firmware::attitude_of;
using leadline::firmware::middle;
using leadline::firmware::MountConfig;
using leadline::firmware::pose_of_mount;
using leadline::firmware::product;
using leadline::firmware::Rotation;
using leadline::firmware::rotation_of;
using leadline::test::bam;
using leadline::test::pose_at;
using leadline::test::Random;

constexpr double kPi = 3.14159265358979323846;
constexpr double kRadPerBam = 2.0 * kPi / 4294967296.0;
constexpr double kOne = 1073741824.0;

struct Matrix {
  double m[3][3];
};

Matrix exact(const Attitude& attitude) {
  const double r = attitude.roll_bam32 * kRadPerBam;
  const double p = attitude.pitch_bam32 * kRadPerBam;
  const double h = attitude.heading_bam32 * kRadPerBam;
  const double sr = std::sin(r), cr = std::cos(r), sp = std::sin(p), cp = std::cos(p),
               sh = std::sin(h), ch = std::cos(h);
  return Matrix{{{ch * cp, ch * sp * sr - sh * cr, ch * sp * cr + sh * sr},
                 {sh * cp, sh * sp * sr + ch * cr, sh * sp * cr - ch * sr},
                 {-sp, cp * sr, cp * cr}}};
}

double worst(const Rotation& a, const Matrix& b) {
  double largest = 0;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      largest = std::max(largest, std::fabs(a.m_q30[i][j] / kOne - b.m[i][j]));
    }
  }
  return largest;
}

Attitude any(Random& random) {
  const auto angle = [&random] { return static_cast<Bam32>(random.next()); };
  Attitude attitude{angle(), angle(), angle()};
  // A third of them at or near the poles.
  if (random.between(0, 2) == 0) {
    attitude.pitch_bam32 = (random.between(0, 1) == 0 ? 0x40000000U : 0xC0000000U) +
                           static_cast<Bam32>(random.between(-2000, 2000));
  }
  return attitude;
}

TEST(matrices_of_angles_and_angles_of_matrices) {
  Random random(1);
  double worst_matrix = 0;
  double worst_back = 0;
  for (int i = 0; i < 100'000; ++i) {
    const Attitude attitude = any(random);
    const Rotation rotation = rotation_of(attitude);
    worst_matrix = std::max(worst_matrix, worst(rotation, exact(attitude)));
    // Other angles perhaps, the same rotation.
    worst_back = std::max(worst_back, worst(rotation, exact(attitude_of(rotation))));
  }
  print_message("worst entry: %.2g of the matrix, %.2g there and back\n", worst_matrix, worst_back);
  assert_true(worst_matrix < 2e-6);
  assert_true(worst_back < 3e-6);
}

TEST(products_follow_each_other) {
  Random random(2);
  for (int i = 0; i < 20'000; ++i) {
    const Attitude a = any(random);
    const Attitude b = any(random);
    const Matrix x = exact(a);
    const Matrix y = exact(b);
    Matrix expected{};
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        for (int k = 0; k < 3; ++k) {
          expected.m[r][c] += x.m[r][k] * y.m[k][c];
        }
      }
    }
    assert_true(worst(product(rotation_of(a), rotation_of(b)), expected) < 4e-6);
  }
}

TEST(arcs_are_within_four_nanoradians) {
  Random random(3);
  double largest = 0;
  for (int i = 0; i < 200'000; ++i) {
    const std::int64_t x = random.between(-(1LL << 31), 1LL << 31);
    const std::int64_t y = random.between(-(1LL << 31), 1LL << 31);
    if (x * x / 2 + y * y / 2 < (1LL << 55)) {
      continue;
    }
    const double angle = std::atan2(static_cast<double>(y), static_cast<double>(x));
    const auto apart = static_cast<std::int32_t>(
        atan2_bam32(y, x) -
        static_cast<Bam32>(static_cast<std::int64_t>(std::llround(angle / kRadPerBam))));
    largest = std::max(largest, std::fabs(apart * kRadPerBam));
  }
  assert_true(largest < 4e-9);
  assert_int_equal(atan2_bam32(0, 0), 0);
  assert_int_equal(atan2_bam32(0, 1 << 30) + 3 < 6, 1);
  assert_in_range(atan2_bam32(0, -(1 << 30)), 0x80000000U - 3, 0x80000000U + 3);
}

MountConfig mount_at(std::int32_t x_mm, std::int32_t y_mm, std::int32_t z_mm) {
  MountConfig mount{};
  mount.lever_arm_mm[0] = x_mm;
  mount.lever_arm_mm[1] = y_mm;
  mount.lever_arm_mm[2] = z_mm;
  return mount;
}

// One test a sign.
TEST(lever_arms_point_forward_right_and_down) {
  Pose pose = pose_at(0, 0, 0);
  pose.attitude.heading_bam32 = bam(90);
  const Pose forward = pose_of_mount(pose, mount_at(2000, 0, 0));
  assert_near(static_cast<double>(forward.position_um[1]), 2e6, 3);
  const Pose right = pose_of_mount(pose, mount_at(0, 2000, 0));
  assert_near(static_cast<double>(right.position_um[0]), -2e6, 3);
  const Pose down = pose_of_mount(pose, mount_at(0, 0, 2000));
  assert_near(static_cast<double>(down.position_um[2]), 2e6, 3);
  // Starboard down: a head to starboard goes down. Nose up: a head at the bow goes up.
  pose.attitude = {bam(30), 0, 0};
  assert_near(static_cast<double>(pose_of_mount(pose, mount_at(0, 2000, 0)).position_um[2]), 1e6,
              3);
  pose.attitude = {0, bam(30), 0};
  assert_near(static_cast<double>(pose_of_mount(pose, mount_at(2000, 0, 0)).position_um[2]), -1e6,
              3);
  // The attitude itself is left exactly as it was.
  assert_int_equal(pose_of_mount(pose, mount_at(2000, 0, 0)).attitude.pitch_bam32, bam(30));
}

TEST(boresight_turns_the_head_within_the_body) {
  // A scanning head turned nose down: its forward axis looks down, whatever the heading.
  for (const double heading : {0.0, 77.0, 251.0}) {
    Pose pose = pose_at(0, 0, 0);
    pose.attitude.heading_bam32 = bam(heading);
    MountConfig mount = mount_at(0, 0, 0);
    mount.boresight.pitch_bam32 = bam(-90);
    const Rotation head = rotation_of(pose_of_mount(pose, mount).attitude);
    assert_near(head.m_q30[2][0] / kOne, 1.0, 1e-5);  // forward is down
    // Its right axis stays the vehicle's.
    assert_near(head.m_q30[0][1] / kOne, -std::sin(heading * kPi / 180), 1e-5);
    assert_near(head.m_q30[1][1] / kOne, std::cos(heading * kPi / 180), 1e-5);
  }
  // Roll of the vehicle and boresight heading: the order is body first, then mount.
  Random random(4);
  for (int i = 0; i < 10'000; ++i) {
    Pose pose = pose_at(0, 0, 0);
    pose.attitude = any(random);
    MountConfig mount = mount_at(0, 0, 0);
    mount.boresight = any(random);
    const Matrix a = exact(pose.attitude);
    const Matrix b = exact(mount.boresight);
    Matrix expected{};
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        for (int k = 0; k < 3; ++k) {
          expected.m[r][c] += a.m[r][k] * b.m[k][c];
        }
      }
    }
    assert_true(worst(rotation_of(pose_of_mount(pose, mount).attitude), expected) < 8e-6);
  }
}

TEST(an_uncertain_attitude_swings_the_lever_arm) {
  Pose pose = pose_at(0, 0, 0);
  pose.covariance.sigma_position_mm[0] = 30;
  pose.covariance.sigma_attitude_urad16[2] = 625;  // 10 mrad
  const Pose head = pose_of_mount(pose, mount_at(4000, 0, 0));
  assert_in_range(head.covariance.sigma_position_mm[0], 50, 52);
  assert_in_range(head.covariance.sigma_position_mm[1], 40, 42);
  assert_int_equal(pose_of_mount(pose, mount_at(0, 0, 0)).covariance.sigma_position_mm[0], 30);
}

TEST(the_middle_lies_between_and_takes_the_short_way_round) {
  Pose a = pose_at(1, 2, 3);
  Pose b = pose_at(2, 4, 3);
  a.t_us = 100;
  b.t_us = 301;
  a.attitude = {bam(350), bam(2), bam(359)};
  b.attitude = {bam(4), bam(-2), bam(3)};
  a.covariance.sigma_position_mm[1] = 7;
  b.covariance.sigma_attitude_urad16[0] = 9;
  b.validity = leadline::base::kPoseVertical;
  const Pose between = middle(a, b);
  assert_int_equal(between.t_us, 200);
  assert_int_equal(between.position_um[0], 1'500'000);
  assert_int_equal(between.position_um[1], 3'000'000);
  assert_near(between.attitude.roll_bam32, bam(357), 2);
  assert_near(static_cast<std::int32_t>(between.attitude.pitch_bam32), 0, 2);
  assert_near(between.attitude.heading_bam32, bam(1), 2);
  assert_int_equal(between.covariance.sigma_position_mm[1], 7);
  assert_int_equal(between.covariance.sigma_attitude_urad16[0], 9);
  assert_int_equal(between.validity, leadline::base::kPoseVertical);
}

}  // namespace
