// Heading, from the north that the positions use: the caller has taken declination and convergence off.
#include "estimator/filter_access.hpp"

namespace leadline::estimator {

Fusion NavigationFilter::update_heading(base::Bam32 heading_bam32, std::uint32_t sigma_urad,
                                        base::TimeUs age_us) {
  const FilterAccess access{*this};
  base::Attitude now = attitude();
  const float moved = rates_valid_ ? 0.0F : square(config_.turn_rate_rad_s) * seconds(age_us);
  const Column<1> noise(square(radians(sigma_urad)) + moved);
  if (!heading_started_) {
    now.heading_bam32 = heading_bam32;
    access.set_attitude(now);
    access.set_variance(kErrorAttitude + 2, noise[0]);
    access.keep_sound();
    heading_started_ = true;
    return access.accept(NavMeasurement::kHeading);
  }
  // heading' = w_d + tan(pitch) (n w_n + e w_e).
  const Vector3 forward = access.rotation().col(0);
  const float level2 = square(forward[0]) + square(forward[1]);
  constexpr float kSteepest2 = 0.01F;
  if (!(level2 > kSteepest2)) {
    return Fusion::kNotReady;
  }
  Rows<1> row = Rows<1>::Zero();
  row(0, kErrorAttitude) = -forward[2] * forward[0] / level2;
  row(0, kErrorAttitude + 1) = -forward[2] * forward[1] / level2;
  row(0, kErrorAttitude + 2) = 1.0F;
  const Column<1> innovation(difference(heading_bam32, now.heading_bam32));
  return access.fuse<1>(NavMeasurement::kHeading, row, innovation, noise, kGate1);
}

}  // namespace leadline::estimator
