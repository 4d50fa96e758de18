// `leadline compare`: how far an elevation raster is from another one that is taken for the truth, and
// whether its stated sigma is honest.
//
// Sign of the error: estimated depth minus true depth, deeper is positive. (The rasters hold
// elevations up, so it is truth minus estimate of the stored numbers.)
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>

#include "host_tools/raster.hpp"

namespace leadline::host {

/// One fifth of the cells, by reported sigma.
struct SigmaQuintile {
  std::size_t cells = 0;
  double mean_sigma_m = 0.0;
  double within_1 = 0.0;  ///< fraction whose |error| <= its own sigma
};

/// Is sigma what it claims to be? Over the compared cells that have a sigma. A Gaussian error gives
/// 0.683 within one sigma and 0.954 within two.
struct SigmaCalibration {
  std::size_t cells = 0;
  std::size_t missing = 0;  ///< compared cells without a sigma, or with one that is not over zero
  double mean_sigma_m = 0.0;
  double within_1 = 0.0;
  double within_2 = 0.0;
  /// Ascending by sigma; ties are split in reading order. A constant sigma shows as five equal means.
  std::array<SigmaQuintile, 5> quintiles;
};

/// Error of one raster. Metres; divide by cell_m for cells. With compared == 0 all figures but the
/// counts, coverage and cell_m are NaN.
struct Comparison {
  std::size_t expected = 0;  ///< cells that count: mask is 1 and the truth is known
  std::size_t compared = 0;  ///< of these, the ones where the estimate is known
  double coverage = 0.0;     ///< compared / expected
  double cell_m = 1.0;
  double rmse_m = kNoValue;
  double bias_m = kNoValue;  ///< mean error, deeper positive
  double p95_m = kNoValue;   ///< |error| that 95 % of the cells do not exceed (nearest rank)
  double max_m = kNoValue;   ///< largest |error|
  std::optional<SigmaCalibration> sigma;

  /// rmse after subtracting the own mean error: what an oracle could make of the estimate.
  [[nodiscard]] double debiased_rmse_m() const;
};

/// Compares over the cells where `mask` is 1 (null: everywhere) and `truth` has a value. `mask` and
/// `sigma` may be null. All geometries must be equal (same_geometry), else HostError kInput.
/// O(cells log cells).
[[nodiscard]] Comparison compare_rasters(const Raster& estimate, const Raster& truth,
                                         const Raster* mask, const Raster* sigma);

/// Estimated depth minus true depth, metres, where both are known and the mask (may be null) is 1.
[[nodiscard]] Raster depth_difference(const Raster& estimate, const Raster& truth,
                                      const Raster* mask);

struct CompareOptions {
  std::string estimate_path;  ///< elevation raster: ESRI ASCII or anything GDAL reads
  std::string truth_path;
  std::string mask_path;   ///< cells that count hold 1; "" = every cell with a truth
  std::string sigma_path;  ///< "" = no calibration
  /// Limits; one that is missed ends in ExitCode::kComparisonFailed. With no compared cell every
  /// limit is missed.
  std::optional<double> max_rmse_m;
  std::optional<double> max_rmse_cells;
  std::optional<double> max_abs_bias_m;
  std::optional<double> max_abs_bias_cells;
  std::optional<double> max_p95_m;
  std::optional<double> min_coverage;  ///< 0 .. 1
  std::string difference_png;          ///< picture of the difference; "" = none
  std::string difference_asc;          ///< the difference as a raster; "" = none
  bool json = false;                   ///< one JSON object on standard output instead of text
};

/// The command. Prints the figures to standard output (and the limits that were missed to standard
/// error) and returns 0 or the exit code of a failed comparison. Throws HostError: kUsage for a limit
/// that is not a number or out of its range, kInput for rasters that cannot be read, differ in
/// geometry or have no cell that counts, kOutput.
int run_compare(const CompareOptions& options);

}  // namespace leadline::host
