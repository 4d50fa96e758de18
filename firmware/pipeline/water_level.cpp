#include "firmware/pipeline/water_level.hpp"

#include "estimator/pose_history.hpp"

namespace leadline::firmware {
namespace {

constexpr base::TimeUs kLongestGap_us = 31LL * 86'400 * 1'000'000;
constexpr std::int32_t kHighest_mm = 100'000;

}  // namespace

bool tide_sound(const WaterConfig& water) {
  if (water.tide_count > kMaxTidePoints) {
    return false;
  }
  for (int i = 0; i < water.tide_count; ++i) {
    const TidePoint& point = water.tide[i];
    if (point.t_us < -estimator::kMaxTime_us || point.t_us > estimator::kMaxTime_us ||
        point.height_mm < -kHighest_mm || point.height_mm > kHighest_mm) {
      return false;
    }
    const base::TimeUs gap_us = i > 0 ? point.t_us - water.tide[i - 1].t_us : 1;
    if (gap_us <= 0 || gap_us > kLongestGap_us) {
      return false;
    }
  }
  return true;
}

std::int64_t water_level_um(const WaterConfig& water, base::TimeUs t_us) {
  if (water.tide_count == 0) {
    return 0;
  }
  int behind = 0;
  while (behind < water.tide_count && water.tide[behind].t_us <= t_us) {
    ++behind;
  }
  if (behind == 0) {
    return std::int64_t{water.tide[0].height_mm} * 1000;
  }
  const TidePoint& a = water.tide[behind - 1];
  const std::int64_t from_um = std::int64_t{a.height_mm} * 1000;
  if (behind == water.tide_count) {
    return from_um;
  }
  const TidePoint& b = water.tide[behind];
  const std::int64_t rise_mm = std::int64_t{b.height_mm} - a.height_mm;
  // Milliseconds: 2.7e9 of them times 2e8 micrometres fit.
  const std::int64_t span_ms = (b.t_us - a.t_us + 999) / 1000;
  return from_um + rise_mm * 1000 * ((t_us - a.t_us) / 1000) / span_ms;
}

}  // namespace leadline::firmware
