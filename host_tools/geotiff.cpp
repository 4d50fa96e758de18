#include "host_tools/geotiff.hpp"

#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <locale>
#include <memory>
#include <sstream>
#include <string>
#include <system_error>
#include <vector>

#include <cpl_conv.h>
#include <cpl_error.h>
#include <cpl_string.h>
#include <fcntl.h>
#include <gdal.h>
#include <ogr_srs_api.h>
#include <unistd.h>

#include "firmware/config/input_file.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/gdal_support.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

constexpr const char* kElevationDescription = "elevation";
constexpr const char* kDepthDescription = "depth";
constexpr const char* kSigmaDescription = "sigma";

struct CloseDataset {
  void operator()(void* dataset) const { GDALClose(dataset); }
};
using Dataset = std::unique_ptr<void, CloseDataset>;

struct FreeList {
  void operator()(char** list) const { CSLDestroy(list); }
};
using StringList = std::unique_ptr<char*, FreeList>;

void add_option(StringList* list, const char* name, const std::string& value) {
  list->reset(CSLSetNameValue(list->release(), name, value.c_str()));
}

/// Tags of a file whose grid is turned: the origin, and the affine map that made the grid.
constexpr const char* kOriginTag = "LEADLINE_ORIGIN";
constexpr const char* kNameTag = "LEADLINE_SURVEY";
constexpr const char* kPlaneTag = "LEADLINE_PLANE";
constexpr const char* kSignTag = "LEADLINE_SIGN";

/// A file under its name for the user and the name under which it is being written.
struct FileName {
  std::string path;
  std::string shown;

  /// GDAL's reason names the file that it knows.
  [[nodiscard]] HostError error(const std::string& what) const {
    std::string text = shown + ": " + what + QuietGdal::reason();
    for (std::size_t at = text.find(path); shown != path && at != std::string::npos;
         at = text.find(path, at + shown.size())) {
      text.replace(at, path.size(), shown);
    }
    return {ExitCode::kOutput, text};
  }
};

std::string exact_numbers(const std::vector<double>& numbers) {
  std::string text;
  for (const double number : numbers) {
    text += (text.empty() ? "" : " ") + json_number(number);
  }
  return text;
}

/// The `count` numbers of a tag; empty where it is missing or otherwise.
std::vector<double> tagged_numbers(GDALDatasetH dataset, const char* tag, std::size_t count) {
  const char* text = GDALGetMetadataItem(dataset, tag, nullptr);
  if (text == nullptr) {
    return {};
  }
  std::istringstream stream{std::string(text)};
  stream.imbue(std::locale::classic());
  std::vector<double> numbers;
  for (double number = 0.0; stream >> number && numbers.size() <= count;) {
    numbers.push_back(number);
  }
  return numbers.size() == count && stream.eof() ? numbers : std::vector<double>();
}

std::vector<double> plane_numbers(const PlaneMap& plane) {
  return {plane.east_m,     plane.north_m,     plane.x_m,        plane.y_m,
          plane.x_per_east, plane.x_per_north, plane.y_per_east, plane.y_per_north};
}

void write_band(const Dataset& dataset, int number, const Raster& raster, const char* description,
                const FileName& name) {
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
    throw name.error("cannot be written");
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

/// The grid as the file has it: local coordinates where the file tells how to get back to them, else those
/// of its system. Throws where neither is a north-up grid of squares.
Raster read_geometry(GDALDatasetH dataset, const std::string& path, GeoTiffContent* content) {
  const int columns = GDALGetRasterXSize(dataset);
  const int rows = GDALGetRasterYSize(dataset);
  // No transform is a plain image: cells of one metre.
  std::array<double, 6> transform = {0.0, 1.0, 0.0, static_cast<double>(rows), 0.0, -1.0};
  GDALGetGeoTransform(dataset, transform.data());
  const std::vector<double> origin = tagged_numbers(dataset, kOriginTag, 2);
  const std::vector<double> numbers = tagged_numbers(dataset, kPlaneTag, 8);
  if (!origin.empty() && !numbers.empty() && content->epsg.has_value()) {
    const PlaneMap plane = {numbers[0], numbers[1], numbers[2], numbers[3],
                            numbers[4], numbers[5], numbers[6], numbers[7]};
    // Tags survive a warp to another grid; that one is not parallel to the local axes any more.
    const std::optional<Raster> local = local_geometry(plane, transform, columns, rows);
    if (local.has_value()) {
      content->lat_deg = origin[0];
      content->lon_deg = origin[1];
      return *local;
    }
  }
  const double cell_m = transform[1];
  if (transform[2] != 0.0 || transform[4] != 0.0 || !(cell_m > 0.0) ||
      !(std::fabs(cell_m + transform[5]) <= 1e-3 * cell_m)) {
    throw HostError(ExitCode::kInput, path + ": cells are not square with north up (steps east " +
                                          std::to_string(transform[1]) + ", north " +
                                          std::to_string(-transform[5]) + ", rotation " +
                                          std::to_string(transform[2]) + ", " +
                                          std::to_string(transform[4]) + ")");
  }
  Raster geometry;
  geometry.columns = columns;
  geometry.rows = rows;
  geometry.west_m = transform[0];
  geometry.cell_m = cell_m;
  geometry.south_m = transform[3] - rows * cell_m;
  return geometry;
}

/// Name, code and, for a plane of our own kind, origin of the file's coordinate system.
void read_system(GDALDatasetH dataset, const std::string& path, GeoTiffContent* content) {
  OGRSpatialReferenceH system = GDALGetSpatialRef(dataset);
  if (system == nullptr) {
    return;
  }
  if (OSRIsGeographic(system) != 0) {
    throw HostError(ExitCode::kInput, path +
                                          ": its cells are degrees; project it to metres first, "
                                          "for example gdalwarp -t_srs EPSG:32632 ...");
  }
  const char* name = OSRGetName(system);
  content->coordinate_system = name != nullptr ? name : "unnamed";
  const char* code = OSRGetAuthorityCode(system, nullptr);
  const char* authority = OSRGetAuthorityName(system, nullptr);
  if (code != nullptr && authority != nullptr && std::string(authority) == "EPSG") {
    content->epsg = std::atoi(code);
    return;
  }
  const char* projection = OSRGetAttrValue(system, "PROJECTION", 0);
  const auto parameter = [system](const char* key) {
    return OSRGetProjParm(system, key, kNoValue, nullptr);
  };
  if (projection != nullptr && std::string(projection) == SRS_PT_TRANSVERSE_MERCATOR &&
      parameter(SRS_PP_SCALE_FACTOR) == 1.0 && parameter(SRS_PP_FALSE_EASTING) == 0.0 &&
      parameter(SRS_PP_FALSE_NORTHING) == 0.0) {
    content->lat_deg = parameter(SRS_PP_LATITUDE_OF_ORIGIN);
    content->lon_deg = parameter(SRS_PP_CENTRAL_MERIDIAN);
  }
}

/// A file of ours says when its heights count downwards.
bool holds_depth(GDALDatasetH dataset) {
  const char* sign = GDALGetMetadataItem(dataset, kSignTag, nullptr);
  return sign != nullptr && lower_ascii(sign).rfind("depth", 0) == 0;
}

}  // namespace

void write_geotiff(const std::string& path, const Raster& elevation, const Raster* sigma,
                   const GeoReference& reference, VerticalSign sign,
                   const std::string& shown_path) {
  const FileName name = {path, shown_path.empty() ? path : shown_path};
  if (sigma != nullptr && !same_geometry(elevation, *sigma)) {
    throw HostError(ExitCode::kInput, name.shown + ": elevation has " +
                                          describe_geometry(elevation) + ", sigma has " +
                                          describe_geometry(*sigma));
  }
  const QuietGdal quiet;
  const Placement placement = place_raster(reference, elevation);
  require_affine(placement, elevation);
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
    throw name.error("cannot be created");
  }
  std::array<double, 6> transform = geotransform(placement.plane, elevation);
  GDALSetGeoTransform(dataset.get(), transform.data());
  if (placement.system) {
    GDALSetSpatialRef(dataset.get(), placement.system.get());
  }
  GDALSetMetadataItem(dataset.get(), "AREA_OR_POINT", "Area", nullptr);
  GDALSetMetadataItem(dataset.get(), "TIFFTAG_SOFTWARE", "leadline", nullptr);
  GDALSetMetadataItem(dataset.get(), "LEADLINE_FRAME", placement.description.c_str(), nullptr);
  if (reference.epsg.has_value() && reference.lat_deg.has_value() &&
      reference.lon_deg.has_value()) {
    GDALSetMetadataItem(dataset.get(), kOriginTag,
                        exact_numbers({*reference.lat_deg, *reference.lon_deg}).c_str(), nullptr);
    GDALSetMetadataItem(dataset.get(), kPlaneTag,
                        exact_numbers(plane_numbers(placement.plane)).c_str(), nullptr);
  }
  if (reference.survey_name) {
    GDALSetMetadataItem(dataset.get(), kNameTag, reference.survey_name->c_str(), nullptr);
  }
  const bool depth = sign == VerticalSign::kDepth;
  GDALSetMetadataItem(dataset.get(), kSignTag,
                      depth ? "depth positive down, equal to minus elevation"
                            : "elevation positive up, equal to minus depth",
                      nullptr);
  GDALSetMetadataItem(dataset.get(), "LEADLINE_VERTICAL_DATUM",
                      reference.vertical_datum.value_or("not stated").c_str(), nullptr);
  GDALSetMetadataItem(dataset.get(), "LEADLINE_SIGMA",
                      sigma != nullptr ? "band 2, one standard deviation, metres" : "none",
                      nullptr);
  write_band(dataset, 1, depth ? negated(elevation) : elevation,
             depth ? kDepthDescription : kElevationDescription, name);
  if (sigma != nullptr) {
    write_band(dataset, 2, *sigma, kSigmaDescription, name);
  }
  // Much reaches the disk only when GDAL closes the file, and GDALClose of this version returns
  // nothing: the error state tells.
  CPLErrorReset();
  GDALFlushCache(dataset.get());
  dataset.reset();
  if (CPLGetLastErrorType() >= CE_Failure) {
    throw name.error("cannot be written");
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
    write_geotiff(temporary, elevation, sigma, reference, sign, path);
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
  GeoTiffContent content;
  read_system(dataset.get(), path, &content);
  const Raster geometry = read_geometry(dataset.get(), path, &content);
  const char* datum = GDALGetMetadataItem(dataset.get(), "LEADLINE_VERTICAL_DATUM", nullptr);
  if (datum != nullptr && std::string(datum) != "not stated") {
    content.vertical_datum = datum;
  }
  const char* name = GDALGetMetadataItem(dataset.get(), kNameTag, nullptr);
  content.survey_name = name != nullptr ? name : "";
  content.elevation = read_band(dataset, 1, geometry, path);
  if (holds_depth(dataset.get())) {
    content.elevation = negated(content.elevation);
  }
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
  std::ifstream file = open_input(path);
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
