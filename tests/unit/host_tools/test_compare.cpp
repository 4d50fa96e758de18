// Comparison of rasters: figures worked by hand, calibration of sigma, limits and exit codes.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>

#include "host_tools/compare.hpp"
#include "host_tools/exit_codes.hpp"
#include "tests/support/host_errors.hpp"
#include "tests/support/test.hpp"

namespace {

namespace fs = std::filesystem;

using leadline::host::compare_rasters;
using leadline::host::CompareOptions;
using leadline::host::Comparison;
using leadline::host::ExitCode;
using leadline::host::kNoValue;
using leadline::host::make_raster;
using leadline::host::Raster;
using leadline::host::run_compare;
using leadline::test::assert_contains;
using leadline::test::error_of;

TEST(figures_worked_by_hand) {
  // Cells of 2 m. Elevations: the estimate is 1 m deeper, 1 m shallower, 3 m deeper, unknown; one cell
  // has no truth, one is masked out.
  Raster truth = make_raster(3, 2, 0.0, 0.0, 2.0, -10.0);
  Raster estimate = truth;
  Raster mask = make_raster(3, 2, 0.0, 0.0, 2.0, 1.0);
  estimate.values = {-11.0, -9.0, -13.0, kNoValue, -10.0, -99.0};
  truth.values[4] = kNoValue;
  mask.values[5] = 0.0;
  const Comparison c = compare_rasters(estimate, truth, &mask, nullptr);
  assert_int_equal(c.expected, 4);
  assert_int_equal(c.compared, 3);
  assert_near(c.coverage, 0.75, 1e-12);
  assert_near(c.rmse_m, std::sqrt(11.0 / 3.0), 1e-12);
  assert_near(c.bias_m, 1.0, 1e-12);  // deeper is positive
  assert_near(c.debiased_rmse_m(), std::sqrt(8.0 / 3.0), 1e-12);
  assert_near(c.p95_m, 3.0, 1e-12);
  assert_near(c.max_m, 3.0, 1e-12);
  assert_near(c.cell_m, 2.0, 0);
  assert_false(c.sigma.has_value());

  const Raster difference = leadline::host::depth_difference(estimate, truth, &mask);
  assert_near(difference.values[0], 1.0, 1e-12);
  assert_near(difference.values[1], -1.0, 1e-12);
  assert_true(std::isnan(difference.values[3]));
  assert_true(std::isnan(difference.values[4]));
  assert_true(std::isnan(difference.values[5]));
}

TEST(p95_is_the_nearest_rank) {
  Raster truth = make_raster(100, 1, 0.0, 0.0, 1.0, 0.0);
  Raster estimate = truth;
  for (std::size_t i = 0; i < 100; ++i) {
    estimate.values[i] = -static_cast<double>((i * 37) % 100 + 1);  // 1 .. 100 deep, shuffled
  }
  const Comparison c = compare_rasters(estimate, truth, nullptr, nullptr);
  assert_near(c.p95_m, 95.0, 0);
  assert_near(c.max_m, 100.0, 0);
  truth.columns = estimate.columns = 1;
  truth.values.resize(1);
  estimate.values.resize(1);
  assert_near(compare_rasters(estimate, truth, nullptr, nullptr).p95_m, 1.0, 0);
}

TEST(honest_gaussian_sigma_is_recognized) {
  leadline::test::Random random(7);
  const Raster truth = make_raster(200, 200, 0.0, 0.0, 1.0, -50.0);
  Raster estimate = truth;
  Raster sigma = truth;
  for (std::size_t i = 0; i < truth.values.size(); ++i) {
    sigma.values[i] = 0.1 + random.uniform();
    estimate.values[i] += sigma.values[i] * random.normal();
  }
  sigma.values[0] = kNoValue;
  sigma.values[1] = 0.0;
  const Comparison c = compare_rasters(estimate, truth, nullptr, &sigma);
  assert_int_equal(c.sigma->missing, 2);
  assert_int_equal(c.sigma->cells, 39998);
  assert_near(c.sigma->within_1, 0.6827, 0.01);
  assert_near(c.sigma->within_2, 0.9545, 0.005);
  double previous = 0.0;
  std::size_t cells = 0;
  for (const leadline::host::SigmaQuintile& quintile : c.sigma->quintiles) {
    assert_near(quintile.within_1, 0.6827, 0.025);
    assert_true(quintile.mean_sigma_m > previous);
    previous = quintile.mean_sigma_m;
    cells += quintile.cells;
  }
  assert_int_equal(cells, c.sigma->cells);
  assert_near(c.sigma->mean_sigma_m, 0.6, 0.01);
}

TEST(constant_sigma_shows_in_the_quintiles) {
  // Errors grow along the raster, sigma does not know: right on the whole, wrong in every part. Ties
  // keep reading order, so the fifths are the raster's fifths.
  const Raster truth = make_raster(1000, 1, 0.0, 0.0, 1.0, 0.0);
  Raster estimate = truth;
  const Raster sigma = make_raster(1000, 1, 0.0, 0.0, 1.0, 0.7);
  for (std::size_t i = 0; i < 1000; ++i) {
    estimate.values[i] = -static_cast<double>(i) / 1000.0;
  }
  const Comparison c = compare_rasters(estimate, truth, nullptr, &sigma);
  assert_near(c.sigma->within_1, 0.7, 0.01);
  assert_near(c.sigma->quintiles[0].within_1, 1.0, 0);
  assert_near(c.sigma->quintiles[4].within_1, 0.0, 0);
  assert_near(c.sigma->quintiles[2].mean_sigma_m, 0.7, 1e-9);
}

TEST(nothing_in_common_gives_no_figures) {
  const Raster truth = make_raster(2, 2, 0.0, 0.0, 1.0, -5.0);
  const Raster nothing = make_raster(2, 2, 0.0, 0.0, 1.0);
  const Comparison c = compare_rasters(nothing, truth, nullptr, &nothing);
  assert_int_equal(c.expected, 4);
  assert_int_equal(c.compared, 0);
  assert_near(c.coverage, 0.0, 0);
  assert_true(std::isnan(c.rmse_m));
  assert_int_equal(c.sigma->cells, 0);
}

TEST(other_geometry_is_an_input_error) {
  const Raster truth = make_raster(2, 2, 0.0, 0.0, 1.0, -5.0);
  const Raster shifted = make_raster(2, 2, 0.0, 0.5, 1.0, -5.0);
  const std::string message =
      error_of(ExitCode::kInput, [&] { (void)compare_rasters(shifted, truth, nullptr, nullptr); });
  assert_contains(message, "the estimate has 2 x 2 cells of 1 m from east 0, north 0.5");
  assert_contains(message, "the truth has 2 x 2 cells of 1 m from east 0, north 0");
  assert_contains(
      error_of(ExitCode::kInput, [&] { (void)compare_rasters(truth, truth, &shifted, nullptr); }),
      "mask");
  assert_contains(
      error_of(ExitCode::kInput, [&] { (void)compare_rasters(truth, truth, nullptr, &shifted); }),
      "sigma");
}

/// A folder with truth.asc (plane at -10), estimate.asc (0.5 m deeper, one cell unknown) and mask.asc.
CompareOptions small_case(const std::string& folder) {
  const Raster truth = make_raster(4, 5, 0.0, 0.0, 0.5, -10.0);
  Raster estimate = make_raster(4, 5, 0.0, 0.0, 0.5, -10.5);
  estimate.values[3] = kNoValue;
  leadline::host::write_esri_ascii(truth, folder + "/truth.asc");
  leadline::host::write_esri_ascii(estimate, folder + "/estimate.asc");
  leadline::host::write_esri_ascii(make_raster(4, 5, 0.0, 0.0, 0.5, 0.0), folder + "/nowhere.asc");
  CompareOptions options;
  options.estimate_path = folder + "/estimate.asc";
  options.truth_path = folder + "/truth.asc";
  return options;
}

TEST(limits_decide_the_exit_code) {
  const CompareOptions base = small_case(leadline::test::scratch_directory());
  assert_int_equal(run_compare(base), 0);
  CompareOptions met = base;
  met.max_rmse_m = 0.5001;
  met.max_rmse_cells = 1.0001;
  met.max_abs_bias_m = 0.5001;
  met.max_abs_bias_cells = 1.0001;
  met.max_p95_m = 0.5001;
  met.min_coverage = 0.95;
  assert_int_equal(run_compare(met), 0);
  const auto fails = [&](auto member, double limit) {
    CompareOptions options = met;
    options.*member = limit;
    assert_int_equal(run_compare(options), 5);
  };
  fails(&CompareOptions::max_rmse_m, 0.499);
  fails(&CompareOptions::max_rmse_cells, 0.99);
  fails(&CompareOptions::max_abs_bias_m, 0.499);
  fails(&CompareOptions::max_abs_bias_cells, 0.99);
  fails(&CompareOptions::max_p95_m, 0.499);
  fails(&CompareOptions::min_coverage, 0.951);
}

TEST(limits_out_of_range_are_usage_errors) {
  const CompareOptions base = small_case(leadline::test::scratch_directory());
  for (const double bad : {-0.1, static_cast<double>(NAN), 1.5}) {
    CompareOptions options = base;
    options.min_coverage = bad;
    assert_contains(error_of(ExitCode::kUsage, [&] { (void)run_compare(options); }),
                    "--min-coverage");
  }
  CompareOptions options = base;
  options.max_rmse_m = -1.0;
  assert_contains(error_of(ExitCode::kUsage, [&] { (void)run_compare(options); }), "--max-rmse");
}

TEST(no_estimate_at_all_misses_every_limit) {
  const std::string folder = leadline::test::scratch_directory();
  CompareOptions options = small_case(folder);
  leadline::host::write_esri_ascii(make_raster(4, 5, 0.0, 0.0, 0.5), options.estimate_path);
  assert_int_equal(run_compare(options), 0);
  CompareOptions limited = options;
  limited.max_rmse_m = 1e9;
  assert_int_equal(run_compare(limited), 5);
  limited = options;
  limited.min_coverage = 0.0;
  assert_int_equal(run_compare(limited), 5);
}

TEST(a_mask_that_selects_nothing_is_an_input_error) {
  const std::string folder = leadline::test::scratch_directory();
  CompareOptions options = small_case(folder);
  options.mask_path = folder + "/nowhere.asc";
  assert_contains(error_of(ExitCode::kInput, [&] { (void)run_compare(options); }), "nowhere.asc");
}

TEST(json_and_difference_are_written) {
  const std::string folder = leadline::test::scratch_directory();
  CompareOptions options = small_case(folder);
  options.sigma_path = options.truth_path;  // negative: counted as missing
  options.json = true;
  options.difference_asc = folder + "/difference.asc";
  options.difference_png = folder + "/difference.png";
  assert_int_equal(run_compare(options), 0);
  const Raster difference = leadline::host::read_esri_ascii(options.difference_asc);
  assert_near(difference.at(0, 0), 0.5, 1e-9);
  assert_true(std::isnan(difference.values[3]));
  assert_true(fs::file_size(options.difference_png) > 1000);
  options.difference_png = folder + "/no/such/folder.png";
  (void)error_of(ExitCode::kOutput, [&] { (void)run_compare(options); });
}

}  // namespace
