// Are the constants with which real logs are flown honest on logs that did not choose them? Each log in turn is left
// out; the other seven choose among 81 sets by one rule, and the one left out is flown with what they chose. The rule:
// the least sum of squared standard scores, of each log's NIS and of the mean NEES at the ends:
//   mean over logs of ((NIS/3 - 1) / 0.041)^2 + ((mean NEES/2 - 1) * sqrt(logs))^2
// Prints the second table of estimator/README.md.
#include <limits>

#include "tests/support/navigation_logs.hpp"

namespace {

using namespace leadline::test;  // NOLINT: the logs' vocabulary

using Runs = std::array<Run, kLogs>;

double score(const Runs& runs, int left_out) {
  double nis = 0;
  double nees = 0;
  int logs = 0;
  for (int i = 0; i < kLogs; ++i) {
    if (i != left_out) {
      const Run& run = runs[static_cast<std::size_t>(i)];
      const double z = (run.nis - 1) / std::sqrt(2.0 / 1200);
      nis += z * z;
      nees += run.nees2;
      ++logs;
    }
  }
  const double z = (nees / logs - 1) * std::sqrt(logs);
  return nis / logs + z * z;
}

TEST(logs_that_did_not_choose_the_constants) {
  std::vector<NavigationConstants> sets;
  for (const std::int64_t sigma_um_s : {4'000, 6'000, 9'000}) {
    for (const float acceleration : {0.05F, 0.1F, 0.15F}) {
      for (const float wander : {3e-4F, 4e-4F, 6e-4F}) {
        for (const float gain : {0.1F, 0.2F, 0.3F}) {
          sets.push_back({sigma_um_s, acceleration, wander, gain});
        }
      }
    }
  }
  std::vector<Runs> runs(sets.size());
  std::array<double, kLogs> plain{};
  for (std::size_t i = 0; i < kLogs; ++i) {
    const Log log = read_log(static_cast<int>(i) + 1);
    const Alignment at = alignment(log);
    plain[i] = 100 * plain_error_m(log) / log.distance_m;
    for (std::size_t set = 0; set < sets.size(); ++set) {
      runs[set][i] = reckon(log, at, sets[set]);
      runs[set][i].error_m *= 100 / log.distance_m;  // percent from here on
    }
  }
  print_message(
      "| left out | log's sigma, mm/s | acceleration | wander | gain | plain, %% | filter, %% | "
      "NEES/2 | NIS/3 | "
      "beyond 95 %%, %% | refused |\n");
  double mean = 0;
  double nees = 0;
  double worst = 0;
  int without = 0;
  for (int out = -1; out < kLogs; ++out) {
    std::size_t best = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t set = 0; set < sets.size(); ++set) {
      const double value = score(runs[set], out);
      if (value < least) {
        least = value;
        best = set;
      }
    }
    const NavigationConstants& chosen = sets[best];
    if (out < 0) {
      print_message("all eight choose: %d mm/s, %.2f, %.0e, %.1f\n",
                    static_cast<int>(chosen.sigma_um_s / 1'000),
                    static_cast<double>(chosen.acceleration_m_s2),
                    static_cast<double>(chosen.wander), static_cast<double>(chosen.motion_gain));
      continue;
    }
    const Run& run = runs[best][static_cast<std::size_t>(out)];
    print_message("| %d | %d | %.2f | %.0e | %.1f | %.2f | %.2f | %.2f | %.2f | %.1f | %d |\n",
                  out + 1, static_cast<int>(chosen.sigma_um_s / 1'000),
                  static_cast<double>(chosen.acceleration_m_s2), static_cast<double>(chosen.wander),
                  static_cast<double>(chosen.motion_gain), plain[static_cast<std::size_t>(out)],
                  run.error_m, run.nees2, run.nis, 100 * run.tail, run.gated);
    mean += run.error_m / kLogs;
    nees += run.nees2 / kLogs;
    worst = std::max(worst, run.nees2);
    without += run.nis > 0.92 && run.nis < 1.08 ? 0 : 1;
    assert_true(run.nis > 0.85 && run.nis < 1.15);
    assert_true(run.gated <= 2);
  }
  // What no choice of constants changes much: the spread over all sets.
  double low = 1e9;
  double high = 0;
  for (const Runs& set : runs) {
    double drift = 0;
    for (const Run& run : set) {
      drift += run.error_m / kLogs;
    }
    low = std::min(low, drift);
    high = std::max(high, drift);
  }
  print_message(
      "| mean | | | | | | %.2f | %.2f | | | |\nmean drift over all sets: %.2f to %.2f %%\n", mean,
      nees, low, high);
  assert_true(nees > 0.43 && nees < 1.80);
  assert_true(worst < 3.69);
  assert_true(without <= 3);
  assert_true(mean < 0.35);
}

}  // namespace
