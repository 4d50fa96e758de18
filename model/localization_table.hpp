// The localization table: everything the integrator must know about one sonar beam, computed ahead
// of time from the physical description by the host tool and handed to the vehicle as one checked
// block of bytes. Stewart's composite localization function (1988, section 3.3.3; here method 1.1),
// split into the parts that one ping needs:
//
//   first return   where on a sloping bottom the range was measured (the earliest detectable part of
//                  the echo comes from uphill), as a function of the incidence angle
//   profile        lateral weight of the event: beam pattern convolved with the Gaussian errors of
//                  pointing and position, one class per ratio of the two
//   kernel         range blur along the column: Gaussian taps per width and sub-cell phase
//   beam weight    two-way pattern inside the envelope, for the empty evidence before the shell
//
// The block is an input of the vehicle: versioned, little-endian, CRC-protected, its CRC recorded with
// every result. It is a plain struct of fixed-width integers without padding, so that the bytes on
// disk are the bytes in memory on every target (all are little-endian).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/base/status.hpp"

namespace leadline::model {

inline constexpr std::uint32_t kTableMagic = 0x31544C4CU;  // "LLT1" in file order
inline constexpr std::uint16_t kTableVersion = 1;

inline constexpr int kIncidenceSteps = 256;  ///< first-return entries per unit of sin(incidence)
inline constexpr int kProfileClasses = 8;    ///< class c: beam variance / total variance = c / 7
inline constexpr int kProfileSteps = 128;    ///< profile entries from m^2 = 0 to kProfileCut2
inline constexpr int kKernelLevels = 24;     ///< level l: variance 0.25 * 2^(l/4) cells^2
inline constexpr int kKernelPhases = 16;     ///< sub-cell positions of the shell
inline constexpr int kKernelTaps = 16;  ///< voxels per row; tap j lies at j - 6.5 - phase cells
inline constexpr int kBeamWeightSteps = 64;  ///< entries over (off-axis / envelope)^2

/// Square of the normalized (Mahalanobis) radius at which the lateral profile is cut: 2.2 sigma.
inline constexpr int kProfileCut2_q8 = 1239;  // 4.84 * 256
/// Sum of the taps of one kernel row: an event's weight is distributed, never gained or lost.
inline constexpr int kKernelSum = 32768;
/// Centre of row position 0 relative to floor(shell): tap j is the voxel floor(shell) - 7 + j.
inline constexpr int kKernelCentre = 7;

/// Beam families; the vehicle needs only axisymmetric or not, results record the rest.
enum class BeamKind : std::uint8_t { kCone = 0, kPiston = 1, kRectangle = 2, kMeasured = 3 };

/// First-return geometry on a plane whose normal is `incidence` away from the beam axis, entry k at
/// sin(incidence) = k / kIncidenceSteps; linear interpolation between entries.
struct FirstReturnEntry {
  /// Perpendicular distance of the plane = range * (cos(incidence) + excess): the detector fires when
  /// `detection_fraction` of the echo has arrived, averaged over the pointing error.
  std::uint32_t excess_q30;
  /// d(cos(incidence) + excess) / d(incidence), per radian: how pointing error becomes depth error.
  std::int32_t slope_q20;
  /// tan(angle from the axis to the detected point) / sin(incidence): the uphill shift.
  std::uint32_t shift_q20;
  /// Variance per axis of the part of the footprint that has echoed by then, (tan of angle)^2.
  std::uint32_t patch_variance_q30;
};

/// The block. Every field little-endian; `crc32c` covers all bytes after itself.
struct LocalizationTable {
  std::uint32_t magic;       ///< kTableMagic
  std::uint16_t version;     ///< kTableVersion; a vehicle refuses any other
  std::uint16_t reserved0;   ///< zero
  std::uint32_t size_bytes;  ///< sizeof(LocalizationTable)
  std::uint32_t crc32c;      ///< of the bytes from `beam_kind` to the end

  BeamKind beam_kind;
  std::uint8_t two_axis;  ///< 1: across-track entries differ from along-track ones
  std::uint16_t detection_fraction_q16;
  // Envelope: off-axis angle where the table is cut (method 1.1), tan of it.
  std::uint32_t tan_envelope_along_q24;
  std::uint32_t tan_envelope_across_q24;
  // Variance per axis of the two-way pattern, (tan of angle)^2.
  std::uint32_t beam_variance_along_q30;
  std::uint32_t beam_variance_across_q30;
  std::uint32_t pointing_variance_q30;  ///< per axis, (tan of angle)^2
  std::uint32_t sigma_range_um;         ///< one sigma of the range error
  std::uint32_t discarded_energy_ppm;   ///< two-way energy outside the envelope
  // Worst errors of the stored integers against the double-precision functions they sample, over the
  // whole domain including interpolation (the generator measures, a test sweeps).
  std::uint32_t error_excess_q30;
  std::uint32_t error_profile_q15;
  std::uint32_t error_kernel_q15;
  std::uint32_t error_kernel_moment_q15;  ///< first moment of a row, cells

  /// [0] incidence in the along-axis plane, [1] in the across-axis plane (equal unless two_axis).
  FirstReturnEntry first_return[2][kIncidenceSteps + 1];
  /// Lateral weight, peak 32767, entry j at m^2 = j/kProfileSteps * kProfileCut2. Axisymmetric beams
  /// use [0] with the radial m^2; two-axis beams multiply [0](along m^2) and [1](across m^2).
  std::uint16_t profile_q15[2][kProfileClasses][kProfileSteps + 4];
  /// Two-way pattern at (off-axis/envelope)^2 = j/kBeamWeightSteps, peak 32767; [0] along, [1] across.
  std::uint16_t beam_weight_q15[2][kBeamWeightSteps + 2];
  /// Range blur. Row [l][p] holds a Gaussian of variance 0.25*2^(l/4) cells^2 sampled at the voxel
  /// centres, cut at max(1.5, min(2 sigma, 7)) cells, tilted so that its first moment is zero for the
  /// phase (p + 0.5)/kKernelPhases, and summing to kKernelSum exactly.
  std::int16_t kernel_q15[kKernelLevels][kKernelPhases][kKernelTaps];
  /// First non-zero tap and number of taps of each row.
  std::uint8_t kernel_first[kKernelLevels][kKernelPhases];
  std::uint8_t kernel_count[kKernelLevels][kKernelPhases];
};

static_assert(sizeof(FirstReturnEntry) == 16, "no padding");
static_assert(sizeof(LocalizationTable) == 25832, "the block's layout is frozen");

/// Checks a block: size, magic, version, CRC, and every value that the integrator relies on (row
/// sums, tap counts, monotone envelopes), so that a wrong table can never make it write out of bounds.
/// Returns kTruncated, kBadVersion, kBadChecksum, kOutOfRange or kOk. O(size).
[[nodiscard]] base::Status check_table(const void* bytes, std::size_t size_bytes);

/// CRC-32C over the part of the block that the header's CRC covers.
[[nodiscard]] std::uint32_t table_crc(const LocalizationTable& table);

}  // namespace leadline::model
