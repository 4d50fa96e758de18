// What the air weighs today: the pressure that a sensor shows at the surface, before the dive.
#pragma once

#include <cstdint>

#include "model/base/units.hpp"

namespace leadline::firmware {

/// The mean of the first seconds, if it can be that of the surface. Until it is known the sensor says nothing;
/// what it says from then on is as if the air's pressure were the configured one. A sensor's own offset goes
/// with it, and so does its depth below the surface while the vehicle floats.
///
/// Integers, no heap, no clock of its own.
class SurfaceReference {
 public:
  static constexpr base::TimeUs kFor_us = 5'000'000;
  static constexpr std::int32_t kLeastSamples = 5;
  /// Of the readings about their mean: waves of half a metre.
  static constexpr std::int64_t kMostSpread_pa = 5'000;
  /// From the configured pressure: weather and a sensor's offset, but no dive of more than a metre.
  static constexpr std::int64_t kMostOffset_pa = 10'000;

  enum class State : std::uint8_t {
    kWaiting = 0,  ///< averages
    kKnown = 1,
    kRefused = 2,  ///< was not at the surface: the configured pressure counts
  };

  void restart() { *this = SurfaceReference{}; }
  /// Takes a reading; true: `pressure_pa` is referred to `configured_pa` (or left, where that was refused) and
  /// can be used. O(1).
  [[nodiscard]] bool refer(base::TimeUs t_us, std::int64_t configured_pa,
                           std::int64_t& pressure_pa);
  [[nodiscard]] State state() const { return state_; }
  /// Of the surface, by the sensor, less the configured; kKnown only.
  [[nodiscard]] std::int64_t offset_pa() const { return offset_pa_; }

 private:
  State state_ = State::kWaiting;
  std::int32_t count_ = 0;
  base::TimeUs first_us_ = 0;
  std::int64_t sum_pa_ = 0;  ///< of readings less the configured pressure
  std::int64_t least_pa_ = 0;
  std::int64_t most_pa_ = 0;
  std::int64_t offset_pa_ = 0;
};

}  // namespace leadline::firmware
