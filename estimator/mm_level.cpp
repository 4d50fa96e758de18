// Roll and pitch: where the sensor says that down is, whatever the heading. The errors are turns about the
// level axes that point forward and to the right.
#include "estimator/filter_access.hpp"
#include "model/base/fixed.hpp"

namespace leadline::estimator {
Fusion NavigationFilter::update_level(base::Bam32 roll_bam32, base::Bam32 pitch_bam32,
                                      const std::uint32_t sigma_urad[2], base::TimeUs age_us) {
  const FilterAccess access{*this};
  const base::Attitude now = attitude();
  const float moved = rates_valid_ ? 0.0F : square(config_.turn_rate_rad_s) * seconds(age_us);
  const Column<2> noise(square(radians(sigma_urad[0])) + moved,
                        square(radians(sigma_urad[1])) + moved);
  if (!level_started_) {
    access.set_attitude({roll_bam32, pitch_bam32, now.heading_bam32});
    access.set_variance(kErrorAttitude, base::max_of(noise[0], noise[1]));
    access.set_variance(kErrorAttitude + 1, base::max_of(noise[0], noise[1]));
    access.keep_sound();
    level_started_ = true;
    return access.accept(NavMeasurement::kLevel);
  }
  // Roll turns about the body's own forward axis, of which cos(pitch) is level; the rest would be heading.
  const float n = static_cast<float>(base::cos_q30(now.heading_bam32)) * 0x1p-30F;
  const float e = static_cast<float>(base::sin_q30(now.heading_bam32)) * 0x1p-30F;
  const float level = static_cast<float>(base::cos_q30(now.pitch_bam32)) * 0x1p-30F;
  // Rates of the angles for a turn w about NED: roll' = (n w_n + e w_e) / cos(pitch), pitch' = n w_e - e w_n.
  constexpr float kSteepest = 0.1F;  // 84 degrees: beyond, roll says nothing
  if (!(level > kSteepest)) {
    return Fusion::kNotReady;
  }
  Rows<2> rows = Rows<2>::Zero();
  rows(0, kErrorAttitude) = n / level;
  rows(0, kErrorAttitude + 1) = e / level;
  rows(1, kErrorAttitude) = -e;
  rows(1, kErrorAttitude + 1) = n;
  const Column<2> innovation(difference(roll_bam32, now.roll_bam32),
                             difference(pitch_bam32, now.pitch_bam32));
  return access.fuse<2>(NavMeasurement::kLevel, rows, innovation, noise, kGate2);
}

}  // namespace leadline::estimator
