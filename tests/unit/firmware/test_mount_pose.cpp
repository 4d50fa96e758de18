#include <cmath>

#include "firmware/pipeline/mount_pose.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/rotations.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Pose;
using leadline::base::rotation_of;
using leadline::firmware::middle;
using leadline::firmware::MountConfig;
using leadline::firmware::pose_of_mount;
using leadline::test::any_attitude;
using leadline::test::bam;
using leadline::test::exact_rotation;
using leadline::test::kOne;
using leadline::test::Matrix;
using leadline::test::pose_at;
using leadline::test::Random;
using leadline::test::worst_entry;

constexpr double kPi = 3.14159265358979323846;

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
    const auto head = rotation_of(pose_of_mount(pose, mount).attitude);
    assert_near(head[2][0] / kOne, 1.0, 1e-5);  // forward is down
    // Its right axis stays the vehicle's.
    assert_near(head[0][1] / kOne, -std::sin(heading * kPi / 180), 1e-5);
    assert_near(head[1][1] / kOne, std::cos(heading * kPi / 180), 1e-5);
  }
  // Roll of the vehicle and boresight heading: the order is body first, then mount.
  Random random(4);
  for (int i = 0; i < 10'000; ++i) {
    Pose pose = pose_at(0, 0, 0);
    pose.attitude = any_attitude(random);
    MountConfig mount = mount_at(0, 0, 0);
    mount.boresight = any_attitude(random);
    const Matrix a = exact_rotation(pose.attitude);
    const Matrix b = exact_rotation(mount.boresight);
    Matrix expected{};
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        for (int k = 0; k < 3; ++k) {
          expected.m[r][c] += a.m[r][k] * b.m[k][c];
        }
      }
    }
    assert_true(worst_entry(rotation_of(pose_of_mount(pose, mount).attitude), expected) < 8e-6);
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
