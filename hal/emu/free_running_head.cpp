#include "hal/emu/free_running_head.hpp"

#include <algorithm>

namespace leadline::emu {

void FreeRunningHead::advance(base::TimeUs now_us, Bytes& out) {
  for (; t_ping_us_ <= now_us; t_ping_us_ += interval_us_) {
    ping(t_ping_us_);
  }
  Bytes unheard;
  line_.take_until(now_us, silent_ ? unheard : out);
}

base::TimeUs FreeRunningHead::next_event_us() const {
  return std::min(line_.next_us(), t_ping_us_);
}

}  // namespace leadline::emu
