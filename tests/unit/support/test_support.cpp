// The harness itself: a failing, a throwing and a skipped test must be reported as such.
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <stdexcept>
#include <string>

#include <sys/wait.h>
#include <unistd.h>

#include "tests/support/test.hpp"

namespace {

using leadline::test::Random;

/// This program runs itself with a pattern: the outcomes below must not fail the whole run.
int run_self(const std::string& pattern) {
  const std::string command =
      "/proc/" + std::to_string(getpid()) + "/exe '" + pattern + "' >/dev/null 2>&1";
  const std::string environment = "LEADLINE_TEST_OUTCOMES=1 LEADLINE_DATA=/nonexistent ";
  const int status = std::system((environment + command).c_str());
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

bool outcomes_wanted() { return std::getenv("LEADLINE_TEST_OUTCOMES") != nullptr; }

TEST(outcome_fails) { assert_true(!outcomes_wanted()); }

TEST(outcome_throws) {
  if (outcomes_wanted()) {
    throw std::runtime_error("on purpose");
  }
}

TEST(outcome_is_skipped) {
  if (outcomes_wanted()) {
    leadline::test::require_data("no/such/file");
    fail_msg("reached");
  }
}

TEST(outcome_is_not_near) {
  if (outcomes_wanted()) {
    assert_near(std::numeric_limits<double>::quiet_NaN(), 1.0, 1e9);
  }
}

TEST(exit_codes_tell_the_outcomes_apart) {
  if (outcomes_wanted()) {
    return;
  }
  assert_int_equal(run_self("outcome_fails"), 1);
  assert_int_equal(run_self("outcome_throws"), 1);
  assert_int_equal(run_self("outcome_is_not_near"), 1);
  assert_int_equal(run_self("outcome_is_skipped"), 77);
  assert_int_equal(run_self("exit_codes*"), 0);
  assert_int_equal(run_self("no_such_test"), 1);
}

TEST(scratch_directories_are_fresh_and_writable) {
  const std::string one = leadline::test::scratch_directory();
  const std::string two = leadline::test::scratch_directory();
  assert_true(one != two);
  std::ofstream(one + "/file") << "x";
  assert_true(std::ifstream(one + "/file").good());
  assert_true(!std::ifstream(two + "/file").good());
}

TEST(random_numbers_are_the_same_everywhere) {
  // SplitMix64's published first outputs for seed 1234567.
  Random random(1234567, 0);
  assert_true(random.next() == 6457827717110365317U);
  assert_true(random.next() == 3203168211198807973U);
  assert_true(random.next() == 9817491932198370423U);
}

TEST(random_numbers_stay_in_range_and_look_normal) {
  Random random(3);
  double sum = 0;
  double sum_of_squares = 0;
  constexpr int kCount = 100'000;
  for (int i = 0; i < kCount; ++i) {
    const auto die = random.between(-3, 3);
    assert_true(die >= -3 && die <= 3);
    const double u = random.uniform();
    assert_true(u >= 0 && u < 1);
    const double n = random.normal();
    sum += n;
    sum_of_squares += n * n;
  }
  assert_near(sum / kCount, 0, 0.02);
  assert_near(sum_of_squares / kCount, 1, 0.03);
  // The whole of 64 bits, where the span does not fit the type.
  for (int i = 0; i < 100; ++i) {
    (void)random.between(INT64_MIN, INT64_MAX);
  }
}

}  // namespace
