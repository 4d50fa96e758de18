// From the intensities of one beam to the range that the localization tables assume: where a given
// fraction of the echo's energy has arrived (method 1.3: every range is that of a first return).
//
// Intensities are taken as energy, linear, with a noise of any mean: its level is estimated from the
// profile itself and subtracted. Integers only; the result depends on the profile alone.
#pragma once

#include <cstdint>

#include "model/base/ping.hpp"

namespace leadline::model {

/// Longest profile. Inclusive; more bins are not looked at.
inline constexpr int kMaxProfileBins = 4096;
/// Fewest bins that say anything about noise.
inline constexpr int kMinProfileBins = 8;

struct EchoDetectorConfig {
  /// LocalizationTable::detection_fraction_q16 of the head's table; 0 counts as 1.
  std::uint16_t detection_fraction_q16 = 0;
  std::int64_t min_range_um = 0;  ///< bins centred nearer are blanked: ring-down
  std::int64_t max_range_um = 0;  ///< bins centred farther are left out
  std::uint8_t max_returns = 1;   ///< 1 .. kMaxReturns; 0 counts as 1
  /// A return stands at least this part of the range behind the one before it: what is nearer may be
  /// another part of the same surface.
  std::uint32_t apart_q16 = 0;
};

/// Most returns of one ping.
inline constexpr int kMaxReturns = 3;

/// A return behind the first.
struct LaterReturn {
  std::int64_t range_um;
  std::uint8_t quality;
};

struct EchoDetection {
  bool found;
  std::uint8_t quality;   ///< 1 .. 255 of the signal-to-noise ratio: 128 at 8, 0 without an echo
  std::int64_t range_um;  ///< where the fraction is reached, between bins by straight line
  // What the decision rests on, in the profile's units.
  std::uint32_t noise_q8;        ///< mean level of noise
  std::uint32_t noise_sigma_q8;  ///< its spread
  std::uint32_t peak_q8;         ///< strongest bin of the echo, above the noise
  std::uint64_t energy_q8;       ///< of the echo, above the noise
  /// Where the first run begins that stands over 8 sigma somewhere, be it too weak for a return.
  std::int64_t clear_um;
  /// Returns behind it, in the order of their ranges.
  LaterReturn behind[kMaxReturns - 1];
  std::uint8_t behind_count;
};

/// Finds the echo of one profile. Noise is median and median deviation of all bins in range. An echo is a
/// run of bins whose smoothed intensity (1 2 1) stands over 3 sigma (gaps of two bins joined) and somewhere
/// over 8; of several the nearest that has a quarter of the strongest one's energy. Its energy is summed
/// from two bins before the run to two bins behind it.
///
/// Behind it a run is a return of its own where it stands far enough from the one before and has more energy:
/// what stood before it did not fill the beam. Weaker ones are the tail of the same surface, or multiples.
/// Of more than max_returns the first ones and the last, which is the strongest.
///
/// Not found: no run, fewer than kMinProfileBins bins in range, or no intensities at all (null).
/// O(bins * 32): the medians are searched bit by bit.
[[nodiscard]] EchoDetection detect_echo(const base::RangeProfile& profile,
                                        const EchoDetectorConfig& config);

}  // namespace leadline::model
