// Bookkeeping of one request under way on a half-duplex line, for heads that are asked.
#pragma once

#include <cstdint>

#include "model/base/units.hpp"

namespace leadline::hal {

/// One request at a time: sent, then answered or given up. Times that go back restart the wait
/// instead of stretching it. O(1).
class PingExchange {
 public:
  void sent(base::TimeUs now_us, std::int64_t timeout_us) {
    t_sent_us_ = now_us;
    timeout_us_ = timeout_us;
    waiting_ = true;
  }
  void answered() { waiting_ = false; }
  [[nodiscard]] bool waiting() const { return waiting_; }
  /// True once per request: it is given up.
  [[nodiscard]] bool gave_up(base::TimeUs now_us) {
    if (!waiting_) {
      return false;
    }
    if (now_us < t_sent_us_) {
      t_sent_us_ = now_us;
    }
    if (now_us - t_sent_us_ < timeout_us_) {
      return false;
    }
    waiting_ = false;
    return true;
  }
  [[nodiscard]] base::TimeUs t_sent_us() const { return t_sent_us_; }

 private:
  base::TimeUs t_sent_us_ = 0;
  std::int64_t timeout_us_ = 0;
  bool waiting_ = false;
};

}  // namespace leadline::hal
