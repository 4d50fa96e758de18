// How fast a counter goes, over the last seconds.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>

namespace leadline::host {

class RateWindow {
 public:
  explicit RateWindow(double window_s) : window_s_(window_s) {}

  /// The counter's value (modulo 2^32) at a time that does not go back; when it does, the window begins
  /// again. Bounded: about kSteps samples are kept.
  void add(double t_s, std::uint32_t count);
  /// Per second from the oldest sample kept to `now_s`: a counter that stopped goes to 0. 0 before a tenth of
  /// the window is full.
  [[nodiscard]] double per_second(double now_s) const;
  /// How far it went in that time.
  [[nodiscard]] std::uint32_t sum() const;
  void clear() { samples_.clear(); }

 private:
  static constexpr int kSteps = 40;
  struct Sample {
    double t_s;
    std::uint32_t count;
  };
  void drop_old(double now_s);

  double window_s_;
  std::deque<Sample> samples_;
};

}  // namespace leadline::host
