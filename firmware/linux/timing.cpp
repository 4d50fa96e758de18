#include "firmware/linux/timing.hpp"

#include <algorithm>
#include <iomanip>
#include <numeric>
#include <sstream>

namespace leadline::host {
namespace {

std::string class_name(std::size_t index) {
  return index + 1 == TimeHistogram::kClasses
             ? "more"
             : "below " + std::to_string(TimeHistogram::end_us(index));
}

std::string histogram_json(const TimeHistogram& histogram) {
  std::string classes;
  for (std::size_t i = 0; i < TimeHistogram::kClasses; ++i) {
    if (histogram.count(i) > 0) {
      classes += (classes.empty() ? "[" : ", [") + std::to_string(TimeHistogram::end_us(i)) + ", " +
                 std::to_string(histogram.count(i)) + "]";
    }
  }
  return R"({"largest_observed_us": )" + std::to_string(histogram.largest_us()) +
         R"(, "below_us": [)" + classes + "]}";
}

}  // namespace

void TimeHistogram::add(std::int64_t time_us) {
  std::size_t index = 0;
  for (std::int64_t rest = time_us; rest > 0 && index + 1 < kClasses; rest >>= 1) {
    ++index;
  }
  ++counts_[index];
  largest_us_ = std::max(largest_us_, time_us);
}

std::uint64_t TimeHistogram::total() const {
  return std::accumulate(counts_.begin(), counts_.end(), std::uint64_t{0});
}

std::string timing_text(const LoopTiming& timing) {
  std::ostringstream out;
  out << "timing of " << timing.cycle.total()
      << " cycles; largest observed, not a bound of what can happen\n"
      << std::setw(18) << "us" << std::setw(12) << "cycle" << std::setw(12) << "slip"
      << "\n";
  for (std::size_t i = 0; i < TimeHistogram::kClasses; ++i) {
    if (timing.cycle.count(i) > 0 || timing.slip.count(i) > 0) {
      out << std::setw(18) << class_name(i) << std::setw(12) << timing.cycle.count(i)
          << std::setw(12) << timing.slip.count(i) << "\n";
    }
  }
  out << std::setw(18) << "largest observed" << std::setw(12) << timing.cycle.largest_us()
      << std::setw(12) << timing.slip.largest_us() << "\n";
  return out.str();
}

std::string timing_json(const LoopTiming& timing) {
  return R"({"cycle": )" + histogram_json(timing.cycle) + R"(, "slip": )" +
         histogram_json(timing.slip) + "}";
}

}  // namespace leadline::host
