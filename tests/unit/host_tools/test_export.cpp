#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gdal.h>
#include <ogr_api.h>

#include "host_tools/exit_codes.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/export/outline.hpp"
#include "host_tools/gdal_support.hpp"
#include "host_tools/map_output.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::ExitCode;
using leadline::host::ExportFormat;
using leadline::host::ExportFrame;
using leadline::host::ExportOptions;
using leadline::host::ExportPlan;
using leadline::host::format_grid;
using leadline::host::format_ply;
using leadline::host::format_xyz;
using leadline::host::GeoTiffContent;
using leadline::host::HostError;
using leadline::host::MapSource;
using leadline::host::plan_export;
using leadline::host::Raster;
using leadline::host::run_export;
using leadline::host::VerticalSign;

// 3 x 2 cells of 0.5 m; one is not known. North row first.
MapSource small_map() {
  MapSource source;
  source.origin = "small";
  source.elevation = leadline::host::make_raster(3, 2, 10.0, 20.0, 0.5, -15.0);
  source.elevation.at(0, 1) = leadline::host::kNoValue;
  source.elevation.at(1, 2) = -16.25;
  source.sigma = leadline::host::make_raster(3, 2, 10.0, 20.0, 0.5, 0.125);
  source.sigma->at(0, 1) = leadline::host::kNoValue;
  return source;
}

ExportOptions to(const std::string& out) {
  ExportOptions options;
  options.out_path = out;
  return options;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    lines.push_back(line);
  }
  return lines;
}

std::string read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
}

std::string complaint(ExitCode code, const ExportOptions& options, const MapSource& source) {
  try {
    (void)plan_export(options, source);
  } catch (const HostError& error) {
    assert_int_equal(static_cast<int>(error.code()), static_cast<int>(code));
    return error.what();
  }
  return "";
}

void assert_says(const std::string& text, const std::string& part) {
  if (text.find(part) == std::string::npos) {
    fail_msg("\"%s\" does not say \"%s\"", text.c_str(), part.c_str());
  }
}

// What MB-System takes for a sounding: a line that begins with a digit, a blank or a sign.
bool is_sounding(const std::string& line) {
  return !line.empty() && (std::isdigit(static_cast<unsigned char>(line[0])) != 0 ||
                           line[0] == ' ' || line[0] == '+' || line[0] == '-');
}

TEST(local_xyz_without_a_place_says_so) {
  const MapSource source = small_map();
  const ExportPlan plan = plan_export(to("m.xyz"), source);
  assert_true(plan.format == ExportFormat::kXyz162);
  assert_true(plan.frame == ExportFrame::kLocal);
  const auto lines = lines_of(format_xyz(source, plan));
  std::vector<std::string> soundings;
  std::string comments;
  for (const std::string& line : lines) {
    if (is_sounding(line)) {
      soundings.push_back(line);
    } else {
      comments += line + "\n";
    }
  }
  assert_says(comments, "not georeferenced");
  assert_says(comments, "positive down");
  assert_says(comments, "vertical datum: not stated");
  assert_int_equal(soundings.size(), 5);
  // North-west first; centres of cells; depth down; sigma.
  assert_true(soundings[0] == "10.2500 20.7500 15.0000 0.1250");
  assert_true(soundings[4] == "11.2500 20.2500 16.2500 0.1250");
}

TEST(xyz168_is_elevation_and_the_two_do_not_mix) {
  const MapSource source = small_map();
  ExportOptions options = to("m.xyz");
  options.format = "xyz168";
  options.datum = "MSL";
  const std::string text = format_xyz(source, plan_export(options, source));
  assert_says(text, "\n10.2500 20.7500 -15.0000 0.1250\n");
  assert_says(text, "vertical datum: MSL");
  assert_says(text, "MB-System format 168");
  options.vertical = "depth";
  assert_says(complaint(ExitCode::kUsage, options, source), "xyz162");
  options.format = "xyz162";
  options.vertical = "elevation";
  assert_says(complaint(ExitCode::kUsage, options, source), "xyz168");
}

TEST(sigma_that_is_not_known_never_becomes_a_flag) {
  MapSource source = small_map();
  source.sigma->at(0, 0) = leadline::host::kNoValue;
  const std::string text = format_xyz(source, plan_export(to("m.xyz"), source));
  assert_says(text, "\n10.2500 20.7500 15.0000\n");
  assert_true(text.find("nan") == std::string::npos);
}

TEST(with_a_place_lines_are_degrees) {
  MapSource source = small_map();
  ExportOptions options = to("m.xyz");
  options.lat_deg = 54.0;
  options.lon_deg = 8.0;
  const ExportPlan plan = plan_export(options, source);
  assert_true(plan.frame == ExportFrame::kLonLat);
  double lon = 0.0;
  double lat = 0.0;
  for (const std::string& line : lines_of(format_xyz(source, plan))) {
    if (is_sounding(line)) {
      std::istringstream(line) >> lon >> lat;
      break;
    }
  }
  // 10.25 m east and 20.75 m north of the origin; lengths of a degree on WGS 84 there.
  assert_near((lon - 8.0) * 65'578.0, 10.25, 0.02);
  assert_near((lat - 54.0) * 111'315.0, 20.75, 0.02);
  options.frame = "local";
  assert_true(plan_export(options, source).frame == ExportFrame::kLocal);
}

TEST(options_that_do_not_fit_are_named) {
  const MapSource source = small_map();
  ExportOptions options = to("map.dat");
  assert_says(complaint(ExitCode::kUsage, options, source), "give --format");
  options.format = "geotif";
  assert_says(complaint(ExitCode::kUsage, options, source), "did you mean geotiff");
  options.format = "ply";
  options.layer = "sigma";
  assert_says(complaint(ExitCode::kUsage, options, source), "--layer sigma");
  options.layer = "voxels";
  assert_says(complaint(ExitCode::kInput, options, source), "model.llm");
  options.layer = "";
  options.vertical = "up";
  assert_says(complaint(ExitCode::kUsage, options, source), "--vertical");
  options.vertical = "";
  options.frame = "lonlat";
  assert_says(complaint(ExitCode::kUsage, options, source), "--frame");
  options.format = "xyz162";
  assert_says(complaint(ExitCode::kUsage, options, source), "no place on Earth");
  options.lat_deg = 91.0;
  options.lon_deg = 0.0;
  assert_says(complaint(ExitCode::kUsage, options, source), "--lat 91");
  options.lat_deg = 50.0;
  options.lon_deg.reset();
  assert_says(complaint(ExitCode::kUsage, options, source), "go together");
}

template <typename Value>
Value take(const std::string& bytes, std::size_t* at) {
  Value value;
  std::memcpy(&value, bytes.data() + *at, sizeof value);
  *at += sizeof value;
  return value;
}

TEST(ply_is_a_mesh_of_the_known_cells) {
  const MapSource source = small_map();
  const std::string ply = format_ply(source, plan_export(to("m.ply"), source));
  assert_says(ply, "format binary_little_endian 1.0\n");
  assert_says(ply, "element vertex 5\n");
  assert_says(ply, "element face 2\n");
  assert_says(ply, "positive up");
  std::size_t at = ply.find("end_header\n") + 11;
  std::vector<double> x;
  std::vector<double> y;
  for (int k = 0; k < 5; ++k) {
    x.push_back(take<double>(ply, &at));
    y.push_back(take<double>(ply, &at));
    const auto z = take<double>(ply, &at);
    assert_near(z, k == 4 ? -16.25 : -15.0, 0.0);
    assert_near(take<float>(ply, &at), 0.125, 0.0);
  }
  for (int face = 0; face < 2; ++face) {
    assert_int_equal(take<std::uint8_t>(ply, &at), 3);
    std::int32_t v[3];
    for (std::int32_t& corner : v) {
      corner = take<std::int32_t>(ply, &at);
      assert_true(corner >= 0 && corner < 5);
    }
    const auto at_corner = [&v](const std::vector<double>& of, int k) {
      return of[static_cast<std::size_t>(v[k])];
    };
    // Counter-clockwise seen from above: the cross product points up.
    const double area = (at_corner(x, 1) - at_corner(x, 0)) * (at_corner(y, 2) - at_corner(y, 0)) -
                        (at_corner(x, 2) - at_corner(x, 0)) * (at_corner(y, 1) - at_corner(y, 0));
    assert_near(area, 0.25, 1e-12);
  }
  assert_int_equal(at, ply.size());
}

TEST(rasters_turn_their_sign_with_their_words) {
  const std::string folder = leadline::test::scratch_directory();
  const MapSource source = small_map();
  {
    leadline::host::OutputDir output(folder + "/map");
    stage_map(&output, source.elevation, *source.sigma, source.reference);
    output.commit();
  }
  ExportOptions options = to(folder + "/depth.tif");
  options.input_path = folder + "/map";
  options.vertical = "depth";
  options.datum = "chart datum";
  assert_int_equal(run_export(options), 0);
  const GeoTiffContent depth = leadline::host::read_geotiff(options.out_path);
  // Band 1 holds depths; whoever reads it through us gets elevations again.
  const std::string bytes = read_file(options.out_path);
  assert_says(bytes, "depth positive down");
  assert_near(depth.elevation.at(1, 2), -16.25, 1e-6);
  assert_true(depth.vertical_datum == "chart datum");
  assert_true(depth.sigma.has_value());
  assert_near(depth.sigma->at(0, 0), 0.125, 1e-6);
  options = to(folder + "/sigma.asc");
  options.input_path = folder + "/map";
  options.layer = "sigma";
  assert_int_equal(run_export(options), 0);
  assert_near(leadline::host::read_esri_ascii(options.out_path).at(0, 0), 0.125, 1e-9);
  options = to(folder + "/depth.asc");
  options.input_path = folder + "/map/depth.tif";
  options.vertical = "depth";
  assert_int_equal(run_export(options), 0);
  assert_near(leadline::host::read_esri_ascii(options.out_path).at(0, 0), 15.0, 1e-6);
  assert_true(std::isnan(leadline::host::read_esri_ascii(options.out_path).at(0, 1)));
  assert_false(read_file(options.out_path).empty());
}

// A grid of 1 m cells whose place is known; the turn is 0.9 degrees in zone 32.
MapSource placed_map(double lon_deg) {
  MapSource source = small_map();
  source.elevation = leadline::host::make_raster(200, 100, 0.0, 0.0, 1.0, -15.0);
  source.sigma.reset();
  source.reference.lat_deg = 47.3;
  source.reference.lon_deg = lon_deg;
  return source;
}

TEST(ascii_grid_goes_into_a_system_only_with_north_up) {
  ExportOptions options = to("m.asc");
  // Nobody asked for a system: local metres, as the map has them.
  const MapSource turned = placed_map(7.8);
  assert_says(format_grid(turned, plan_export(options, turned)), "xllcorner 0\n");
  options.epsg = 32632;
  try {
    (void)format_grid(turned, plan_export(options, turned));
    fail_msg("a turned grid was written as an ASCII grid");
  } catch (const HostError& error) {
    assert_int_equal(static_cast<int>(error.code()), static_cast<int>(ExitCode::kUsage));
    assert_says(error.what(), "turned by 0.88");
    assert_says(error.what(), "--frame local");
  }
  options.frame = "local";
  assert_says(format_grid(turned, plan_export(options, turned)), "xllcorner 0\n");
  options.frame.clear();
  // On the zone's meridian north is north; the cells shrink by the zone's scale.
  const MapSource straight = placed_map(9.0);
  const Raster placed = leadline::host::parse_esri_ascii(
      format_grid(straight, plan_export(options, straight)), "m.asc");
  assert_near(placed.west_m, 500000.0, 1e-3);
  assert_near(placed.cell_m, 0.9996, 1e-9);
  options.frame = "lonlat";
  assert_says(complaint(ExitCode::kUsage, options, straight), "--frame lonlat");
}

TEST(a_code_keeps_the_maps_own_origin) {
  const MapSource source = placed_map(7.8);
  ExportOptions options = to("m.tif");
  options.epsg = 32632;
  const ExportPlan plan = plan_export(options, source);
  assert_near(plan.reference.lat_deg.value_or(0.0), 47.3, 0.0);
  assert_int_equal(plan.reference.epsg.value_or(0), 32632);
}

TEST(errors_name_the_file_that_was_asked_for) {
  const std::string folder = leadline::test::scratch_directory();
  const MapSource source = small_map();
  const std::string path = folder + "/no/such/depth.tif";
  try {
    leadline::host::write_geotiff_whole(path, source.elevation, nullptr, {});
    fail_msg("written into a folder that is not there");
  } catch (const HostError& error) {
    assert_int_equal(static_cast<int>(error.code()), static_cast<int>(ExitCode::kOutput));
    assert_says(error.what(), path);
    assert_true(std::string(error.what()).find("partial") == std::string::npos);
  }
}

// ---- Outlines ---------------------------------------------------------------------------------

using leadline::host::covered_areas;
using leadline::host::CoveredArea;
using leadline::host::GridCorner;

// Twice the area, in cells; positive counter-clockwise with north up.
std::int64_t doubled_area(const std::vector<GridCorner>& ring) {
  std::int64_t sum = 0;
  for (std::size_t k = 0; k < ring.size(); ++k) {
    const GridCorner& a = ring[k];
    const GridCorner& b = ring[(k + 1) % ring.size()];
    sum += std::int64_t{b.column} * a.row - std::int64_t{a.column} * b.row;
  }
  return sum;
}

// Whether the centre of a cell lies inside a ring, by crossings.
bool inside(const std::vector<GridCorner>& ring, int row, int column) {
  bool in = false;
  for (std::size_t k = 0; k < ring.size(); ++k) {
    const GridCorner& a = ring[k];
    const GridCorner& b = ring[(k + 1) % ring.size()];
    if (a.column == b.column && a.column > column && (a.row > row) != (b.row > row)) {
      in = !in;
    }
  }
  return in;
}

TEST(outlines_hold_the_known_cells_and_no_others) {
  leadline::test::Random random(7);
  for (int trial = 0; trial < 200; ++trial) {
    const int columns = static_cast<int>(random.between(1, 12));
    const int rows = static_cast<int>(random.between(1, 12));
    Raster raster = leadline::host::make_raster(columns, rows, 0.0, 0.0, 1.0);
    const double share = random.uniform();
    for (double& value : raster.values) {
      value = random.uniform() < share ? 1.0 : leadline::host::kNoValue;
    }
    const std::vector<CoveredArea> areas = covered_areas(raster);
    std::size_t cells = 0;
    for (const CoveredArea& area : areas) {
      cells += area.cells;
      std::int64_t sum = doubled_area(area.outer);
      assert_true(sum > 0);
      for (const auto& hole : area.holes) {
        assert_true(doubled_area(hole) < 0);
        sum += doubled_area(hole);
      }
      assert_int_equal(sum, 2 * static_cast<std::int64_t>(area.cells));
    }
    assert_int_equal(cells, raster.known_count());
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        int holding = 0;
        for (const CoveredArea& area : areas) {
          bool in = inside(area.outer, row, column);
          for (const auto& hole : area.holes) {
            in = in && !inside(hole, row, column);
          }
          holding += in ? 1 : 0;
        }
        assert_int_equal(holding, std::isnan(raster.at(row, column)) ? 0 : 1);
      }
    }
  }
}

// ---- What GDAL finds in contours and outlines ---------------------------------------------------

// A cone of 40 x 40 cells of 0.5 m, 15 m deep at its rim and 5 m at its top, with a gap of 4 x 4 cells.
MapSource cone_map() {
  MapSource source;
  source.origin = "cone & <gap>";
  source.elevation = leadline::host::make_raster(40, 40, 100.0, 200.0, 0.5);
  for (int row = 0; row < 40; ++row) {
    for (int column = 0; column < 40; ++column) {
      const double away = std::hypot(row - 19.5, column - 19.5);
      if (away < 19.0) {
        source.elevation.at(row, column) = -5.0 - away * 10.0 / 19.0;
      }
    }
  }
  for (int row = 4; row < 8; ++row) {
    for (int column = 18; column < 22; ++column) {
      source.elevation.at(row, column) = leadline::host::kNoValue;
    }
  }
  return source;
}

struct OgrContent {
  int lines = 0;
  int polygons = 0;
  int holes = 0;
  double area = 0.0;  // units of the file, squared
  double length = 0.0;
  double low = HUGE_VAL;  // the height field
  double high = -HUGE_VAL;
  OGREnvelope box;
  bool valid = true;
};

// Every feature of every layer, through GDAL.
OgrContent read_with_gdal(const std::string& path, const char* driver, const char* height_field) {
  const leadline::host::QuietGdal quiet;
  const char* const drivers[] = {driver, nullptr};
  GDALDatasetH const data = GDALOpenEx(path.c_str(), GDAL_OF_VECTOR, drivers, nullptr, nullptr);
  assert_non_null(data);
  OgrContent content;
  for (int k = 0; k < GDALDatasetGetLayerCount(data); ++k) {
    OGRLayerH const layer = GDALDatasetGetLayer(data, k);
    OGR_L_ResetReading(layer);
    while (OGRFeatureH const feature = OGR_L_GetNextFeature(layer)) {
      OGRGeometryH const geometry = OGR_F_GetGeometryRef(feature);
      assert_non_null(geometry);
      OGREnvelope box;
      OGR_G_GetEnvelope(geometry, &box);
      content.box.Merge(box);
      content.valid = content.valid && OGR_G_IsValid(geometry) != 0;
      if (OGR_GT_Flatten(OGR_G_GetGeometryType(geometry)) == wkbLineString) {
        content.lines += 1;
        content.length += OGR_G_Length(geometry);
        const int field = OGR_F_GetFieldIndex(feature, height_field);
        assert_true(field >= 0);
        const double height = OGR_F_GetFieldAsDouble(feature, field);
        content.low = std::min(content.low, height);
        content.high = std::max(content.high, height);
      } else {
        assert_int_equal(OGR_GT_Flatten(OGR_G_GetGeometryType(geometry)), wkbPolygon);
        content.polygons += 1;
        content.holes += OGR_G_GetGeometryCount(geometry) - 1;
        content.area += OGR_G_Area(geometry);
      }
      OGR_F_Destroy(feature);
    }
  }
  GDALClose(data);
  return content;
}

TEST(gdal_opens_contours_and_coverage_in_local_metres) {
  const MapSource source = cone_map();
  const std::string path = leadline::test::scratch_directory() + "/cone.geojson";
  ExportOptions options = to(path);
  options.vertical = "depth";
  options.contour_interval_m = 1.0;
  const ExportPlan plan = plan_export(options, source);
  assert_true(plan.frame == ExportFrame::kLocal);
  leadline::host::write_file_whole(path, format_geojson(source, plan));
  const OgrContent content = read_with_gdal(path, "GeoJSON", "depth_m");
  assert_int_equal(content.polygons, 1);
  assert_int_equal(content.holes, 1);
  assert_true(content.valid);
  assert_near(content.area, static_cast<double>(source.elevation.known_count()) * 0.25, 1e-6);
  assert_near(content.low, 6.0, 0.0);
  assert_near(content.high, 14.0, 0.0);
  assert_true(content.lines >= 9);
  // Circles of 1.9 m per metre of depth, but for what the gap and the rim cut out.
  assert_true(content.length > 0.8 * 2 * 3.14159 * 0.95 * (1 + 2 + 3 + 4 + 5 + 6 + 7 + 8 + 9));
  assert_true(content.length < 2 * 3.14159 * 0.95 * (1 + 2 + 3 + 4 + 5 + 6 + 7 + 8 + 9));
  assert_near(content.box.MinX, 100.5, 1e-9);
  assert_near(content.box.MaxY, 219.5, 1e-9);
  assert_says(read_file(path), "local metres");
}

TEST(gdal_opens_contours_and_coverage_in_degrees) {
  MapSource source = cone_map();
  source.reference.lat_deg = 54.0;
  source.reference.lon_deg = 8.0;
  const std::string folder = leadline::test::scratch_directory();
  for (const auto& [name, driver] :
       {std::pair{"/cone.geojson", "GeoJSON"}, std::pair{"/cone.kml", "KML"}}) {
    ExportOptions options = to(folder + name);
    const ExportPlan plan = plan_export(options, source);
    assert_true(plan.frame == ExportFrame::kLonLat);
    leadline::host::write_file_whole(options.out_path, plan.format == ExportFormat::kKml
                                                           ? format_kml(source, plan)
                                                           : format_geojson(source, plan));
    const bool is_kml = plan.format == ExportFormat::kKml;
    const OgrContent content =
        read_with_gdal(options.out_path, driver, is_kml ? "Name" : "elevation_m");
    assert_int_equal(content.polygons, 1);
    assert_int_equal(content.holes, 1);
    assert_true(content.lines >= 9);
    // 100.5 .. 119.5 m east and 200.5 .. 219.5 m north of the origin.
    assert_near((content.box.MinX - 8.0) * 65'578.0, 100.5, 0.05);
    assert_near((content.box.MaxX - 8.0) * 65'578.0, 119.5, 0.05);
    assert_near((content.box.MinY - 54.0) * 111'315.0, 200.5, 0.05);
    assert_near((content.box.MaxY - 54.0) * 111'315.0, 219.5, 0.05);
  }
}

// A summit and a ledge whose heights are those of contours: no line of a single point, none twice.
TEST(a_contour_at_a_cells_own_height_is_a_line_or_none) {
  MapSource source;
  source.origin = "summit";
  source.elevation = leadline::host::make_raster(9, 9, 0.0, 0.0, 1.0, -12.5);
  source.elevation.at(4, 4) = -12.0;
  for (int column = 0; column < 9; ++column) {
    source.elevation.at(8, column) = -13.0;
  }
  const std::string path = leadline::test::scratch_directory() + "/summit.geojson";
  ExportOptions options = to(path);
  options.contour_interval_m = 0.25;
  leadline::host::write_file_whole(path, format_geojson(source, plan_export(options, source)));
  const OgrContent content = read_with_gdal(path, "GeoJSON", "elevation_m");
  assert_true(content.valid);
  assert_true(content.lines >= 2);
}

TEST(gdal_opens_every_raster) {
  const MapSource source = cone_map();
  const std::string folder = leadline::test::scratch_directory();
  for (const auto& [name, driver] :
       {std::pair{"/cone.tif", "GTiff"}, std::pair{"/cone.asc", "AAIGrid"}}) {
    const ExportOptions options = to(folder + name);
    const ExportPlan plan = plan_export(options, source);
    if (plan.format == ExportFormat::kGeoTiff) {
      leadline::host::write_geotiff_whole(options.out_path, source.elevation, nullptr, {});
    } else {
      leadline::host::write_file_whole(options.out_path, format_grid(source, plan));
    }
    const leadline::host::QuietGdal quiet;
    const char* const drivers[] = {driver, nullptr};
    GDALDatasetH const data =
        GDALOpenEx(options.out_path.c_str(), GDAL_OF_RASTER, drivers, nullptr, nullptr);
    assert_non_null(data);
    double transform[6];
    assert_int_equal(GDALGetGeoTransform(data, transform), CE_None);
    assert_near(transform[1], 0.5, 1e-9);
    // The summit, in the four cells round the middle.
    const int column = static_cast<int>((110.0 - transform[0]) / transform[1]);
    const int row = static_cast<int>((210.0 - transform[3]) / transform[5]);
    double value = 0.0;
    assert_int_equal(GDALRasterIO(GDALGetRasterBand(data, 1), GF_Read, column, row, 1, 1, &value, 1,
                                  1, GDT_Float64, 0, 0),
                     CE_None);
    assert_near(std::fabs(value), 5.0 + std::sqrt(0.5) * 10.0 / 19.0, 1e-3);
    GDALClose(data);
  }
}

TEST(contours_and_coverage_go_one_without_the_other) {
  const MapSource source = cone_map();
  ExportOptions options = to("m.geojson");
  options.layer = "coverage";
  const std::string coverage = format_geojson(source, plan_export(options, source));
  assert_true(coverage.find("\"contour\"") == std::string::npos);
  assert_says(coverage, "\"coverage\"");
  options.layer = "contours";
  assert_true(format_geojson(source, plan_export(options, source)).find("\"coverage\"") ==
              std::string::npos);
  options.contour_interval_m = 1e-4;
  try {
    (void)format_geojson(source, plan_export(options, source));
    fail_msg("a hundred thousand contours were drawn");
  } catch (const HostError& error) {
    assert_says(error.what(), "--contours");
  }
  options.contour_interval_m = -1.0;
  assert_says(complaint(ExitCode::kUsage, options, source), "--contours -1");
  options = to("m.ply");
  options.contour_interval_m = 1.0;
  assert_says(complaint(ExitCode::kUsage, options, source), "geojson and kml only");
  options = to("m.kml");
  assert_says(complaint(ExitCode::kUsage, options, source), "no place on Earth");
  // Nothing known: empty, and still what it says it is.
  MapSource nothing = cone_map();
  nothing.elevation = leadline::host::make_raster(4, 4, 0.0, 0.0, 1.0);
  assert_says(format_geojson(nothing, plan_export(to("m.geojson"), nothing)),
              "\"features\": [\n]}");
}

// ---- LAS -----------------------------------------------------------------------------------------

struct LasFile {
  std::uint32_t count = 0;
  std::uint32_t records = 0;
  std::uint16_t point_bytes = 0;
  std::vector<double> x, y, z;
  std::vector<float> sigma;
  double bounds[6] = {};  // as in the header: max x, min x, ...
  std::vector<std::uint16_t> keys;
};

// By the standard's table of offsets, independent of the writer.
LasFile parse_las(const std::string& bytes) {
  LasFile las;
  assert_true(bytes.size() >= 227);
  assert_true(bytes.substr(0, 4) == "LASF");
  assert_int_equal(bytes[24], 1);
  assert_int_equal(bytes[25], 2);
  std::size_t at = 94;
  assert_int_equal(take<std::uint16_t>(bytes, &at), 227);
  const auto points_at = take<std::uint32_t>(bytes, &at);
  las.records = take<std::uint32_t>(bytes, &at);
  assert_int_equal(take<std::uint8_t>(bytes, &at), 0);
  las.point_bytes = take<std::uint16_t>(bytes, &at);
  las.count = take<std::uint32_t>(bytes, &at);
  at = 131;
  double scale[3];
  double offset[3];
  for (double& value : scale) {
    value = take<double>(bytes, &at);
  }
  for (double& value : offset) {
    value = take<double>(bytes, &at);
  }
  for (double& value : las.bounds) {
    value = take<double>(bytes, &at);
  }
  for (std::uint32_t k = 0; k < las.records; ++k) {
    at += 2;
    const std::string user = bytes.c_str() + at;
    at += 16;
    const auto id = take<std::uint16_t>(bytes, &at);
    const auto size = take<std::uint16_t>(bytes, &at);
    at += 32;
    if (user == "LASF_Projection" && id == 34735) {
      std::size_t key = at;
      for (int word = 0; word < size / 2; ++word) {
        las.keys.push_back(take<std::uint16_t>(bytes, &key));
      }
    }
    at += size;
  }
  assert_int_equal(at, points_at);
  assert_int_equal(bytes.size(), points_at + std::size_t{las.count} * las.point_bytes);
  for (std::uint32_t k = 0; k < las.count; ++k) {
    std::size_t point = points_at + std::size_t{k} * las.point_bytes;
    las.x.push_back(offset[0] + scale[0] * take<std::int32_t>(bytes, &point));
    las.y.push_back(offset[1] + scale[1] * take<std::int32_t>(bytes, &point));
    las.z.push_back(offset[2] + scale[2] * take<std::int32_t>(bytes, &point));
    point += 8;
    if (las.point_bytes == 24) {
      las.sigma.push_back(take<float>(bytes, &point));
    }
    assert_true(las.x.back() >= las.bounds[1] && las.x.back() <= las.bounds[0]);
    assert_true(las.y.back() >= las.bounds[3] && las.y.back() <= las.bounds[2]);
    assert_true(las.z.back() >= las.bounds[5] && las.z.back() <= las.bounds[4]);
  }
  return las;
}

TEST(las_holds_the_known_cells) {
  const MapSource source = small_map();
  const LasFile las = parse_las(format_las(source, plan_export(to("m.las"), source)));
  assert_int_equal(las.count, 5);
  assert_int_equal(las.point_bytes, 24);
  assert_true(las.keys.empty());
  assert_near(las.x[0], 10.25, 1e-9);
  assert_near(las.y[0], 20.75, 1e-9);
  assert_near(las.z[4], -16.25, 1e-9);
  assert_near(las.sigma[4], 0.125, 0.0);
  // In a system by its code; in degrees; back in local metres.
  ExportOptions options = to("m.las");
  options.lat_deg = 47.3;
  options.lon_deg = 9.0;
  options.epsg = 32632;
  const LasFile projected = parse_las(format_las(source, plan_export(options, source)));
  assert_near(projected.x[0], 500'000.0 + 0.9996 * 10.25, 1e-3);
  assert_true(projected.keys.size() > 11 && projected.keys[0] == 1);
  assert_int_equal(projected.keys[8], 3072);
  assert_int_equal(projected.keys[11], 32632);
  options.frame = "lonlat";
  const LasFile degrees = parse_las(format_las(source, plan_export(options, source)));
  assert_near((degrees.x[0] - 9.0) * 75'700.0, 10.25, 0.05);
  assert_int_equal(degrees.keys[11], 4326);
  options.frame = "local";
  assert_near(parse_las(format_las(source, plan_export(options, source))).x[0], 10.25, 1e-9);
}

TEST(las_of_nothing_and_of_a_continent) {
  MapSource source = small_map();
  source.sigma.reset();
  for (double& value : source.elevation.values) {
    value = leadline::host::kNoValue;
  }
  const LasFile empty = parse_las(format_las(source, plan_export(to("m.las"), source)));
  assert_int_equal(empty.count, 0);
  assert_int_equal(empty.point_bytes, 20);
  // Two cells of 10 mm as far apart as 32 bits of 0.1 mm do not reach: fewer digits, not garbage.
  source.elevation = leadline::host::make_raster(2, 1, -4e8, 0.0, 8e8, -1.0);
  const LasFile wide = parse_las(format_las(source, plan_export(to("m.las"), source)));
  assert_near(wide.x[0], 0.0, 1.0);
  assert_near(wide.x[1], 8e8, 1.0);
}

TEST(a_map_over_the_antimeridian_stays_in_one_piece) {
  for (const double longitude_deg : {179.999, -179.999}) {
    MapSource source = cone_map();
    source.elevation.west_m = longitude_deg > 0.0 ? 100.0 : -120.0;
    source.reference.lat_deg = -16.5;
    source.reference.lon_deg = longitude_deg;
    const std::string folder = leadline::test::scratch_directory();
    for (const auto& [name, driver] :
         {std::pair{"/cone.geojson", "GeoJSON"}, std::pair{"/cone.kml", "KML"}}) {
      ExportOptions options = to(folder + name);
      const ExportPlan plan = plan_export(options, source);
      const bool is_kml = plan.format == ExportFormat::kKml;
      leadline::host::write_file_whole(
          options.out_path, is_kml ? format_kml(source, plan) : format_geojson(source, plan));
      const OgrContent content =
          read_with_gdal(options.out_path, driver, is_kml ? "Name" : "elevation_m");
      assert_true(content.valid);
      assert_near((content.box.MaxX - content.box.MinX) * 106'750.0, 19.0, 0.1);
    }
    ExportOptions options = to("m.las");
    options.frame = "lonlat";
    const LasFile las = parse_las(format_las(source, plan_export(options, source)));
    assert_true(las.bounds[0] - las.bounds[1] < 0.001);
    assert_true(las.bounds[0] > 180.0 || las.bounds[1] < -180.0);
  }
}

}  // namespace
