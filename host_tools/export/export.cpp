#include "host_tools/export/export.hpp"

#include <array>
#include <cmath>
#include <cstring>
#include <iostream>
#include <vector>

#include "host_tools/exit_codes.hpp"
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
constexpr std::array<FormatName, 5> kFormats = {{
    {ExportFormat::kGeoTiff, "geotiff", ".tif"},
    {ExportFormat::kEsriAscii, "asc", ".asc"},
    {ExportFormat::kXyz162, "xyz162", ".xyz"},
    {ExportFormat::kXyz168, "xyz168", ""},
    {ExportFormat::kPly, "ply", ".ply"},
}};

[[noreturn]] void usage_error(const std::string& message) {
  throw HostError(ExitCode::kUsage, "export: " + message);
}

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
  usage_error(std::string(option) + " " + printable(text) + ": must be one of " + all +
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
    usage_error("--out " + printable(options.out_path) +
                ": the ending does not tell the format (.tif, .asc, .xyz, .ply); give --format");
  }
  return kFormats[choice("--format", options.format, names)].format;
}

bool is_xyz(ExportFormat format) {
  return format == ExportFormat::kXyz162 || format == ExportFormat::kXyz168;
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
    usage_error("--vertical " + options.vertical + ": " +
                (format == ExportFormat::kXyz162 ? "xyz162 is depth; elevations are xyz168"
                                                 : "xyz168 is elevation; depths are xyz162"));
  }
  return sign;
}

ExportLayer chosen_layer(const ExportOptions& options, ExportFormat format,
                         const MapSource& source) {
  if (options.layer.empty()) {
    return ExportLayer::kMap;
  }
  const auto layer =
      static_cast<ExportLayer>(choice("--layer", options.layer, {"map", "sigma", "voxels"}));
  if (layer == ExportLayer::kSigma && format != ExportFormat::kEsriAscii) {
    usage_error("--layer sigma: for asc only; the other formats carry sigma beside the heights");
  }
  if (layer == ExportLayer::kSigma && !source.sigma) {
    throw HostError(ExitCode::kInput, source.origin + ": has no sigma");
  }
  if (layer == ExportLayer::kVoxels && format != ExportFormat::kPly) {
    usage_error("--layer voxels: for ply only");
  }
  if (layer == ExportLayer::kVoxels && !source.model) {
    throw HostError(ExitCode::kInput, source.origin + ": has no voxels (model.llm)");
  }
  return layer;
}

GeoReference chosen_reference(const ExportOptions& options, const MapSource& source) {
  GeoReference reference = source.reference;
  if (options.lat_deg.has_value() != options.lon_deg.has_value()) {
    usage_error("--lat and --lon go together");
  }
  if (options.lat_deg && !(std::fabs(*options.lat_deg) <= 90.0)) {
    usage_error("--lat " + number_text(*options.lat_deg) + ": must be -90 .. 90");
  }
  if (options.lon_deg && !(*options.lon_deg >= -180.0 && *options.lon_deg <= 360.0)) {
    usage_error("--lon " + number_text(*options.lon_deg) + ": must be -180 .. 360");
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

std::string datum_text(const GeoReference& reference) {
  return reference.vertical_datum.value_or("not stated");
}

const char* sign_text(VerticalSign sign) {
  return sign == VerticalSign::kDepth ? "depth in metres, positive down"
                                      : "elevation in metres, positive up";
}

/// Calls visit(row, column, elevation) for every known cell, north to south, west to east.
template <typename Visit>
void for_each_cell(const Raster& raster, Visit visit) {
  for (int row = 0; row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column) {
      if (!std::isnan(raster.at(row, column))) {
        visit(row, column, raster.at(row, column));
      }
    }
  }
}

double signed_height(double elevation_m, VerticalSign sign) {
  return sign == VerticalSign::kDepth ? -elevation_m : elevation_m;
}

/// Little-endian binary PLY: header lines, then packed values.
class PlyWriter {
 public:
  void line(const std::string& text) { bytes_ += text + "\n"; }
  template <typename Value>
  void value(Value value) {
    static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "PLY is written as memory has it");
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    bytes_.append(raw, sizeof raw);
  }
  [[nodiscard]] std::string take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

void ply_head(PlyWriter* ply, const MapSource& source, const ExportPlan& plan) {
  ply->line("ply");
  ply->line("format binary_little_endian 1.0");
  ply->line("comment leadline: " + printable(source.origin, 200));
  ply->line("comment x east, y north, local metres; z " + std::string(sign_text(plan.sign)));
  ply->line("comment vertical datum: " + printable(datum_text(plan.reference), 100));
}

std::string ply_of_voxels(const MapSource& source, const ExportPlan& plan) {
  const SavedModel& model = *source.model;
  const GridConfig& grid = model.config.grid;
  struct Point {
    double position[3];
    float probability;
  };
  std::vector<Point> points;
  for (std::int32_t n = 0; n < grid.size[0]; ++n) {
    for (std::int32_t e = 0; e < grid.size[1]; ++e) {
      for (std::int32_t d = 0; d < grid.size[2]; ++d) {
        const model::Voxel& voxel = model.voxel(n, e, d);
        if (voxel_state(voxel) != VoxelState::kOccupied) {
          continue;
        }
        const auto centre_m = [&grid](int axis, std::int32_t index) {
          return (static_cast<double>(grid.origin_mm[axis]) + (index + 0.5) * grid.cell_mm) /
                 1000.0;
        };
        points.push_back(
            {{centre_m(1, e), centre_m(0, n), signed_height(-centre_m(2, d), plan.sign)},
             static_cast<float>(voxel_signal(voxel))});
      }
    }
  }
  PlyWriter ply;
  ply_head(&ply, source, plan);
  ply.line("comment centres of occupied voxels of " + number_text(grid.cell_mm / 1000.0) + " m");
  ply.line("element vertex " + std::to_string(points.size()));
  for (const char* const axis : {"x", "y", "z"}) {
    ply.line(std::string("property double ") + axis);
  }
  ply.line("property float probability");
  ply.line("end_header");
  for (const Point& point : points) {
    for (const double coordinate : point.position) {
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

/// What the coordinates in the file are, in words.
std::string coordinates_text(const MapSource& source, const ExportPlan& plan) {
  if (is_xyz(plan.format)) {
    return plan.frame == ExportFrame::kLonLat ? "longitude and latitude on WGS 84"
                                              : "local metres, east and north";
  }
  const bool in_system = plan.format == ExportFormat::kGeoTiff || plan.grid_in_epsg;
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

}  // namespace

ExportPlan plan_export(const ExportOptions& options, const MapSource& source) {
  ExportPlan plan;
  plan.format = chosen_format(options);
  plan.sign = chosen_sign(options, plan.format);
  plan.layer = chosen_layer(options, plan.format, source);
  plan.reference = chosen_reference(options, source);
  const bool placed = GeographicFrame::has_place(plan.reference);
  plan.frame = placed ? ExportFrame::kLonLat : ExportFrame::kLocal;
  if (!options.frame.empty()) {
    plan.frame = static_cast<ExportFrame>(choice("--frame", options.frame, {"local", "lonlat"}));
    if (plan.format == ExportFormat::kEsriAscii && plan.frame == ExportFrame::kLonLat) {
      usage_error("--frame lonlat: the cells of an ESRI ASCII grid are metres");
    }
    if (!is_xyz(plan.format) && plan.format != ExportFormat::kEsriAscii) {
      usage_error("--frame: for xyz162, xyz168 and asc only");
    }
  }
  // Who asks for a system of an ASCII grid gets it, or an error; otherwise it stays as the map has it.
  plan.grid_in_epsg = plan.format == ExportFormat::kEsriAscii && options.epsg.has_value() &&
                      plan.reference.lat_deg.has_value() && options.frame.empty();
  if (is_xyz(plan.format) && plan.frame == ExportFrame::kLonLat && !placed) {
    usage_error(
        "--frame lonlat: the map has no place on Earth; give --lat and --lon (of its "
        "origin) or --epsg");
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
      usage_error("--epsg " + std::to_string(*plan.reference.epsg) +
                  ": an ESRI ASCII grid has north up, this map is turned by " + turn +
                  " degrees there (" + error +
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
  std::string text = "# leadline: " + printable(source.origin, 200) + "\n";
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
  PlyWriter ply;
  ply_head(&ply, source, plan);
  ply.line("element vertex " + std::to_string(count));
  for (const char* const axis : {"x", "y", "z"}) {
    ply.line(std::string("property double ") + axis);
  }
  if (source.sigma) {
    ply.line("property float sigma");
  }
  ply.line("element face " + std::to_string(faces.size()));
  ply.line("property list uchar int vertex_indices");
  ply.line("end_header");
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
        usage_error("--out -: a GeoTIFF cannot go to standard output");
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
  }
  if (options.out_path != "-") {
    std::cout << options.out_path << ": " << source.elevation.known_count() << " cells, "
              << sign_text(plan.sign) << ", vertical datum " << datum_text(plan.reference) << "; "
              << coordinates_text(source, plan) << "\n";
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
