// Device clocks that drift, step and wrap, behind lines that delay: what ClockSync says against the truth.
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "estimator/clock_sync.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::TimeUs;
using leadline::estimator::ClockReading;
using leadline::estimator::ClockSync;
using leadline::test::Random;

/// A device clock and its line. Latencies: `jitter_us` on the mean, with a long tail, and stalls.
struct Device {
  double ppm = 0;          ///< the device's clock runs fast by this
  double offset_us = 5e9;  ///< it says this at vehicle time 0
  double jitter_us = 3'000;
  double stall_us = 0;  ///< once in ten seconds everything waits until this has passed
  TimeUs interval_us = 10'000;
  TimeUs tick_us = 1;    ///< its clock counts in these
  TimeUs newest_us = 0;  ///< arrival: nothing overtakes

  [[nodiscard]] TimeUs clock(double t_us) const {
    const double exact = offset_us + t_us * (1.0 + ppm * 1e-6);
    return static_cast<TimeUs>(std::floor(exact / static_cast<double>(tick_us))) * tick_us;
  }
  [[nodiscard]] TimeUs arrival(TimeUs t_us, Random& random) const {
    const double late = -jitter_us * std::log(1.0 - random.uniform());
    const TimeUs due = t_us + static_cast<TimeUs>(late);
    const TimeUs since = due % 10'000'000;
    return static_cast<double>(since) < stall_us ? due - since + static_cast<TimeUs>(stall_us)
                                                 : due;
  }
};

struct Result {
  double worst_us = 0;     ///< |stamp - truth| while sure
  double worst_share = 0;  ///< of the error that is stated
  TimeUs stated_us = 0;    ///< largest
  double sure_share = 0;
  double arrival_rms_us = 0;
};

/// Runs from `from_s` to `to_s` of vehicle time.
Result run(ClockSync& sync, Device& device, double from_s, double to_s, Random& random) {
  Result result;
  int count = 0;
  int sure = 0;
  TimeUs& newest = device.newest_us;
  for (auto t = static_cast<TimeUs>(from_s * 1e6); t < static_cast<TimeUs>(to_s * 1e6);
       t += device.interval_us) {
    newest = std::max(newest, device.arrival(t, random));
    const TimeUs stamp = sync.stamp(device.clock(static_cast<double>(t)), newest);
    assert_true(stamp <= newest);
    ++count;
    result.arrival_rms_us += static_cast<double>((newest - t) * (newest - t));
    if (!sync.sure()) {
      continue;
    }
    ++sure;
    const ClockReading reading = sync.at(device.clock(static_cast<double>(t)));
    const auto error = static_cast<double>(std::llabs(stamp - t));
    result.worst_us = std::max(result.worst_us, error);
    result.stated_us = std::max(result.stated_us, reading.error_us);
    result.worst_share =
        std::max(result.worst_share, (error - static_cast<double>(device.tick_us - 1)) /
                                         static_cast<double>(reading.error_us));
  }
  result.arrival_rms_us = std::sqrt(result.arrival_rms_us / count);
  result.sure_share = static_cast<double>(sure) / count;
  return result;
}

// Cells of half a metre at 1.5 m/s.
double cells(double error_us) { return error_us * 1e-6 * 1.5 / 0.5; }

void print(const char* name, const Result& result) {
  std::printf(
      "%-24s sure %5.1f %%  worst %6.0f us (%.4f cells)  stated <= %5lld us  worst/stated %.2f  "
      "arrival rms %6.0f us\n",
      name, 100.0 * result.sure_share, result.worst_us, cells(result.worst_us),
      static_cast<long long>(result.stated_us), result.worst_share, result.arrival_rms_us);
}

TEST(drift_of_200_ppm_is_followed_within_the_stated_error) {
  for (const double ppm : {-200.0, -20.0, 0.0, 200.0}) {
    Device device;
    device.ppm = ppm;
    Random random(1);
    ClockSync sync;
    const Result result = run(sync, device, 0, 600, random);
    char name[32];
    std::snprintf(name, sizeof(name), "%+.0f ppm, 100 Hz", ppm);
    print(name, result);
    assert_true(result.sure_share > 0.98);
    assert_true(result.worst_us < 500);
    assert_true(result.worst_share < 1.0);
    assert_near(sync.drift_ppb(), -1000.0 * ppm / (1.0 + ppm * 1e-6), 20'000);
    assert_int_equal(sync.counters().steps, 0);
  }
}

TEST(slow_devices_coarse_clocks_and_stalls) {
  Device slow;
  slow.ppm = 200;
  slow.interval_us = 1'000'000;
  slow.jitter_us = 2'000;
  Device coarse;
  coarse.ppm = -200;
  coarse.tick_us = 1'000;
  Device stalled;
  stalled.ppm = 200;
  stalled.stall_us = 450'000;
  Device jittery;
  jittery.ppm = 200;
  jittery.jitter_us = 8'000;
  struct {
    const char* name;
    Device device;
    double limit_us;
  } rows[] = {{"1 Hz", slow, 5'000},
              {"clock of 1 ms", coarse, 1'500},
              {"stalls of 450 ms", stalled, 500},
              {"latency 8 ms", jittery, 5'000}};
  for (auto& row : rows) {
    Random random(2);
    ClockSync sync;
    const Result result = run(sync, row.device, 0, 600, random);
    print(row.name, result);
    assert_true(result.sure_share > 0.8);
    assert_true(result.worst_us < row.limit_us);
    assert_true(result.worst_share < 1.0);
    assert_int_equal(sync.counters().steps, 0);
  }
}

TEST(steps_of_a_second_are_noticed_and_then_followed) {
  for (const double step_s : {-1.0, 1.0, -0.3, 0.3, 3600.0, -3600.0}) {
    Device device;
    device.ppm = 100;
    Random random(3);
    ClockSync sync;
    run(sync, device, 0, 60, random);
    assert_true(sync.sure());
    device.offset_us += step_s * 1e6;
    const Result after = run(sync, device, 60, 120, random);
    char name[32];
    std::snprintf(name, sizeof(name), "step of %+.1f s", step_s);
    print(name, after);
    assert_int_equal(sync.counters().steps, 1);
    assert_true(sync.sure());
    assert_true(after.sure_share > 0.7);
    // A step that no line can delay by is never believed; a smaller one back is until its second has passed.
    const bool hidden = step_s == -0.3;
    assert_true(after.worst_us < (hidden ? 305'000 : 2'000));
    const Result later = run(sync, device, 120, 180, random);
    assert_true(later.worst_us < 500);
    assert_near(later.sure_share, 1.0, 1e-9);
  }
}

TEST(one_wild_pair_changes_nothing) {
  Device device;
  Random random(4);
  ClockSync sync;
  run(sync, device, 0, 30, random);
  const std::int64_t drift = sync.drift_ppb();
  assert_false(sync.add(device.clock(30e6) + 777'000'000, 30'000'500));
  assert_false(sync.add(device.clock(30e6) - 777'000'000, 30'000'600));
  assert_false(sync.add(INT64_MAX, 30'000'700));
  assert_false(sync.add(INT64_MIN, 30'000'800));
  assert_false(sync.at(INT64_MIN).sure);
  assert_int_equal(sync.drift_ppb(), drift);
  const Result after = run(sync, device, 31, 60, random);
  assert_int_equal(sync.counters().steps, 0);
  assert_int_equal(sync.counters().early, 1);
  assert_true(after.worst_us < 500 && after.sure_share > 0.9);
}

TEST(time_that_goes_back_is_never_merged) {
  Device device;
  Random random(5);
  ClockSync sync;
  run(sync, device, 0, 20, random);
  const auto merged = sync.counters().merged;
  // The arrival goes back; then the device's clock, by less than a line delays.
  assert_false(sync.add(device.clock(20e6), 5'000'000));
  assert_false(sync.add(device.clock(19.9e6), 20'100'000));
  assert_int_equal(sync.stamp(device.clock(19.8e6), 20'100'000), 20'100'000);
  assert_int_equal(sync.counters().merged, merged);
  assert_int_equal(sync.counters().backwards, 3);
  // Random times of both: nothing that goes back is merged, and no stamp that is sure does.
  for (int round = 0; round < 200; ++round) {
    ClockSync wild;
    TimeUs newest_arrival = INT64_MIN;
    TimeUs newest_stamp = INT64_MIN;
    TimeUs t = 0;
    std::uint32_t steps = 0;
    for (int i = 0; i < 3'000; ++i) {
      t += random.between(-2'000, 20'000);
      const TimeUs jump = random.between(0, 400) == 0 ? random.between(-3'000'000, 3'000'000) : 0;
      const TimeUs arrival = t + random.between(0, 5'000);
      const bool merged_one = wild.add(device.clock(static_cast<double>(t)) + jump, arrival);
      assert_false(merged_one && arrival < newest_arrival);
      newest_arrival = std::max(newest_arrival, arrival);
      const TimeUs stamp = wild.stamp(device.clock(static_cast<double>(t)), newest_arrival);
      if (wild.counters().steps != steps) {
        steps = wild.counters().steps;
        newest_stamp = INT64_MIN;
      }
      if (wild.sure() && stamp != newest_arrival) {
        assert_true(stamp >= newest_stamp);
        newest_stamp = stamp;
      }
    }
  }
}

TEST(a_restart_forgets_and_long_silence_too) {
  Device device;
  Random random(6);
  ClockSync sync;
  run(sync, device, 0, 20, random);
  sync.restart();
  assert_false(sync.sure());
  assert_false(sync.at(0).sure);
  device.offset_us = -3e9;
  run(sync, device, 20, 40, random);
  assert_true(sync.sure());
  assert_true(sync.add(device.clock(2000e6), 2'000'000'000));
  assert_false(sync.sure());
  assert_int_equal(sync.counters().steps, 0);
}

TEST(a_clock_that_no_crystal_has_is_not_believed) {
  Device device;
  device.ppm = 5'000;
  Random random(7);
  ClockSync sync;
  const Result result = run(sync, device, 0, 120, random);
  assert_true(result.worst_us < 25'000);
  assert_true(std::llabs(sync.drift_ppb()) <= 500'000);
}

}  // namespace
