#include "model/event.hpp"

#include "model/base/fixed.hpp"
#include "model/capacity.hpp"
#include "model/column_kernels.hpp"
#include "model/cone_column.hpp"

namespace leadline::model {
namespace {

using base::clamp;
using base::max_of;
using base::min_of;
using base::mul_shift;
using base::ratio;
using base::sqrt_u64;

// Steepest slope that the tangent plane follows, 2.5 : 1 (68 deg).
constexpr std::int32_t kMaxSlope_q12 = 10240;
// Variance of the voxel's own footprint in the lateral weight: half a cell^2, so that a beam thinner
// than a cell still reaches every column that it may have hit.
constexpr std::int64_t kCellVariance_q12 = 2048;
// Share of the position variance that widens the lateral weight. The ping is also *displaced* by that
// error, so the map is blurred by it once already; the full variance would blur it twice.
constexpr int kPositionShareShift = 1;
// Floor of the shell's variance: rounding of depths and voxels, 0.02 cells^2.
constexpr std::int64_t kFloorVariance_q12 = 82;
constexpr std::int32_t kLateralFloor_q12 = 205;  // 0.05 cells^2

std::int64_t dot_q30(std::int64_t an, std::int64_t ae, std::int64_t bn, std::int64_t be) {
  return (an * bn + ae * be) >> 30;
}

Direction turn(const Direction& body, std::int64_t sr, std::int64_t cr, std::int64_t sp,
               std::int64_t cp, std::int64_t sh, std::int64_t ch) {
  const std::int64_t x = body.q30[0];
  const std::int64_t y = body.q30[1];
  const std::int64_t z = body.q30[2];
  const std::int64_t y1 = (cr * y - sr * z) >> 30;
  const std::int64_t z1 = (sr * y + cr * z) >> 30;
  const std::int64_t x2 = (cp * x + sp * z1) >> 30;
  const std::int64_t z2 = (cp * z1 - sp * x) >> 30;
  return Direction{{static_cast<std::int32_t>((ch * x2 - sh * y1) >> 30),
                    static_cast<std::int32_t>((sh * x2 + ch * y1) >> 30),
                    static_cast<std::int32_t>(z2)}};
}

struct FirstReturn {
  std::int64_t excess_q30;
  std::int64_t slope_q20;
  std::int64_t shift_q20;
  std::int64_t patch_variance_q30;
};

FirstReturn first_return(const FirstReturnEntry* entries, std::uint32_t sine_q12) {
  const std::uint32_t index = min_of<std::uint32_t>(sine_q12 >> 4U, kIncidenceSteps - 1);
  const auto fraction_q4 =
      static_cast<std::int64_t>(min_of<std::uint32_t>(sine_q12 - (index << 4U), 16));
  const FirstReturnEntry& a = entries[index];
  const FirstReturnEntry& b = entries[index + 1];
  const auto between = [fraction_q4](std::int64_t from, std::int64_t to) {
    return from + (((to - from) * fraction_q4) >> 4);
  };
  return FirstReturn{between(a.excess_q30, b.excess_q30), between(a.slope_q20, b.slope_q20),
                     between(a.shift_q20, b.shift_q20),
                     between(a.patch_variance_q30, b.patch_variance_q30)};
}

// Lateral frame: two horizontal linear forms and the variances along them -> normalized coordinates.
struct Lateral {
  std::int64_t m11_q16, m12_q16, m21_q16, m22_q16;  // xi = m11 dn + m12 de, eta = m21 dn + m22 de
  std::int64_t half_north_q16, half_east_q16;       // half extents of the cut ellipse
};

// b1, b2 (Q14) are the two forms; c11, c12, c22 (Q12) their covariance.
Lateral whiten(std::int64_t b1n, std::int64_t b1e, std::int64_t b2n, std::int64_t b2e,
               std::int64_t c11, std::int64_t c12, std::int64_t c22) {
  c11 = max_of<std::int64_t>(c11, kLateralFloor_q12);
  const std::int64_t slant_q14 = ratio(c12, c11, 14);
  c22 = max_of<std::int64_t>(c22 - mul_shift(c12, slant_q14, 14), kLateralFloor_q12);
  const std::uint32_t s1_q12 = sqrt_u64(static_cast<std::uint64_t>(c11) << 12U);
  const std::uint32_t s2_q12 = sqrt_u64(static_cast<std::uint64_t>(c22) << 12U);
  // Of the floor: 2^18.2 at most.
  const std::int64_t inverse1_q16 = (1U << 28U) / s1_q12;
  const std::int64_t inverse2_q16 = (1U << 28U) / s2_q12;
  Lateral out{};
  out.m11_q16 = mul_shift(b1n, inverse1_q16, 14);
  out.m12_q16 = mul_shift(b1e, inverse1_q16, 14);
  out.m21_q16 = mul_shift(b2n - mul_shift(slant_q14, b1n, 14), inverse2_q16, 14);
  out.m22_q16 = mul_shift(b2e - mul_shift(slant_q14, b1e, 14), inverse2_q16, 14);
  std::int64_t determinant_q16 = (out.m11_q16 * out.m22_q16 - out.m12_q16 * out.m21_q16) >> 16;
  determinant_q16 = determinant_q16 < 0 ? -determinant_q16 : determinant_q16;
  // half extent = cut * sqrt(C_nn), C = (M^T M)^-1
  const auto column_e_q16 = static_cast<std::int64_t>(
      sqrt_u64(static_cast<std::uint64_t>(out.m12_q16 * out.m12_q16 + out.m22_q16 * out.m22_q16)));
  const auto column_n_q16 = static_cast<std::int64_t>(
      sqrt_u64(static_cast<std::uint64_t>(out.m11_q16 * out.m11_q16 + out.m21_q16 * out.m21_q16)));
  constexpr std::int64_t kCut_q16 = 144179;  // 2.2
  constexpr std::int64_t kLongest_q16 = static_cast<std::int64_t>(kMaxFootprintCells) << 16;
  if (determinant_q16 < 16) {
    out.half_north_q16 = kLongest_q16;
    out.half_east_q16 = kLongest_q16;
  } else {
    out.half_north_q16 =
        min_of(base::quotient(kCut_q16 * column_e_q16, determinant_q16), kLongest_q16);
    out.half_east_q16 =
        min_of(base::quotient(kCut_q16 * column_n_q16, determinant_q16), kLongest_q16);
  }
  return out;
}

// Fills box, lateral coordinates and depth plane of an event centred at (north, east).
void place(ShellEvent& event, const Scale& scale, const Lateral& lateral, std::int64_t north_q16,
           std::int64_t east_q16, std::int64_t depth_centre_q16, std::int64_t depth_dn_q16,
           std::int64_t depth_de_q16) {
  constexpr std::int64_t kHalf = 0x8000;
  const std::int64_t limit_q16 = (static_cast<std::int64_t>(scale.footprint_cells) << 16) - 1;
  const std::int64_t half_n = min_of(lateral.half_north_q16, limit_q16);
  const std::int64_t half_e = min_of(lateral.half_east_q16, limit_q16);
  const auto first = [](std::int64_t low_q16) {
    return static_cast<std::int64_t>(max_of<std::int64_t>(0, (low_q16 - kHalf + 0xFFFF) >> 16));
  };
  const auto last = [](std::int64_t high_q16, std::int32_t cells) {
    return min_of<std::int64_t>(cells - 1, (high_q16 - kHalf) >> 16);
  };
  constexpr std::int64_t kStep = 1LL << 24;  // 48 steps and the start stay within 32 bits
  const auto step = [](std::int64_t value) {
    return static_cast<std::int32_t>(clamp<std::int64_t>(value, -kStep, kStep));
  };
  event.depth_dn_q16 = step(depth_dn_q16);
  event.depth_de_q16 = step(depth_de_q16);
  event.plane0_q16 =
      depth_centre_q16 +
      ((depth_dn_q16 * (kHalf - north_q16) + depth_de_q16 * (kHalf - east_q16)) >> 16);
  const std::int64_t n0 = first(north_q16 - half_n);
  const std::int64_t n1 = last(north_q16 + half_n, scale.size[0]);
  const std::int64_t e0 = first(east_q16 - half_e);
  const std::int64_t e1 = last(east_q16 + half_e, scale.size[1]);
  if (n0 > n1 || e0 > e1) {
    event.north0 = 0;
    event.north1 = -1;
    event.east0 = 0;
    event.east1 = -1;
    return;
  }
  event.north0 = static_cast<std::int32_t>(n0);
  event.north1 = static_cast<std::int32_t>(n1);
  event.east0 = static_cast<std::int32_t>(e0);
  event.east1 = static_cast<std::int32_t>(e1);
  // Offsets of the first column's centre: at most the footprint, so everything below fits 32 bits.
  const std::int64_t dn = (n0 << 16) + kHalf - north_q16;
  const std::int64_t de = (e0 << 16) + kHalf - east_q16;
  constexpr std::int64_t kRoom = 1LL << 30;
  const auto narrow = [](std::int64_t value) {
    return static_cast<std::int32_t>(clamp<std::int64_t>(value, -kRoom, kRoom));
  };
  event.xi_dn_q16 = step(lateral.m11_q16);
  event.xi_de_q16 = step(lateral.m12_q16);
  event.eta_dn_q16 = step(lateral.m21_q16);
  event.eta_de_q16 = step(lateral.m22_q16);
  event.xi0_q16 = narrow((lateral.m11_q16 * dn + lateral.m12_q16 * de) >> 16);
  event.eta0_q16 = narrow((lateral.m21_q16 * dn + lateral.m22_q16 * de) >> 16);
  event.depth0_q16 = narrow(depth_centre_q16 + ((depth_dn_q16 * dn + depth_de_q16 * de) >> 16));
}

std::uint8_t profile_class(std::int64_t beam_q12, std::int64_t total_q12) {
  if (total_q12 <= 0) {
    return 0;
  }
  const std::int64_t c =
      base::quotient(beam_q12 * (kProfileClasses - 1) + total_q12 / 2, total_q12);
  return static_cast<std::uint8_t>(clamp<std::int64_t>(c, 0, kProfileClasses - 1));
}

std::uint32_t event_weight_q7(std::int64_t min_variance_q12, std::int64_t variance_q12) {
  // 255 units, Q7, for the best ping that the configuration allows, in proportion to information.
  constexpr std::int64_t kBest_q7 = kMaxWeight_q7;
  return static_cast<std::uint32_t>(
      min_of(kBest_q7, base::quotient(kBest_q7 * min_variance_q12, variance_q12)));
}

std::uint16_t saturate_q8(std::int64_t variance_q12) {
  return static_cast<std::uint16_t>(min_of<std::int64_t>(65535, variance_q12 >> 4));
}

}  // namespace

BeamFrame beam_frame(const base::Attitude& attitude, base::Bam32 azimuth_bam32,
                     base::Bam32 elevation_bam32, base::Bam32 rotation_bam32) {
  const std::int64_t sa = base::sin_q30(azimuth_bam32);
  const std::int64_t ca = base::cos_q30(azimuth_bam32);
  const std::int64_t se = base::sin_q30(elevation_bam32);
  const std::int64_t ce = base::cos_q30(elevation_bam32);
  const auto q30 = [](std::int64_t v) { return static_cast<std::int32_t>(v); };
  const Direction axis{{q30((ce * ca) >> 30), q30((ce * sa) >> 30), q30(se)}};
  // Derivatives of the axis by elevation (up-track) and azimuth (sideways): orthonormal with it.
  Direction along{{q30(-((se * ca) >> 30)), q30(-((se * sa) >> 30)), q30(ce)}};
  Direction across{{q30(-sa), q30(ca), 0}};
  if (rotation_bam32 != 0) {
    const std::int64_t sr = base::sin_q30(rotation_bam32);
    const std::int64_t cr = base::cos_q30(rotation_bam32);
    const Direction a = along;
    const Direction b = across;
    for (int i = 0; i < 3; ++i) {
      along.q30[i] = q30((cr * a.q30[i] + sr * b.q30[i]) >> 30);
      across.q30[i] = q30((cr * b.q30[i] - sr * a.q30[i]) >> 30);
    }
  }
  const std::int64_t sr = base::sin_q30(attitude.roll_bam32);
  const std::int64_t cr = base::cos_q30(attitude.roll_bam32);
  const std::int64_t sp = base::sin_q30(attitude.pitch_bam32);
  const std::int64_t cp = base::cos_q30(attitude.pitch_bam32);
  const std::int64_t sh = base::sin_q30(attitude.heading_bam32);
  const std::int64_t ch = base::cos_q30(attitude.heading_bam32);
  return BeamFrame{turn(axis, sr, cr, sp, cp, sh, ch), turn(along, sr, cr, sp, cp, sh, ch),
                   turn(across, sr, cr, sp, cp, sh, ch)};
}

std::uint8_t kernel_level(std::int64_t variance_q12) {
  // level = round(4 log2(variance / 0.25)): octave from the leading bit, quarter by comparison with
  // 2^((2i+1)/8) in Q16.
  constexpr std::int64_t kQuarter_q12 = 1024;
  if (variance_q12 <= kQuarter_q12) {
    return 0;
  }
  const int octave = 53 - base::leading_zeros64(static_cast<std::uint64_t>(variance_q12));
  if (octave >= 6) {
    return kKernelLevels - 1;
  }
  const std::int64_t mantissa_q16 = (variance_q12 << 16) >> (10 + octave);
  constexpr std::int64_t kThreshold_q16[4] = {71468, 84990, 101071, 120194};
  int quarter = 0;
  for (const std::int64_t threshold_q16 : kThreshold_q16) {
    quarter += mantissa_q16 >= threshold_q16 ? 1 : 0;
  }
  return static_cast<std::uint8_t>(min_of(4 * octave + quarter, kKernelLevels - 1));
}

std::int32_t kernel_reach_q16(std::uint8_t level) {
  // 2 sigma = 2^(level / 8) cells; the eighth roots in Q16.
  constexpr std::int32_t kRoot_q16[8] = {65536, 71468, 77936, 84990, 92682, 101071, 110218, 120194};
  const std::int32_t two_sigma_q16 = kRoot_q16[level & 7] << (level >> 3);
  return clamp<std::int32_t>(two_sigma_q16, 98304, 7 << 16);
}

ShellEvent make_shell(const Scale& scale, const LocalizationTable& table, const BeamFrame& frame,
                      const Sighting& sighting, const Slope& slope) {
  const std::int64_t un = frame.axis.q30[0];
  const std::int64_t ue = frame.axis.q30[1];
  const std::int64_t uz = frame.axis.q30[2];
  const std::int64_t range = sighting.range_q16;
  std::int64_t gn = slope.north_q12;
  std::int64_t ge = slope.east_q12;
  std::int64_t steepness_q24 = gn * gn + ge * ge;
  if (steepness_q24 > static_cast<std::int64_t>(kMaxSlope_q12) * kMaxSlope_q12) {
    const auto length =
        static_cast<std::int64_t>(sqrt_u64(static_cast<std::uint64_t>(steepness_q24)));
    gn = gn * kMaxSlope_q12 / length;
    ge = ge * kMaxSlope_q12 / length;
    steepness_q24 = gn * gn + ge * ge;
  }
  const std::int64_t secant2_q24 = (1LL << 24) + steepness_q24;  // 1 + |g|^2
  const auto secant_q12 =
      static_cast<std::int64_t>(sqrt_u64(static_cast<std::uint64_t>(secant2_q24)));
  // cos(incidence) * secant: the vertical drop to the plane per unit of range along the axis.
  const std::int64_t drop_q30 = uz - ((gn * un + ge * ue) >> 12);
  const std::int64_t range2_q6 = (range * range) >> 26;  // cells^2, range < 8000 cells: 32 bits
  const auto scaled_q12 = [range2_q6](std::int64_t variance_q30) {
    return mul_shift(range2_q6, variance_q30, 24);
  };
  const std::int64_t pointing_q12 = scaled_q12(table.pointing_variance_q30);
  const std::int64_t position_n_q12 = sighting.position_variance_q12[0] >> kPositionShareShift;
  const std::int64_t position_e_q12 = sighting.position_variance_q12[1] >> kPositionShareShift;

  ShellEvent event{};
  const std::int64_t end_n = sighting.origin_q16[0] + mul_shift(range, un, 30);
  const std::int64_t end_e = sighting.origin_q16[1] + mul_shift(range, ue, 30);

  if (drop_q30 < mul_shift(kGrazingCosine_q30, secant_q12, 12)) {
    event.wall = true;
    const auto horizontal_q30 =
        static_cast<std::int64_t>(sqrt_u64(static_cast<std::uint64_t>(un * un + ue * ue)));
    std::int64_t hn = 1 << 14;  // Q14 unit vector, any direction when the beam is vertical
    std::int64_t he = 0;
    std::int64_t rise_q12 = 0;  // depth per horizontal cell along the beam
    if (horizontal_q30 > (1 << 20)) {
      hn = un * (1 << 14) / horizontal_q30;
      he = ue * (1 << 14) / horizontal_q30;
      rise_q12 =
          clamp<std::int64_t>(uz * (1 << 12) / horizontal_q30, -kMaxSlope_q12, kMaxSlope_q12);
    }
    const std::int64_t patch_q12 = scaled_q12(table.beam_variance_across_q30);
    const std::int64_t lateral_q12 = patch_q12 + pointing_q12;
    const std::int64_t radial_q12 = mul_shift(scale.sigma_range_q12, scale.sigma_range_q12, 12);
    const std::int64_t c11 = radial_q12 +
                             ((hn * hn * position_n_q12 + he * he * position_e_q12) >> 28) +
                             kCellVariance_q12;
    const std::int64_t c22 = lateral_q12 +
                             ((he * he * position_n_q12 + hn * hn * position_e_q12) >> 28) +
                             kCellVariance_q12;
    const Lateral lateral = whiten(hn, he, -he, hn, c11, 0, c22);
    const std::int64_t variance_q12 = scaled_q12(table.beam_variance_along_q30) + pointing_q12 +
                                      sighting.position_variance_q12[2] + kFloorVariance_q12;
    event.level = kernel_level(variance_q12);
    event.weight_q7 = event_weight_q7(
        scale.min_variance_q12, max_of(radial_q12 + kFloorVariance_q12, scale.min_variance_q12));
    event.profile_class = profile_class(patch_q12, c22);
    event.blur_q8 = saturate_q8(c22 + position_n_q12 + position_e_q12);
    place(event, scale, lateral, end_n, end_e, sighting.origin_q16[2] + mul_shift(range, uz, 30),
          (rise_q12 * hn) >> 10, (rise_q12 * he) >> 10);
    const auto radial_sigma_q12 =
        static_cast<std::int64_t>(sqrt_u64(static_cast<std::uint64_t>(c11) << 12U));
    // Two radial deviations before a standing shell; before one that the beam meets from above or below,
    // the reach of its kernel.
    const std::int64_t uz_abs = uz < 0 ? -uz : uz;
    const std::int64_t clearance_q10 =
        max_of(mul_shift(radial_sigma_q12 >> 1, horizontal_q30, 30),
               mul_shift(kernel_reach_q16(event.level) >> 6, uz_abs, 30));
    event.empty_range_q10 =
        static_cast<std::int32_t>(max_of<std::int64_t>(0, (range >> 6) - clearance_q10));
    return event;
  }

  // sin^2(incidence) = 1 - drop^2 / (1 + |g|^2)
  const std::int64_t drop2_q24 = mul_shift(drop_q30, drop_q30, 36);
  const std::int64_t sine2_q24 =
      max_of<std::int64_t>(0, base::quotient((secant2_q24 - drop2_q24) << 24, secant2_q24));
  const std::uint32_t sine_q12 = sqrt_u64(static_cast<std::uint64_t>(sine2_q24));
  const std::int64_t inverse_secant_q16 = (1 << 28) / static_cast<std::int32_t>(secant_q12);
  const std::int64_t cosine_q30 = mul_shift(drop_q30, inverse_secant_q16, 16);
  // Uphill direction across the beam, length sin(incidence): down-normal minus its axis part.
  const std::int64_t gsn_q30 = gn * inverse_secant_q16 * 4;
  const std::int64_t gse_q30 = ge * inverse_secant_q16 * 4;
  const std::int64_t uphill_n = -gsn_q30 - mul_shift(cosine_q30, un, 30);
  const std::int64_t uphill_e = -gse_q30 - mul_shift(cosine_q30, ue, 30);

  FirstReturn first = first_return(table.first_return[0], sine_q12);
  std::int64_t patch_along_q30 = first.patch_variance_q30;
  std::int64_t patch_across_q30 = first.patch_variance_q30;
  if (table.two_axis != 0 && sine_q12 > 0) {
    // Blend the two planes of incidence by the squared share of the uphill direction along `along`.
    const std::int64_t uphill_z = (inverse_secant_q16 << 14) - mul_shift(cosine_q30, uz, 30);
    const std::int64_t share = dot_q30(uphill_n, uphill_e, frame.along.q30[0], frame.along.q30[1]) +
                               mul_shift(uphill_z, frame.along.q30[2], 30);
    const std::int64_t share_q12 = clamp<std::int64_t>(
        (share >> 18) * (1 << 12) / static_cast<std::int64_t>(sine_q12), -4096, 4096);
    const std::int64_t along_q12 = (share_q12 * share_q12) >> 12;
    const FirstReturn second = first_return(table.first_return[1], sine_q12);
    const auto blend = [along_q12](std::int64_t along, std::int64_t across) {
      return across + (((along - across) * along_q12) >> 12);
    };
    patch_along_q30 = blend(first.patch_variance_q30, table.beam_variance_along_q30);
    patch_across_q30 = blend(table.beam_variance_across_q30, second.patch_variance_q30);
    first.excess_q30 = blend(first.excess_q30, second.excess_q30);
    first.slope_q20 = blend(first.slope_q20, second.slope_q20);
    first.shift_q20 = blend(first.shift_q20, second.shift_q20);
  }

  // Plane through the shell: depth over the point right below the transducer, then along the slope.
  const std::int64_t excess_drop_q30 = mul_shift(first.excess_q30, secant_q12, 12);
  const std::int64_t below_q16 =
      sighting.origin_q16[2] + mul_shift(range, drop_q30 + excess_drop_q30, 30);
  const std::int64_t shift_q16 = mul_shift(range, first.shift_q20, 20);
  const std::int64_t centre_n = end_n + mul_shift(shift_q16, uphill_n, 30);
  const std::int64_t centre_e = end_e + mul_shift(shift_q16, uphill_e, 30);
  const std::int64_t centre_depth_q16 = below_q16 +
                                        mul_shift(gn, centre_n - sighting.origin_q16[0], 12) +
                                        mul_shift(ge, centre_e - sighting.origin_q16[1], 12);

  // Vertical variance: range, position and pointing errors projected, terrain inside the footprint.
  const std::int64_t reach_q14 = (drop_q30 + excess_drop_q30) >> 16;
  const std::int64_t range_sigma_q12 = mul_shift(scale.sigma_range_q12, reach_q14, 14);
  const std::int64_t slope_q12 = first.slope_q20 >> 8;
  const std::int64_t pointing_vertical_q12 =
      mul_shift(mul_shift(pointing_q12, slope_q12 * slope_q12, 24), secant2_q24, 24);
  const std::int64_t growing_q12 =
      pointing_vertical_q12 + (scaled_q12(table.beam_variance_along_q30) >> 3);
  const std::int64_t variance_q12 =
      mul_shift(range_sigma_q12, range_sigma_q12, 12) + sighting.position_variance_q12[2] +
      mul_shift(gn * gn, sighting.position_variance_q12[0], 24) +
      mul_shift(ge * ge, sighting.position_variance_q12[1], 24) + growing_q12 + kFloorVariance_q12;

  // Lateral covariance in the beam's footprint axes, written as forms of the horizontal offset.
  const auto form = [gn, ge](const Direction& d, std::int64_t& n_q14, std::int64_t& e_q14) {
    n_q14 = (d.q30[0] + mul_shift(gn, d.q30[2], 12)) >> 16;
    e_q14 = (d.q30[1] + mul_shift(ge, d.q30[2], 12)) >> 16;
  };
  std::int64_t b1n = 0;
  std::int64_t b1e = 0;
  std::int64_t b2n = 0;
  std::int64_t b2e = 0;
  form(frame.along, b1n, b1e);
  form(frame.across, b2n, b2e);
  const std::int64_t along_q12 = scaled_q12(patch_along_q30) + pointing_q12;
  const std::int64_t across_q12 = scaled_q12(patch_across_q30) + pointing_q12;
  const std::int64_t spread_n_q12 = position_n_q12 + kCellVariance_q12;
  const std::int64_t spread_e_q12 = position_e_q12 + kCellVariance_q12;
  const std::int64_t c11 =
      along_q12 + ((b1n * b1n * spread_n_q12 + b1e * b1e * spread_e_q12) >> 28);
  const std::int64_t c22 =
      across_q12 + ((b2n * b2n * spread_n_q12 + b2e * b2e * spread_e_q12) >> 28);
  const std::int64_t c12 = (b1n * b2n * spread_n_q12 + b1e * b2e * spread_e_q12) >> 28;
  const Lateral lateral = whiten(b1n, b1e, b2n, b2e, c11, c12, c22);

  event.level = kernel_level(variance_q12);
  event.weight_q7 =
      event_weight_q7(scale.min_variance_q12, max_of(variance_q12, scale.min_variance_q12));
  event.profile_class = profile_class(scaled_q12(patch_along_q30), c11);
  event.blur_q8 = saturate_q8((c11 + c22) / 2 + position_n_q12 + position_e_q12);
  place(event, scale, lateral, centre_n, centre_e, centre_depth_q16, gn * 16, ge * 16);
  const auto growth_q24 = static_cast<std::uint32_t>(
      min_of<std::int64_t>(base::quotient(growing_q12 << 24, variance_q12), 1 << 24));
  event.growth_q24 = growth_q24 < kLeastGrowth_q24 ? 0 : growth_q24;
  event.empty_range_q10 = static_cast<std::int32_t>(range >> 6);
  return event;
}

std::uint32_t peak_gain_q8(std::uint32_t growth_q24, std::uint32_t share_q16) {
  return peak_gain_inline_q8(growth_q24, share_q16);
}

std::int32_t cone_growth_q20(std::int32_t tan_q20, std::int32_t range_q10) {
  const std::int64_t end_q10 = mul_shift(tan_q20, range_q10, 20);
  if (end_q10 <= kTouch_q10 || range_q10 <= 0) {
    return kLeastGrowth_q20;
  }
  return static_cast<std::int32_t>(max_of<std::int64_t>(
      base::quotient((end_q10 - kTouch_q10) << 20, range_q10), kLeastGrowth_q20));
}

Cone make_cone(const Scale& scale, const Direction& axis, std::int32_t range_q10) {
  Cone cone{};
  const std::int64_t un = axis.q30[0];
  const std::int64_t ue = axis.q30[1];
  cone.down_q30 = axis.q30[2];
  cone.horizontal_q30 =
      static_cast<std::int32_t>(sqrt_u64(static_cast<std::uint64_t>(un * un + ue * ue)));
  if (cone.horizontal_q30 > (1 << 12)) {
    cone.heading_north_q20 =
        static_cast<std::int32_t>(base::quotient(un * (1 << 20), cone.horizontal_q30));
    cone.heading_east_q20 =
        static_cast<std::int32_t>(base::quotient(ue * (1 << 20), cone.horizontal_q30));
  } else {
    cone.heading_north_q20 = 1 << 20;
    cone.heading_east_q20 = 0;
  }
  cone.growth_q20 = cone_growth_q20(scale.cone_tan_q20, range_q10);
  cone.touch_growth_q20 = static_cast<std::int32_t>(mul_shift(cone.growth_q20, kTouch_q10, 10));
  cone.range_q10 = range_q10;
  cone.radius_q10 =
      kTouch_q10 + static_cast<std::int32_t>(mul_shift(cone.growth_q20, range_q10, 20));
  const std::int64_t growth_down_q30 = mul_shift(cone.growth_q20, cone.down_q30, 20);
  cone.a_q30 = mul_shift(cone.horizontal_q30, cone.horizontal_q30, 30) -
               mul_shift(growth_down_q30 >> 4, growth_down_q30 >> 4, 22);
  cone.a_q24 = static_cast<std::int32_t>(cone.a_q30 >> 6);
  // 1/4096: a flatter axis leaves its end upright, which over a radius of 40 cells is a hundredth of one.
  cone.inverse_a_q16 = cone.a_q30 > -(1 << 20) && cone.a_q30 < (1 << 20)
                           ? 0
                           : static_cast<std::int32_t>(base::quotient(1LL << 46, cone.a_q30));
  constexpr std::int32_t kLevel_q30 = 1 << 18;
  cone.inverse_down_q12 = cone.down_q30 > kLevel_q30 || cone.down_q30 < -kLevel_q30
                              ? static_cast<std::int32_t>(base::quotient(1LL << 42, cone.down_q30))
                              : 0;
  // Largest B and C of any column that the cone can reach; a beam of 80 degrees has a growth of 5.7.
  const auto bits = [](std::int64_t value) {
    return 64 - base::leading_zeros64(static_cast<std::uint64_t>(value < 0 ? -value : value));
  };
  const std::int64_t reach_q10 = range_q10 + cone.radius_q10;
  const std::int64_t growth2_q20 = mul_shift(cone.growth_q20, cone.growth_q20, 20);
  const int bits_b = bits(mul_shift(reach_q10, (1LL << 20) + growth2_q20, 10)) + 1;
  const int bits_c = 2 * bits(mul_shift(reach_q10, (1LL << 20) + cone.growth_q20, 20)) + 1;
  cone.drop = max_of(0, max_of(bits_b - 31, (bits(cone.a_q30 >> 6) + bits_c - 61) / 2));
  // The root is at most as large as B where the transducer is outside the column, else B and |A C|^1/2.
  cone.narrow = cone.drop == 0 && bits_b <= 29 && bits_c <= 60;
  return cone;
}

ColumnSpan wide_cone_span(const Cone& cone, std::int32_t x_q10, std::int32_t y_q10) {
  constexpr ColumnSpan kOutside{1, 0};
  // |x| < 16000 cells: p_q20 below 2^34.
  const std::int64_t p_q20 = mul_shift(cone.horizontal_q30, x_q10, 20);
  const std::int64_t gp_q20 = mul_shift(cone.growth_q20, p_q20, 20);
  // (1 + g^2) p below 2^38: 8000 cells of an 80 degree beam.
  const std::int64_t b_q20 =
      mul_shift(cone.down_q30 >> 6,
                p_q20 + mul_shift(cone.growth_q20, gp_q20, 20) + cone.touch_growth_q20, 24);
  // Lengths of 32 bits from here on: the radius is below 2^26, of a point beyond the cone's end below 2^29.
  const auto sx_q10 = static_cast<std::int32_t>(mul_shift(cone.down_q30, x_q10, 30));
  const auto radius_q10 = static_cast<std::int32_t>(kTouch_q10 + (gp_q20 >> 10));
  const std::int64_t c_q20 = mul_shift(sx_q10, sx_q10, 0) + mul_shift(y_q10, y_q10, 0) -
                             mul_shift(radius_q10, radius_q10, 0);
  const std::int64_t b_short = b_q20 >> cone.drop;
  std::int64_t disc_q40 =
      mul_shift(b_short, b_short, 0) - mul_shift(cone.a_q24, c_q20 >> (2 * cone.drop), 4);
  if (disc_q40 < 0) {
    if (cone.a_q30 >= 0) {
      return kOutside;
    }
    // A vertical inside the opening always meets the cone: near the axis of a vertical beam the
    // discriminant, g^2 times the squared offset, is a small difference that rounding turns negative.
    disc_q40 = 0;
  }
  const auto root_q20 = static_cast<std::int64_t>(sqrt_u64(static_cast<std::uint64_t>(disc_q40)))
                        << cone.drop;
  // The two roots without cancellation: q / A and C / q.
  const std::int64_t q_q20 = b_q20 >= 0 ? b_q20 + root_q20 : b_q20 - root_q20;
  const std::int32_t one_q10 = q_q20 == 0 ? 0 : limited_q10(c_q20 * (1 << 10) / q_q20);
  // |q| < 2^39 (8000 cells of an 80 degree beam), 1/A < 2^26: less 6 bits, below 2^59. Close to the
  // vertical A is small and worth a division.
  std::int32_t other_q10 = (q_q20 >= 0) == (cone.a_q30 >= 0) ? kFar_q10 : -kFar_q10;
  if (cone.inverse_a_q16 != 0) {
    other_q10 = limited_q10(mul_shift(q_q20 >> 6, cone.inverse_a_q16, 20));
  } else if (cone.a_q30 <= -16 || cone.a_q30 >= 16) {
    other_q10 = limited_q10(mul_shift(q_q20, 1 << 20, 0) / cone.a_q30);
  }
  ColumnSpan span{min_of(one_q10, other_q10), max_of(one_q10, other_q10)};
  if (cone.a_q30 < 0) {
    // The vertical runs inside the opening: forward of the farther root only.
    span = cone.down_q30 > 0 ? ColumnSpan{span.bottom_q10, kFar_q10}
                             : ColumnSpan{-kFar_q10, span.top_q10};
  }
  // Slant distance p + s z between the transducer and the end.
  const auto p_q10 = static_cast<std::int32_t>(p_q20 >> 10);
  if (cone.inverse_down_q12 != 0) {
    const std::int32_t at_start = limited_q10(mul_shift(-p_q10, cone.inverse_down_q12, 12));
    const std::int32_t at_end =
        limited_q10(mul_shift(cone.range_q10 - p_q10, cone.inverse_down_q12, 12));
    span.top_q10 = max_of(span.top_q10, min_of(at_start, at_end));
    span.bottom_q10 = min_of(span.bottom_q10, max_of(at_start, at_end));
  } else if (p_q10 < 0 || p_q10 > cone.range_q10) {
    return kOutside;
  }
  return span;
}

ColumnSpan cone_span(const Cone& cone, std::int32_t x_q10, std::int32_t y_q10) {
  return cone_span_inline(cone, x_q10, y_q10);
}

}  // namespace leadline::model
