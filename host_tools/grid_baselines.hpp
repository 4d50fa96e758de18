// `leadline grid`: what a surveyor's gridding makes of the same pings. These are the baselines that the
// map is measured against; they know neither beam width nor first-return geometry, and they are meant
// to be exactly what their names say.
//
// Every return becomes one sounding on the beam's axis, position + range * direction, and belongs to
// the cell it falls into (cells are half-open; soundings outside the raster are dropped, whatever their
// depth). Ranges are not filtered: "all ranges".
//   mean       mean depth of the cell's soundings
//   gaussian   weighted mean of all soundings in the square window of +-ceil(2.5 sigma) cells; weight
//              exp(-d^2 / 2 sigma^2) with d the distance from cell centre to cell centre in cells
//   median     median depth of all soundings in the square window of +-radius cells; of an even
//              number the shallower of the two in the middle
// A cell with no sounding in its window has no value. Rasters hold elevation (minus depth), as all do.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "host_tools/compare.hpp"
#include "host_tools/ping_csv.hpp"
#include "host_tools/raster.hpp"

namespace leadline::host {

/// A point of the seafloor, NED metres.
struct Sounding {
  double north_m;
  double east_m;
  double depth_m;
};

/// The point on the beam's axis at the measured range; nothing when the row has no return.
[[nodiscard]] std::optional<Sounding> on_axis_sounding(const PingRow& ping);

/// Soundings sorted into the cells of a raster.
class SoundingBins {
 public:
  /// Bins of the cells of `geometry` (its values are ignored).
  explicit SoundingBins(const Raster& geometry);

  /// Adds one; false (and counted) when it lies outside the raster or is not finite.
  bool add(const Sounding& sounding);

  [[nodiscard]] std::size_t count() const { return count_; }      ///< inside
  [[nodiscard]] std::size_t outside() const { return outside_; }  ///< dropped
  /// Depths in one cell, in the order they came.
  [[nodiscard]] const std::vector<double>& depths_m(int row, int column) const {
    return depths_m_[geometry_.index(row, column)];
  }
  [[nodiscard]] const Raster& geometry() const { return geometry_; }

 private:
  Raster geometry_;  // values empty
  std::vector<std::vector<double>> depths_m_;
  std::size_t count_ = 0;
  std::size_t outside_ = 0;
};

[[nodiscard]] Raster grid_mean(const SoundingBins& bins);
/// sigma_cells > 0. O(cells * window).
[[nodiscard]] Raster grid_gaussian(const SoundingBins& bins, double sigma_cells);
/// radius_cells >= 0. O(cells * soundings in the window).
[[nodiscard]] Raster grid_median(const SoundingBins& bins, int radius_cells);

/// One of the baselines.
struct Baseline {
  enum class Kind { kMean, kGaussian, kMedian };
  Kind kind;
  double sigma_cells;  ///< kGaussian
  int radius_cells;    ///< kMedian

  /// "mean", "gaussian-1.5", "median-2": also the name of its file.
  [[nodiscard]] std::string name() const;
};

/// mean; gaussian-1, -1.5, -2, -3; median-1, -2, -3.
[[nodiscard]] const std::vector<Baseline>& all_baselines();
[[nodiscard]] Raster grid_baseline(const SoundingBins& bins, const Baseline& baseline);

/// Index of the best of `comparisons` (parallel to `baselines`): the lowest rmse among Gaussian and
/// median with a coverage of at least 95 %; nothing when none has it.
[[nodiscard]] std::optional<std::size_t> best_baseline(const std::vector<Baseline>& baselines,
                                                       const std::vector<Comparison>& comparisons);

struct GridOptions {
  std::string pings_path;   ///< CSV as for `leadline map`
  std::string config_path;  ///< map.toml: only [grid] and [frame] matter here
  std::string out_dir;      ///< receives NAME.asc per baseline and grid.json; "" = only figures
  std::vector<std::string> methods;  ///< names of all_baselines(); empty = all
  std::string
      truth_path;  ///< elevation raster of the same geometry: adds rmse and the best; "" = none
  std::string mask_path;  ///< cells that count hold 1; "" = every cell with a truth
  bool strict = false;    ///< stop at the first unusable row
  bool json = false;      ///< one JSON object on standard output instead of a table
};

/// The command; returns 0. Throws HostError: kUsage (unknown method; mask without truth; nothing to
/// do; configuration), kInput (pings, truth, mask; no sounding inside the grid), kOutput.
int run_grid(const GridOptions& options);

}  // namespace leadline::host
