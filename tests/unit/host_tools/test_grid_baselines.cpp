// The baselines: definitions on cases worked by hand, and the published figures on the shared scenes.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "host_tools/exit_codes.hpp"
#include "host_tools/geotiff.hpp"
#include "host_tools/grid_baselines.hpp"
#include "tests/support/host_errors.hpp"
#include "tests/support/test.hpp"

namespace {

namespace fs = std::filesystem;

using leadline::host::all_baselines;
using leadline::host::Baseline;
using leadline::host::best_baseline;
using leadline::host::Comparison;
using leadline::host::ExitCode;
using leadline::host::GridOptions;
using leadline::host::make_raster;
using leadline::host::on_axis_sounding;
using leadline::host::PingRow;
using leadline::host::Raster;
using leadline::host::Sounding;
using leadline::host::SoundingBins;
using leadline::test::assert_contains;
using leadline::test::error_of;

constexpr double kLsbPerDeg = 4294967296.0 / 360.0;

leadline::base::Bam32 bam32(double degrees) {
  return static_cast<leadline::base::Bam32>(std::llround(degrees * kLsbPerDeg));
}

PingRow ping(double roll_deg, double pitch_deg, double heading_deg, double azimuth_deg,
             double elevation_deg) {
  PingRow row{};
  row.position_um[0] = 1'000'000;
  row.position_um[1] = 2'000'000;
  row.position_um[2] = 3'000'000;
  row.attitude = {bam32(roll_deg), bam32(pitch_deg), bam32(heading_deg)};
  row.azimuth_bam32 = bam32(azimuth_deg);
  row.elevation_bam32 = bam32(elevation_deg);
  row.range_um = 10'000'000;
  row.has_range = true;
  return row;
}

void assert_offset(const PingRow& row, double north_m, double east_m, double down_m) {
  const std::optional<Sounding> sounding = on_axis_sounding(row);
  assert_true(sounding.has_value());
  assert_near(sounding->north_m - 1.0, north_m, 1e-6);
  assert_near(sounding->east_m - 2.0, east_m, 1e-6);
  assert_near(sounding->depth_m - 3.0, down_m, 1e-6);
}

TEST(beam_directions_follow_the_contract) {
  assert_offset(ping(0, 0, 0, 0, 90), 0, 0, 10);    // straight down
  assert_offset(ping(0, 0, 0, 0, 0), 10, 0, 0);     // forward is north
  assert_offset(ping(0, 0, 90, 0, 0), 0, 10, 0);    // heading east
  assert_offset(ping(0, 0, 0, 90, 0), 0, 10, 0);    // starboard
  assert_offset(ping(0, 0, 90, 90, 0), -10, 0, 0);  // starboard when heading east is south
  assert_offset(ping(0, 90, 0, 0, 0), 0, 0, -10);   // nose up lifts a forward beam
  assert_offset(ping(90, 0, 0, 90, 0), 0, 0, 10);   // starboard down lowers a starboard beam
  assert_offset(ping(90, 0, 0, 0, 90), 0, -10, 0);  // and turns a nadir beam to port
  const double root = std::sqrt(0.5) * 10;
  assert_offset(ping(0, 45, 0, 0, 90), root, 0, root);  // nose up swings a nadir beam forward
  // Order matters: roll first, then pitch, then heading.
  assert_offset(ping(90, 90, 0, 0, 90), 0, -10, 0);
  assert_offset(ping(90, 0, 90, 0, 90), 10, 0, 0);
  PingRow silent = ping(0, 0, 0, 0, 90);
  silent.has_range = false;
  assert_false(on_axis_sounding(silent).has_value());
}

TEST(cells_are_half_open_and_rows_count_from_north) {
  SoundingBins bins(make_raster(4, 3, 10.0, 20.0, 2.0));
  assert_true(bins.add({20.0, 10.0, 1.0}));   // the south-west corner belongs to the last row
  assert_true(bins.add({25.9, 17.9, 2.0}));   // north-east cell
  assert_false(bins.add({26.0, 12.0, 3.0}));  // the north edge is outside
  assert_false(bins.add({22.0, 18.0, 3.0}));  // the east edge too
  assert_false(bins.add({19.999, 12.0, 3.0}));
  assert_false(bins.add({22.0, 9.999, 3.0}));
  assert_false(bins.add({NAN, 12.0, 3.0}));
  assert_false(bins.add({22.0, 12.0, NAN}));
  assert_false(bins.add({1e300, -1e300, 3.0}));
  assert_true(bins.add({22.0, 12.0, -1e6}));  // any depth counts
  assert_int_equal(bins.count(), 3);
  assert_int_equal(bins.outside(), 7);
  assert_int_equal(bins.depths_m(2, 0).size(), 1);
  assert_int_equal(bins.depths_m(0, 3).size(), 1);
  assert_int_equal(bins.depths_m(1, 1).size(), 1);
}

TEST(mean_per_cell) {
  SoundingBins bins(make_raster(2, 1, 0.0, 0.0, 1.0));
  bins.add({0.5, 0.1, 10.0});
  bins.add({0.5, 0.9, 13.0});
  const Raster raster = leadline::host::grid_mean(bins);
  assert_near(raster.at(0, 0), -11.5, 1e-12);
  assert_true(std::isnan(raster.at(0, 1)));
}

TEST(gaussian_weighs_by_centres_in_a_square_window) {
  // One sounding of 10 m off-centre in the middle, two of 20 m one column further: distances count
  // from centre to centre, and a cell's soundings count each.
  SoundingBins bins(make_raster(9, 9, 0.0, 0.0, 1.0));
  bins.add({4.95, 4.05, 10.0});
  bins.add({4.5, 5.5, 20.0});
  bins.add({4.1, 5.9, 20.0});
  const Raster raster = leadline::host::grid_gaussian(bins, 1.0);
  const double w1 = std::exp(-0.5);
  assert_near(raster.at(4, 4), -(10.0 + 2 * w1 * 20.0) / (1 + 2 * w1), 1e-12);
  assert_near(raster.at(4, 5), -(w1 * 10.0 + 2 * 20.0) / (w1 + 2), 1e-12);
  // The window reaches ceil(2.5) = 3 cells, diagonally too.
  assert_near(raster.at(1, 1), -10.0, 1e-12);
  assert_near(raster.at(7, 8), -20.0, 1e-12);
  assert_true(std::isnan(raster.at(4, 0)));
  assert_true(std::isnan(raster.at(0, 4)));
  // ceil(2.5 * 1.5) = 4
  const Raster wide = leadline::host::grid_gaussian(bins, 1.5);
  assert_near(wide.at(0, 0), -10.0, 1e-12);
}

TEST(median_takes_the_shallower_of_two) {
  SoundingBins bins(make_raster(5, 1, 0.0, 0.0, 1.0));
  bins.add({0.5, 0.5, 30.0});
  bins.add({0.5, 0.6, 10.0});
  bins.add({0.5, 1.5, 20.0});
  bins.add({0.5, 2.5, 99.0});
  const Raster one = leadline::host::grid_median(bins, 1);
  assert_near(one.at(0, 0), -20.0, 0);  // 10, 20, 30
  assert_near(one.at(0, 1), -20.0, 0);  // 10, 20, 30, 99
  assert_near(one.at(0, 2), -20.0, 0);  // 20, 99
  assert_near(one.at(0, 3), -99.0, 0);
  assert_true(std::isnan(one.at(0, 4)));
  assert_near(leadline::host::grid_median(bins, 0).at(0, 0), -10.0, 0);
}

TEST(names_and_the_choice_of_the_best) {
  const std::vector<Baseline>& baselines = all_baselines();
  const char* names[] = {"mean",       "gaussian-1", "gaussian-1.5", "gaussian-2",
                         "gaussian-3", "median-1",   "median-2",     "median-3"};
  assert_int_equal(baselines.size(), 8);
  std::vector<Comparison> comparisons(8);
  for (std::size_t i = 0; i < 8; ++i) {
    assert_string_equal(baselines[i].name().c_str(), names[i]);
    comparisons[i].coverage = 1.0;
    comparisons[i].rmse_m = 1.0 + 0.1 * static_cast<double>(i);
  }
  assert_int_equal(*best_baseline(baselines, comparisons), 1);  // the mean does not compete
  comparisons[6].rmse_m = 0.5;
  comparisons[6].coverage = 0.949;
  assert_int_equal(*best_baseline(baselines, comparisons), 1);
  comparisons[6].coverage = 0.95;
  assert_int_equal(*best_baseline(baselines, comparisons), 6);
  for (Comparison& comparison : comparisons) {
    comparison.coverage = 0.5;
  }
  assert_false(best_baseline(baselines, comparisons).has_value());
}

/// A flat bottom at 12 m under a small grid, truth and mask beside it.
GridOptions small_survey(const std::string& folder) {
  std::ofstream toml(folder + "/map.toml");
  toml << "[grid]\ncell_mm = 500\nsize = [4, 6, 8]\norigin_mm = [1000, -2000, 10000]\n"
          "[sonar]\nbeam_half_angle_deg = 3\n";
  std::ofstream csv(folder + "/pings.csv");
  csv << "time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m\n";
  for (int i = 0; i < 24; ++i) {
    csv << i << "," << 1.25 + 0.5 * (i / 6) << "," << -1.75 + 0.5 * (i % 6) << ",2,0,0,0,0,90,10\n";
  }
  csv << "30,0,0,2,0,0,0,0,90,10\n31,1.25,-1.75,2,0,0,0,0,90,\n";
  leadline::host::write_esri_ascii(make_raster(6, 4, -2.0, 1.0, 0.5, -12.25),
                                   folder + "/truth.asc");
  GridOptions options;
  options.pings_path = folder + "/pings.csv";
  options.config_path = folder + "/map.toml";
  options.out_dir = folder + "/out";
  return options;
}

TEST(the_command_writes_every_baseline) {
  const std::string folder = leadline::test::scratch_directory();
  GridOptions options = small_survey(folder);
  options.truth_path = folder + "/truth.asc";
  options.json = true;
  assert_int_equal(leadline::host::run_grid(options), 0);
  for (const Baseline& baseline : all_baselines()) {
    const Raster raster =
        leadline::host::read_esri_ascii(folder + "/out/" + baseline.name() + ".asc");
    assert_int_equal(raster.columns, 6);
    assert_int_equal(raster.rows, 4);
    assert_near(raster.west_m, -2.0, 1e-12);
    assert_near(raster.south_m, 1.0, 1e-12);
    assert_int_equal(raster.known_count(), 24);
    assert_near(raster.at(2, 3), -12.0, 1e-4);
  }
  std::ifstream file(folder + "/out/grid.json");
  const std::string json{std::istreambuf_iterator<char>(file), {}};
  assert_contains(json, "\"soundings\": 24");
  assert_contains(json, "\"outside\": 1");
  assert_contains(json, "\"no_return\": 1");
  assert_contains(json, "\"best\": \"");
  assert_contains(json, "\"bias_cells\": -0.5");  // 0.25 m shallower than the truth, cells of 0.5 m
  options.json = false;
  options.methods = {"median-2"};
  options.out_dir = folder + "/one";
  assert_int_equal(leadline::host::run_grid(options), 0);
  assert_true(fs::exists(folder + "/one/median-2.asc"));
  assert_false(fs::exists(folder + "/one/mean.asc"));
  options.truth_path.clear();
  assert_int_equal(leadline::host::run_grid(options), 0);
}

TEST(what_the_command_refuses) {
  const std::string folder = leadline::test::scratch_directory();
  const GridOptions good = small_survey(folder);
  GridOptions options = good;
  options.methods = {"mean", "kriging"};
  assert_contains(error_of(ExitCode::kUsage, [&] { (void)leadline::host::run_grid(options); }),
                  "kriging");
  options = good;
  options.mask_path = folder + "/truth.asc";
  assert_contains(error_of(ExitCode::kUsage, [&] { (void)leadline::host::run_grid(options); }),
                  "--mask needs --truth");
  options = good;
  options.out_dir.clear();
  assert_contains(error_of(ExitCode::kUsage, [&] { (void)leadline::host::run_grid(options); }),
                  "nothing to do");
  options = good;
  options.truth_path = folder + "/shifted.asc";
  leadline::host::write_esri_ascii(make_raster(6, 4, -2.0, 1.5, 0.5, -12.0), options.truth_path);
  assert_contains(error_of(ExitCode::kInput, [&] { (void)leadline::host::run_grid(options); }),
                  "shifted.asc has 6 x 4");
  options = good;
  options.truth_path = folder + "/truth.asc";
  options.mask_path = folder + "/truth.asc";  // nowhere 1
  assert_contains(error_of(ExitCode::kInput, [&] { (void)leadline::host::run_grid(options); }),
                  "no cell counts");
  options = good;
  options.pings_path = folder + "/far.csv";
  std::ofstream(options.pings_path)
      << "time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m\n"
         "0,900,900,2,0,0,0,0,90,10\n";
  assert_contains(error_of(ExitCode::kInput, [&] { (void)leadline::host::run_grid(options); }),
                  "none of 1 soundings lies in the grid");
  assert_false(fs::exists(folder + "/out/mean.asc"));
  options = good;
  options.config_path = folder + "/huge.toml";
  std::ofstream(options.config_path)
      << "[grid]\ncell_mm = 500\nsize = [100000, 100000, 8]\norigin_mm = [0, 0, 0]\n"
         "[sonar]\nbeam_half_angle_deg = 3\n";
  assert_contains(error_of(ExitCode::kUsage, [&] { (void)leadline::host::run_grid(options); }),
                  "10000000000 columns");
}

/// Published figures of a scene (shared accuracy.md): rmse of the best gridding and the same after
/// subtracting its own mean error, in cells. They pin down every choice in the definitions.
void assert_published(const std::string& scene, const char* best, double rmse_cells,
                      double debiased_cells) {
  const std::string folder = "scenes/" + scene + "/";
  const std::string pings = leadline::test::require_data(folder + "pings.csv");
  const Raster truth =
      leadline::host::read_raster(leadline::test::require_data(folder + "truth.asc"));
  const Raster mask =
      leadline::host::read_raster(leadline::test::require_data(folder + "touched.asc"));
  SoundingBins bins(truth);
  for (const PingRow& row :
       leadline::host::read_ping_csv(pings, leadline::host::PingCsvOptions(), nullptr)) {
    if (const std::optional<Sounding> sounding = on_axis_sounding(row)) {
      bins.add(*sounding);
    }
  }
  std::vector<Comparison> comparisons;
  for (const Baseline& baseline : all_baselines()) {
    comparisons.push_back(leadline::host::compare_rasters(
        leadline::host::grid_baseline(bins, baseline), truth, &mask, nullptr));
  }
  const std::optional<std::size_t> winner = best_baseline(all_baselines(), comparisons);
  assert_true(winner.has_value());
  assert_string_equal(all_baselines()[*winner].name().c_str(), best);
  assert_near(comparisons[*winner].rmse_m / truth.cell_m, rmse_cells, 0.00051);
  assert_near(comparisons[*winner].debiased_rmse_m() / truth.cell_m, debiased_cells, 0.00051);
}

TEST(published_helens_low) { assert_published("helens_low", "gaussian-1.5", 0.565, 0.338); }
TEST(published_helens_high) { assert_published("helens_high", "gaussian-2", 0.751, 0.560); }
TEST(published_monterey_fan) { assert_published("monterey_fan", "median-2", 0.496, 0.353); }
TEST(published_helens_altimeter) {
  assert_published("helens_altimeter", "gaussian-1.5", 0.607, 0.388);
}
TEST(published_helens_half_altitude) {
  assert_published("helens_half_altitude", "gaussian-1.5", 0.390, 0.303);
}
TEST(published_helens_rolling_fan) {
  assert_published("helens_rolling_fan", "median-1", 0.349, 0.324);
}
TEST(published_plane_flat) { assert_published("plane_flat", "gaussian-3", 0.297, 0.077); }
TEST(published_plane_slope30) { assert_published("plane_slope30", "gaussian-1.5", 0.526, 0.281); }

}  // namespace
