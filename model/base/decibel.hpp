// Decibels to linear numbers.
#pragma once

#include <cstdint>

namespace leadline::base {

/// 65535 * 10^(-attenuation / 20): an amplitude that lies `attenuation_mdb` under full scale; 65535 for 0 and
/// below. Of energies the attenuation counts twice. Within 2. O(1).
[[nodiscard]] std::uint16_t amplitude_of_attenuation(std::int64_t attenuation_mdb);

}  // namespace leadline::base
