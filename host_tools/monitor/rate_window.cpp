#include "host_tools/monitor/rate_window.hpp"

namespace leadline::host {

void RateWindow::drop_old(double now_s) {
  while (samples_.size() > 1 && samples_[1].t_s <= now_s - window_s_) {
    samples_.pop_front();
  }
}

void RateWindow::add(double t_s, std::uint32_t count) {
  if (!samples_.empty() && t_s < samples_.back().t_s) {
    samples_.clear();
  }
  const std::size_t size = samples_.size();
  if (size >= 2 && t_s - samples_[size - 2].t_s < window_s_ / kSteps) {
    samples_.back() = {t_s, count};
  } else {
    samples_.push_back({t_s, count});
  }
  drop_old(t_s);
}

double RateWindow::per_second(double now_s) const {
  if (samples_.empty()) {
    return 0.0;
  }
  // The newest sample that is a window old or older, else the oldest.
  const Sample* from = &samples_.front();
  for (const Sample& sample : samples_) {
    if (sample.t_s > now_s - window_s_) {
      break;
    }
    from = &sample;
  }
  const double span_s = now_s - from->t_s;
  if (span_s < window_s_ / 10.0) {
    return 0.0;
  }
  return static_cast<double>(static_cast<std::uint32_t>(samples_.back().count - from->count)) /
         span_s;
}

std::uint32_t RateWindow::sum() const {
  return samples_.empty() ? 0 : samples_.back().count - samples_.front().count;
}

}  // namespace leadline::host
