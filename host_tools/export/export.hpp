// `leadline export`: a map in the formats of other programs.
//
//   geotiff   GDAL; band 1 height, band 2 sigma
//   asc       ESRI ASCII grid of heights, or of sigma
//   xyz162    MB-System format 162: lines "longitude latitude depth sigma", depth positive down
//   xyz168    MB-System format 168: the same with elevation, positive up
//   ply       binary mesh of the seafloor with sigma per vertex, or the occupied voxels
//   las       LAS 1.2 points: the known cells with sigma, or the occupied voxels
//   geojson   contours, and the outline of what is known
//   kml       the same, for a map that has a place on Earth
//
// A map without a place on Earth is the normal case: XYZ, PLY, LAS and GeoJSON then hold local metres, east
// and north.
// Every file says in its own header which coordinates, sign and vertical datum it has.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "host_tools/export/map_source.hpp"

namespace leadline::host {

enum class ExportFormat : std::uint8_t {
  kGeoTiff,
  kEsriAscii,
  kXyz162,
  kXyz168,
  kPly,
  kLas,
  kGeoJson,
  kKml,
};

enum class ExportLayer : std::uint8_t { kMap, kSigma, kVoxels, kContours, kCoverage };

/// Coordinates of points: metres of the map, degrees on WGS 84, or (LAS) the reference's EPSG system.
enum class ExportFrame : std::uint8_t { kLocal, kLonLat, kProjected };

struct ExportOptions {
  std::string input_path;
  std::string out_path;  ///< "-" is standard output
  std::string format;    ///< "" = by the ending of out_path
  std::string vertical;  ///< "elevation", "depth"; "" = elevation, for xyz162 depth
  /// "map", "sigma" (asc), "voxels" (ply, las), "contours" or "coverage" (geojson, kml: one without the
  /// other); "" = map
  std::string layer;
  /// XYZ, LAS, GeoJSON: "local", "lonlat"; "" = lonlat where the map has a place, but LAS in the EPSG system
  /// where there is one. ASCII grid: "local", or "".
  std::string frame;
  std::optional<double>
      contour_interval_m;  ///< geojson, kml; 0 = none; unset: a round step, about 12
  /// Instead of what the source says. An origin given here without a code means no code; a code given
  /// here keeps the source's origin.
  std::optional<double> lat_deg;
  std::optional<double> lon_deg;
  std::optional<int> epsg;
  std::optional<std::string> datum;  ///< vertical datum, stated in the file
};

/// What was asked for, checked against each other and against the source.
struct ExportPlan {
  ExportFormat format = ExportFormat::kGeoTiff;
  VerticalSign sign = VerticalSign::kElevation;
  ExportLayer layer = ExportLayer::kMap;
  ExportFrame frame = ExportFrame::kLocal;
  bool grid_in_epsg = false;  ///< ASCII grid in the reference's system instead of the map's own
  std::optional<double> contour_interval_m;
  GeoReference reference;
};

/// Throws HostError kUsage naming the option: a name that is not known (with a suggestion), a sign or
/// layer that the format does not have, degrees without a place.
[[nodiscard]] ExportPlan plan_export(const ExportOptions& options, const MapSource& source);

/// The files as bytes. format_grid throws HostError kUsage where a north-up grid in the wanted system would
/// put a cell more than kMaxPlacementError_cells from where it belongs.
[[nodiscard]] std::string format_grid(const MapSource& source, const ExportPlan& plan);
[[nodiscard]] std::string format_xyz(const MapSource& source, const ExportPlan& plan);
[[nodiscard]] std::string format_ply(const MapSource& source, const ExportPlan& plan);
[[nodiscard]] std::string format_las(const MapSource& source, const ExportPlan& plan);
/// HostError kUsage where more than 1000 levels would be drawn.
[[nodiscard]] std::string format_geojson(const MapSource& source, const ExportPlan& plan);
[[nodiscard]] std::string format_kml(const MapSource& source, const ExportPlan& plan);

/// The command; returns 0. Throws HostError: kUsage, kInput, kOutput.
int run_export(const ExportOptions& options);

}  // namespace leadline::host
