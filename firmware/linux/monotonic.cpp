#include "firmware/linux/monotonic.hpp"

#include <ctime>

namespace leadline::host {
namespace {

std::int64_t clock_us(clockid_t clock) {
  timespec now{};
  (void)clock_gettime(clock, &now);  // both clocks exist on every Linux
  return std::int64_t{now.tv_sec} * 1'000'000 + now.tv_nsec / 1000;
}

}  // namespace

std::int64_t monotonic_us() { return clock_us(CLOCK_MONOTONIC); }
std::int64_t utc_us() { return clock_us(CLOCK_REALTIME); }

}  // namespace leadline::host
