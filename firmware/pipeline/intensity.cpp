#include "firmware/pipeline/intensity.hpp"

#include "model/base/decibel.hpp"
#include "model/base/fixed.hpp"
#include "model/echo_detector.hpp"

namespace leadline::firmware {
namespace {

std::uint32_t strongest_of(const std::uint16_t* intensity, int count) {
  std::uint32_t strongest = 0;
  for (int i = 0; i < count; ++i) {
    strongest = base::max_of<std::uint32_t>(strongest, intensity[i]);
  }
  return strongest;
}

}  // namespace

void energies_of(const base::RangeProfile& profile, IntensityScale scale, std::int32_t step_mdb,
                 std::uint16_t* energy) {
  const int count = base::min_of<int>(profile.bin_count, model::kMaxProfileBins);
  const std::uint32_t strongest = strongest_of(profile.intensity, count);
  unsigned shift = 0;
  while (((strongest * strongest) >> shift) > 0xFFFFU) {
    ++shift;
  }
  for (int i = 0; i < count; ++i) {
    const std::uint32_t own = profile.intensity[i];
    switch (scale) {
      case IntensityScale::kEnergy:
        energy[i] = profile.intensity[i];
        break;
      case IntensityScale::kAmplitude:
        energy[i] = static_cast<std::uint16_t>((own * own) >> shift);
        break;
      case IntensityScale::kDecibel:
        // Energies: their decibels are those of amplitudes twice.
        energy[i] = base::amplitude_of_attenuation(2 * std::int64_t{strongest - own} * step_mdb);
        break;
    }
  }
}

}  // namespace leadline::firmware
