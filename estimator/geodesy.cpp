#include "estimator/geodesy.hpp"

#include "estimator/wide.hpp"

namespace leadline::estimator {
namespace {

using base::Result;
using base::Status;

// Sines, angles in radians and pure numbers carry 44 fraction bits: 4e-7 um on the Earth's radius.
constexpr int kBits = 44;
constexpr std::int64_t kOne = std::int64_t{1} << kBits;

constexpr std::int64_t kSemiMajor_um = 6'378'137'000'000;
constexpr std::int64_t kEccentricity2 = 117'768'778'239;  // e^2 = f (2 - f), f = 1 / 298.257223563
constexpr std::int64_t kSecondEccentricity2 = 118'562'480'536;  // e'^2 = e^2 / (1 - e^2)
// Meridian arc: kArc0 phi - kArc2 sin 2phi + kArc4 sin 4phi - ..., of the third flattening n = f / (2 - f).
constexpr std::int64_t kArc0_um = 6'367'449'145'823;
constexpr std::int64_t kArc2_um = 16'038'508'663;
constexpr std::int64_t kArc4_um = 16'832'613;
constexpr std::int64_t kArc6_um = 21'984;
constexpr std::int64_t kArc8_um = 31;

constexpr std::int64_t kRadian_q74 = 329'683'374'448;  // of 1e-9 degree
constexpr std::int64_t kRadian_e9deg = 57'295'779'513;
constexpr std::int64_t kBam32PerRadian_q20 = 716'770'142'402'832;
constexpr std::int64_t kQuarterTurn_e9deg = 90'000'000'000;

std::int64_t times(std::int64_t a, std::int64_t b) { return mul_round(a, b, kBits); }

std::int64_t radians(std::int64_t angle_e9deg) { return mul_round(angle_e9deg, kRadian_q74, 30); }

// sin or cos of |x| <= pi / 4 by Taylor's series: 15 or 14 powers, end below 2^-44.
std::int64_t taylor(std::int64_t x, bool sine) {
  const std::int64_t square = times(x, x);
  std::int64_t term = sine ? x : kOne;
  std::int64_t sum = term;
  for (std::int64_t k = sine ? 2 : 1; k <= 14; k += 2) {
    term = -times(term, square) / (k * (k + 1));
    sum += term;
  }
  return sum;
}

struct SineCosine {
  std::int64_t sine;
  std::int64_t cosine;
};

// |latitude| <= 90 degrees.
SineCosine sine_cosine(std::int64_t latitude_e9deg) {
  const bool south = latitude_e9deg < 0;
  const std::int64_t north_e9deg = south ? -latitude_e9deg : latitude_e9deg;
  const bool steep = north_e9deg > kQuarterTurn_e9deg / 2;
  const std::int64_t x = radians(steep ? kQuarterTurn_e9deg - north_e9deg : north_e9deg);
  const std::int64_t sine = taylor(x, !steep);
  return SineCosine{south ? -sine : sine, taylor(x, steep)};
}

std::int64_t meridian_arc_um(std::int64_t latitude_e9deg, const SineCosine& at) {
  const std::int64_t s2 = 2 * times(at.sine, at.cosine);
  const std::int64_t c2 = times(at.cosine, at.cosine) - times(at.sine, at.sine);
  const std::int64_t s4 = 2 * times(s2, c2);
  const std::int64_t c4 = times(c2, c2) - times(s2, s2);
  const std::int64_t s6 = times(s4, c2) + times(c4, s2);
  const std::int64_t s8 = 2 * times(s4, c4);
  return times(kArc0_um, radians(latitude_e9deg)) - times(kArc2_um, s2) + times(kArc4_um, s4) -
         times(kArc6_um, s6) + times(kArc8_um, s8);
}

// Radii of curvature in the prime vertical and in the meridian, from powers of x = e^2 sin^2 phi <= 0.0067:
// (1 - x)^(-1/2) and its cube.
struct Radii {
  std::int64_t prime_um;
  std::int64_t meridian_um;
};

Radii radii(const SineCosine& at) {
  const std::int64_t x = times(kEccentricity2, times(at.sine, at.sine));
  std::int64_t term = kOne;
  std::int64_t sum = kOne;
  for (std::int64_t k = 1; k <= 5; ++k) {
    term = times(term, x) * (2 * k - 1) / (2 * k);
    sum += term;
  }
  const std::int64_t cube = times(sum, times(sum, sum));
  return Radii{times(kSemiMajor_um, sum), times(times(kSemiMajor_um, kOne - kEccentricity2), cube)};
}

std::int64_t wrapped_longitude(std::int64_t difference_e9deg) {
  constexpr std::int64_t kTurn = 2 * kMaxLongitude_e9deg;
  if (difference_e9deg > kMaxLongitude_e9deg) {
    return difference_e9deg - kTurn;
  }
  return difference_e9deg < -kMaxLongitude_e9deg ? difference_e9deg + kTurn : difference_e9deg;
}

bool within(std::int64_t value, std::int64_t limit) { return value >= -limit && value <= limit; }

// The projection of a point at longitude difference l (radians) without the origin's arc: the classic series
// in l, with powers of cos phi multiplied in, so that nothing is divided by it.
//   east  = N c l [1 + l^2/6 (c^2 - s^2 + c^4 e'^2)
//                    + l^4/120 (5 c^4 - 18 s^2 c^2 + s^4 + c^4 e'^2 (14 c^2 - 58 s^2))
//                    + l^6/5040 (61 c^6 - 479 s^2 c^4 + 179 s^4 c^2 - s^6)]
//   north = N s c l^2/2 [1 + l^2/12 (5 c^2 - s^2 + 9 h c^2 + 4 h^2 c^2)
//                          + l^4/360 (61 c^4 - 58 s^2 c^2 + s^4)
//                          + l^6/20160 (1385 c^6 - 3111 s^2 c^4 + 543 s^4 c^2 - s^6)],  h = e'^2 c^2
struct Offset {
  std::int64_t north_um;  // beyond the arc of the point's own latitude
  std::int64_t east_um;
  std::int64_t convergence;  // radians
};

Offset project(const SineCosine& at, std::int64_t l) {
  const std::int64_t s = at.sine;
  const std::int64_t c = at.cosine;
  const std::int64_t s2 = times(s, s);
  const std::int64_t c2 = times(c, c);
  const std::int64_t s2c2 = times(s2, c2);
  const std::int64_t s4 = times(s2, s2);
  const std::int64_t c4 = times(c2, c2);
  const std::int64_t h = times(kSecondEccentricity2, c2);
  const std::int64_t l2 = times(l, l);
  const std::int64_t l4 = times(l2, l2);
  const std::int64_t l6 = times(l4, l2);
  const std::int64_t c6 = times(c4, c2);
  const std::int64_t s6 = times(s4, s2);
  const std::int64_t s2c4 = times(s2, c4);
  const std::int64_t s4c2 = times(s4, c2);
  const std::int64_t prime_um = radii(at).prime_um;

  const std::int64_t east_third = times(l2, c2 - s2 + times(h, c2)) / 6;
  const std::int64_t east_fifth =
      times(l4, 5 * c4 - 18 * s2c2 + s4 + times(h, 14 * c4 - 58 * s2c2)) / 120;
  const std::int64_t east_seventh = times(l6, 61 * c6 - 479 * s2c4 + 179 * s4c2 - s6) / 5040;
  const std::int64_t north_fourth =
      times(l2, 5 * c2 - s2 + times(9 * h + 4 * times(h, h), c2)) / 12;
  const std::int64_t north_sixth = times(l4, 61 * c4 - 58 * s2c2 + s4) / 360;
  const std::int64_t north_eighth = times(l6, 1385 * c6 - 3111 * s2c4 + 543 * s4c2 - s6) / 20160;
  // Convergence to third order: l s [1 + l^2/3 c^2 (1 + 3 h + 2 h^2)].
  const std::int64_t turn = times(l2, times(c2, kOne + 3 * h + 2 * times(h, h))) / 3;

  const std::int64_t lc = times(l, c);
  Offset offset{};
  offset.east_um = times(prime_um, times(lc, kOne + east_third + east_fifth + east_seventh));
  offset.north_um =
      times(prime_um,
            times(times(lc, times(l, s)), kOne + north_fourth + north_sixth + north_eighth) / 2);
  offset.convergence = times(times(l, s), kOne + turn);
  return offset;
}

}  // namespace

Status LocalPlane::configure(const Geodetic& origin) {
  if (!within(origin.latitude_e9deg, kMaxLatitude_e9deg) ||
      !within(origin.longitude_e9deg, kMaxLongitude_e9deg)) {
    return Status::kOutOfRange;
  }
  origin_ = origin;
  origin_arc_um_ = meridian_arc_um(origin.latitude_e9deg, sine_cosine(origin.latitude_e9deg));
  configured_ = true;
  return Status::kOk;
}

Result<PlanePoint> LocalPlane::to_plane(const Geodetic& point) const {
  if (!configured_) {
    return Status::kNotReady;
  }
  if (!within(point.latitude_e9deg, kMaxLatitude_e9deg) ||
      !within(point.longitude_e9deg, kMaxLongitude_e9deg)) {
    return Status::kOutOfRange;
  }
  const SineCosine at = sine_cosine(point.latitude_e9deg);
  const std::int64_t l =
      radians(wrapped_longitude(point.longitude_e9deg - origin_.longitude_e9deg));
  // Coarse reach first: the series makes no sense far away. 5 % of the Earth's radius is 319 km.
  if (!within(times(l, at.cosine), kOne / 20)) {
    return Status::kOutOfRange;
  }
  const Offset offset = project(at, l);
  const std::int64_t north_um =
      meridian_arc_um(point.latitude_e9deg, at) - origin_arc_um_ + offset.north_um;
  if (!within(north_um, kMaxReach_um) || !within(offset.east_um, kMaxReach_um)) {
    return Status::kOutOfRange;
  }
  const std::int64_t turn_bam = mul_round(offset.convergence, kBam32PerRadian_q20, kBits + 18) / 4;
  return PlanePoint{north_um, offset.east_um, static_cast<std::int32_t>(turn_bam)};
}

Result<Geodetic> LocalPlane::to_geodetic(std::int64_t north_um, std::int64_t east_um) const {
  if (!configured_) {
    return Status::kNotReady;
  }
  if (!within(north_um, kMaxReach_um) || !within(east_um, kMaxReach_um)) {
    return Status::kOutOfRange;
  }
  // Newton's steps on the projection itself, whose first derivatives are the radii of curvature turned by
  // the convergence: all but the scale, so that each step leaves a thousandth of the error before.
  constexpr int kSteps = 8;
  std::int64_t latitude = origin_.latitude_e9deg;
  std::int64_t difference = 0;  // of longitude
  for (int step = 0; step < kSteps; ++step) {
    const SineCosine at = sine_cosine(latitude);
    const Offset offset = project(at, radians(difference));
    const std::int64_t dn =
        north_um - (meridian_arc_um(latitude, at) - origin_arc_um_ + offset.north_um);
    const std::int64_t de = east_um - offset.east_um;
    const Radii radius = radii(at);
    const std::int64_t s = taylor(offset.convergence, true);
    const std::int64_t c = taylor(offset.convergence, false);
    latitude += mul_div(times(c, dn) - times(s, de), kRadian_e9deg, radius.meridian_um);
    difference +=
        mul_div(times(c, de) + times(s, dn), kRadian_e9deg, times(radius.prime_um, at.cosine));
    if (!within(latitude, kMaxLatitude_e9deg)) {
      return Status::kOutOfRange;
    }
  }
  return Geodetic{latitude, wrapped_longitude(origin_.longitude_e9deg + difference)};
}

}  // namespace leadline::estimator
