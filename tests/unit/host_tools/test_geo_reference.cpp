// Where a map's grid lies on Earth. The truth here is not PROJ, which the code under test uses, but the
// estimator's own transverse Mercator (swept against the exact series by its tests) and closed formulas.
#include <cmath>
#include <string>

#include <gdal.h>

#include "estimator/geodesy.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/geo_reference.hpp"
#include "host_tools/geotiff.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::estimator::Geodetic;
using leadline::estimator::LocalPlane;
using leadline::estimator::PlanePoint;
using leadline::host::ExitCode;
using leadline::host::GeographicFrame;
using leadline::host::GeoReference;
using leadline::host::GeoTiffContent;
using leadline::host::HostError;
using leadline::host::make_raster;
using leadline::host::Placement;
using leadline::host::Raster;

constexpr double kUtmScale = 0.9996;
constexpr double kDegree = 3.14159265358979323846 / 180.0;

GeoReference reference_at(double lat_deg, double lon_deg, std::optional<int> epsg) {
  GeoReference reference;
  reference.lat_deg = lat_deg;
  reference.lon_deg = lon_deg;
  reference.epsg = epsg;
  return reference;
}

LocalPlane plane_at(double lat_deg, double lon_deg) {
  LocalPlane plane;
  const Geodetic origin = {std::llround(lat_deg * 1e9), std::llround(lon_deg * 1e9)};
  assert_true(plane.configure(origin) == leadline::base::Status::kOk);
  return plane;
}

/// A point of the local plane in the UTM zone of `meridian_deg`: easting, and northing seen from that of
/// (lat_deg, meridian).
struct UtmPoint {
  double easting_m;
  double northing_m;
};

UtmPoint utm_of(double east_m, double north_m, double lat_deg, double lon_deg,
                double meridian_deg) {
  const auto point = plane_at(lat_deg, lon_deg)
                         .to_geodetic(std::llround(north_m * 1e6), std::llround(east_m * 1e6));
  assert_true(point.ok());
  const auto zone = plane_at(lat_deg, meridian_deg).to_plane(point.value());
  assert_true(zone.ok());
  return {500000.0 + kUtmScale * static_cast<double>(zone.value().east_um) / 1e6,
          kUtmScale * static_cast<double>(zone.value().north_um) / 1e6};
}

TEST(grid_is_turned_and_scaled_into_a_utm_zone) {
  const double lat_deg = 47.3;
  for (const double lon_deg : {7.8, 9.0, 10.1}) {
    const GeoReference reference = reference_at(lat_deg, lon_deg, 32632);
    const Raster map = make_raster(400, 300, -150.0, 20.0, 0.5, -8.0);
    const Placement placement = leadline::host::place_raster(reference, map);
    assert_true(placement.error_cells < 0.01);
    // Grid convergence of the sphere; the ellipsoid's share is below 1e-4 degree here.
    const double convergence_deg =
        std::atan(std::tan((lon_deg - 9.0) * kDegree) * std::sin(lat_deg * kDegree)) / kDegree;
    assert_near(placement.plane.turn_deg(), -convergence_deg, 2e-3);
    const UtmPoint first = utm_of(map.west_m, map.south_m, lat_deg, lon_deg, 9.0);
    for (const double east_m : {map.west_m, 0.0, map.east_m()}) {
      for (const double north_m : {map.south_m, 100.0, map.north_m()}) {
        const UtmPoint exact = utm_of(east_m, north_m, lat_deg, lon_deg, 9.0);
        assert_near(placement.plane.x(east_m, north_m), exact.easting_m, 2e-3);
        assert_near(placement.plane.y(east_m, north_m) - placement.plane.y(map.west_m, map.south_m),
                    exact.northing_m - first.northing_m, 2e-3);
      }
    }
  }
}

TEST(published_point_lies_where_it_was_published) {
  // Meridian arc to 45 degrees north on WGS 84: 4,984,944.378 m, times the scale of a UTM zone.
  const GeoReference reference = reference_at(45.0, 9.0, 32632);
  const Placement placement =
      leadline::host::place_raster(reference, make_raster(2, 2, -1.0, -1.0, 1.0));
  assert_near(placement.plane.x(0.0, 0.0), 500000.0, 1e-4);
  assert_near(placement.plane.y(0.0, 0.0), 4984944.378 * kUtmScale, 1e-3);
  assert_near(placement.plane.scale(), kUtmScale, 1e-9);
  assert_near(placement.plane.turn_deg(), 0.0, 1e-9);
}

TEST(turned_geotiff_comes_back_in_local_metres_whole_and_cropped) {
  const std::string folder = leadline::test::scratch_directory();
  const std::string path = folder + "/turned.tif";
  Raster map = make_raster(40, 30, -15.0, 20.0, 0.5, -8.0);
  map.at(7, 9) = -3.0;
  const GeoReference reference = reference_at(47.3, 7.8, 32632);
  leadline::host::write_geotiff(path, map, nullptr, reference);

  GDALDatasetH file = GDALOpen(path.c_str(), GA_ReadOnly);
  double transform[6] = {};
  assert_int_equal(GDALGetGeoTransform(file, transform), CE_None);
  // The cell of row 7, column 9, as any other program finds it.
  const UtmPoint exact = utm_of(map.east_of_column_m(9), map.north_of_row_m(7), 47.3, 7.8, 9.0);
  assert_near(transform[0] + 9.5 * transform[1] + 7.5 * transform[2], exact.easting_m, 2e-3);
  assert_true(std::fabs(transform[2]) > 0.01 * 0.5);  // 0.88 degrees
  // The same file cropped by another program, tags and all.
  GDALDatasetH crop = GDALCreate(GDALGetDriverByName("GTiff"), (folder + "/crop.tif").c_str(), 10,
                                 8, 1, GDT_Float32, nullptr);
  GDALSetMetadata(crop, GDALGetMetadata(file, nullptr), nullptr);
  GDALSetSpatialRef(crop, GDALGetSpatialRef(file));
  double moved[6] = {
      transform[0] + 5 * transform[1] + 4 * transform[2], transform[1], transform[2],
      transform[3] + 5 * transform[4] + 4 * transform[5], transform[4], transform[5]};
  GDALSetGeoTransform(crop, moved);
  GDALClose(crop);
  // And with a grid of its own: not ours any more, and not north up.
  GDALDatasetH other = GDALCreate(GDALGetDriverByName("GTiff"), (folder + "/other.tif").c_str(), 10,
                                  8, 1, GDT_Float32, nullptr);
  GDALSetMetadata(other, GDALGetMetadata(file, nullptr), nullptr);
  GDALSetSpatialRef(other, GDALGetSpatialRef(file));
  moved[2] *= 1.5;
  GDALSetGeoTransform(other, moved);
  GDALClose(other);
  GDALClose(file);

  const GeoTiffContent whole = leadline::host::read_geotiff(path);
  assert_true(leadline::host::same_geometry(whole.elevation, map));
  assert_near(whole.elevation.at(7, 9), -3.0, 1e-6);
  assert_int_equal(whole.epsg.value_or(0), 32632);
  assert_near(whole.lat_deg.value_or(0.0), 47.3, 1e-12);
  assert_near(whole.lon_deg.value_or(0.0), 7.8, 1e-12);
  const GeoTiffContent part = leadline::host::read_geotiff(folder + "/crop.tif");
  assert_true(leadline::host::same_geometry(part.elevation, make_raster(10, 8, -12.5, 29.0, 0.5)));
  bool refused = false;
  try {
    (void)leadline::host::read_geotiff(folder + "/other.tif");
  } catch (const HostError& error) {
    refused = error.code() == ExitCode::kInput;
    assert_true(std::string(error.what()).find("other.tif: cells are not square") !=
                std::string::npos);
  }
  assert_true(refused);
}

TEST(other_references_leave_the_grid_as_it_is) {
  const std::string path = leadline::test::scratch_directory() + "/a.tif";
  const Raster map = make_raster(4, 3, -20.0, 10.0, 5.0, -8.0);
  GeoReference reference;
  reference.epsg = 32632;  // the survey's coordinates are that system's
  leadline::host::write_geotiff(path, map, nullptr, reference);
  const GeoTiffContent utm = leadline::host::read_geotiff(path);
  assert_near(utm.elevation.west_m, -20.0, 1e-9);
  assert_int_equal(utm.epsg.value_or(0), 32632);
  assert_false(utm.lat_deg.has_value());
  // A local projection about the origin; the file gives the origin back.
  leadline::host::write_geotiff(path, map, nullptr, reference_at(53.5, 8.1, std::nullopt));
  const GeoTiffContent local = leadline::host::read_geotiff(path);
  assert_near(local.elevation.west_m, -20.0, 1e-9);
  assert_true(!local.coordinate_system.empty());
  assert_false(local.epsg.has_value());
  assert_near(local.lat_deg.value_or(0.0), 53.5, 1e-9);
  assert_near(local.lon_deg.value_or(0.0), 8.1, 1e-9);
}

TEST(degrees_are_exact_for_each_point_whatever_the_code) {
  // Far enough out for the plane's curvature and the zone's convergence to show: 20 km.
  for (const std::optional<int> epsg : {std::optional<int>(), std::optional<int>(32632)}) {
    const GeographicFrame frame(reference_at(47.3, 7.8, epsg));
    const auto exact = plane_at(47.3, 7.8).to_geodetic(12'000'000'000, -20'000'000'000);
    assert_true(exact.ok());
    const auto point = frame.at(-20000.0, 12000.0);
    assert_near(point.latitude_deg, static_cast<double>(exact.value().latitude_e9deg) / 1e9, 1e-8);
    assert_near(point.longitude_deg, static_cast<double>(exact.value().longitude_e9deg) / 1e9,
                1e-8);
  }
}

TEST(a_grid_too_wide_for_a_straight_one_is_refused) {
  const Raster wide = make_raster(20000, 20000, 0.0, 0.0, 1.0);
  const Placement placement = leadline::host::place_raster(reference_at(47.3, 4.0, 32632), wide);
  assert_true(placement.error_cells > 0.25);
  bool refused = false;
  try {
    leadline::host::require_affine(placement, wide);
  } catch (const HostError& error) {
    refused = error.code() == ExitCode::kUsage;
    assert_true(std::string(error.what()).find("gdalwarp") != std::string::npos);
  }
  assert_true(refused);
}

}  // namespace
