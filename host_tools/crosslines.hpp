// `leadline crosslines`: do lines of a survey agree where they cross? Differences of depth between soundings of
// different lines (or of soundings and a map), and which order of the IHO's S-44 they would do for.
//
// A pair is a sounding of one file and the nearest one of another file, not farther than a radius
// horizontally. Total vertical uncertainty allowed at depth d, 95 %: sqrt(a^2 + (b d)^2); both soundings of
// a pair may be off by that, so a difference counts as within when it is at most sqrt(2) times as large;
// against a map it is at most the limit itself. An order is met when 95 % of the differences are within.
// Facts: IHO S-44 edition 6.1, table 1. Horizontal uncertainty, coverage and detection are not judged.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "host_tools/grid_baselines.hpp"
#include "host_tools/raster.hpp"

namespace leadline::host {

struct SurveyOrder {
  const char* name;
  double a_m;
  double b;
};
/// Strictest first.
inline constexpr std::array<SurveyOrder, 5> kSurveyOrders = {{{"Exclusive", 0.15, 0.0075},
                                                              {"Special", 0.25, 0.0075},
                                                              {"1a", 0.5, 0.013},
                                                              {"1b", 0.5, 0.013},
                                                              {"2", 1.0, 0.023}}};

/// One difference.
struct Crossing {
  double difference_m;  ///< first minus second, or sounding minus map; deeper positive
  double depth_m;       ///< mean of the two
};

/// Figures of a list of crossings. With none of them, NaN.
struct CrossingStatistics {
  std::size_t count = 0;
  double median_m = kNoValue;
  double robust_sigma_m = kNoValue;  ///< 1.4826 times the median distance from the median
  double rms_m = kNoValue;
  double p95_m = kNoValue;                            ///< |difference| that 95 % do not exceed
  std::array<double, kSurveyOrders.size()> within{};  ///< share, per order
  /// Index of the strictest order met; kSurveyOrders.size() for none.
  std::size_t order = kSurveyOrders.size();
};

/// The nearest sounding of `second` for each of `first`, not farther than `radius_m` (> 0). O(n) for
/// soundings that are not all in one place.
[[nodiscard]] std::vector<Crossing> crossings(const std::vector<Sounding>& first,
                                              const std::vector<Sounding>& second, double radius_m);

/// Each sounding against the cell it falls into; `elevation` is a map's depth.asc.
[[nodiscard]] std::vector<Crossing> against_map(const std::vector<Sounding>& soundings,
                                                const Raster& elevation);

/// `allowance`: times the limits (sqrt 2 for pairs). O(n log n).
[[nodiscard]] CrossingStatistics statistics_of(const std::vector<Crossing>& crossings,
                                               double allowance);

struct CrosslinesOptions {
  std::vector<std::string> paths;  ///< pings, CSV as for `leadline map`: one file a line (or day)
  std::string map_path;  ///< elevation raster: compare with it instead; "" = with each other
  double radius_m = 1.0;
  std::string require_order;  ///< name of one of kSurveyOrders: fail below it; "" = none
  bool json = false;
};

/// The command. Returns 0, or the exit code of a failed comparison. Throws HostError: kUsage (one file and no
/// map, unknown order), kInput (files; no crossing).
int run_crosslines(const CrosslinesOptions& options);

}  // namespace leadline::host
