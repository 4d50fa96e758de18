#include "host_tools/store/merge.hpp"

#include <algorithm>
#include <cmath>

namespace leadline::host {
namespace {

struct Value {
  double elevation_m;
  double sigma_m;
};

/// Smallest sigma that is believed: of a cell that claims none at all.
constexpr double kLeastSigma_m = 1e-6;

bool consistent(const std::vector<Value>& values) {
  for (std::size_t a = 0; a < values.size(); ++a) {
    for (std::size_t b = a + 1; b < values.size(); ++b) {
      const double sigma_m = std::hypot(values[a].sigma_m, values[b].sigma_m);
      if (std::fabs(values[a].elevation_m - values[b].elevation_m) > kDisputeSigmas * sigma_m) {
        return false;
      }
    }
  }
  return true;
}

Value weighted_mean(const std::vector<Value>& values) {
  double weights = 0.0;
  double sum = 0.0;
  for (const Value& value : values) {
    const double weight = 1.0 / (value.sigma_m * value.sigma_m);
    weights += weight;
    sum += weight * value.elevation_m;
  }
  return {sum / weights, 1.0 / std::sqrt(weights)};
}

Value shallowest(const std::vector<Value>& values) {
  const auto higher = [](const Value& a, const Value& b) { return a.elevation_m < b.elevation_m; };
  const auto [low, high] = std::minmax_element(values.begin(), values.end(), higher);
  return {high->elevation_m, std::max(high->sigma_m, 0.5 * (high->elevation_m - low->elevation_m))};
}

}  // namespace

MergedMap merge_maps(const std::vector<AlignedMap>& maps) {
  const Raster& grid = maps.front().elevation;
  MergedMap merged{grid, grid, grid};
  std::vector<Value> values;
  for (std::size_t k = 0; k < grid.values.size(); ++k) {
    values.clear();
    for (const AlignedMap& map : maps) {
      const double sigma_m = map.sigma.values[k];
      if (!std::isnan(map.elevation.values[k]) && !std::isnan(sigma_m)) {
        values.push_back({map.elevation.values[k], std::max(sigma_m, kLeastSigma_m)});
      }
    }
    // Sums of the same values in the same order, whatever the order of the maps.
    std::sort(values.begin(), values.end(), [](const Value& a, const Value& b) {
      return a.elevation_m != b.elevation_m ? a.elevation_m < b.elevation_m : a.sigma_m < b.sigma_m;
    });
    Value value{kNoValue, kNoValue};
    double disputed = kNoValue;
    if (values.size() == 1) {
      merged.single += 1;
      value = values.front();
    } else if (values.size() > 1 && consistent(values)) {
      merged.consistent += 1;
      value = weighted_mean(values);
    } else if (values.size() > 1) {
      merged.disputes += 1;
      disputed = 1.0;
      value = shallowest(values);
    }
    merged.elevation.values[k] = value.elevation_m;
    merged.sigma.values[k] = value.sigma_m;
    merged.disputed.values[k] = disputed;
  }
  return merged;
}

namespace {

/// Connected areas (by edges) of cells whose significance passes the threshold with one sign.
std::vector<ChangedArea> changed_areas(const MapDifference& difference, double threshold_sigmas) {
  const Raster& raster = difference.significance;
  std::vector<bool> seen(raster.values.size(), false);
  const auto side = [&raster, threshold_sigmas](std::size_t cell) {
    const double value = raster.values[cell];
    // A NaN passes neither.
    return value > threshold_sigmas ? 1 : (value < -threshold_sigmas ? -1 : 0);
  };
  std::vector<ChangedArea> areas;
  std::vector<std::pair<int, int>> open;
  for (int row = 0; row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column) {
      const std::size_t first = raster.index(row, column);
      const int sign = side(first);
      if (sign == 0 || seen[first]) {
        continue;
      }
      ChangedArea area;
      double variances_m2 = 0.0;
      double sigmas_m = 0.0;
      seen[first] = true;
      open.emplace_back(row, column);
      while (!open.empty()) {
        const auto [r, c] = open.back();
        open.pop_back();
        const std::size_t cell = raster.index(r, c);
        area.cells += 1;
        area.east_m += raster.east_of_column_m(c);
        area.north_m += raster.north_of_row_m(r);
        area.mean_m += difference.change.values[cell];
        const double sigma_m = difference.sigma.values[cell];
        variances_m2 += sigma_m * sigma_m;
        sigmas_m += sigma_m;
        area.peak_sigmas = std::max(area.peak_sigmas, std::fabs(raster.values[cell]));
        for (const auto& [dr, dc] :
             {std::pair{0, 1}, std::pair{0, -1}, std::pair{1, 0}, std::pair{-1, 0}}) {
          if (!raster.contains(r + dr, c + dc)) {
            continue;
          }
          const std::size_t next = raster.index(r + dr, c + dc);
          if (!seen[next] && side(next) == sign) {
            seen[next] = true;
            open.emplace_back(r + dr, c + dc);
          }
        }
      }
      if (area.cells < kLeastChangedCells) {
        continue;
      }
      const double cell_area_m2 = raster.cell_m * raster.cell_m;
      const auto cells = static_cast<double>(area.cells);
      area.area_m2 = cells * cell_area_m2;
      area.volume_m3 = area.mean_m * cell_area_m2;
      area.volume_sigma_m3 = cell_area_m2 * std::hypot(std::sqrt(variances_m2),
                                                       cells * difference.removed_offset_sigma_m);
      area.volume_sigma_common_m3 = cell_area_m2 * sigmas_m;
      area.mean_m /= cells;
      area.east_m /= cells;
      area.north_m /= cells;
      areas.push_back(area);
    }
  }
  std::stable_sort(areas.begin(), areas.end(), [](const ChangedArea& a, const ChangedArea& b) {
    return std::fabs(a.volume_m3) > std::fabs(b.volume_m3);
  });
  return areas;
}

/// Sigma of the median of values with these sigmas: sqrt(n) / (2 times the sum of their densities at the middle).
double sigma_of_median(const Raster& sigmas, const Raster& values) {
  double known = 0.0;
  double inverses = 0.0;
  for (std::size_t k = 0; k < sigmas.values.size(); ++k) {
    if (!std::isnan(values.values[k]) && !std::isnan(sigmas.values[k])) {
      known += 1.0;
      inverses += 1.0 / sigmas.values[k];
    }
  }
  constexpr double kHalfPi = 1.5707963267948966;
  return inverses > 0.0 ? std::sqrt(kHalfPi * known) / inverses : 0.0;
}

double median_of(std::vector<double> values) {
  if (values.empty()) {
    return kNoValue;
  }
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 != 0) {
    return *middle;
  }
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

}  // namespace

MapDifference difference_of(const AlignedMap& earlier, const AlignedMap& later,
                            double threshold_sigmas, bool level) {
  MapDifference difference;
  difference.change = earlier.elevation;
  difference.sigma = earlier.elevation;
  difference.significance = earlier.elevation;
  std::vector<double> changes;
  for (std::size_t k = 0; k < earlier.elevation.values.size(); ++k) {
    const double before = earlier.elevation.values[k];
    const double after = later.elevation.values[k];
    difference.only_earlier += !std::isnan(before) && std::isnan(after) ? 1U : 0U;
    difference.only_later += std::isnan(before) && !std::isnan(after) ? 1U : 0U;
    // Elevations: what became deeper has fallen.
    difference.change.values[k] = before - after;
    difference.sigma.values[k] =
        std::max(std::hypot(earlier.sigma.values[k], later.sigma.values[k]), kLeastSigma_m);
    if (!std::isnan(before - after)) {
      changes.push_back(before - after);
    }
  }
  difference.compared = changes.size();
  difference.median_m = median_of(std::move(changes));
  if (level && difference.compared > 0) {
    difference.removed_offset_m = difference.median_m;
    difference.removed_offset_sigma_m = sigma_of_median(difference.sigma, difference.change);
  }
  for (std::size_t k = 0; k < difference.change.values.size(); ++k) {
    double& change_m = difference.change.values[k];
    change_m -= difference.removed_offset_m;
    const double significance = change_m / difference.sigma.values[k];
    difference.significance.values[k] = significance;
    difference.significant += std::fabs(significance) > threshold_sigmas ? 1U : 0U;
  }
  difference.expected_by_chance =
      static_cast<double>(difference.compared) * std::erfc(threshold_sigmas / std::sqrt(2.0));
  difference.areas = changed_areas(difference, threshold_sigmas);
  return difference;
}

}  // namespace leadline::host
