// Latitude and longitude (WGS 84) to north and east of a survey's origin and back, in integers.
//
// The plane is the transverse Mercator projection with its centre at the origin and scale 1 along the
// origin's meridian (PROJ: +proj=tmerc +lat_0=.. +lon_0=.. +k=1 +ellps=WGS84): conformal, so that a
// heading and a shape stay what they are, and known to every map program, so that a grid can be exported
// as it is. Lengths grow with the distance x from the meridian by 1 + x^2 / (2 R^2): 1.2e-6 at 10 km,
// 1.2e-4 at 100 km. Down stays the depth below the surface.
#pragma once

#include <cstdint>

#include "model/base/status.hpp"
#include "model/base/units.hpp"

namespace leadline::estimator {

/// Farthest north or south that an origin or a point may lie. Inclusive.
inline constexpr std::int64_t kMaxLatitude_e9deg = 85'000'000'000;
inline constexpr std::int64_t kMaxLongitude_e9deg = 180'000'000'000;
/// Farthest east or west of the origin, and north or south of it, that a point may lie. Inclusive.
inline constexpr std::int64_t kMaxReach_um = 300'000'000'000;
/// Error of to_plane() against the exact projection, micrometres (swept by a test): up to 100 km east or
/// west of the origin, and up to kMaxReach_um. It is the series' end that grows, with the ninth power, and
/// most near the poles (5 mm below 80 degrees).
inline constexpr std::int64_t kPlaneErrorNear_um = 20;
inline constexpr std::int64_t kPlaneErrorFar_um = 60'000;

struct Geodetic {
  std::int64_t latitude_e9deg;   ///< north positive
  std::int64_t longitude_e9deg;  ///< east positive, -180e9 .. 180e9
};

struct PlanePoint {
  std::int64_t north_um;
  std::int64_t east_um;
  /// Grid north seen from true north, clockwise: grid heading = true heading - convergence. Error below
  /// 1e-6 rad up to 100 km, 3e-5 rad beyond.
  std::int32_t convergence_bam32;
};

/// One origin. Trivially copyable. Every call is O(1): a few hundred multiplications.
class LocalPlane {
 public:
  /// kOutOfRange beyond kMaxLatitude_e9deg or kMaxLongitude_e9deg: nothing changed.
  [[nodiscard]] base::Status configure(const Geodetic& origin);
  [[nodiscard]] bool configured() const { return configured_; }
  [[nodiscard]] const Geodetic& origin() const { return origin_; }

  /// kNotReady: no origin; kOutOfRange: no such place, or beyond the reach.
  [[nodiscard]] base::Result<PlanePoint> to_plane(const Geodetic& point) const;
  /// Inverse of to_plane within 2e-9 degrees of arc (0.22 mm). kNotReady; kOutOfRange: beyond the reach, or a latitude
  /// beyond kMaxLatitude_e9deg.
  [[nodiscard]] base::Result<Geodetic> to_geodetic(std::int64_t north_um,
                                                   std::int64_t east_um) const;

 private:
  Geodetic origin_{};
  std::int64_t origin_arc_um_ = 0;  ///< meridian arc from the equator
  bool configured_ = false;
};

}  // namespace leadline::estimator
