// The plane against the projection's exact series in long double: Krueger's in n, of eighth order where the
// product has Redfearn's in longitude.
#include <cmath>
#include <cstdint>

#include "estimator/geodesy.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::base::Status;
using leadline::estimator::Geodetic;
using leadline::estimator::kMaxLatitude_e9deg;
using leadline::estimator::kMaxLongitude_e9deg;
using leadline::estimator::kPlaneErrorFar_um;
using leadline::estimator::kPlaneErrorNear_um;
using leadline::estimator::LocalPlane;
using leadline::estimator::PlanePoint;
using leadline::test::Random;

using Real = long double;

constexpr Real kPi = 3.14159265358979323846264338327950288L;
constexpr Real kA = 6378137.0L;
constexpr Real kF = 1.0L / 298.257223563L;

struct Reference {
  Real north_m;
  Real east_m;
  Real convergence_rad;
};

// Transverse Mercator, k = 1: L. Krueger 1912, coefficients as in Karney 2011 (to n^4).
Reference reference(Real latitude_deg, Real longitude_deg) {
  const Real n = kF / (2 - kF);
  const Real e = std::sqrt(kF * (2 - kF));
  const Real radius = kA / (1 + n) * (1 + n * n / 4 + n * n * n * n / 64);
  const Real alpha[4] = {n / 2 - 2 * n * n / 3 + 5 * n * n * n / 16 + 41 * n * n * n * n / 180,
                         13 * n * n / 48 - 3 * n * n * n / 5 + 557 * n * n * n * n / 1440,
                         61 * n * n * n / 240 - 103 * n * n * n * n / 140,
                         49561 * n * n * n * n / 161280};
  const Real phi = latitude_deg * kPi / 180;
  const Real lambda = longitude_deg * kPi / 180;
  const Real tau = std::tan(phi);
  const Real sigma = std::sinh(e * std::atanh(e * tau / std::sqrt(1 + tau * tau)));
  const Real tau1 = tau * std::sqrt(1 + sigma * sigma) - sigma * std::sqrt(1 + tau * tau);
  const Real xi1 = std::atan2(tau1, std::cos(lambda));
  const Real eta1 =
      std::asinh(std::sin(lambda) / std::sqrt(tau1 * tau1 + std::cos(lambda) * std::cos(lambda)));
  Real xi = xi1;
  Real eta = eta1;
  Real p = 1;
  Real q = 0;
  for (int j = 1; j <= 4; ++j) {
    xi += alpha[j - 1] * std::sin(2 * j * xi1) * std::cosh(2 * j * eta1);
    eta += alpha[j - 1] * std::cos(2 * j * xi1) * std::sinh(2 * j * eta1);
    p += 2 * j * alpha[j - 1] * std::cos(2 * j * xi1) * std::cosh(2 * j * eta1);
    q += 2 * j * alpha[j - 1] * std::sin(2 * j * xi1) * std::sinh(2 * j * eta1);
  }
  const Real convergence =
      std::atan(tau1 / std::sqrt(1 + tau1 * tau1) * std::tan(lambda)) + std::atan2(q, p);
  return Reference{radius * xi, radius * eta, convergence};
}

Real difference_deg(std::int64_t longitude, std::int64_t origin) {
  Real d = static_cast<Real>(longitude - origin) / 1e9L;
  d += d > 180 ? -360 : (d < -180 ? 360 : 0);
  return d;
}

constexpr std::int64_t kLatitudes_deg[] = {-85, -72, -45, -12, 0, 1, 33, 47, 60, 78, 84, 85};

TEST(plane_agrees_with_the_exact_projection) {
  Random random(1);
  long double worst_near = 0;
  long double worst_far = 0;
  long double worst_far_below_80 = 0;
  long double worst_turn_near = 0;
  long double worst_turn_far = 0;
  int tried = 0;
  for (const std::int64_t latitude : kLatitudes_deg) {
    for (int i = 0; i < 4000; ++i) {
      LocalPlane plane;
      const Geodetic origin{
          latitude * 1'000'000'000 - (latitude > 0 ? 1 : -1) * random.between(0, 999'999'999),
          random.between(-kMaxLongitude_e9deg, kMaxLongitude_e9deg)};
      assert_int_equal(plane.configure(origin), Status::kOk);
      const Real cosine = std::cos(static_cast<Real>(origin.latitude_e9deg) / 1e9L * kPi / 180);
      const auto reach_e9deg = static_cast<std::int64_t>(2.69e9L / cosine);
      Geodetic point{origin.latitude_e9deg + random.between(-2'690'000'000, 2'690'000'000),
                     origin.longitude_e9deg + random.between(-reach_e9deg, reach_e9deg)};
      point.longitude_e9deg += point.longitude_e9deg > kMaxLongitude_e9deg ? -360'000'000'000 : 0;
      point.longitude_e9deg += point.longitude_e9deg < -kMaxLongitude_e9deg ? 360'000'000'000 : 0;
      const auto result = plane.to_plane(point);
      if (!result.ok()) {
        continue;
      }
      ++tried;
      const Real l = difference_deg(point.longitude_e9deg, origin.longitude_e9deg);
      const Reference there = reference(static_cast<Real>(point.latitude_e9deg) / 1e9L, l);
      const Reference start = reference(static_cast<Real>(origin.latitude_e9deg) / 1e9L, 0);
      const Real dn = std::fabs(static_cast<Real>(result.value().north_um) -
                                (there.north_m - start.north_m) * 1e6L);
      const Real de = std::fabs(static_cast<Real>(result.value().east_um) - there.east_m * 1e6L);
      const Real turn =
          std::fabs(static_cast<Real>(result.value().convergence_bam32) * 2 * kPi / 4294967296.0L -
                    there.convergence_rad);
      const bool near = std::fabs(there.east_m) <= 100'000;
      (near ? worst_near : worst_far) = std::max(near ? worst_near : worst_far, std::max(dn, de));
      if (!near && latitude > -80 && latitude < 80) {
        worst_far_below_80 = std::max(worst_far_below_80, std::max(dn, de));
      }
      (near ? worst_turn_near : worst_turn_far) =
          std::max(near ? worst_turn_near : worst_turn_far, turn);
    }
  }
  print_message(
      "%d points: worst %.1Lf um within 100 km, %.1Lf um beyond; convergence %.2Lg, %.2Lg rad\n",
      tried, worst_near, worst_far, worst_turn_near, worst_turn_far);
  assert_true(tried > 30'000);
  assert_true(worst_near <= kPlaneErrorNear_um);
  assert_true(worst_far <= kPlaneErrorFar_um);
  assert_true(worst_far_below_80 <= 5'000);
  assert_true(worst_turn_near < 1e-6L);
  assert_true(worst_turn_far < 3e-5L);
}

TEST(there_and_back_is_the_same_place) {
  Random random(2);
  for (const std::int64_t latitude : kLatitudes_deg) {
    LocalPlane plane;
    const Geodetic origin{latitude * 1'000'000'000, 179'999'000'000};
    assert_int_equal(plane.configure(origin), Status::kOk);
    for (int i = 0; i < 1000; ++i) {
      const std::int64_t north = random.between(-250'000'000'000, 250'000'000'000);
      const std::int64_t east = random.between(-250'000'000'000, 250'000'000'000);
      const auto place = plane.to_geodetic(north, east);
      if (!place.ok()) {
        assert_true(latitude > 80 || latitude < -80);  // beyond the last latitude
        continue;
      }
      assert_true(std::abs(place.value().longitude_e9deg) <= kMaxLongitude_e9deg);
      const auto back = plane.to_plane(place.value());
      assert_true(back.ok());
      // 2e-9 degrees of arc are 0.22 mm.
      if (std::abs(back.value().north_um - north) > 230 ||
          std::abs(back.value().east_um - east) > 230) {
        const auto whole = [](std::int64_t value) { return static_cast<long long>(value); };
        fail_msg("latitude %lld: %lld, %lld um comes back as %lld, %lld", whole(latitude),
                 whole(north), whole(east), whole(back.value().north_um),
                 whole(back.value().east_um));
      }
    }
  }
}

TEST(the_origin_is_nought_and_north_is_up) {
  LocalPlane plane;
  assert_false(plane.configured());
  assert_int_equal(plane.to_plane({0, 0}).status(), Status::kNotReady);
  assert_int_equal(plane.to_geodetic(0, 0).status(), Status::kNotReady);
  const Geodetic origin{-33'000'000'000, 151'000'000'000};
  assert_int_equal(plane.configure(origin), Status::kOk);
  const PlanePoint zero = plane.to_plane(origin).value();
  assert_int_equal(zero.north_um, 0);
  assert_int_equal(zero.east_um, 0);
  assert_int_equal(zero.convergence_bam32, 0);
  // One degree of latitude at 33.5 degrees: 110.9 km.
  const PlanePoint south = plane.to_plane({-34'000'000'000, 151'000'000'000}).value();
  assert_near(static_cast<double>(south.north_um) * 1e-9, -110.92, 0.05);
  assert_int_equal(south.east_um, 0);
  // East of the origin in the southern hemisphere grid north lies west of true north.
  const PlanePoint east = plane.to_plane({-33'000'000'000, 151'500'000'000}).value();
  assert_true(east.east_um > 46'000'000'000);
  assert_true(east.convergence_bam32 < 0);
}

TEST(what_lies_beyond_is_refused) {
  LocalPlane plane;
  assert_int_equal(plane.configure({kMaxLatitude_e9deg + 1, 0}), Status::kOutOfRange);
  assert_int_equal(plane.configure({0, kMaxLongitude_e9deg + 1}), Status::kOutOfRange);
  assert_false(plane.configured());
  assert_int_equal(plane.configure({kMaxLatitude_e9deg, -kMaxLongitude_e9deg}), Status::kOk);
  assert_int_equal(plane.configure({10'000'000'000, 20'000'000'000}), Status::kOk);
  assert_int_equal(plane.to_plane({-kMaxLatitude_e9deg - 1, 20'000'000'000}).status(),
                   Status::kOutOfRange);
  assert_int_equal(plane.to_plane({10'000'000'000, kMaxLongitude_e9deg + 1}).status(),
                   Status::kOutOfRange);
  assert_int_equal(plane.to_plane({10'000'000'000, -160'000'000'000}).status(),
                   Status::kOutOfRange);
  assert_int_equal(plane.to_plane({10'000'000'000, 22'800'000'000}).status(), Status::kOutOfRange);
  assert_int_equal(plane.to_plane({13'000'000'000, 20'000'000'000}).status(), Status::kOutOfRange);
  assert_int_equal(plane.to_geodetic(300'000'000'001, 0).status(), Status::kOutOfRange);
  assert_int_equal(plane.to_geodetic(0, -300'000'000'001).status(), Status::kOutOfRange);
  assert_int_equal(plane.configure({84'000'000'000, 0}), Status::kOk);
  assert_int_equal(plane.to_geodetic(200'000'000'000, 0).status(), Status::kOutOfRange);
}

}  // namespace
