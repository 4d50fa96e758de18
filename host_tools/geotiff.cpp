#include "host_tools/geotiff.hpp"

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <system_error>
#include <vector>

#include <cpl_conv.h>
#include <cpl_error.h>
#include <cpl_string.h>
#include <fcntl.h>
#include <gdal.h>
#include <ogr_srs_api.h>
#include <unistd.h>

#include "host_tools/exit_codes.hpp"

namespace leadline::host {
namespace {

constexpr const char* kElevationDescription = "elevation";
constexpr const char* kDepthDescription = "depth";
constexpr const char* kSigmaDescription = "sigma";

struct CloseDataset {
  void operator()(void* dataset) const { GDALClose(dataset); }
};
using Dataset = std::unique_ptr<void, CloseDataset>;

struct DestroySystem {
  void operator()(void* system) const { OSRDestroySpatialReference(system); }
};
using CoordinateSystem = std::unique_ptr<void, DestroySystem>;

struct DestroyTransform {
  void operator()(void* transform) const { OCTDestroyCoordinateTransformation(transform); }
};
using Transform = std::unique_ptr<void, DestroyTransform>;

struct FreeList {
  void operator()(char** list) const { CSLDestroy(list); }
};
using StringList = std::unique_ptr<char*, FreeList>;

void add_option(StringList* list, const char* name, const std::string& value) {
  list->reset(CSLSetNameValue(list->release(), name, value.c_str()));
}

void register_drivers() {
  static std::once_flag once;
  std::call_once(once, [] { GDALAllRegister(); });
}

/// Keeps GDAL from printing: its last message becomes part of ours.
class QuietGdal {
 public:
  QuietGdal() {
    CPLErrorReset();
    CPLPushErrorHandler(CPLQuietErrorHandler);
  }
  ~QuietGdal() { CPLPopErrorHandler(); }
  QuietGdal(const QuietGdal&) = delete;
  QuietGdal& operator=(const QuietGdal&) = delete;

  /// ": reason" or nothing.
  [[nodiscard]] static std::string reason() {
    const std::string text = CPLGetLastErrorMsg();
    return text.empty() ? text : ": " + text;
  }
};

CoordinateSystem make_system() {
  CoordinateSystem system(OSRNewSpatialReference(nullptr));
  // x is always east and y north here, whatever order an authority prefers.
  OSRSetAxisMappingStrategy(system.get(), OAMS_TRADITIONAL_GIS_ORDER);
  return system;
}

/// The raster's coordinate system and the coordinates of the local origin in it.
struct Placement {
  CoordinateSystem system;
  double east_m = 0.0;
  double north_m = 0.0;
  std::string description = "local metres east and north of the survey's origin, not georeferenced";
};

Placement place(const GeoReference& reference) {
  Placement placement;
  const bool has_origin = reference.lat_deg.has_value() && reference.lon_deg.has_value();
  if (!has_origin && !reference.epsg.has_value()) {
    return placement;
  }
  placement.system = make_system();
  if (!reference.epsg.has_value()) {
    const OGRErr wgs84 = OSRSetWellKnownGeogCS(placement.system.get(), "WGS84");
    OSRSetProjCS(placement.system.get(), "Local tangent plane of the survey's origin");
    const OGRErr mercator =
        OSRSetTM(placement.system.get(), *reference.lat_deg, *reference.lon_deg, 1.0, 0.0, 0.0);
    if (wgs84 != OGRERR_NONE || mercator != OGRERR_NONE) {
      throw HostError(ExitCode::kUsage,
                      "[frame] lat, lon: no local projection there" + QuietGdal::reason());
    }
    placement.description =
        "metres east and north of [frame] lat, lon (transverse Mercator, WGS 84)";
    return placement;
  }
  const std::string code = "EPSG:" + std::to_string(*reference.epsg);
  if (OSRImportFromEPSG(placement.system.get(), *reference.epsg) != OGRERR_NONE) {
    throw HostError(ExitCode::kUsage,
                    "[frame] epsg: PROJ does not know " + code + QuietGdal::reason());
  }
  const double unit_m = OSRGetLinearUnits(placement.system.get(), nullptr);
  if (OSRIsProjected(placement.system.get()) == 0 || std::fabs(unit_m - 1.0) > 1e-9) {
    throw HostError(ExitCode::kUsage, "[frame] epsg: " + code +
                                          " is not a projected system in metres (a UTM zone is, "
                                          "say 32632)");
  }
  placement.description = code + " easting and northing";
  if (!has_origin) {
    return placement;
  }
  const CoordinateSystem geographic = make_system();
  const OGRErr wgs84 = OSRSetWellKnownGeogCS(geographic.get(), "WGS84");
  OSRSetAxisMappingStrategy(geographic.get(), OAMS_TRADITIONAL_GIS_ORDER);
  const Transform transform(wgs84 == OGRERR_NONE ? OCTNewCoordinateTransformation(
                                                       geographic.get(), placement.system.get())
                                                 : nullptr);
  double x = *reference.lon_deg;
  double y = *reference.lat_deg;
  if (!transform || OCTTransform(transform.get(), 1, &x, &y, nullptr) == 0 || !std::isfinite(x) ||
      !std::isfinite(y)) {
    throw HostError(ExitCode::kUsage,
                    "[frame] lat, lon: cannot be expressed in " + code + QuietGdal::reason());
  }
  placement.east_m = x;
  placement.north_m = y;
  placement.description += ", local origin at [frame] lat, lon";
  return placement;
}

void write_band(const Dataset& dataset, int number, const Raster& raster, const char* description,
                const std::string& path) {
  GDALRasterBandH band = GDALGetRasterBand(dataset.get(), number);
  GDALSetDescription(band, description);
  GDALSetRasterUnitType(band, "m");
  bool good = GDALSetRasterNoDataValue(band, kRasterNodata) == CE_None;
  std::vector<float> line(static_cast<std::size_t>(raster.columns));
  for (int row = 0; good && row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column) {
      const double value = raster.at(row, column);
      line[static_cast<std::size_t>(column)] =
          static_cast<float>(std::isnan(value) ? kRasterNodata : value);
    }
    good = GDALRasterIO(band, GF_Write, 0, row, raster.columns, 1, line.data(), raster.columns, 1,
                        GDT_Float32, 0, 0) == CE_None;
  }
  if (!good) {
    throw HostError(ExitCode::kOutput, path + ": cannot be written" + QuietGdal::reason());
  }
}

std::string lower_ascii(std::string text) {
  for (char& c : text) {
    if (c >= 'A' && c <= 'Z') {
      c = static_cast<char>(c - 'A' + 'a');
    }
  }
  return text;
}

Raster read_band(const Dataset& dataset, int number, const Raster& geometry,
                 const std::string& path) {
  GDALRasterBandH band = GDALGetRasterBand(dataset.get(), number);
  Raster raster = geometry;
  raster.values.resize(static_cast<std::size_t>(raster.columns) *
                       static_cast<std::size_t>(raster.rows));
  for (int row = 0; row < raster.rows; ++row) {
    if (GDALRasterIO(band, GF_Read, 0, row, raster.columns, 1, &raster.at(row, 0), raster.columns,
                     1, GDT_Float64, 0, 0) != CE_None) {
      throw HostError(ExitCode::kInput, path + ": row " + std::to_string(row + 1) +
                                            " cannot be read" + QuietGdal::reason());
    }
  }
  int has_nodata = 0;
  const double nodata = GDALGetRasterNoDataValue(band, &has_nodata);
  // A float32 band compares after the nodata value went through float32 as well.
  const bool is_float = GDALGetRasterDataType(band) == GDT_Float32;
  const double stored_nodata = is_float ? static_cast<double>(static_cast<float>(nodata)) : nodata;
  int has_scale = 0;
  int has_offset = 0;
  const double scale_given = GDALGetRasterScale(band, &has_scale);
  const double offset_given = GDALGetRasterOffset(band, &has_offset);
  const double scale = has_scale != 0 ? scale_given : 1.0;
  const double offset = has_offset != 0 ? offset_given : 0.0;
  for (double& value : raster.values) {
    const bool is_nodata = has_nodata != 0 && (value == nodata || value == stored_nodata);
    value = is_nodata || !std::isfinite(value) ? kNoValue : value * scale + offset;
  }
  return raster;
}

}  // namespace

struct GeographicFrame::Impl {
  Placement placement;
  CoordinateSystem geographic = make_system();
  Transform transform;
};

GeographicFrame::GeographicFrame(const GeoReference& reference) : impl_(std::make_unique<Impl>()) {
  register_drivers();
  const QuietGdal quiet;
  impl_->placement = place(reference);
  if (!impl_->placement.system) {
    throw HostError(ExitCode::kUsage, "[frame]: lat and lon, or epsg, are needed for degrees");
  }
  if (OSRSetWellKnownGeogCS(impl_->geographic.get(), "WGS84") == OGRERR_NONE) {
    OSRSetAxisMappingStrategy(impl_->geographic.get(), OAMS_TRADITIONAL_GIS_ORDER);
    impl_->transform.reset(
        OCTNewCoordinateTransformation(impl_->placement.system.get(), impl_->geographic.get()));
  }
  if (!impl_->transform) {
    throw HostError(ExitCode::kUsage,
                    "[frame]: cannot be turned into degrees" + QuietGdal::reason());
  }
}

GeographicFrame::~GeographicFrame() = default;

GeographicPoint GeographicFrame::at(double east_m, double north_m) const {
  const QuietGdal quiet;
  double x = east_m + impl_->placement.east_m;
  double y = north_m + impl_->placement.north_m;
  if (OCTTransform(impl_->transform.get(), 1, &x, &y, nullptr) == 0 || !std::isfinite(x) ||
      !std::isfinite(y)) {
    throw HostError(ExitCode::kUsage, "[frame]: a point of the map has no longitude and latitude" +
                                          QuietGdal::reason());
  }
  return {x, y};
}

const std::string& GeographicFrame::description() const { return impl_->placement.description; }

void write_geotiff(const std::string& path, const Raster& elevation, const Raster* sigma,
                   const GeoReference& reference, VerticalSign sign) {
  if (sigma != nullptr && !same_geometry(elevation, *sigma)) {
    throw HostError(ExitCode::kInput, path + ": elevation has " + describe_geometry(elevation) +
                                          ", sigma has " + describe_geometry(*sigma));
  }
  register_drivers();
  const QuietGdal quiet;
  const Placement placement = place(reference);
  GDALDriverH driver = GDALGetDriverByName("GTiff");
  StringList options;
  add_option(&options, "COMPRESS", "DEFLATE");
  add_option(&options, "PREDICTOR", "3");  // made for floating point
  const int bands = sigma != nullptr ? 2 : 1;
  Dataset dataset(driver == nullptr
                      ? nullptr
                      : GDALCreate(driver, path.c_str(), elevation.columns, elevation.rows, bands,
                                   GDT_Float32, options.get()));
  if (!dataset) {
    throw HostError(ExitCode::kOutput, path + ": cannot be created" + QuietGdal::reason());
  }
  double transform[6] = {elevation.west_m + placement.east_m,
                         elevation.cell_m,
                         0.0,
                         elevation.north_m() + placement.north_m,
                         0.0,
                         -elevation.cell_m};
  GDALSetGeoTransform(dataset.get(), transform);
  if (placement.system) {
    GDALSetSpatialRef(dataset.get(), placement.system.get());
  }
  GDALSetMetadataItem(dataset.get(), "AREA_OR_POINT", "Area", nullptr);
  GDALSetMetadataItem(dataset.get(), "TIFFTAG_SOFTWARE", "leadline", nullptr);
  GDALSetMetadataItem(dataset.get(), "LEADLINE_FRAME", placement.description.c_str(), nullptr);
  const bool depth = sign == VerticalSign::kDepth;
  GDALSetMetadataItem(dataset.get(), "LEADLINE_SIGN",
                      depth ? "depth positive down, equal to minus elevation"
                            : "elevation positive up, equal to minus depth",
                      nullptr);
  GDALSetMetadataItem(dataset.get(), "LEADLINE_VERTICAL_DATUM",
                      reference.vertical_datum.value_or("not stated").c_str(), nullptr);
  GDALSetMetadataItem(dataset.get(), "LEADLINE_SIGMA",
                      sigma != nullptr ? "band 2, one standard deviation, metres" : "none",
                      nullptr);
  write_band(dataset, 1, depth ? negated(elevation) : elevation,
             depth ? kDepthDescription : kElevationDescription, path);
  if (sigma != nullptr) {
    write_band(dataset, 2, *sigma, kSigmaDescription, path);
  }
  // Much reaches the disk only when GDAL closes the file, and GDALClose of this version returns
  // nothing: the error state tells.
  CPLErrorReset();
  GDALFlushCache(dataset.get());
  dataset.reset();
  if (CPLGetLastErrorType() >= CE_Failure) {
    throw HostError(ExitCode::kOutput, path + ": cannot be written" + QuietGdal::reason());
  }
}

void write_geotiff_whole(const std::string& path, const Raster& elevation, const Raster* sigma,
                         const GeoReference& reference, VerticalSign sign) {
  // What is under that name gives way only if it is a file; a link keeps standing.
  std::error_code ignored;
  const std::filesystem::path real = std::filesystem::canonical(path, ignored);
  const std::string target = real.empty() ? path : real.string();
  const std::filesystem::file_status status = std::filesystem::status(target, ignored);
  if (std::filesystem::exists(status) && !std::filesystem::is_regular_file(status)) {
    throw HostError(ExitCode::kOutput, path + ": is not a file, a GeoTIFF cannot go there");
  }
  const std::string temporary = target + ".partial-" + std::to_string(getpid()) + ".tif";
  try {
    write_geotiff(temporary, elevation, sigma, reference, sign);
  } catch (...) {
    std::remove(temporary.c_str());
    throw;
  }
  const int fd = open(temporary.c_str(), O_RDONLY | O_CLOEXEC);
  const bool synced = fd >= 0 && fsync(fd) == 0;
  if (fd >= 0) {
    close(fd);
  }
  if (!synced || std::rename(temporary.c_str(), target.c_str()) != 0) {
    const std::string reason = std::strerror(errno);
    std::remove(temporary.c_str());
    throw HostError(ExitCode::kOutput, path + ": cannot be put in place: " + reason);
  }
}

GeoTiffContent read_geotiff(const std::string& path) {
  register_drivers();
  const QuietGdal quiet;
  const Dataset dataset(
      GDALOpenEx(path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY, nullptr, nullptr, nullptr));
  if (!dataset) {
    throw HostError(ExitCode::kInput,
                    path + ": is not a raster that GDAL reads" + QuietGdal::reason());
  }
  const int columns = GDALGetRasterXSize(dataset.get());
  const int rows = GDALGetRasterYSize(dataset.get());
  const int bands = GDALGetRasterCount(dataset.get());
  if (columns < 1 || rows < 1 || bands < 1 ||
      static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows) > kMaxRasterCells) {
    throw HostError(ExitCode::kInput, path + ": " + std::to_string(columns) + " x " +
                                          std::to_string(rows) + " cells in " +
                                          std::to_string(bands) + " bands cannot be used");
  }
  double transform[6] = {0.0, 1.0, 0.0, static_cast<double>(rows), 0.0, -1.0};
  // No transform is a plain image: cells of one metre.
  GDALGetGeoTransform(dataset.get(), transform);
  const double cell_m = transform[1];
  if (transform[2] != 0.0 || transform[4] != 0.0 || !(cell_m > 0.0) ||
      !(std::fabs(cell_m + transform[5]) <= 1e-3 * cell_m)) {
    throw HostError(ExitCode::kInput, path + ": cells are not square with north up (steps east " +
                                          std::to_string(transform[1]) + ", north " +
                                          std::to_string(-transform[5]) + ", rotation " +
                                          std::to_string(transform[2]) + ", " +
                                          std::to_string(transform[4]) + ")");
  }
  GeoTiffContent content;
  OGRSpatialReferenceH system = GDALGetSpatialRef(dataset.get());
  if (system != nullptr && OSRIsGeographic(system) != 0) {
    throw HostError(ExitCode::kInput, path +
                                          ": its cells are degrees; project it to metres first, "
                                          "for example gdalwarp -t_srs EPSG:32632 ...");
  }
  Raster geometry;
  geometry.columns = columns;
  geometry.rows = rows;
  geometry.west_m = transform[0];
  geometry.cell_m = cell_m;
  geometry.south_m = transform[3] - rows * cell_m;
  if (system != nullptr) {
    const char* name = OSRGetName(system);
    content.coordinate_system = name != nullptr ? name : "unnamed";
    const char* code = OSRGetAuthorityCode(system, nullptr);
    const char* authority = OSRGetAuthorityName(system, nullptr);
    if (code != nullptr && authority != nullptr && std::string(authority) == "EPSG") {
      content.epsg = std::atoi(code);
    }
  }
  const char* datum = GDALGetMetadataItem(dataset.get(), "LEADLINE_VERTICAL_DATUM", nullptr);
  if (datum != nullptr && std::string(datum) != "not stated") {
    content.vertical_datum = datum;
  }
  content.elevation = read_band(dataset, 1, geometry, path);
  if (bands >= 2) {
    const std::string description =
        lower_ascii(GDALGetDescription(GDALGetRasterBand(dataset.get(), 2)));
    if (description.rfind("sigma", 0) == 0 || description.rfind("uncertainty", 0) == 0) {
      content.sigma = read_band(dataset, 2, geometry, path);
    }
  }
  return content;
}

Raster read_raster(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) {
    throw HostError(ExitCode::kInput, path + ": cannot be opened");
  }
  char head[6] = {};
  file.read(head, sizeof head - 1);
  const std::string start = lower_ascii(std::string(head));
  const bool is_ascii = start == "ncols" || start == "nrows" || start == "xllco" ||
                        start == "xllce" || start == "yllco" || start == "yllce" ||
                        start == "cells";
  const bool named_ascii = path.size() >= 4 && lower_ascii(path.substr(path.size() - 4)) == ".asc";
  // A file called .asc that is not one gets the message of the reader that names the line.
  return is_ascii || named_ascii ? read_esri_ascii(path) : read_geotiff(path).elevation;
}

}  // namespace leadline::host
