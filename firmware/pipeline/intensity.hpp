// Intensities as the echo detector takes them: energies, whatever the head's own scale is.
#pragma once

#include <cstdint>

#include "firmware/pipeline/config.hpp"
#include "model/base/ping.hpp"

namespace leadline::firmware {

/// Writes the energy of each bin of `profile` to `energy` (profile.bin_count of them, at most
/// model::kMaxProfileBins are): as it is (kEnergy), its square (kAmplitude), or full scale for the strongest
/// bin and `step_mdb` less per step under it (kDecibel). Squares are taken of what the strongest bin leaves
/// room for. O(bins).
void energies_of(const base::RangeProfile& profile, IntensityScale scale, std::int32_t step_mdb,
                 std::uint16_t* energy);

}  // namespace leadline::firmware
