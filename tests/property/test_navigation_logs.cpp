// The navigation filter on real logs of an AUV: dead reckoning from velocity, depth and attitude, beside plain
// integration. Prints the table of estimator/README.md. Whether the constants hold on logs that did not choose
// them: property.navigation_constants_full.
#include "tests/support/navigation_logs.hpp"

namespace {

using namespace leadline::test;  // NOLINT: the logs' vocabulary

TEST(dead_reckoning_of_a_real_vehicle) {
  print_message(
      "| log | way, m | reference's velocity, %% | plain, %% | filter, %% | with the log's arm and "
      "time, %% | "
      "arm, m | shift, s | NEES/2 | NIS/3 | beyond 95 %%, %% | gated | constant noise: %%, NEES/2, "
      "NIS/3 | filter's defaults: %%, NEES/2, NIS/3 |\n");
  double plain = 0;
  double bare = 0;
  double aligned = 0;
  double nees = 0;
  int within = 0;
  double drift_shipped = 0;
  double nees_shipped = 0;
  int within_shipped = 0;
  for (int number = 1; number <= kLogs; ++number) {
    const Log log = read_log(number);
    const Alignment at = alignment(log);
    const double percent = 100 / log.distance_m;
    const double plain_m = plain_error_m(log);
    const NavigationConstants constants;
    NavigationConstants constant_noise;
    constant_noise.motion_gain = 0.0F;
    const NavigationFilterConfig defaults;
    const NavigationConstants shipped = {constants.sigma_um_s, defaults.acceleration_m_s2,
                                         defaults.velocity_scale_walk, defaults.motion_gain};
    const Run none = reckon(log, {0, 0}, constants);
    const Run both = reckon(log, at, constants);
    const Run constant = reckon(log, at, constant_noise);
    const Run as_shipped = reckon(log, at, shipped);
    print_message(
        "| %d | %.0f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | %.2f | %.3f | %.1f | %d | %.2f, "
        "%.2f, %.2f | %.2f, %.2f, %.2f |\n",
        number, log.distance_m, percent * reference_error_m(log), percent * plain_m,
        percent * none.error_m, percent * both.error_m, at.arm_m, at.shift_s, both.nees2, both.nis,
        100 * both.tail, both.gated, percent * constant.error_m, constant.nees2, constant.nis,
        percent * as_shipped.error_m, as_shipped.nees2, as_shipped.nis);
    // The same log on the same vehicle: each finds the same arm.
    assert_true(at.arm_m > -1.95 && at.arm_m < -1.65);
    // 1,200 degrees of freedom: 95 % between 0.92 and 1.08. Two smooth logs and a rough one lie at the edge.
    within += both.nis > 0.92 && both.nis < 1.08 ? 1 : 0;
    assert_true(both.nis > 0.90 && both.nis < 1.10);
    // What a vehicle flies with errs on the safe side.
    within_shipped += as_shipped.nis > 0.92 && as_shipped.nis < 1.08 ? 1 : 0;
    assert_true(as_shipped.nis > 0.80 && as_shipped.nis < 1.08);
    assert_true(as_shipped.nees2 < 3.69);
    drift_shipped += percent * as_shipped.error_m / kLogs;
    nees_shipped += as_shipped.nees2 / kLogs;
    // Two degrees of freedom: 97.5 % below.
    assert_true(both.nees2 < 3.69);
    assert_true(both.gated <= 1);
    plain += percent * plain_m / kLogs;
    bare += percent * none.error_m / kLogs;
    aligned += percent * both.error_m / kLogs;
    nees += both.nees2 / kLogs;
  }
  print_message("| mean | | | %.2f | %.2f | %.2f | | | %.2f | |\n", plain, bare, aligned, nees);
  print_message(
      "NIS / 3 within 0.92 and 1.08 on %d of %d logs; with the filter's defaults on %d, drift %.2f "
      "%%, NEES / 2 "
      "%.2f in the mean\n",
      within, kLogs, within_shipped, drift_shipped, nees_shipped);
  assert_true(within >= kLogs - 3);
  assert_true(aligned < 0.7 * plain);
  // Sixteen degrees of freedom: 95 % between 0.43 and 1.80.
  assert_true(nees > 0.43 && nees < 1.80);
  assert_true(nees_shipped > 0.43 && nees_shipped < 1.80);
  assert_true(drift_shipped < 0.7 * plain);
}

}  // namespace
