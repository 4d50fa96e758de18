// GeoTIFF of a map (elevation and, if known, sigma) and reading of any raster that GDAL knows.
//
// A local frame without any place on Earth is the normal case: then the file holds local metres (east,
// north) with no coordinate system, and says so in its metadata. With an EPSG code, or with the
// latitude and longitude of the survey's origin, the same cells become georeferenced; nothing is
// resampled, ever.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "host_tools/raster.hpp"

namespace leadline::host {

/// Where the local frame (east, north) lies on Earth; table [frame] of map.toml.
///   none                       local metres, no coordinate system
///   epsg only                  the survey's x and y *are* that system's northing and easting
///   lat, lon only              a transverse Mercator about the origin (WGS 84, scale 1): east and
///                              north of the local tangent plane, true north up
///   lat, lon and epsg          the origin's coordinates in that system are added to x and y; the
///                              survey's headings must then refer to its grid north
struct GeoReference {
  std::optional<double> lat_deg;
  std::optional<double> lon_deg;
  std::optional<int> epsg;  ///< a projected system in metres
  std::optional<std::string> vertical_datum;
};

/// Which way a written height counts. Rasters in memory are elevations, always.
enum class VerticalSign : std::uint8_t {
  kElevation,  ///< positive up
  kDepth,      ///< positive down: minus elevation
};

/// A point of the local frame on Earth, degrees on WGS 84.
struct GeographicPoint {
  double longitude_deg;
  double latitude_deg;
};

/// Turns local coordinates into longitude and latitude. Errors as write_geotiff().
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

/// What a GeoTIFF (or another raster that GDAL reads) holds.
struct GeoTiffContent {
  Raster elevation;               ///< band 1, metres up (unit and scale of the band applied)
  std::optional<Raster> sigma;    ///< band 2 where its description is or starts with "sigma" or
                                  ///< "uncertainty", one standard deviation, metres
  std::string coordinate_system;  ///< name of the coordinate system; "" = local
  std::optional<int> epsg;        ///< its EPSG code where it states one
  std::string vertical_datum;     ///< "" = not stated
};

/// Writes band 1 `elevation` (float32; metres up, or down with `sign` kDepth) and, unless null, band 2 `sigma` (same
/// geometry, one standard deviation, metres), nodata -9999, deflate compression. Band descriptions
/// and metadata name quantity, sign, unit, frame and vertical datum; pixels are areas. The same input
/// gives the same bytes with one version of GDAL.
///
/// `path` is written in place (GDAL seeks): stage it in an OutputDir, or use write_geotiff_whole.
/// Errors (HostError): kUsage for an EPSG code that PROJ does not know or that is not projected in
/// metres, kOutput for anything that cannot be written, kInput when the geometries differ.
void write_geotiff(const std::string& path, const Raster& elevation, const Raster* sigma,
                   const GeoReference& reference, VerticalSign sign = VerticalSign::kElevation);

/// The same beside `path`, renamed when complete.
void write_geotiff_whole(const std::string& path, const Raster& elevation, const Raster* sigma,
                         const GeoReference& reference,
                         VerticalSign sign = VerticalSign::kElevation);

/// Reads a raster through GDAL. North-up rasters with square cells (to one part in 1000) only. Errors:
/// HostError kInput naming the file.
[[nodiscard]] GeoTiffContent read_geotiff(const std::string& path);

/// Any raster: ESRI ASCII with our own reader (its messages name line and field), everything else
/// through GDAL, band 1.
[[nodiscard]] Raster read_raster(const std::string& path);

}  // namespace leadline::host
