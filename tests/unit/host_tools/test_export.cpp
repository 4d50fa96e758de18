#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/export/export.hpp"
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

}  // namespace
