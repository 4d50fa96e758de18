// Rasters: the ESRI ASCII reader and writer, GeoTIFF through GDAL.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <sys/stat.h>

#include "host_tools/exit_codes.hpp"
#include "host_tools/geotiff.hpp"
#include "host_tools/raster.hpp"
#include "tests/support/host_errors.hpp"
#include "tests/support/test.hpp"

namespace {

namespace fs = std::filesystem;

using leadline::host::ExitCode;
using leadline::host::GeoReference;
using leadline::host::GeoTiffContent;
using leadline::host::kNoValue;
using leadline::host::make_raster;
using leadline::host::parse_esri_ascii;
using leadline::host::Raster;
using leadline::test::assert_contains;
using leadline::test::error_of;

std::string content_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

void assert_rejected(const std::string& text, const std::string& part) {
  assert_contains(error_of(ExitCode::kInput, [&] { (void)parse_esri_ascii(text, "map.asc"); }),
                  part);
}

constexpr const char* kHeader =
    "ncols 3\nnrows 2\nxllcorner 10\nyllcorner 20.5\ncellsize 0.5\nNODATA_value -9999\n";

void assert_same(const Raster& a, const Raster& b, double tolerance) {
  assert_int_equal(a.columns, b.columns);
  assert_int_equal(a.rows, b.rows);
  assert_near(a.west_m, b.west_m, 1e-9);
  assert_near(a.south_m, b.south_m, 1e-9);
  assert_near(a.cell_m, b.cell_m, 1e-12);
  assert_int_equal(a.values.size(), b.values.size());
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    assert_int_equal(std::isnan(a.values[i]), std::isnan(b.values[i]));
    if (!std::isnan(a.values[i])) {
      assert_near(a.values[i], b.values[i], tolerance);
    }
  }
}

Raster random_raster(leadline::test::Random* random, int columns, int rows) {
  Raster raster = make_raster(columns, rows, static_cast<double>(random->between(-5000, 5000)) / 8,
                              static_cast<double>(random->between(-5000, 5000)) / 8,
                              static_cast<double>(random->between(1, 64)) / 16);
  for (double& value : raster.values) {
    value = random->uniform() < 0.1 ? kNoValue : -100.0 + 50.0 * random->normal();
  }
  return raster;
}

TEST(rows_run_from_north_and_values_are_elevations) {
  const Raster raster = parse_esri_ascii(std::string(kHeader) + "1 2 3\n-4 -9999 6.25e1\n", "a");
  assert_int_equal(raster.columns, 3);
  assert_int_equal(raster.rows, 2);
  assert_near(raster.at(0, 0), 1.0, 0);
  assert_near(raster.at(1, 0), -4.0, 0);
  assert_true(std::isnan(raster.at(1, 1)));
  assert_near(raster.at(1, 2), 62.5, 0);
  assert_int_equal(raster.known_count(), 5);
  // Row 0 is the northern one; coordinates are those of cell centres.
  assert_near(raster.north_of_row_m(0), 21.25, 1e-12);
  assert_near(raster.north_of_row_m(1), 20.75, 1e-12);
  assert_near(raster.east_of_column_m(0), 10.25, 1e-12);
  assert_near(raster.east_m(), 11.5, 1e-12);
  assert_near(raster.north_m(), 21.5, 1e-12);
}

TEST(header_in_any_case_and_order_centres_line_breaks_and_default_nodata) {
  const Raster raster = parse_esri_ascii(
      "\r\nCELLSIZE\t2\r\nYLLCENTER 1\r\nxllcenter 1\r\nNRows 2 NCols 2\r\n1\r\n+2 "
      "3\r\n\r\n-9999.0",
      "a");
  assert_near(raster.west_m, 0.0, 0);
  assert_near(raster.south_m, 0.0, 0);
  assert_near(raster.at(0, 1), 2.0, 0);
  assert_near(raster.at(1, 0), 3.0, 0);
  assert_true(std::isnan(raster.at(1, 1)));
}

TEST(nodata_may_be_nan_or_any_number) {
  const std::string start = "ncols 2 nrows 1 xllcorner 0 yllcorner 0 cellsize 1 ";
  const Raster nan = parse_esri_ascii(start + "NODATA_value nan\nnan 1", "a");
  assert_true(std::isnan(nan.at(0, 0)));
  assert_near(nan.at(0, 1), 1.0, 0);
  const Raster big = parse_esri_ascii(
      start + "NODATA_value -3.4028234663852886e+38\n-3.4028234663852886e+38 -9999", "a");
  assert_true(std::isnan(big.at(0, 0)));
  assert_near(big.at(0, 1), -9999.0, 0);
}

TEST(errors_name_file_line_field_and_value) {
  const std::string text = std::string(kHeader) + "1 2 3\n4 five 6\n";
  const std::string message =
      error_of(ExitCode::kInput, [&] { (void)parse_esri_ascii(text, "dir/map.asc"); });
  assert_contains(message, "dir/map.asc:8: field 2");
  assert_contains(message, "\"five\"");
}

TEST(bad_values_are_refused) {
  const std::string header = kHeader;
  assert_rejected(header + "1 2 3 4 5", "ends after 5 of 6");
  assert_rejected(header + "1 2 3 4 5 6 7", "after the last of 6");
  assert_rejected(header + "1 2 3 4 5 nan", "not finite");
  assert_rejected(header + "1 2 3 4 5 inf", "not finite");
  assert_rejected(header + "1 2 3 4 5 1e999", "not a number");
  assert_rejected(header + "1 2 3 4 5 1,5", "not a number");
  assert_rejected(header + "1 2 3 4 5 0x10", "not a number");
  assert_rejected(header + "1 2 3 4 5 +-6", "not a number");
  assert_rejected(header + "1 2 3 4 5 " + std::string(100000, '\x01'), "...");
}

TEST(bad_headers_are_refused) {
  const std::string rest = " xllcorner 0 yllcorner 0 cellsize 1 1 2 3 4";
  assert_rejected("", "no ncols");
  assert_rejected("{\"type\": 1}", "no ncols");
  assert_rejected("ncols 2 xllcorner 0 yllcorner 0 cellsize 1 1 2 3 4", "no nrows");
  assert_rejected("ncols 2 nrows 2 yllcorner 0 cellsize 1 1 2 3 4", "no xllcorner");
  assert_rejected("ncols 2 nrows 2 xllcorner 0 cellsize 1 1 2 3 4", "no yllcorner");
  assert_rejected("ncols 2 nrows 2 xllcorner 0 yllcorner 0 1 2 3 4", "no cellsize");
  assert_rejected("ncols 2 ncols 2 nrows 2" + rest, "ncols is given twice");
  assert_rejected("ncols 2 nrows 2 xllcenter 0" + rest, "given twice");
  assert_rejected("ncols 0 nrows 2" + rest, "ncols is 0");
  assert_rejected("ncols -2 nrows 2" + rest, "ncols is -2");
  assert_rejected("ncols 2.5 nrows 2" + rest, "ncols is 2.5");
  assert_rejected("ncols two nrows 2" + rest, "\"two\"");
  assert_rejected("ncols nan nrows 2" + rest, "not a finite number");
  assert_rejected("ncols 1e300 nrows 2" + rest, "ncols is 1e+300");
  assert_rejected("ncols 2 nrows", "the value of nrows is missing");
  assert_rejected("ncols 2 nrows 2 xllcorner 0 yllcorner 0 cellsize 0 1 2 3 4", "cellsize is 0");
  assert_rejected("ncols 2 nrows 2 xllcorner 0 yllcorner 0 cellsize -1 1 2 3 4", "cellsize is -1");
  assert_rejected("ncols 2 nrows 2 xllcorner 0 yllcorner 0 cellsize 1e308 1 2 3 4", "far edge");
  assert_rejected("ncols 2 nrows 2 dx 1" + rest, "unknown header key \"dx\"");
  assert_rejected("ncols 2 nrows 2 NODATA_value none" + rest, "NODATA_value is \"none\"");
}

TEST(a_header_that_promises_too_much_allocates_nothing) {
  assert_rejected("ncols 16384 nrows 16384 xllcorner 0 yllcorner 0 cellsize 1 1 2 3",
                  "ends after 3 of 268435456");
  assert_rejected("ncols 268435456 nrows 268435456 xllcorner 0 yllcorner 0 cellsize 1 1", "limit");
}

TEST(writing_follows_the_contract) {
  Raster raster = make_raster(2, 2, -1.5, 3.0, 0.5);
  raster.at(0, 0) = -12.34567;
  raster.at(0, 1) = -0.00001;
  raster.at(1, 1) = 7.0;
  assert_string_equal(leadline::host::format_esri_ascii(raster).c_str(),
                      "ncols 2\nnrows 2\nxllcorner -1.5\nyllcorner 3\ncellsize 0.5\n"
                      "NODATA_value -9999\n-12.3457 0.0000\n-9999 7.0000\n");
  assert_contains(leadline::host::format_esri_ascii(raster, 0), "\n-12 0\n-9999 7\n");
}

TEST(a_value_like_nodata_stays_a_value) {
  Raster raster = make_raster(2, 1, 0.0, 0.0, 1.0);
  raster.at(0, 0) = -9999.0;
  raster.at(0, 1) = -9999.00001;
  const Raster back = parse_esri_ascii(leadline::host::format_esri_ascii(raster), "a");
  assert_near(back.at(0, 0), -9999.0, 1.01e-4);
  assert_near(back.at(0, 1), -9999.0, 1.01e-4);
}

TEST(round_trip_of_random_rasters) {
  leadline::test::Random random(1);
  for (int i = 0; i < 50; ++i) {
    const Raster raster = random_raster(&random, static_cast<int>(random.between(1, 20)),
                                        static_cast<int>(random.between(1, 20)));
    const std::string text = leadline::host::format_esri_ascii(raster);
    const Raster back = parse_esri_ascii(text, "a");
    assert_same(raster, back, 0.5001e-4);
    assert_string_equal(leadline::host::format_esri_ascii(back).c_str(), text.c_str());
  }
}

TEST(files_are_written_whole_and_read_back) {
  const std::string folder = leadline::test::scratch_directory();
  leadline::test::Random random(2);
  const Raster raster = random_raster(&random, 7, 5);
  leadline::host::write_esri_ascii(raster, folder + "/a.asc", 9);
  assert_same(leadline::host::read_esri_ascii(folder + "/a.asc"), raster, 1e-9);
  assert_same(leadline::host::read_raster(folder + "/a.asc"), raster, 1e-9);
  const std::string missing = folder + "/none.asc";
  assert_contains(error_of(ExitCode::kInput, [&] { (void)leadline::host::read_raster(missing); }),
                  "none.asc: cannot be read: No such file");
  assert_contains(
      error_of(ExitCode::kInput, [&] { (void)leadline::host::read_esri_ascii(missing); }),
      "none.asc: cannot be read: No such file");
  std::ofstream(folder + "/empty.asc").flush();
  assert_contains(
      error_of(ExitCode::kInput, [&] { (void)leadline::host::read_raster(folder + "/empty.asc"); }),
      "empty.asc:1");
  (void)error_of(ExitCode::kInput, [&] { (void)leadline::host::read_esri_ascii(folder); });
  (void)error_of(ExitCode::kOutput, [&] {
    leadline::host::write_esri_ascii(raster, folder + "/no/such/folder/a.asc");
  });
}

TEST(geometry_is_compared_over_the_whole_extent) {
  const Raster a = make_raster(1000, 10, 5.0, 6.0, 1.0);
  Raster b = a;
  assert_true(leadline::host::same_geometry(a, b));
  b.west_m += 0.0005;
  assert_true(leadline::host::same_geometry(a, b));
  b.west_m += 0.01;
  assert_false(leadline::host::same_geometry(a, b));
  b = a;
  b.cell_m *= 1.00001;  // a hundredth of a cell at the far edge
  assert_false(leadline::host::same_geometry(a, b));
  assert_string_equal(leadline::host::describe_geometry(a).c_str(),
                      "1000 x 10 cells of 1 m from east 5, north 6");
}

TEST(geotiff_in_a_local_frame_keeps_cells_sigma_and_datum) {
  const std::string path = leadline::test::scratch_directory() + "/depth.tif";
  leadline::test::Random random(3);
  const Raster elevation = random_raster(&random, 11, 7);
  Raster sigma = elevation;
  for (double& value : sigma.values) {
    value = std::isnan(value) ? kNoValue : std::fabs(value) * 0.01;
  }
  GeoReference reference;
  reference.vertical_datum = "chart datum";
  leadline::host::write_geotiff_whole(path, elevation, &sigma, reference);
  const GeoTiffContent content = leadline::host::read_geotiff(path);
  assert_same(content.elevation, elevation, 1e-4);
  assert_true(content.sigma.has_value());
  assert_same(*content.sigma, sigma, 1e-5);
  assert_string_equal(content.coordinate_system.c_str(), "");
  assert_false(content.epsg.has_value());
  assert_string_equal(content.vertical_datum.c_str(), "chart datum");
  assert_same(leadline::host::read_raster(path), elevation, 1e-4);
  // Sign and frame stand in the file in plain text, for whoever opens it elsewhere.
  const std::string bytes = content_of(path);
  assert_contains(bytes, "elevation positive up, equal to minus depth");
  assert_contains(bytes, "not georeferenced");
  // Nothing else is left in the folder (no side files, no temporary).
  assert_int_equal(
      std::distance(fs::directory_iterator(fs::path(path).parent_path()), fs::directory_iterator()),
      1);
}

TEST(geotiff_bytes_repeat) {
  const std::string folder = leadline::test::scratch_directory();
  leadline::test::Random random(4);
  const Raster elevation = random_raster(&random, 30, 20);
  leadline::host::write_geotiff(folder + "/a.tif", elevation, nullptr, GeoReference());
  leadline::host::write_geotiff(folder + "/b.tif", elevation, nullptr, GeoReference());
  assert_true(content_of(folder + "/a.tif") == content_of(folder + "/b.tif"));
  assert_false(leadline::host::read_geotiff(folder + "/a.tif").sigma.has_value());
}

TEST(bad_reference_or_place_is_refused) {
  const std::string folder = leadline::test::scratch_directory();
  const Raster elevation = make_raster(4, 3, 0.0, 0.0, 5.0, -8.0);
  GeoReference reference;
  for (const int code : {4326, 999998}) {  // degrees; unknown
    reference.epsg = code;
    const std::string message = error_of(ExitCode::kUsage, [&] {
      leadline::host::write_geotiff_whole(folder + "/a.tif", elevation, nullptr, reference);
    });
    assert_contains(message, "EPSG:" + std::to_string(code));
  }
  (void)error_of(ExitCode::kOutput, [&] {
    leadline::host::write_geotiff_whole(folder + "/no/such/a.tif", elevation, nullptr,
                                        GeoReference());
  });
  const Raster other = make_raster(3, 3, 0.0, 0.0, 5.0, 1.0);
  (void)error_of(ExitCode::kInput, [&] {
    leadline::host::write_geotiff_whole(folder + "/a.tif", elevation, &other, GeoReference());
  });
  assert_true(fs::is_empty(folder));
}

TEST(only_a_file_gives_way_to_a_geotiff) {
  const std::string folder = leadline::test::scratch_directory();
  const Raster elevation = make_raster(4, 3, 0.0, 0.0, 5.0, -8.0);
  // As root, a rename would put the file in a device's place.
  const std::string pipe = folder + "/pipe.tif";
  assert_int_equal(::mkfifo(pipe.c_str(), 0600), 0);
  const std::string message = error_of(ExitCode::kOutput, [&] {
    leadline::host::write_geotiff_whole(pipe, elevation, nullptr, GeoReference());
  });
  assert_contains(message, "pipe.tif: is not a file");
  assert_true(fs::is_fifo(pipe));
  // A link stays one; what it points to is written.
  std::ofstream(folder + "/target.tif") << "old";
  fs::create_symlink("target.tif", folder + "/link.tif");
  leadline::host::write_geotiff_whole(folder + "/link.tif", elevation, nullptr, GeoReference());
  assert_true(fs::is_symlink(folder + "/link.tif"));
  assert_true(leadline::host::read_raster(folder + "/target.tif").values.size() == 12);
}

TEST(what_is_not_a_raster_is_refused) {
  const std::string folder = leadline::test::scratch_directory();
  std::ofstream(folder + "/a.tif") << "not a raster";
  const std::string message =
      error_of(ExitCode::kInput, [&] { (void)leadline::host::read_raster(folder + "/a.tif"); });
  assert_contains(message, "a.tif");
  assert_contains(message, "not a raster that GDAL reads");
  // A GeoTIFF that was cut off.
  leadline::test::Random random(5);
  leadline::host::write_geotiff(folder + "/whole.tif", random_raster(&random, 60, 60), nullptr,
                                GeoReference());
  const std::string bytes = content_of(folder + "/whole.tif");
  std::ofstream(folder + "/cut.tif", std::ios::binary) << bytes.substr(0, bytes.size() / 2);
  (void)error_of(ExitCode::kInput, [&] { (void)leadline::host::read_raster(folder + "/cut.tif"); });
}

TEST(real_bag_reads_like_its_ascii_crop) {
  const std::string bag =
      leadline::test::require_data("bag_navo_jd211/JD211_public_Release_1-4_UTM.bag");
  const std::string crop = leadline::test::require_data("bag_navo_jd211/jd211_crop512_2m_elev.asc");
  const GeoTiffContent content = leadline::host::read_geotiff(bag);
  const Raster ascii = leadline::host::read_raster(crop);
  assert_true(content.sigma.has_value());
  assert_near(content.elevation.cell_m, 2.0, 1e-9);
  const int row0 =
      static_cast<int>(std::lround((content.elevation.north_m() - ascii.north_m()) / ascii.cell_m));
  const int column0 =
      static_cast<int>(std::lround((ascii.west_m - content.elevation.west_m) / ascii.cell_m));
  int compared = 0;
  for (int row = 0; row < ascii.rows; row += 7) {
    for (int column = 0; column < ascii.columns; column += 5) {
      const double expected = ascii.at(row, column);
      const double found = content.elevation.at(row0 + row, column0 + column);
      assert_int_equal(std::isnan(expected), std::isnan(found));
      if (!std::isnan(expected)) {
        assert_near(found, expected, 0.00051);  // the crop has three decimals
        ++compared;
      }
    }
  }
  assert_true(compared > 7000);
}

}  // namespace
