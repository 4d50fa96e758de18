// Patience for what another thread or process does.
#pragma once

#include <poll.h>

namespace leadline::test {

/// Looks every millisecond until `condition` holds; false when it does not within about 20 s.
template <typename Condition>
bool wait_until(const Condition& condition) {
  for (int i = 0; i < 20'000; ++i) {
    if (condition()) {
      return true;
    }
    (void)::poll(nullptr, 0, 1);
  }
  return false;
}

}  // namespace leadline::test
