// Where a map's local frame (east, north) lies on Earth, and what a grid of it looks like in another
// coordinate system.
#pragma once

#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>

#include "host_tools/gdal_support.hpp"
#include "host_tools/raster.hpp"

namespace leadline::host {

/// Table [frame] of map.toml.
///   none                       local metres, no coordinate system
///   epsg only                  the survey's x and y *are* that system's northing and easting
///   lat, lon only              a transverse Mercator about the origin (WGS 84, scale 1): east and
///                              north of the local tangent plane, true north up at the origin
///   lat, lon and epsg          the same plane, expressed in that system: turned by its grid
///                              convergence there and scaled by its point scale
struct GeoReference {
  std::optional<double> lat_deg;
  std::optional<double> lon_deg;
  std::optional<int> epsg;  ///< a projected system in metres
  std::optional<std::string> vertical_datum;
  std::optional<std::string> survey_name;  ///< [survey] name
};

/// A point of the local frame on Earth, degrees on WGS 84.
struct GeographicPoint {
  double longitude_deg;
  double latitude_deg;
};

/// The longitude, whole turns from what is said, that lies within half a turn of `middle_deg`: a map over the
/// antimeridian stays in one piece, at 179.9 .. 180.1 instead of at both ends of the world.
[[nodiscard]] inline double longitude_near(double longitude_deg, double middle_deg) {
  return longitude_deg - 360.0 * std::round((longitude_deg - middle_deg) / 360.0);
}

/// Turns local coordinates into longitude and latitude, each point for itself. Errors: HostError kUsage
/// naming the field of [frame].
class GeographicFrame {
 public:
  /// The reference must name a place: has_place().
  explicit GeographicFrame(const GeoReference& reference);
  ~GeographicFrame();
  GeographicFrame(const GeographicFrame&) = delete;
  GeographicFrame& operator=(const GeographicFrame&) = delete;

  [[nodiscard]] static bool has_place(const GeoReference& reference) {
    return reference.epsg.has_value() ||
           (reference.lat_deg.has_value() && reference.lon_deg.has_value());
  }
  [[nodiscard]] GeographicPoint at(double east_m, double north_m) const;
  /// Where the local frame lies, in words.
  [[nodiscard]] const std::string& description() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Farthest that a grid may lie from where its cells belong, in cells.
inline constexpr double kMaxPlacementError_cells = 0.25;

/// An affine map from the local plane to a coordinate system:
///   x = x_m + x_per_east (e - east_m) + x_per_north (n - north_m), y likewise.
struct PlaneMap {
  double east_m = 0.0;
  double north_m = 0.0;
  double x_m = 0.0;
  double y_m = 0.0;
  double x_per_east = 1.0;
  double x_per_north = 0.0;
  double y_per_east = 0.0;
  double y_per_north = 1.0;

  [[nodiscard]] double x(double east, double north) const {
    return x_m + x_per_east * (east - east_m) + x_per_north * (north - north_m);
  }
  [[nodiscard]] double y(double east, double north) const {
    return y_m + y_per_east * (east - east_m) + y_per_north * (north - north_m);
  }
  /// Of the local north, seen clockwise from the system's.
  [[nodiscard]] double turn_deg() const;
  [[nodiscard]] double scale() const;
};

/// A raster's coordinate system and its grid there.
struct Placement {
  CoordinateSystem system;  ///< null: local metres
  PlaneMap plane;
  /// Largest distance between the affine grid and the projection over the raster.
  double error_cells = 0.0;
  /// The same for a grid with the system's own north up, as an ESRI ASCII file has.
  double north_up_error_cells = 0.0;
  std::string description;
};

/// Where `raster` lies. The affine map touches the projection in the raster's middle. Errors: HostError
/// kUsage for an EPSG code that PROJ does not know or that is not projected in metres, and for a place
/// that it cannot express.
[[nodiscard]] Placement place_raster(const GeoReference& reference, const Raster& raster);

/// Throws HostError kUsage where the placement's affine grid is more than kMaxPlacementError_cells off.
void require_affine(const Placement& placement, const Raster& raster);

/// GDAL's six numbers for the raster's grid.
[[nodiscard]] std::array<double, 6> geotransform(const PlaneMap& plane, const Raster& raster);

/// The local raster geometry (no values) of a grid that geotransform() made with `plane`, or of a part
/// of it; nothing where the cells are not square or not parallel to the local axes.
[[nodiscard]] std::optional<Raster> local_geometry(const PlaneMap& plane,
                                                   const std::array<double, 6>& transform,
                                                   int columns, int rows);

/// The raster with the cells of a north-up grid of the placement's system. Only where
/// north_up_error_cells is at most kMaxPlacementError_cells.
[[nodiscard]] Raster north_up(const Placement& placement, const Raster& raster);

}  // namespace leadline::host
