// `leadline store merge` and `difference`: what two surveys or more say together, and against each other.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "host_tools/store/align.hpp"

namespace leadline::host {

/// Two values contradict each other when they differ by more than this many of their common sigmas.
inline constexpr double kDisputeSigmas = 3.0;

struct MergedMap {
  Raster elevation;            ///< metres up
  Raster sigma;                ///< metres
  Raster disputed;             ///< 1 where surveys contradict each other; unknown elsewhere
  std::size_t single = 0;      ///< cells that one survey knows
  std::size_t consistent = 0;  ///< cells that several know, and agree on
  std::size_t disputes = 0;
};

/// Cell by cell. Surveys that agree: the mean by inverse variances, whose variance is the inverse of their
/// sum (their errors are taken to be independent: other days, other vehicles). Surveys that do not: the
/// shallowest value, its sigma wide enough that the deepest lies within two; and the cell is marked. The
/// result does not depend on the order of the maps. O(cells maps^2).
[[nodiscard]] MergedMap merge_maps(const std::vector<AlignedMap>& maps);

/// A connected area where the later survey is significantly deeper or shallower.
struct ChangedArea {
  std::size_t cells = 0;
  double area_m2 = 0.0;
  double east_m = 0.0;  ///< mean of its cells
  double north_m = 0.0;
  double mean_m = 0.0;     ///< change of depth, deeper is positive
  double volume_m3 = 0.0;  ///< what is missing (positive) or was added
  /// Sigma of the volume: if every cell errs on its own (and of the offset that was removed, which they share), and if
  /// all cells of a survey err together (a tide, a sound speed). The truth lies between: a beam covers several cells.
  double volume_sigma_m3 = 0.0;
  double volume_sigma_common_m3 = 0.0;
  double peak_sigmas = 0.0;  ///< largest |change| / sigma
};

struct MapDifference {
  Raster change;        ///< later depth minus earlier depth, metres
  Raster sigma;         ///< of the change, metres
  Raster significance;  ///< change in these sigmas
  std::size_t compared = 0;
  std::size_t significant = 0;      ///< cells beyond the threshold
  double expected_by_chance = 0.0;  ///< of them, were nothing changed and every sigma right
  std::size_t only_earlier = 0;     ///< cells that one of the two knows
  std::size_t only_later = 0;
  double median_m = kNoValue;
  double removed_offset_m = 0.0;
  double removed_offset_sigma_m =
      0.0;                         ///< of that median, from the cells' sigmas; 0: none was removed
  std::vector<ChangedArea> areas;  ///< largest |volume| first; of at least kLeastChangedCells
};
/// Smaller areas are left to the raster: single cells pass any threshold by chance.
inline constexpr std::size_t kLeastChangedCells = 4;

/// `threshold_sigmas` > 0. `level`: the median difference is taken for a change of datum or tide, and removed.
[[nodiscard]] MapDifference difference_of(const AlignedMap& earlier, const AlignedMap& later,
                                          double threshold_sigmas, bool level);

}  // namespace leadline::host
