#include "estimator/stuck_watch.hpp"

namespace leadline::estimator {
namespace {

std::uint64_t mixed(std::uint64_t hash, std::int64_t value) {
  return (hash ^ static_cast<std::uint64_t>(value)) * 0x100000001B3U;
}

std::uint64_t hash_of(const base::NavSample& sample) {
  std::uint64_t hash = mixed(0xCBF29CE484222325U, sample.fields & ~std::uint32_t{base::kNavUtc});
  for (const base::Bam32 angle :
       {sample.attitude.roll_bam32, sample.attitude.pitch_bam32, sample.attitude.heading_bam32}) {
    hash = mixed(hash, static_cast<std::int64_t>(angle));
  }
  for (const std::int64_t value :
       {sample.latitude_e9deg, sample.longitude_e9deg, sample.pressure_pa, sample.depth_um,
        sample.altitude_um, sample.heave_um, std::int64_t{sample.sound_speed_mm_s},
        std::int64_t{sample.temperature_mdegc}}) {
    hash = mixed(hash, value);
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    hash = mixed(mixed(mixed(hash, sample.velocity_um_s[axis]), sample.rate_urad_s[axis]),
                 sample.position_um[axis]);
  }
  return hash;
}

}  // namespace

bool StuckWatch::stuck(const base::NavSample& sample) {
  const auto kind = static_cast<std::size_t>(sample.kind);
  if (kind >= kKinds) {
    return false;
  }
  Row& row = rows_[kind];
  const std::uint64_t hash = hash_of(sample);
  if (row.equal == 0 || hash != row.hash) {
    row = Row{hash, 1};
    return false;
  }
  if (row.equal < kStuckSamples) {
    ++row.equal;
  }
  return row.equal >= kStuckSamples;
}

}  // namespace leadline::estimator
