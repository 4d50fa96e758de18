// Histograms of times, and what Linux answers to the wish for real time.
#include <string>

#include "firmware/linux/real_time.hpp"
#include "firmware/linux/timing.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::host;  // NOLINT: a test of this namespace

TEST(a_time_counts_in_the_class_that_holds_it) {
  TimeHistogram histogram;
  for (const std::int64_t time_us : {-5, 0, 1, 2, 3, 4, 1023, 1024}) {
    histogram.add(time_us);
  }
  histogram.add(INT64_MAX);
  assert_int_equal(histogram.count(0), 2);   // below 1
  assert_int_equal(histogram.count(1), 1);   // 1
  assert_int_equal(histogram.count(2), 2);   // 2, 3
  assert_int_equal(histogram.count(3), 1);   // 4
  assert_int_equal(histogram.count(10), 1);  // 1023
  assert_int_equal(histogram.count(11), 1);  // 1024
  assert_int_equal(histogram.count(TimeHistogram::kClasses - 1), 1);
  assert_int_equal(histogram.total(), 9);
  assert_true(histogram.largest_us() == INT64_MAX);
}

TEST(a_report_says_largest_observed_and_never_more) {
  LoopTiming timing;
  timing.cycle.add(70);
  timing.cycle.add(90);
  timing.slip.add(3);
  const std::string text = timing_text(timing);
  assert_true(text.find("largest observed          90           3") != std::string::npos);
  assert_true(text.find("below 128           2           0") != std::string::npos);
  assert_true(text.find("WCET") == std::string::npos);
  assert_string_equal(timing_json(timing).c_str(),
                      R"({"cycle": {"largest_observed_us": 90, "below_us": [[128, 2]]}, "slip": )"
                      R"({"largest_observed_us": 3, "below_us": [[4, 1]]}})");
}

TEST(what_linux_refuses_is_said) {
  RealTimeReport report;
  report.memory_problem = "Cannot allocate memory";
  report.priority_problem = "Operation not permitted";
  assert_string_equal(report.text().c_str(),
                      "memory not locked: Cannot allocate memory, ordinary scheduling: Operation "
                      "not permitted");
  assert_string_equal(report.scheduling().c_str(), "other");
  report = RealTimeReport{true, "", 20, ""};
  assert_string_equal(report.text().c_str(), "memory locked, SCHED_FIFO 20");
  assert_string_equal(report.scheduling().c_str(), "fifo 20");
}

}  // namespace
