// From one ping and one pose to the geometry of its event: where the shell lies, how wide it is, what
// the cone before it looks like. Integers only; no voxel is read or written here.
//
// Frames: grid cells, north/east/down from the grid's lowest corner, Q16 unless named otherwise.
#pragma once

#include <cstdint>

#include "model/base/ping.hpp"
#include "model/base/pose.hpp"
#include "model/config.hpp"
#include "model/localization_table.hpp"

namespace leadline::model {

/// A unit vector NED in Q30.
struct Direction {
  std::int32_t q30[3];
};

/// The beam's own axes in the world: `axis` is where it looks, `along` and `across` span the plane of
/// its footprint (an axisymmetric beam does not care which is which).
struct BeamFrame {
  Direction axis;
  Direction along;
  Direction across;
};

/// Axes of a beam in NED: v_FRD = (cos el cos az, cos el sin az, sin el) turned by the attitude, the
/// footprint axes turned by `rotation` about the beam. O(1).
[[nodiscard]] BeamFrame beam_frame(const base::Attitude& attitude, base::Bam32 azimuth_bam32,
                                   base::Bam32 elevation_bam32, base::Bam32 rotation_bam32);

/// Slope of the bottom, depth cells per horizontal cell.
struct Slope {
  std::int32_t north_q12;
  std::int32_t east_q12;
};

/// Numbers that depend on configuration and table only, computed once.
struct Scale {
  std::int64_t inverse_cell_q46;  ///< cells per micrometre * 2^46
  std::int64_t origin_um[3];
  std::int32_t cell_um;
  std::int32_t size[3];
  std::int64_t sigma_range_q12;   ///< cells
  std::int64_t min_variance_q12;  ///< smallest shell variance that a ping can have, cells^2
  std::int32_t max_range_q16;     ///< cells
  std::int32_t footprint_cells;   ///< largest half-width of a shell event
  std::int32_t cone_tan_q20;      ///< half-angle of the empty cone, tan: the wider of the two below
  std::int32_t tan_along_q20;     ///< beam envelope in its along plane
  std::int32_t tan_across_q20;    ///< and in its across plane
  /// Pulling rules: share of a voxel per event of full weight and tap 1, k_p over the best kernel's peak;
  /// and event units of evidence (as in the additive rules) per unit of a voxel's half, Q16.
  std::uint32_t pull_gain_q15;
  std::uint32_t pull_unit_q16;
  std::uint32_t confidence_scale_q22;  ///< 64 entries per max_range: index = range_q10 * this >> 22
};

/// Position of the transducer and range of the return, in cells.
struct Sighting {
  std::int32_t origin_q16[3];
  std::int32_t range_q16;
  /// Position variance per axis, cells^2.
  std::int64_t position_variance_q12[3];
};

/// Below this part of the variance (1/32) nearer shells weigh the same, to 5 %.
inline constexpr std::uint32_t kLeastGrowth_q24 = 1U << 19U;

/// The shell as columns see it: over column (n, e) of the box it is centred at
/// depth0 + (n - north0) depth_dn + (e - east0) depth_de, and its lateral coordinates (xi, eta),
/// normalized to unit variance, run linearly as well.
struct ShellEvent {
  std::int32_t north0, north1, east0, east1;  ///< box, inclusive, inside the grid; empty if 0 > 1
  std::int32_t xi0_q16, xi_dn_q16, xi_de_q16;
  std::int32_t eta0_q16, eta_dn_q16, eta_de_q16;
  std::int32_t depth0_q16, depth_dn_q16, depth_de_q16;
  std::int64_t plane0_q16;  ///< depth of the same plane over column (0, 0), for the cone
  std::uint32_t weight_q7;  ///< evidence of the event at its centre, 0 .. 32767
  /// Lateral variance per axis by which the event blurs the map, its own displacement by the position
  /// error included; cells^2, saturated.
  std::uint16_t blur_q8;
  /// Part of the shell's variance that goes with the square of the range, pointing and footprint; Q24 of
  /// 1. Says what a ping that ends nearer would have weighed. 0 in wall mode and below kLeastGrowth.
  std::uint32_t growth_q24;
  std::uint8_t level;  ///< kernel level
  std::uint8_t profile_class;
  bool wall;  ///< the shell stands upright (see make_shell)
  /// Slant range up to which the cone is surely empty, cells Q10 from the transducer.
  std::int32_t empty_range_q10;
};

/// Grazing limit: with cos(incidence) below this the bottom cannot explain the echo; the shell is
/// then taken perpendicular to the beam, as in front of a wall or in open water.
inline constexpr std::int32_t kGrazingCosine_q30 = 214748365;  // 0.2

/// Builds the shell of a return. `slope` is the bottom's slope near the axis end (zero when unknown).
/// Always succeeds; the box may be empty.
///
/// Plane mode (the bottom): the range is that of the earliest detectable part of the echo. On a plane
/// with incidence i that part lies uphill of the axis, and the plane's distance from the transducer is
/// R (cos i + excess(i)): the table's first-return entry. The shell is that plane, blurred by range,
/// position and pointing errors projected on the vertical; its lateral extent is the part of the
/// footprint that has echoed, pointing and position in quadrature, half a cell for the voxel itself.
///
/// Wall mode: shell perpendicular to the beam, lateral extent and range blur change roles.
[[nodiscard]] ShellEvent make_shell(const Scale& scale, const LocalizationTable& table,
                                    const BeamFrame& frame, const Sighting& sighting,
                                    const Slope& slope);

/// Kernel level whose variance is nearest to `variance_q12` (cells^2) on the logarithmic scale.
[[nodiscard]] std::uint8_t kernel_level(std::int64_t variance_q12);
/// Half-width in cells Q16 of a level's kernel: max(1.5, min(2 sigma, 7)).
[[nodiscard]] std::int32_t kernel_reach_q16(std::uint8_t level);

/// The cone of empty evidence before a shell: a frustum of radius kTouch + growth * a at slant distance
/// a from the transducer, 0 <= a <= range, ready for column-wise traversal. In a column at horizontal
/// offset (x along the axis' heading, y across), depth z below the transducer lies inside when
///   A z^2 - 2 B z + C <= 0,  A = c^2 - g^2 s^2,  B = s (p + g^2 p + g kTouch),  p = c x,
///   C = (s x)^2 + y^2 - (kTouch + g p)^2
/// with c, s the horizontal and vertical parts of the axis and g the growth.
struct Cone {
  // Of 32 bits wherever the value is: their products are one instruction of a 32-bit machine.
  std::int32_t horizontal_q30;     ///< c, 0..1
  std::int32_t down_q30;           ///< s, -1..1
  std::int32_t heading_north_q20;  ///< unit vector of the axis' horizontal direction
  std::int32_t heading_east_q20;
  std::int32_t growth_q20;        ///< at most 5.7: 80 degrees
  std::int32_t touch_growth_q20;  ///< g kTouch
  std::int64_t a_q30;
  std::int32_t a_q24;          ///< A again: below 2^29
  std::int32_t inverse_a_q16;  ///< 1 / A, 0 when |A| is below 2^-10
  std::int32_t range_q10;
  std::int32_t radius_q10;        ///< at the far end, the largest: below 2^26
  std::int32_t inverse_down_q12;  ///< 1 / s, 0 when the axis is nearly horizontal
  int drop;     ///< bits that B gives up so that B^2 and A C fit; 0 for short ranges
  bool narrow;  ///< B and its terms fit 32 bits, wherever a column of the cone stands
};

/// Half the diagonal of a voxel: a cone at least this thick touches every voxel that its axis crosses,
/// however thin the beam is.
inline constexpr std::int32_t kTouch_q10 = 887;
/// Least opening of the virtual cone, 1/1024.
inline constexpr std::int32_t kLeastGrowth_q20 = 1024;

/// Opening (tan) of the frustum that is kTouch thick at the transducer and as wide as the beam, or as
/// thick as it began, at `range_q10`: it holds the beam's cone and the tube of every crossed voxel.
[[nodiscard]] std::int32_t cone_growth_q20(std::int32_t tan_q20, std::int32_t range_q10);

/// How much more a shell at `share_q16` of an event's range would weigh against the peak of its own: with
/// v = 1 - growth + growth share^2 of the variance, v^-1.5 (weight goes with 1 / v, the height of a unit's
/// peak with v^-0.5). Q8, at most 4096; within 0.1 % + 1/256. O(1).
[[nodiscard]] std::uint32_t peak_gain_q8(std::uint32_t growth_q24, std::uint32_t share_q16);

/// Cone along `axis`, ending `range_q10` cells from the transducer.
[[nodiscard]] Cone make_cone(const Scale& scale, const Direction& axis, std::int32_t range_q10);

/// Depths below the transducer, Q10 cells, between which a column at (x, y) lies inside the cone.
struct ColumnSpan {
  std::int32_t top_q10;
  std::int32_t bottom_q10;  ///< below top: the column is outside
};
/// What an unlimited depth is: farther than any grid reaches.
inline constexpr std::int32_t kFar_q10 = 1 << 26;
[[nodiscard]] ColumnSpan cone_span(const Cone& cone, std::int32_t x_q10, std::int32_t y_q10);

}  // namespace leadline::model
