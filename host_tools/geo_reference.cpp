#include "host_tools/geo_reference.hpp"

#include <algorithm>
#include <cmath>

#include <ogr_srs_api.h>

#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

static_assert(kMaxPlacementError_cells == 0.25, "stated in a message");
constexpr double kDegreesPerRadian = 57.295779513082320877;

struct Point {
  double x;
  double y;
};

CoordinateSystem make_system() {
  CoordinateSystem system(OSRNewSpatialReference(nullptr));
  // x is always east and y north here, whatever order an authority prefers.
  OSRSetAxisMappingStrategy(system.get(), OAMS_TRADITIONAL_GIS_ORDER);
  return system;
}

[[noreturn]] void refuse(const std::string& message) {
  throw HostError(ExitCode::kUsage, message + QuietGdal::reason());
}

bool has_origin(const GeoReference& reference) {
  return reference.lat_deg.has_value() && reference.lon_deg.has_value();
}

/// The plane that local coordinates are measured in when an origin is known.
CoordinateSystem tangent_plane(const GeoReference& reference) {
  CoordinateSystem system = make_system();
  const OGRErr wgs84 = OSRSetWellKnownGeogCS(system.get(), "WGS84");
  OSRSetProjCS(system.get(), "Local tangent plane of the survey's origin");
  const OGRErr mercator =
      OSRSetTM(system.get(), *reference.lat_deg, *reference.lon_deg, 1.0, 0.0, 0.0);
  if (wgs84 != OGRERR_NONE || mercator != OGRERR_NONE) {
    refuse("[frame] lat, lon: no local projection there");
  }
  return system;
}

std::string epsg_name(const GeoReference& reference) {
  return "EPSG:" + std::to_string(*reference.epsg);
}

CoordinateSystem epsg_system(const GeoReference& reference) {
  CoordinateSystem system = make_system();
  if (OSRImportFromEPSG(system.get(), *reference.epsg) != OGRERR_NONE) {
    refuse("[frame] epsg: PROJ does not know " + epsg_name(reference));
  }
  const double unit_m = OSRGetLinearUnits(system.get(), nullptr);
  if (OSRIsProjected(system.get()) == 0 || std::fabs(unit_m - 1.0) > 1e-9) {
    throw HostError(ExitCode::kUsage, "[frame] epsg: " + epsg_name(reference) +
                                          " is not a projected system in metres (a UTM zone is, "
                                          "say 32632)");
  }
  return system;
}

/// The system that local coordinates are measured in; null: local metres.
CoordinateSystem own_system(const GeoReference& reference) {
  if (has_origin(reference)) {
    return tangent_plane(reference);
  }
  return reference.epsg.has_value() ? epsg_system(reference) : CoordinateSystem();
}

/// In words, what the coordinates of a placed raster are.
std::string description_of(const GeoReference& reference) {
  if (!GeographicFrame::has_place(reference)) {
    return "local metres east and north of the survey's origin, not georeferenced";
  }
  if (!reference.epsg.has_value()) {
    return "metres east and north of [frame] lat, lon (transverse Mercator, WGS 84)";
  }
  const std::string grid = epsg_name(reference) + " easting and northing";
  return has_origin(reference)
             ? grid + ", local plane about [frame] lat, lon turned and scaled into it"
             : grid;
}

Point transformed(const CoordinateTransform& transform, Point point,
                  const GeoReference& reference) {
  if (OCTTransform(transform.get(), 1, &point.x, &point.y, nullptr) == 0 ||
      !std::isfinite(point.x) || !std::isfinite(point.y)) {
    refuse("[frame] lat, lon: cannot be expressed in " + epsg_name(reference));
  }
  return point;
}

/// Touches the projection at the raster's middle; slopes over the raster's own width and height.
template <typename Project>
PlaneMap fit_plane(const Raster& raster, const Project& project) {
  PlaneMap plane;
  const double half_east_m = 0.5 * (raster.east_m() - raster.west_m);
  const double half_north_m = 0.5 * (raster.north_m() - raster.south_m);
  plane.east_m = raster.west_m + half_east_m;
  plane.north_m = raster.south_m + half_north_m;
  const Point middle = project(plane.east_m, plane.north_m);
  plane.x_m = middle.x;
  plane.y_m = middle.y;
  const Point east = project(raster.east_m(), plane.north_m);
  const Point west = project(raster.west_m, plane.north_m);
  const Point north = project(plane.east_m, raster.north_m());
  const Point south = project(plane.east_m, raster.south_m);
  plane.x_per_east = (east.x - west.x) / (2.0 * half_east_m);
  plane.y_per_east = (east.y - west.y) / (2.0 * half_east_m);
  plane.x_per_north = (north.x - south.x) / (2.0 * half_north_m);
  plane.y_per_north = (north.y - south.y) / (2.0 * half_north_m);
  return plane;
}

/// `plane` without its turn: what an ESRI ASCII grid can hold.
PlaneMap without_turn(const PlaneMap& plane) {
  PlaneMap straight = plane;
  straight.x_per_east = plane.scale();
  straight.y_per_north = plane.scale();
  straight.x_per_north = 0.0;
  straight.y_per_east = 0.0;
  return straight;
}

/// Largest distance between an affine grid and the projection, in cells. What is left of a projection
/// after its slope is smooth, and largest at the edges: a lattice of 9 x 9 points with the corners on
/// it sees it.
template <typename Project>
double largest_error_cells(const PlaneMap& plane, const Raster& raster, const Project& project) {
  constexpr int kSteps = 8;
  double largest_m = 0.0;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const double east_m = raster.west_m + (raster.east_m() - raster.west_m) * i / kSteps;
      const double north_m = raster.south_m + (raster.north_m() - raster.south_m) * j / kSteps;
      const Point exact = project(east_m, north_m);
      largest_m = std::max(largest_m, std::hypot(plane.x(east_m, north_m) - exact.x,
                                                 plane.y(east_m, north_m) - exact.y));
    }
  }
  return largest_m / raster.cell_m;
}

}  // namespace

double PlaneMap::turn_deg() const {
  return std::atan2(x_per_north, y_per_north) * kDegreesPerRadian;
}

double PlaneMap::scale() const {
  return std::sqrt(std::fabs(x_per_east * y_per_north - x_per_north * y_per_east));
}

Placement place_raster(const GeoReference& reference, const Raster& raster) {
  const QuietGdal quiet;
  Placement placement;
  placement.description = description_of(reference);
  CoordinateSystem own = own_system(reference);
  if (!reference.epsg.has_value() || !has_origin(reference)) {
    placement.system = std::move(own);
    return placement;
  }
  placement.system = epsg_system(reference);
  const CoordinateTransform transform(
      OCTNewCoordinateTransformation(own.get(), placement.system.get()));
  if (!transform) {
    refuse("[frame] lat, lon: cannot be expressed in " + epsg_name(reference));
  }
  const auto project = [&transform, &reference](double east_m, double north_m) {
    return transformed(transform, {east_m, north_m}, reference);
  };
  placement.plane = fit_plane(raster, project);
  placement.error_cells = largest_error_cells(placement.plane, raster, project);
  placement.north_up_error_cells =
      largest_error_cells(without_turn(placement.plane), raster, project);
  return placement;
}

void require_affine(const Placement& placement, const Raster& raster) {
  // Asked positively, so that a NaN is refused.
  if (placement.error_cells <= kMaxPlacementError_cells) {
    return;
  }
  std::string error;
  append_fixed(&error, placement.error_cells, 2);
  throw HostError(
      ExitCode::kUsage,
      "[frame] epsg: over " + describe_geometry(raster) +
          " no straight grid follows that projection closer than " + error +
          " cells (limit 0.25); without an EPSG code the grid is exact in a projection of its own, "
          "which gdalwarp resamples");
}

std::array<double, 6> geotransform(const PlaneMap& plane, const Raster& raster) {
  return {plane.x(raster.west_m, raster.north_m()), plane.x_per_east * raster.cell_m,
          -plane.x_per_north * raster.cell_m,       plane.y(raster.west_m, raster.north_m()),
          plane.y_per_east * raster.cell_m,         -plane.y_per_north * raster.cell_m};
}

std::optional<Raster> local_geometry(const PlaneMap& plane, const std::array<double, 6>& transform,
                                     int columns, int rows) {
  const double determinant =
      plane.x_per_east * plane.y_per_north - plane.x_per_north * plane.y_per_east;
  if (!(std::fabs(determinant) > 1e-6)) {
    return std::nullopt;
  }
  const auto local_step = [&plane, determinant](double dx, double dy) {
    return Point{(plane.y_per_north * dx - plane.x_per_north * dy) / determinant,
                 (plane.x_per_east * dy - plane.y_per_east * dx) / determinant};
  };
  const Point right = local_step(transform[1], transform[4]);
  const Point down = local_step(transform[2], transform[5]);
  const Point corner = local_step(transform[0] - plane.x_m, transform[3] - plane.y_m);
  // A thousandth of a cell over the whole grid: more is another grid.
  const double tolerance = 1e-3 / std::max(columns, rows);
  const bool parallel = right.x > 0.0 && std::fabs(right.y) <= tolerance * right.x &&
                        std::fabs(down.x) <= tolerance * right.x &&
                        std::fabs(down.y + right.x) <= tolerance * right.x;
  if (!parallel) {
    return std::nullopt;
  }
  Raster geometry;
  geometry.columns = columns;
  geometry.rows = rows;
  geometry.cell_m = right.x;
  geometry.west_m = plane.east_m + corner.x;
  geometry.south_m = plane.north_m + corner.y - rows * right.x;
  return geometry;
}

Raster north_up(const Placement& placement, const Raster& raster) {
  const PlaneMap straight = without_turn(placement.plane);
  Raster placed = raster;
  placed.cell_m = raster.cell_m * straight.scale();
  placed.west_m = straight.x(raster.west_m, raster.south_m);
  placed.south_m = straight.y(raster.west_m, raster.south_m);
  return placed;
}

struct GeographicFrame::Impl {
  CoordinateSystem system;
  CoordinateSystem geographic = make_system();
  CoordinateTransform transform;
  std::string description;
};

GeographicFrame::GeographicFrame(const GeoReference& reference) : impl_(std::make_unique<Impl>()) {
  const QuietGdal quiet;
  if (!has_place(reference)) {
    throw HostError(ExitCode::kUsage, "[frame]: lat and lon, or epsg, are needed for degrees");
  }
  GeoReference own = reference;
  if (has_origin(reference)) {
    own.epsg.reset();  // degrees come straight from the plane about the origin
  }
  impl_->description = description_of(own);
  impl_->system = own_system(own);
  if (OSRSetWellKnownGeogCS(impl_->geographic.get(), "WGS84") == OGRERR_NONE) {
    OSRSetAxisMappingStrategy(impl_->geographic.get(), OAMS_TRADITIONAL_GIS_ORDER);
    impl_->transform.reset(
        OCTNewCoordinateTransformation(impl_->system.get(), impl_->geographic.get()));
  }
  if (!impl_->transform) {
    refuse("[frame]: cannot be turned into degrees");
  }
}

GeographicFrame::~GeographicFrame() = default;

GeographicPoint GeographicFrame::at(double east_m, double north_m) const {
  const QuietGdal quiet;
  double x = east_m;
  double y = north_m;
  if (OCTTransform(impl_->transform.get(), 1, &x, &y, nullptr) == 0 || !std::isfinite(x) ||
      !std::isfinite(y)) {
    refuse("[frame]: a point of the map has no longitude and latitude");
  }
  return {x, y};
}

const std::string& GeographicFrame::description() const { return impl_->description; }

}  // namespace leadline::host
