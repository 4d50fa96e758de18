#include <cmath>
#include <vector>

#include "estimator/pose_history.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Bam32;
using leadline::base::Pose;
using leadline::base::Status;
using leadline::estimator::kMaxGapLimit_us;
using leadline::estimator::kMaxTime_us;
using leadline::estimator::PoseHistoryBuffer;
using leadline::test::Random;

constexpr std::int64_t kSecond_us = 1'000'000;

Pose pose_at(std::int64_t t_us, std::int64_t north_um = 0, Bam32 heading = 0) {
  Pose pose{};
  pose.t_us = t_us;
  pose.position_um[leadline::base::kNorth] = north_um;
  pose.attitude.heading_bam32 = heading;
  pose.validity = leadline::base::kPoseAll;
  return pose;
}

constexpr Bam32 degrees(double value) {
  return static_cast<Bam32>(static_cast<std::int64_t>(value * 4294967296.0 / 360.0));
}

TEST(empty_history_has_no_pose) {
  PoseHistoryBuffer<4> buffer(kSecond_us);
  assert_int_equal(buffer.history().at(0).status(), Status::kEmpty);
  assert_int_equal(buffer.history().size(), 0);
  assert_int_equal(buffer.history().capacity(), 4);
}

TEST(exact_times_return_the_pose_itself) {
  PoseHistoryBuffer<4> buffer(0);
  auto& history = buffer.history();
  for (std::int64_t i = 0; i < 4; ++i) {
    assert_int_equal(history.push(pose_at(i * kSecond_us, i * 1000)), Status::kOk);
  }
  for (std::int64_t i = 0; i < 4; ++i) {
    const auto result = history.at(i * kSecond_us);
    assert_true(result.ok());
    assert_int_equal(result.value().position_um[0], i * 1000);
    assert_int_equal(result.value().t_us, i * kSecond_us);
  }
  // max_gap 0: nothing in between.
  assert_int_equal(history.at(1).status(), Status::kOutOfRange);
}

TEST(outside_the_history_is_never_extrapolated) {
  PoseHistoryBuffer<4> buffer(kSecond_us);
  auto& history = buffer.history();
  assert_int_equal(history.push(pose_at(100)), Status::kOk);
  assert_int_equal(history.push(pose_at(200)), Status::kOk);
  assert_int_equal(history.at(99).status(), Status::kStale);
  assert_int_equal(history.at(201).status(), Status::kNotReady);
  assert_true(history.at(150).ok());
}

TEST(positions_round_to_the_nearest_micrometre_on_both_signs) {
  PoseHistoryBuffer<2> buffer(kSecond_us);
  auto& history = buffer.history();
  Pose from = pose_at(0);
  Pose to = pose_at(4);
  to.position_um[0] = 10;   // 2.5 -> 3, 5, 7.5 -> 8
  to.position_um[1] = -10;  // the mirror image
  to.position_um[2] = 1;    // 0.25 -> 0, 0.5 -> 1, 0.75 -> 1
  assert_int_equal(history.push(from), Status::kOk);
  assert_int_equal(history.push(to), Status::kOk);
  const std::int64_t north[] = {0, 3, 5, 8, 10};
  const std::int64_t down[] = {0, 0, 1, 1, 1};
  for (std::int64_t t = 0; t <= 4; ++t) {
    const auto pose = history.at(t);
    assert_true(pose.ok());
    assert_int_equal(pose.value().position_um[0], north[t]);
    assert_int_equal(pose.value().position_um[1], -north[t]);
    assert_int_equal(pose.value().position_um[2], down[t]);
  }
}

TEST(angles_take_the_shorter_arc_through_north) {
  PoseHistoryBuffer<2> buffer(kSecond_us);
  auto& history = buffer.history();
  assert_int_equal(history.push(pose_at(0, 0, degrees(350))), Status::kOk);
  assert_int_equal(history.push(pose_at(1000, 0, degrees(370))), Status::kOk);
  const auto middle = history.at(500);
  assert_true(middle.ok());
  const auto error = static_cast<std::int32_t>(middle.value().attitude.heading_bam32);
  assert_in_range(std::abs(error), 0, 2);

  history.clear();
  assert_int_equal(history.push(pose_at(0, 0, degrees(10))), Status::kOk);
  assert_int_equal(history.push(pose_at(1000, 0, degrees(350))), Status::kOk);
  const auto back = static_cast<std::int32_t>(history.at(500).value().attitude.heading_bam32);
  assert_in_range(std::abs(back), 0, 2);
}

TEST(half_a_turn_goes_down) {
  PoseHistoryBuffer<2> buffer(kSecond_us);
  auto& history = buffer.history();
  assert_int_equal(history.push(pose_at(0, 0, 0)), Status::kOk);
  assert_int_equal(history.push(pose_at(1000, 0, 0x80000000U)), Status::kOk);
  assert_int_equal(history.at(500).value().attitude.heading_bam32, 0xC0000000U);
}

TEST(all_three_angles_are_interpolated) {
  PoseHistoryBuffer<2> buffer(kSecond_us);
  auto& history = buffer.history();
  Pose from = pose_at(0);
  Pose to = pose_at(1000);
  to.attitude = {400, 0U - 800U, 1200};
  assert_int_equal(history.push(from), Status::kOk);
  assert_int_equal(history.push(to), Status::kOk);
  const auto attitude = history.at(250).value().attitude;
  assert_int_equal(attitude.roll_bam32, 100);
  assert_int_equal(attitude.pitch_bam32, 0U - 200U);
  assert_int_equal(attitude.heading_bam32, 300);
}

TEST(epochs_are_never_mixed) {
  PoseHistoryBuffer<4> buffer(kSecond_us);
  auto& history = buffer.history();
  Pose jumped = pose_at(200, 5'000'000);
  jumped.epoch = 1;
  assert_int_equal(history.push(pose_at(100)), Status::kOk);
  assert_int_equal(history.push(jumped), Status::kOk);
  assert_int_equal(history.at(150).status(), Status::kEpochMismatch);
  // Both ends exist, each in its own epoch.
  assert_int_equal(history.at(100).value().epoch, 0);
  assert_int_equal(history.at(200).value().epoch, 1);
}

TEST(gaps_beyond_the_limit_are_not_bridged) {
  PoseHistoryBuffer<4> buffer(1000);
  auto& history = buffer.history();
  assert_int_equal(history.push(pose_at(0)), Status::kOk);
  assert_int_equal(history.push(pose_at(1000)), Status::kOk);
  assert_int_equal(history.push(pose_at(2001)), Status::kOk);
  assert_true(history.at(500).ok());
  assert_int_equal(history.at(1500).status(), Status::kOutOfRange);
}

TEST(time_going_backwards_is_refused_and_counted) {
  PoseHistoryBuffer<4> buffer(kSecond_us);
  auto& history = buffer.history();
  assert_int_equal(history.push(pose_at(100, 7)), Status::kOk);
  assert_int_equal(history.push(pose_at(100, 8)), Status::kStale);
  assert_int_equal(history.push(pose_at(99, 9)), Status::kStale);
  assert_int_equal(history.counters().stale, 2);
  assert_int_equal(history.stale_in_a_row(), 2);
  assert_int_equal(history.counters().accepted, 1);
  assert_int_equal(history.at(100).value().position_um[0], 7);
  assert_int_equal(history.push(pose_at(101)), Status::kOk);
  assert_int_equal(history.stale_in_a_row(), 0);
  // After clear() an earlier clock is fine; the counters tell what was.
  history.clear();
  assert_int_equal(history.push(pose_at(5)), Status::kOk);
  assert_int_equal(history.counters().stale, 2);
  assert_int_equal(history.counters().accepted, 3);
}

TEST(absurd_poses_are_refused_and_counted) {
  PoseHistoryBuffer<4> buffer(kSecond_us);
  auto& history = buffer.history();
  assert_int_equal(history.push(pose_at(kMaxTime_us + 1)), Status::kOutOfRange);
  assert_int_equal(history.push(pose_at(-kMaxTime_us - 1)), Status::kOutOfRange);
  assert_int_equal(history.push(pose_at(0, leadline::base::kMaxHorizontal_um + 1)),
                   Status::kOutOfRange);
  assert_int_equal(history.push(pose_at(0, INT64_MIN)), Status::kOutOfRange);
  Pose deep = pose_at(0);
  deep.position_um[leadline::base::kDown] = leadline::base::kMaxVertical_um + 1;
  assert_int_equal(history.push(deep), Status::kOutOfRange);
  assert_int_equal(history.counters().out_of_range, 5);
  assert_int_equal(history.size(), 0);
  assert_int_equal(history.push(pose_at(-kMaxTime_us, leadline::base::kMaxHorizontal_um)),
                   Status::kOk);
  assert_int_equal(history.push(pose_at(kMaxTime_us, -leadline::base::kMaxHorizontal_um)),
                   Status::kOk);
  // The widest difference of times there is: refused by the gap, not by overflow.
  assert_int_equal(history.at(0).status(), Status::kOutOfRange);
}

TEST(oldest_poses_give_way) {
  PoseHistoryBuffer<3> buffer(kSecond_us);
  auto& history = buffer.history();
  for (std::int64_t t = 0; t < 10; ++t) {
    assert_int_equal(history.push(pose_at(t, t * 100)), Status::kOk);
    const std::int64_t oldest = t < 3 ? 0 : t - 2;
    assert_int_equal(history.at(oldest - 1).status(), Status::kStale);
    for (std::int64_t look = oldest; look <= t; ++look) {
      assert_int_equal(history.at(look).value().position_um[0], look * 100);
    }
  }
  assert_int_equal(history.counters().overwritten, 7);
  assert_int_equal(history.size(), 3);
}

TEST(covariance_and_validity_are_conservative) {
  PoseHistoryBuffer<2> buffer(kSecond_us);
  auto& history = buffer.history();
  Pose from = pose_at(0);
  Pose to = pose_at(1000);
  from.covariance.sigma_position_mm[0] = 10;
  to.covariance.sigma_position_mm[0] = 30;
  from.covariance.sigma_position_mm[2] = 25;
  to.covariance.sigma_position_mm[2] = 5;
  from.covariance.sigma_attitude_urad16[1] = 7;
  from.covariance.correlation_ne_q7 = 64;
  to.covariance.correlation_ne_q7 = -64;
  from.validity = leadline::base::kPoseHorizontal | leadline::base::kPoseAttitude;
  to.validity = leadline::base::kPoseVertical | leadline::base::kPoseAttitude;
  assert_int_equal(history.push(from), Status::kOk);
  assert_int_equal(history.push(to), Status::kOk);
  for (const std::int64_t t : {1, 499, 500, 501, 999}) {
    const Pose pose = history.at(t).value();
    assert_int_equal(pose.covariance.sigma_position_mm[0], 30);
    assert_int_equal(pose.covariance.sigma_position_mm[2], 25);
    assert_int_equal(pose.covariance.sigma_attitude_urad16[1], 7);
    assert_int_equal(pose.covariance.correlation_ne_q7, t <= 500 ? 64 : -64);
    assert_int_equal(pose.validity, leadline::base::kPoseAttitude);
  }
}

/// The same in long double, which holds every product here exactly enough (64-bit mantissa).
TEST(interpolation_equals_a_wide_reference_on_random_poses) {
  Random random(1);
  for (int round = 0; round < 20'000; ++round) {
    const std::int64_t gap_limit = round % 2 == 0 ? kMaxGapLimit_us : 50'000;
    const std::int64_t gap = random.between(1, gap_limit);
    const std::int64_t start = random.between(-kMaxTime_us, kMaxTime_us - gap);
    const std::int64_t reach = round % 3 == 0 ? leadline::base::kMaxHorizontal_um : 10'000'000;
    PoseHistoryBuffer<2> buffer(kMaxGapLimit_us);
    auto& history = buffer.history();
    Pose from = pose_at(start, random.between(-reach, reach), static_cast<Bam32>(random.next()));
    Pose to =
        pose_at(start + gap, random.between(-reach, reach), static_cast<Bam32>(random.next()));
    assert_int_equal(history.push(from), Status::kOk);
    assert_int_equal(history.push(to), Status::kOk);
    const std::int64_t elapsed = random.between(0, gap);
    const auto result = history.at(start + elapsed);
    assert_true(result.ok());
    assert_int_equal(result.value().t_us, start + elapsed);

    const auto fraction = static_cast<long double>(elapsed) / static_cast<long double>(gap);
    const auto difference = static_cast<long double>(to.position_um[0] - from.position_um[0]);
    const auto moved =
        static_cast<long double>(result.value().position_um[0] - from.position_um[0]);
    assert_true(std::fabs(moved - difference * fraction) <= 0.5001L);

    const auto arc =
        static_cast<std::int32_t>(to.attitude.heading_bam32 - from.attitude.heading_bam32);
    const auto turned = static_cast<std::int32_t>(result.value().attitude.heading_bam32 -
                                                  from.attitude.heading_bam32);
    assert_true(std::fabs(static_cast<long double>(turned) -
                          static_cast<long double>(arc) * fraction) <= 0.5001L);
  }
}

/// Any sequence of pushes and look-ups agrees with a plain list of poses.
TEST(ring_equals_a_plain_list_on_random_sequences) {
  Random random(2);
  for (int round = 0; round < 200; ++round) {
    PoseHistoryBuffer<7> buffer(40);
    auto& history = buffer.history();
    std::vector<Pose> list;
    std::int64_t now = 0;
    for (int step = 0; step < 200; ++step) {
      if (random.between(0, 99) == 0) {
        history.clear();
        list.clear();
      }
      now += random.between(-5, 30);
      Pose pose = pose_at(now, random.between(-1000, 1000));
      pose.epoch = static_cast<std::uint16_t>(now / 500);
      const Status status = history.push(pose);
      if (!list.empty() && now <= list.back().t_us) {
        assert_int_equal(status, Status::kStale);
        now = list.back().t_us;
      } else {
        assert_int_equal(status, Status::kOk);
        list.push_back(pose);
        if (list.size() > 7) {
          list.erase(list.begin());
        }
      }
      const std::int64_t look = now - random.between(-3, 150);
      const auto result = history.at(look);
      Status expected = Status::kOk;
      if (look < list.front().t_us) {
        expected = Status::kStale;
      } else if (look > list.back().t_us) {
        expected = Status::kNotReady;
      } else {
        for (std::size_t i = 0; i + 1 < list.size(); ++i) {
          if (list[i].t_us < look && look < list[i + 1].t_us) {
            if (list[i].epoch != list[i + 1].epoch) {
              expected = Status::kEpochMismatch;
            } else if (list[i + 1].t_us - list[i].t_us > 40) {
              expected = Status::kOutOfRange;
            }
          }
        }
      }
      assert_int_equal(result.status(), expected);
    }
  }
}

}  // namespace
