// A sensor that repeats itself is noticed at the hundredth sample, each kind on its own.
#include "estimator/stuck_watch.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::NavKind;
using leadline::base::NavSample;
using leadline::estimator::kStuckSamples;
using leadline::estimator::StuckWatch;

NavSample depth_sample() {
  NavSample sample{};
  sample.kind = NavKind::kDepth;
  sample.fields = leadline::base::kNavDepth;
  sample.depth_um = 2'000'000;
  return sample;
}

TEST(the_hundredth_equal_sample_is_stuck_and_one_that_differs_is_not) {
  StuckWatch watch;
  NavSample sample = depth_sample();
  for (int round = 0; round < 2; ++round) {
    for (int i = 1; i < kStuckSamples; ++i) {
      sample.t_us += 10'000;  // time goes on, that is all
      sample.t_device_us += 10'000;
      sample.utc_us += 10'000;
      assert_false(watch.stuck(sample));
    }
    for (int i = 0; i < 70'000; ++i) {
      assert_true(watch.stuck(sample));
    }
    sample.depth_um += 1;
  }
  watch.restart();
  assert_false(watch.stuck(sample));
}

TEST(kinds_are_watched_each_on_its_own) {
  StuckWatch watch;
  NavSample heading{};
  heading.kind = NavKind::kHeading;
  heading.fields = leadline::base::kNavHeading;
  NavSample unknown = depth_sample();
  unknown.kind = static_cast<NavKind>(200);
  int stuck = 0;
  for (int i = 0; i < 300; ++i) {
    heading.attitude.heading_bam32 += 1;
    assert_false(watch.stuck(heading));
    assert_false(watch.stuck(unknown));
    stuck += watch.stuck(depth_sample()) ? 1 : 0;
  }
  assert_int_equal(stuck, 300 - kStuckSamples + 1);
}

}  // namespace
