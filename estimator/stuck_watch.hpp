// A sensor that says the same again and again: it hangs, or something between it and the vehicle does.
//
// Every sensor that resolves its own noise changes its last digit from sample to sample; a coarse one (1 degree,
// 1 hPa) on a calm vehicle does not. So this is asked for per port (vehicle.toml `watch_stuck`), not a habit.
#pragma once

#include <array>
#include <cstdint>

#include "model/base/nav_sample.hpp"

namespace leadline::estimator {

/// This many equal samples of one kind in a row are a sensor that is stuck.
inline constexpr std::uint16_t kStuckSamples = 100;

/// Of one sensor. About 200 bytes.
class StuckWatch {
 public:
  /// Whether this sample, with those before it, is that of a stuck sensor: from the 100th equal one to the
  /// first that differs. Times, sigmas and qualities are not looked at. O(1).
  [[nodiscard]] bool stuck(const base::NavSample& sample);
  void restart() { rows_ = {}; }

 private:
  static constexpr std::size_t kKinds = static_cast<std::size_t>(base::NavKind::kWater) + 1;
  struct Row {
    std::uint64_t hash;  ///< FNV-1a of what was measured
    std::uint16_t equal;
  };
  std::array<Row, kKinds> rows_{};
};

}  // namespace leadline::estimator
