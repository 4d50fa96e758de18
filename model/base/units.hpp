// Units and frames shared by every folder.
//
// Frames: world = NED (north, east, down) metres-like integers around a stated origin; body = FRD
// (forward, right, down). Depth is positive down. Every integer carries its unit in its name:
//   _us microseconds   _um micrometres   _mm millimetres   _bam32 binary angle, 2^32 = one turn
//   _qN fixed point with N fraction bits (in the unit that the word before it names)
#pragma once

#include <cstddef>
#include <cstdint>

namespace leadline::base {

/// Vehicle time: microseconds of a monotonic clock chosen by the caller. Signed so that differences
/// are plain subtractions; the vehicle code never reads a clock.
using TimeUs = std::int64_t;

/// Binary angle: the full turn is 2^32, so wrap-around is the integer's own. 1 LSB = 8.4e-8 deg.
/// Signed interpretation covers [-180, +180) degrees.
using Bam32 = std::uint32_t;

inline constexpr Bam32 kBam32HalfTurn = 0x80000000U;
inline constexpr Bam32 kBam32QuarterTurn = 0x40000000U;

/// Largest |north| or |east| that a record may carry: farther out a survey must re-origin (the
/// geodetic origin moves), because millimetres no longer fit 32 bits. Inclusive, in micrometres.
inline constexpr std::int64_t kMaxHorizontal_um = 2'000'000'000'000;
/// Largest |down|: deeper than any ocean, higher than any lake. Inclusive, in micrometres.
inline constexpr std::int64_t kMaxVertical_um = 20'000'000'000;
/// Longest range a record may carry. Inclusive, in micrometres.
inline constexpr std::int64_t kMaxRange_um = 20'000'000'000;

/// Axis indices of every [3] array in world coordinates.
enum Axis : std::size_t { kNorth = 0, kEast = 1, kDown = 2 };

}  // namespace leadline::base
