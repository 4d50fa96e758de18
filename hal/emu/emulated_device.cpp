#include "hal/emu/emulated_device.hpp"

#include <algorithm>

namespace leadline::emu {

void SendQueue::send(base::TimeUs t_start_us, const Bytes& bytes) {
  free_ns_ = std::max(free_ns_, t_start_us * 1000);
  for (const std::uint8_t byte : bytes) {
    free_ns_ += byte_time_ns_;
    queue_.push_back({(free_ns_ + 999) / 1000, byte});
  }
}

void SendQueue::take_until(base::TimeUs now_us, Bytes& out) {
  while (!queue_.empty() && queue_.front().t_us <= now_us) {
    out.push_back(queue_.front().byte);
    queue_.pop_front();
  }
}

void SendQueue::clear() {
  queue_.clear();
  free_ns_ = std::numeric_limits<std::int64_t>::min();
}

}  // namespace leadline::emu
