#include "host_tools/export/export.hpp"

#include <array>
#include <cmath>
#include <cstring>
#include <iostream>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/export/export_parts.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/settings.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

struct FormatName {
  ExportFormat format;
  const char* name;
  const char* ending;
};
constexpr std::array<FormatName, 8> kFormats = {{
    {ExportFormat::kGeoTiff, "geotiff", ".tif"},
    {ExportFormat::kEsriAscii, "asc", ".asc"},
    {ExportFormat::kXyz162, "xyz162", ".xyz"},
    {ExportFormat::kXyz168, "xyz168", ""},
    {ExportFormat::kPly, "ply", ".ply"},
    {ExportFormat::kLas, "las", ".las"},
    {ExportFormat::kGeoJson, "geojson", ".geojson"},
    {ExportFormat::kKml, "kml", ".kml"},
}};

/// Index of `text` among `names`; kUsage naming the option otherwise.
std::size_t choice(const char* option, const std::string& text,
                   const std::vector<std::string>& names) {
  std::string all;
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (names[k] == text) {
      return k;
    }
    all += (k == 0 ? "" : ", ") + names[k];
  }
  const std::string near = closest_name(text, names);
  export_usage_error(std::string(option) + " " + printable(text) + ": must be one of " + all +
                     (near.empty() ? "" : "; did you mean " + near + "?"));
}

ExportFormat chosen_format(const ExportOptions& options) {
  std::vector<std::string> names;
  for (const FormatName& format : kFormats) {
    const std::string ending = format.ending;
    const std::string& path = options.out_path;
    if (options.format.empty() && !ending.empty() && path.size() > ending.size() &&
        path.compare(path.size() - ending.size(), ending.size(), ending) == 0) {
      return format.format;
    }
    names.emplace_back(format.name);
  }
  if (options.format.empty()) {
    export_usage_error("--out " + printable(options.out_path) +
                       ": the ending does not tell the format (.tif, .asc, .xyz, .ply, .las, "
                       ".geojson, .kml); give --format");
  }
  return kFormats[choice("--format", options.format, names)].format;
}

bool is_xyz(ExportFormat format) {
  return format == ExportFormat::kXyz162 || format == ExportFormat::kXyz168;
}

/// Contours and outlines.
bool is_vector(ExportFormat format) {
  return format == ExportFormat::kGeoJson || format == ExportFormat::kKml;
}

/// Formats of points, whose coordinates --frame chooses.
bool has_frame(ExportFormat format) {
  return is_xyz(format) || is_vector(format) || format == ExportFormat::kLas;
}

VerticalSign chosen_sign(const ExportOptions& options, ExportFormat format) {
  const VerticalSign natural =
      format == ExportFormat::kXyz162 ? VerticalSign::kDepth : VerticalSign::kElevation;
  if (options.vertical.empty()) {
    return natural;
  }
  const VerticalSign sign = choice("--vertical", options.vertical, {"elevation", "depth"}) == 0
                                ? VerticalSign::kElevation
                                : VerticalSign::kDepth;
  if (is_xyz(format) && sign != natural) {
    export_usage_error("--vertical " + options.vertical + ": " +
                       (format == ExportFormat::kXyz162
                            ? "xyz162 is depth; elevations are xyz168"
                            : "xyz168 is elevation; depths are xyz162"));
  }
  return sign;
}

ExportLayer chosen_layer(const ExportOptions& options, ExportFormat format,
                         const MapSource& source) {
  if (options.layer.empty()) {
    return ExportLayer::kMap;
  }
  const auto layer = static_cast<ExportLayer>(
      choice("--layer", options.layer, {"map", "sigma", "voxels", "contours", "coverage"}));
  if (layer == ExportLayer::kSigma && format != ExportFormat::kEsriAscii) {
    export_usage_error(
        "--layer sigma: for asc only; the other formats carry sigma beside the heights");
  }
  if (layer == ExportLayer::kSigma && !source.sigma) {
    throw HostError(ExitCode::kInput, source.origin + ": has no sigma");
  }
  if (layer == ExportLayer::kVoxels && format != ExportFormat::kPly &&
      format != ExportFormat::kLas) {
    export_usage_error("--layer voxels: for ply and las only");
  }
  if ((layer == ExportLayer::kContours || layer == ExportLayer::kCoverage) && !is_vector(format)) {
    export_usage_error("--layer " + options.layer + ": for geojson and kml only");
  }
  if (layer == ExportLayer::kVoxels && !source.model) {
    throw HostError(ExitCode::kInput, source.origin + ": has no voxels (model.llm)");
  }
  return layer;
}

GeoReference chosen_reference(const ExportOptions& options, const MapSource& source) {
  GeoReference reference = source.reference;
  if (options.lat_deg.has_value() != options.lon_deg.has_value()) {
    export_usage_error("--lat and --lon go together");
  }
  if (options.lat_deg && !(std::fabs(*options.lat_deg) <= 90.0)) {
    export_usage_error("--lat " + number_text(*options.lat_deg) + ": must be -90 .. 90");
  }
  if (options.lon_deg && !(*options.lon_deg >= -180.0 && *options.lon_deg <= 360.0)) {
    export_usage_error("--lon " + number_text(*options.lon_deg) + ": must be -180 .. 360");
  }
  if (options.lat_deg) {
    reference.lat_deg = options.lat_deg;
    reference.lon_deg = options.lon_deg;
  }
  if (options.lat_deg || options.epsg) {
    reference.epsg = options.epsg;
  }
  if (options.datum) {
    reference.vertical_datum = options.datum;
  }
  return reference;
}

void ply_line(PackedBytes* ply, const std::string& text) { ply->text(text + "\n"); }

void ply_head(PackedBytes* ply, const MapSource& source, const ExportPlan& plan) {
  ply_line(ply, "ply");
  ply_line(ply, "format binary_little_endian 1.0");
  ply_line(ply, "comment leadline: " + origin_text(source, plan));
  ply_line(ply, "comment x east, y north, local metres; z " + std::string(sign_text(plan.sign)));
  ply_line(ply, "comment vertical datum: " + printable(datum_text(plan.reference), 100));
}

std::string ply_of_voxels(const MapSource& source, const ExportPlan& plan) {
  const std::vector<VoxelPoint> points = occupied_voxels(*source.model, plan.sign);
  PackedBytes ply;
  ply_head(&ply, source, plan);
  ply_line(&ply, "comment centres of occupied voxels of " +
                     number_text(source.model->config.grid.cell_mm / 1000.0) + " m");
  ply_line(&ply, "element vertex " + std::to_string(points.size()));
  for (const char* const axis : {"x", "y", "z"}) {
    ply_line(&ply, std::string("property double ") + axis);
  }
  ply_line(&ply, "property float probability");
  ply_line(&ply, "end_header");
  for (const VoxelPoint& point : points) {
    for (const double coordinate : point.position_m) {
      ply.value(coordinate);
    }
    ply.value(point.probability);
  }
  return ply.take();
}

/// Triangles between known neighbours: two for a whole square of four, one where a corner is missing.
/// Counter-clockwise seen from above.
std::vector<std::array<std::int32_t, 3>> triangles(const Raster& raster,
                                                   const std::vector<std::int32_t>& vertex) {
  std::vector<std::array<std::int32_t, 3>> faces;
  for (int row = 0; row + 1 < raster.rows; ++row) {
    for (int column = 0; column + 1 < raster.columns; ++column) {
      // Round the square from its south-west corner.
      const std::array<std::int32_t, 4> corners = {
          vertex[raster.index(row + 1, column)], vertex[raster.index(row + 1, column + 1)],
          vertex[raster.index(row, column + 1)], vertex[raster.index(row, column)]};
      std::vector<std::int32_t> known;
      for (const std::int32_t corner : corners) {
        if (corner >= 0) {
          known.push_back(corner);
        }
      }
      for (std::size_t k = 2; k < known.size(); ++k) {
        faces.push_back({known[0], known[k - 1], known[k]});
      }
    }
  }
  return faces;
}

/// What went into the file, for who asked for it.
std::string content_text(const MapSource& source, const ExportPlan& plan) {
  if (plan.layer == ExportLayer::kSigma) {
    return std::to_string(source.sigma->known_count()) +
           " cells, one standard deviation of the depth in metres";
  }
  const std::string what = plan.layer == ExportLayer::kVoxels
                               ? "centres of the occupied voxels"
                               : std::to_string(source.elevation.known_count()) + " cells";
  return what + ", " + sign_text(plan.sign) + ", vertical datum " + datum_text(plan.reference);
}

}  // namespace

[[noreturn]] void export_usage_error(const std::string& message) {
  throw HostError(ExitCode::kUsage, "export: " + message);
}

std::string origin_text(const MapSource& source, const ExportPlan& plan) {
  const std::string name = plan.reference.survey_name.value_or("");
  return printable(source.origin, 200) + (name.empty() ? "" : ", survey " + printable(name, 100));
}

std::string datum_text(const GeoReference& reference) {
  return reference.vertical_datum.value_or("not stated");
}

const char* sign_text(VerticalSign sign) {
  return sign == VerticalSign::kDepth ? "depth in metres, positive down"
                                      : "elevation in metres, positive up";
}

std::vector<VoxelPoint> occupied_voxels(const SavedModel& model, VerticalSign sign) {
  const GridConfig& grid = model.config.grid;
  const auto centre_m = [&grid](int axis, std::int32_t index) {
    return (static_cast<double>(grid.origin_mm[axis]) + (index + 0.5) * grid.cell_mm) / 1000.0;
  };
  std::vector<VoxelPoint> points;
  for (std::int32_t n = 0; n < grid.size[0]; ++n) {
    for (std::int32_t e = 0; e < grid.size[1]; ++e) {
      for (std::int32_t d = 0; d < grid.size[2]; ++d) {
        const model::Voxel& voxel = model.voxel(n, e, d);
        if (voxel_state(voxel) == VoxelState::kOccupied) {
          points.push_back({{centre_m(1, e), centre_m(0, n), signed_height(-centre_m(2, d), sign)},
                            static_cast<float>(voxel_signal(voxel))});
        }
      }
    }
  }
  return points;
}

std::string coordinates_text(const MapSource& source, const ExportPlan& plan) {
  const bool in_system = plan.format == ExportFormat::kGeoTiff || plan.grid_in_epsg ||
                         plan.frame == ExportFrame::kProjected;
  if (has_frame(plan.format) && !in_system) {
    return plan.frame == ExportFrame::kLonLat ? "longitude and latitude on WGS 84"
                                              : "local metres, east and north";
  }
  if (!in_system) {
    return "coordinates as the map has them";
  }
  const Placement placement = place_raster(plan.reference, source.elevation);
  std::string text = placement.description;
  if (plan.format == ExportFormat::kGeoTiff && placement.plane.turn_deg() != 0.0) {
    text += ", turned by ";
    append_fixed(&text, placement.plane.turn_deg(), 3);
    text += " degrees";
  }
  return text;
}

ExportPlan plan_export(const ExportOptions& options, const MapSource& source) {
  ExportPlan plan;
  plan.format = chosen_format(options);
  plan.sign = chosen_sign(options, plan.format);
  plan.layer = chosen_layer(options, plan.format, source);
  plan.reference = chosen_reference(options, source);
  const bool placed = GeographicFrame::has_place(plan.reference);
  plan.frame = placed ? ExportFrame::kLonLat : ExportFrame::kLocal;
  if (plan.format == ExportFormat::kLas && plan.reference.epsg.has_value()) {
    plan.frame = ExportFrame::kProjected;
  }
  if (!options.frame.empty()) {
    plan.frame = static_cast<ExportFrame>(choice("--frame", options.frame, {"local", "lonlat"}));
    if (plan.format == ExportFormat::kEsriAscii && plan.frame == ExportFrame::kLonLat) {
      export_usage_error("--frame lonlat: the cells of an ESRI ASCII grid are metres");
    }
    if (plan.format == ExportFormat::kKml && plan.frame == ExportFrame::kLocal) {
      export_usage_error(
          "--frame local: KML is longitude and latitude; GeoJSON holds local metres");
    }
    if (!has_frame(plan.format) && plan.format != ExportFormat::kEsriAscii) {
      export_usage_error("--frame: for xyz162, xyz168, las, geojson, kml and asc only");
    }
  }
  if (plan.format == ExportFormat::kKml && !placed) {
    export_usage_error(
        "KML is longitude and latitude, and the map has no place on Earth: give --lat and --lon "
        "(of "
        "its origin) or --epsg, or export GeoJSON in local metres");
  }
  // Who asks for a system of an ASCII grid gets it, or an error; otherwise it stays as the map has it.
  plan.grid_in_epsg = plan.format == ExportFormat::kEsriAscii && options.epsg.has_value() &&
                      plan.reference.lat_deg.has_value() && options.frame.empty();
  if (has_frame(plan.format) && plan.frame == ExportFrame::kLonLat && !placed) {
    export_usage_error(
        "--frame lonlat: the map has no place on Earth; give --lat and --lon (of its "
        "origin) or --epsg");
  }
  plan.contour_interval_m = options.contour_interval_m;
  if (plan.contour_interval_m && !is_vector(plan.format)) {
    export_usage_error("--contours: for geojson and kml only");
  }
  if (plan.contour_interval_m && !(*plan.contour_interval_m >= 0.0)) {
    export_usage_error("--contours " + number_text(*plan.contour_interval_m) +
                       ": must be 0 or more metres");
  }
  return plan;
}

std::string format_grid(const MapSource& source, const ExportPlan& plan) {
  const bool sigma = plan.layer == ExportLayer::kSigma;
  Raster raster = sigma ? *source.sigma : source.elevation;
  if (!sigma && plan.sign == VerticalSign::kDepth) {
    raster = negated(raster);
  }
  if (plan.grid_in_epsg) {
    const Placement placement = place_raster(plan.reference, raster);
    // Asked positively, so that a NaN is refused.
    if (!(placement.north_up_error_cells <= kMaxPlacementError_cells)) {
      std::string turn;
      append_fixed(&turn, placement.plane.turn_deg(), 3);
      std::string error;
      append_fixed(&error, placement.north_up_error_cells, 2);
      export_usage_error(
          "--epsg " + std::to_string(*plan.reference.epsg) +
          ": an ESRI ASCII grid has north up, this map is turned by " + turn + " degrees there (" +
          error +
          " cells at its edge); export a GeoTIFF, which holds the turned grid, or keep "
          "local metres with --frame local");
    }
    raster = north_up(placement, raster);
  }
  return format_esri_ascii(raster, raster_decimals(raster.cell_m));
}

std::string format_xyz(const MapSource& source, const ExportPlan& plan) {
  const bool degrees = plan.frame == ExportFrame::kLonLat;
  std::unique_ptr<GeographicFrame> frame;
  if (degrees) {
    frame = std::make_unique<GeographicFrame>(plan.reference);
  }
  // Lines that start with neither digit, space nor sign are comments to MB-System.
  std::string text = "# leadline: " + origin_text(source, plan) + "\n";
  text += "# MB-System format " +
          std::string(plan.format == ExportFormat::kXyz162 ? "162" : "168") + ", " +
          sign_text(plan.sign) + ", vertical datum: " + printable(datum_text(plan.reference), 100) +
          "\n";
  text += degrees ? "# longitude latitude (degrees, WGS 84), from " + frame->description() + "\n"
                  : "# local metres, not georeferenced: east north\n";
  text += std::string("# columns: ") + (degrees ? "longitude latitude " : "east north ") +
          (plan.sign == VerticalSign::kDepth ? "depth" : "elevation") +
          (source.sigma ? " sigma\n" : "\n");
  const int height_digits = raster_decimals(source.elevation.cell_m);
  for_each_cell(source.elevation, [&](int row, int column, double elevation_m) {
    const double east_m = source.elevation.east_of_column_m(column);
    const double north_m = source.elevation.north_of_row_m(row);
    if (degrees) {
      const GeographicPoint point = frame->at(east_m, north_m);
      append_fixed(&text, point.longitude_deg, 9);
      text += ' ';
      append_fixed(&text, point.latitude_deg, 9);
    } else {
      append_fixed(&text, east_m, height_digits);
      text += ' ';
      append_fixed(&text, north_m, height_digits);
    }
    text += ' ';
    append_fixed(&text, signed_height(elevation_m, plan.sign), height_digits);
    // Never "nan": a fourth word that starts with N would flag the sounding as none.
    if (source.sigma && !std::isnan(source.sigma->at(row, column))) {
      text += ' ';
      append_fixed(&text, source.sigma->at(row, column), height_digits);
    }
    text += '\n';
  });
  return text;
}

std::string format_ply(const MapSource& source, const ExportPlan& plan) {
  if (plan.layer == ExportLayer::kVoxels) {
    return ply_of_voxels(source, plan);
  }
  const Raster& raster = source.elevation;
  std::vector<std::int32_t> vertex(raster.values.size(), -1);
  std::int32_t count = 0;
  for_each_cell(raster, [&](int row, int column, double) {
    vertex[raster.index(row, column)] = count;
    ++count;
  });
  const std::vector<std::array<std::int32_t, 3>> faces = triangles(raster, vertex);
  PackedBytes ply;
  ply_head(&ply, source, plan);
  ply_line(&ply, "element vertex " + std::to_string(count));
  for (const char* const axis : {"x", "y", "z"}) {
    ply_line(&ply, std::string("property double ") + axis);
  }
  if (source.sigma) {
    ply_line(&ply, "property float sigma");
  }
  ply_line(&ply, "element face " + std::to_string(faces.size()));
  ply_line(&ply, "property list uchar int vertex_indices");
  ply_line(&ply, "end_header");
  for_each_cell(raster, [&](int row, int column, double elevation_m) {
    ply.value(raster.east_of_column_m(column));
    ply.value(raster.north_of_row_m(row));
    ply.value(signed_height(elevation_m, plan.sign));
    if (source.sigma) {
      ply.value(static_cast<float>(source.sigma->at(row, column)));
    }
  });
  for (const std::array<std::int32_t, 3>& face : faces) {
    ply.value(std::uint8_t{3});
    for (const std::int32_t corner : face) {
      ply.value(corner);
    }
  }
  return ply.take();
}

int run_export(const ExportOptions& options) {
  const MapSource source = load_map_source(options.input_path);
  const ExportPlan plan = plan_export(options, source);
  switch (plan.format) {
    case ExportFormat::kGeoTiff:
      if (options.out_path == "-") {
        export_usage_error("--out -: a GeoTIFF cannot go to standard output");
      }
      write_geotiff_whole(options.out_path, source.elevation,
                          source.sigma ? &*source.sigma : nullptr, plan.reference, plan.sign);
      break;
    case ExportFormat::kEsriAscii:
      write_file_whole(options.out_path, format_grid(source, plan));
      break;
    case ExportFormat::kXyz162:
    case ExportFormat::kXyz168:
      write_file_whole(options.out_path, format_xyz(source, plan));
      break;
    case ExportFormat::kPly:
      write_file_whole(options.out_path, format_ply(source, plan));
      break;
    case ExportFormat::kLas:
      write_file_whole(options.out_path, format_las(source, plan));
      break;
    case ExportFormat::kGeoJson:
      write_file_whole(options.out_path, format_geojson(source, plan));
      break;
    case ExportFormat::kKml:
      write_file_whole(options.out_path, format_kml(source, plan));
      break;
  }
  if (options.out_path != "-") {
    std::cout << options.out_path << ": " << content_text(source, plan) << "; "
              << coordinates_text(source, plan) << "\n";
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
