#include "firmware/pipeline/surface_reference.hpp"

#include "model/base/fixed.hpp"

namespace leadline::firmware {

bool SurfaceReference::refer(base::TimeUs t_us, std::int64_t configured_pa,
                             std::int64_t& pressure_pa) {
  if (state_ == State::kWaiting) {
    const std::int64_t above_pa = pressure_pa - configured_pa;
    first_us_ = count_ == 0 ? t_us : first_us_;
    least_pa_ = count_ == 0 ? above_pa : base::min_of(least_pa_, above_pa);
    most_pa_ = count_ == 0 ? above_pa : base::max_of(most_pa_, above_pa);
    sum_pa_ += above_pa;
    ++count_;
    if (t_us - first_us_ < kFor_us || count_ < kLeastSamples) {
      return false;
    }
    const std::int64_t mean_pa = sum_pa_ / count_;
    const bool still =
        most_pa_ - mean_pa <= kMostSpread_pa && mean_pa - least_pa_ <= kMostSpread_pa;
    const bool surface = mean_pa >= -kMostOffset_pa && mean_pa <= kMostOffset_pa;
    state_ = still && surface ? State::kKnown : State::kRefused;
    offset_pa_ = state_ == State::kKnown ? mean_pa : 0;
  }
  pressure_pa -= offset_pa_;
  return true;
}

}  // namespace leadline::firmware
