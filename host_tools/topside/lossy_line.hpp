// A line that loses, reorders and doubles whole frames, in simulated time. Deterministic: what becomes of a frame hangs
// on seed, stream and the frame's number alone, whatever its bytes. So ways of sending meet the same losses.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "host_tools/sim/random.hpp"
#include "model/base/units.hpp"

namespace leadline::host {

/// A line, both ways alike. What is lost, late or doubled is decided frame by frame.
struct LineOptions {
  double bytes_per_s = 960.0;
  double loss = 0.0;
  double reorder = 0.0;  ///< share that arrives behind up to three of its followers
  double duplicate = 0.0;
  base::TimeUs delay_us = 5000;  ///< one way, besides what the bytes take
  std::uint64_t seed = 1;
};

/// One way of a line: frames in, frames out later, or never, or twice. `options` outlive it; `stream`: another one
/// has another luck.
class LossyLine {
 public:
  using Bytes = std::vector<std::uint8_t>;

  LossyLine(const LineOptions& options, std::uint64_t stream)
      : options_(options), random_(options.seed, stream) {}

  /// Whether it will arrive.
  bool send(base::TimeUs now_us, const std::uint8_t* frame, std::size_t size_bytes, bool cut) {
    const double take_us = 1e6 * static_cast<double>(size_bytes) / options_.bytes_per_s;
    idle_us_ += std::max(0.0, static_cast<double>(now_us) - free_us_);
    free_us_ = std::max(free_us_, static_cast<double>(now_us)) + take_us;
    // Four draws a frame, whatever becomes of it: fates depend on the frame's number alone.
    const bool lost = random_.uniform() < options_.loss;
    const bool late = random_.uniform() < options_.reorder;
    const bool twice = random_.uniform() < options_.duplicate;
    const double followers = 1.0 + 2.0 * random_.uniform();
    if (lost || cut) {
      return false;
    }
    const double step_us = std::max(take_us, 1000.0);
    const double arrival_us = free_us_ + static_cast<double>(options_.delay_us);
    const double late_us = late ? followers * step_us + 1.0 : 0.0;
    put(arrival_us + late_us, frame, size_bytes);
    if (twice) {
      put(arrival_us + late_us + step_us / 2.0, frame, size_bytes);
    }
    return true;
  }

  /// The next frame that arrives until then, and when.
  [[nodiscard]] std::optional<std::pair<base::TimeUs, Bytes>> receive(base::TimeUs until_us) {
    if (under_way_.empty() || under_way_.begin()->first > until_us) {
      return std::nullopt;
    }
    auto next = std::make_pair(under_way_.begin()->first, std::move(under_way_.begin()->second));
    under_way_.erase(under_way_.begin());
    return next;
  }
  /// Until `now_us`, with nothing to carry.
  [[nodiscard]] double idle_us(base::TimeUs now_us) const {
    return idle_us_ + std::max(0.0, static_cast<double>(now_us) - free_us_);
  }
  void begin(base::TimeUs now_us) { free_us_ = static_cast<double>(now_us); }
  [[nodiscard]] base::TimeUs next_us() const {
    return under_way_.empty() ? INT64_MAX : under_way_.begin()->first;
  }

 private:
  void put(double arrival_us, const std::uint8_t* frame, std::size_t size_bytes) {
    under_way_.emplace(static_cast<base::TimeUs>(arrival_us), Bytes(frame, frame + size_bytes));
  }

  const LineOptions& options_;
  Random random_;
  double free_us_ = 0.0;
  double idle_us_ = 0.0;
  std::multimap<base::TimeUs, Bytes> under_way_;
};

}  // namespace leadline::host
