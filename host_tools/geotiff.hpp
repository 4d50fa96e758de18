// GeoTIFF of a map (elevation and, if known, sigma) and reading of any raster that GDAL knows.
//
// A local frame without any place on Earth is the normal case: then the file holds local metres (east,
// north) with no coordinate system, and says so in its metadata. With an EPSG code, or with the
// latitude and longitude of the survey's origin, the same cells become georeferenced, turned and scaled
// where that system needs it; nothing is resampled, ever.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "host_tools/geo_reference.hpp"
#include "host_tools/raster.hpp"

namespace leadline::host {

/// Which way a written height counts. Rasters in memory are elevations, always.
enum class VerticalSign : std::uint8_t {
  kElevation,  ///< positive up
  kDepth,      ///< positive down: minus elevation
};

/// What a GeoTIFF (or another raster that GDAL reads) holds.
struct GeoTiffContent {
  /// Band 1, metres up: unit and scale of the band applied, and its sign where the tag LEADLINE_SIGN
  /// says that the file holds depths.
  Raster elevation;
  std::optional<Raster> sigma;    ///< band 2 where its description is or starts with "sigma" or
                                  ///< "uncertainty", one standard deviation, metres
  std::string coordinate_system;  ///< name of the coordinate system; "" = local
  std::optional<int> epsg;        ///< its EPSG code where it states one
  /// Origin of the local plane that the raster's coordinates belong to: of a file of ours that names
  /// one, or of a transverse Mercator with scale 1 and no false origin.
  std::optional<double> lat_deg;
  std::optional<double> lon_deg;
  std::string vertical_datum;  ///< "" = not stated
  std::string survey_name;     ///< "" = none
};

/// Writes band 1 `elevation` (float32; metres up, or down with `sign` kDepth) and, unless null, band 2 `sigma` (same
/// geometry, one standard deviation, metres), nodata -9999, deflate compression. Band descriptions
/// and metadata name quantity, sign, unit, frame and vertical datum; pixels are areas. The same input
/// gives the same bytes with one version of GDAL.
///
/// `path` is written in place (GDAL seeks): stage it in an OutputDir, or use write_geotiff_whole.
/// Errors (HostError): those of place_raster() and require_affine(), kOutput for anything that cannot
/// be written, kInput when the geometries differ. They name `shown_path`, unless empty.
void write_geotiff(const std::string& path, const Raster& elevation, const Raster* sigma,
                   const GeoReference& reference, VerticalSign sign = VerticalSign::kElevation,
                   const std::string& shown_path = "");

/// The same beside `path`, renamed when complete.
void write_geotiff_whole(const std::string& path, const Raster& elevation, const Raster* sigma,
                         const GeoReference& reference,
                         VerticalSign sign = VerticalSign::kElevation);

/// Reads a raster through GDAL: north-up rasters with square cells (to one part in 1000), and the turned
/// ones that write_geotiff() makes of a local plane, whole or cropped, which come back in local
/// coordinates. Errors: HostError kInput naming the file.
[[nodiscard]] GeoTiffContent read_geotiff(const std::string& path);

/// Any raster: ESRI ASCII with our own reader (its messages name line and field), everything else
/// through GDAL, band 1.
[[nodiscard]] Raster read_raster(const std::string& path);

}  // namespace leadline::host
