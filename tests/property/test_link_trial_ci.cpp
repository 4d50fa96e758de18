// The vehicle's link and the topside's receiver over a line that loses 30 % of the frames, puts 5 % out of order and
// doubles 5 %, both ways: seeds x rates, cuts, restarts, who joins late. Simulated time.
#include <algorithm>
#include <cstdio>
#include <vector>

#include "host_tools/topside/link_trial.hpp"
#include "tests/support/bad_tether.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::firmware::Vehicle;
using leadline::host::LinkTrialOptions;
using leadline::host::LinkTrialResult;
using leadline::host::run_link_trial;
using leadline::host::settle_vehicle;
using leadline::test::bad_line;
using leadline::test::Recording;

Vehicle vehicle;

/// The rig's flight, recorded once.
const Recording& flight() {
  static const Recording recording = [] {
    leadline::test::configure_rig(vehicle, leadline::test::rig_config());
    leadline::test::RigOptions options;
    options.seconds = 260;
    options.speed_m_s = 3.0;
    return leadline::test::fly(vehicle, options);
  }();
  return recording;
}

/// A vehicle that flew, drained, with a link of that rate.
TimeUs flown(double bytes_per_s, std::uint16_t mtu_bytes) {
  const Recording& recording = flight();
  return leadline::test::fly_and_settle(&vehicle, leadline::test::rig_config(), recording,
                                        bytes_per_s, mtu_bytes);
}

TEST(a_bad_line_converges_within_its_bounds) {
  std::printf(
      "baud    MTU  seeds  B0     bytes/ideal mean max within  up/down  time/ideal mean max "
      "within\n");
  for (const double baud : {1200.0, 9600.0, 115'200.0, 1'000'000.0}) {
    for (const std::uint16_t mtu_bytes : {std::uint16_t{1400}}) {
      const double bytes_per_s = baud / 10.0;
      TimeUs t_us = flown(bytes_per_s, mtu_bytes);
      LinkTrialOptions clean;
      clean.line.bytes_per_s = bytes_per_s;
      const LinkTrialResult lossless = run_link_trial(&vehicle, &t_us, clean);
      assert_true(lossless.converged);
      assert_true(lossless.tiles >= 24);
      // Of thirty: the first round trips on a slow line are guesses.
      assert_true(lossless.tiles_lost <= 4);
      const double ideal_bytes =
          static_cast<double>(lossless.bytes_down) / (1.0 - leadline::test::kBadLineLoss);
      leadline::firmware::Downlink bucket;
      bucket.configure(static_cast<std::uint32_t>(bytes_per_s), mtu_bytes);
      const std::uint64_t budget_bytes =
          static_cast<std::uint64_t>(bytes_per_s) + bucket.burst_bytes();
      double bytes_sum = 0.0;
      double bytes_most = 0.0;
      double time_sum = 0.0;
      double time_most = 0.0;
      double up_most = 0.0;
      constexpr int kSeeds = 20;
      int bytes_within = 0;
      int time_within = 0;
      for (int seed = 1; seed <= kSeeds; ++seed) {
        settle_vehicle(&vehicle, &t_us, 20'000);
        const LinkTrialResult result = run_link_trial(
            &vehicle, &t_us, bad_line(bytes_per_s, static_cast<std::uint64_t>(seed)));
        assert_true(result.converged && result.hash_equal);
        const double bytes = static_cast<double>(result.bytes_down) / ideal_bytes;
        const double time = result.seconds * bytes_per_s / ideal_bytes;
        bytes_sum += bytes;
        time_sum += time;
        bytes_within += bytes <= 1.3 ? 1 : 0;
        time_within += time <= 1.5 ? 1 : 0;
        bytes_most = std::max(bytes_most, bytes);
        time_most = std::max(time_most, time);
        up_most = std::max(
            up_most, static_cast<double>(result.bytes_up) / static_cast<double>(result.bytes_down));
        // The budget holds in every second, to the byte: the rate and a full bucket.
        assert_true(result.most_in_1s <= budget_bytes);
      }
      std::printf("%-7.0f %4d %5d %6llu        %5.2f %5.2f %3d  %5.3f  %5.2f %5.2f %3d\n", baud,
                  mtu_bytes, kSeeds, static_cast<unsigned long long>(lossless.bytes_down),
                  bytes_sum / kSeeds, bytes_most, bytes_within, up_most, time_sum / kSeeds,
                  time_most, time_within);
      std::fflush(stdout);
      // Of 30 tiles single runs hang on luck: a byte more in a brief deals all seeds anew, and 18 to 20 of them keep
      // the demand. Most must, and the mean; a hello more in B0 is 4 % of it.
      assert_true(bytes_sum / kSeeds <= 1.2 && bytes_most <= 1.6);
      assert_true(up_most <= 0.1);
      assert_true(bytes_within >= 16);
      // A line that carries all in a few round trips waits for these instead.
      if (ideal_bytes / bytes_per_s > 1.0) {
        assert_true(time_sum / kSeeds <= 1.2 && time_within >= 16);
      } else {
        assert_true(time_sum / kSeeds <= 2.5);
      }
    }
  }
}

// What a line does wrong alone must not cost more than both ends need to notice it, whatever the MTU.
TEST(any_mtu_and_a_line_that_only_reorders_or_only_doubles_converge) {
  for (const std::uint16_t mtu_bytes :
       {std::uint16_t{256}, std::uint16_t{700}, std::uint16_t{1400}}) {
    TimeUs t_us = flown(960.0, mtu_bytes);
    LinkTrialOptions clean;
    clean.line.bytes_per_s = 960.0;
    const LinkTrialResult lossless = run_link_trial(&vehicle, &t_us, clean);
    assert_true(lossless.converged);
    settle_vehicle(&vehicle, &t_us, 20'000);
    LinkTrialOptions options = bad_line(960.0, mtu_bytes);
    const LinkTrialResult bad = run_link_trial(&vehicle, &t_us, options);
    assert_true(bad.converged && bad.frames_dropped > 0);
    options.line.loss = 0.0;
    for (const bool reorders : {true, false}) {
      settle_vehicle(&vehicle, &t_us, 20'000);
      options.line.reorder = reorders ? 0.3 : 0.0;
      options.line.duplicate = reorders ? 0.0 : 0.5;
      const LinkTrialResult result = run_link_trial(&vehicle, &t_us, options);
      assert_true(result.converged && result.hash_equal);
      assert_int_equal(result.frames_dropped, 0);
      // Less than a line that loses needs at least: one run on such a line may be luckier than that.
      assert_true(static_cast<double>(result.bytes_down) * (1.0 - leadline::test::kBadLineLoss) <
                  static_cast<double>(lossless.bytes_down));
      // A tenth of what came, doubles too, and what the first reports take on credit.
      assert_true(result.bytes_up * 20 <= result.bytes_down * 3 + 1280);
    }
    settle_vehicle(&vehicle, &t_us, 20'000);
  }
}

TEST(who_joins_late_or_starts_over_has_the_whole_map_in_the_end) {
  TimeUs t_us = flown(960.0, 256);
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    LinkTrialOptions options = bad_line(960.0, seed);
    options.introduced = false;
    assert_true(run_link_trial(&vehicle, &t_us, options).converged);
    settle_vehicle(&vehicle, &t_us, 20'000);
    options.topside_restart_us = 6'000'000;
    const LinkTrialResult result = run_link_trial(&vehicle, &t_us, options);
    assert_true(result.converged && result.seconds > 6.0);
    settle_vehicle(&vehicle, &t_us, 20'000);
  }
}

// The tether is gone for minutes, in the middle of everything: what was sent into the void is handed over.
TEST(after_a_cut_the_vehicle_hands_over_what_was_missed) {
  TimeUs t_us = flown(120.0, 256);
  for (const TimeUs minutes : {1, 10}) {
    LinkTrialOptions options = bad_line(120.0, static_cast<std::uint64_t>(minutes));
    options.cut_from_us = 3'000'000;
    options.cut_until_us = options.cut_from_us + minutes * 60'000'000;
    const LinkTrialResult result = run_link_trial(&vehicle, &t_us, options);
    assert_true(result.converged);
    const double after_s = result.seconds - 1e-6 * static_cast<double>(options.cut_until_us);
    std::printf("cut for %lld min: equal %.1f s later, %u tiles\n", static_cast<long long>(minutes),
                after_s, result.tiles);
    assert_true(after_s > 0.0 && after_s < 120.0);
    settle_vehicle(&vehicle, &t_us, 20'000);
  }
}

}  // namespace
