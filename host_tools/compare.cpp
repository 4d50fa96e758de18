#include "host_tools/compare.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include <nlohmann/json.hpp>

#include "host_tools/exit_codes.hpp"
#include "host_tools/geotiff.hpp"
#include "host_tools/options.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/render/render.hpp"

namespace leadline::host {
namespace {

void require_same_geometry(const Raster& raster, const std::string& what, const Raster& truth) {
  if (!same_geometry(raster, truth)) {
    throw HostError(ExitCode::kInput, "the " + what + " has " + describe_geometry(raster) +
                                          ", the truth has " + describe_geometry(truth));
  }
}

bool counts(const Raster* mask, std::size_t index) {
  return mask == nullptr || mask->values[index] == 1.0;
}

struct SigmaError {
  double sigma_m;
  double error_m;  // absolute
};

SigmaCalibration calibrate(std::vector<SigmaError>* cells, std::size_t missing) {
  SigmaCalibration result;
  result.cells = cells->size();
  result.missing = missing;
  if (cells->empty()) {
    return result;
  }
  std::stable_sort(cells->begin(), cells->end(),
                   [](const SigmaError& a, const SigmaError& b) { return a.sigma_m < b.sigma_m; });
  const std::size_t total = cells->size();
  for (std::size_t q = 0; q < result.quintiles.size(); ++q) {
    SigmaQuintile& quintile = result.quintiles[q];
    const std::size_t begin = total * q / result.quintiles.size();
    const std::size_t end = total * (q + 1) / result.quintiles.size();
    std::size_t within_1 = 0;
    std::size_t within_2 = 0;
    double sum_m = 0.0;
    for (std::size_t i = begin; i < end; ++i) {
      const SigmaError& cell = (*cells)[i];
      within_1 += cell.error_m <= cell.sigma_m ? 1U : 0U;
      within_2 += cell.error_m <= 2.0 * cell.sigma_m ? 1U : 0U;
      sum_m += cell.sigma_m;
    }
    quintile.cells = end - begin;
    if (quintile.cells > 0) {
      quintile.mean_sigma_m = sum_m / static_cast<double>(quintile.cells);
      quintile.within_1 = static_cast<double>(within_1) / static_cast<double>(quintile.cells);
    }
    result.mean_sigma_m += sum_m / static_cast<double>(total);
    result.within_1 += static_cast<double>(within_1) / static_cast<double>(total);
    result.within_2 += static_cast<double>(within_2) / static_cast<double>(total);
  }
  return result;
}

nlohmann::ordered_json number_or_null(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

nlohmann::ordered_json to_json(const Comparison& comparison) {
  const double cell_m = comparison.cell_m;
  nlohmann::ordered_json json;
  json["cells_expected"] = comparison.expected;
  json["cells_compared"] = comparison.compared;
  json["coverage"] = comparison.coverage;
  json["cell_m"] = cell_m;
  const std::pair<const char*, double> figures[] = {{"rmse", comparison.rmse_m},
                                                    {"bias", comparison.bias_m},
                                                    {"debiased_rmse", comparison.debiased_rmse_m()},
                                                    {"p95", comparison.p95_m},
                                                    {"max", comparison.max_m}};
  for (const auto& [name, value_m] : figures) {
    json[std::string(name) + "_m"] = number_or_null(value_m);
    json[std::string(name) + "_cells"] = number_or_null(value_m / cell_m);
  }
  json["bias_sign"] = "estimated depth minus true depth: deeper is positive";
  if (comparison.sigma.has_value()) {
    const SigmaCalibration& sigma = *comparison.sigma;
    nlohmann::ordered_json block;
    block["cells"] = sigma.cells;
    block["missing"] = sigma.missing;
    block["mean_m"] = sigma.mean_sigma_m;
    block["within_1"] = sigma.within_1;
    block["within_2"] = sigma.within_2;
    for (const SigmaQuintile& quintile : sigma.quintiles) {
      block["quintiles"].push_back({{"cells", quintile.cells},
                                    {"mean_sigma_m", quintile.mean_sigma_m},
                                    {"within_1", quintile.within_1}});
    }
    json["sigma"] = block;
  }
  return json;
}

void print_text(const Comparison& comparison) {
  const double cell_m = comparison.cell_m;
  std::printf("cells      %zu of %zu compared, coverage %.3f %%\n", comparison.compared,
              comparison.expected, 100.0 * comparison.coverage);
  if (comparison.compared == 0) {
    return;
  }
  const auto line = [cell_m](const char* name, double value_m) {
    std::printf("%-10s %.4f m  %.4f cells\n", name, value_m, value_m / cell_m);
  };
  line("rmse", comparison.rmse_m);
  std::printf("%-10s %+.4f m  %+.4f cells  (deeper than the truth is positive)\n", "bias",
              comparison.bias_m, comparison.bias_m / cell_m);
  line("debiased", comparison.debiased_rmse_m());
  line("p95", comparison.p95_m);
  line("max", comparison.max_m);
  if (comparison.sigma.has_value()) {
    const SigmaCalibration& sigma = *comparison.sigma;
    std::printf("sigma      mean %.4f m, %.1f %% of cells within 1 sigma, %.1f %% within 2\n",
                sigma.mean_sigma_m, 100.0 * sigma.within_1, 100.0 * sigma.within_2);
    for (std::size_t q = 0; q < sigma.quintiles.size(); ++q) {
      std::printf("  fifth %zu  sigma %.4f m: %.1f %% within 1 sigma\n", q + 1,
                  sigma.quintiles[q].mean_sigma_m, 100.0 * sigma.quintiles[q].within_1);
    }
    if (sigma.missing > 0) {
      std::printf("  %zu compared cells have no sigma\n", sigma.missing);
    }
  }
}

struct Limit {
  const char* name;
  std::optional<double> limit;
  double value;
  bool at_least;  ///< the value must reach the limit; otherwise it must not pass it
};

}  // namespace

double Comparison::debiased_rmse_m() const {
  return std::sqrt(std::max(0.0, rmse_m * rmse_m - bias_m * bias_m));
}

Comparison compare_rasters(const Raster& estimate, const Raster& truth, const Raster* mask,
                           const Raster* sigma) {
  require_same_geometry(estimate, "estimate", truth);
  if (mask != nullptr) {
    require_same_geometry(*mask, "mask", truth);
  }
  if (sigma != nullptr) {
    require_same_geometry(*sigma, "sigma", truth);
  }
  Comparison result;
  result.cell_m = truth.cell_m;
  std::vector<double> errors_m;
  std::vector<SigmaError> sigma_cells;
  std::size_t sigma_missing = 0;
  double sum_m = 0.0;
  double sum_m2 = 0.0;
  for (std::size_t i = 0; i < truth.values.size(); ++i) {
    if (!counts(mask, i) || std::isnan(truth.values[i])) {
      continue;
    }
    ++result.expected;
    if (std::isnan(estimate.values[i])) {
      continue;
    }
    const double error_m = truth.values[i] - estimate.values[i];
    errors_m.push_back(std::fabs(error_m));
    sum_m += error_m;
    sum_m2 += error_m * error_m;
    if (sigma == nullptr) {
      continue;
    }
    if (sigma->values[i] > 0.0) {
      sigma_cells.push_back({sigma->values[i], std::fabs(error_m)});
    } else {
      ++sigma_missing;  // NaN as well
    }
  }
  result.compared = errors_m.size();
  if (sigma != nullptr) {
    result.sigma = calibrate(&sigma_cells, sigma_missing);
  }
  if (result.compared == 0) {
    return result;
  }
  const auto count = static_cast<double>(result.compared);
  result.coverage = count / static_cast<double>(result.expected);
  result.rmse_m = std::sqrt(sum_m2 / count);
  result.bias_m = sum_m / count;
  // Nearest rank: the ceil(0.95 n)-th smallest.
  const std::size_t rank = (result.compared * 95 + 99) / 100 - 1;
  std::nth_element(errors_m.begin(), errors_m.begin() + static_cast<std::ptrdiff_t>(rank),
                   errors_m.end());
  result.p95_m = errors_m[rank];
  result.max_m = *std::max_element(errors_m.begin(), errors_m.end());
  return result;
}

Raster depth_difference(const Raster& estimate, const Raster& truth, const Raster* mask) {
  require_same_geometry(estimate, "estimate", truth);
  if (mask != nullptr) {
    require_same_geometry(*mask, "mask", truth);
  }
  Raster difference = truth;
  for (std::size_t i = 0; i < truth.values.size(); ++i) {
    // NaN of either stays NaN.
    difference.values[i] = counts(mask, i) ? truth.values[i] - estimate.values[i] : kNoValue;
  }
  return difference;
}

int run_compare(const CompareOptions& options) {
  for (const auto& [name, limit, highest] :
       {std::tuple{"--max-rmse", options.max_rmse_m, 1e9},
        std::tuple{"--max-rmse-cells", options.max_rmse_cells, 1e9},
        std::tuple{"--max-bias", options.max_abs_bias_m, 1e9},
        std::tuple{"--max-bias-cells", options.max_abs_bias_cells, 1e9},
        std::tuple{"--max-p95", options.max_p95_m, 1e9},
        std::tuple{"--min-coverage", options.min_coverage, 1.0}}) {
    if (limit.has_value()) {
      check_limits(name, *limit, {0, highest});
    }
  }
  const Raster estimate = read_raster(options.estimate_path);
  const Raster truth = read_raster(options.truth_path);
  std::optional<Raster> mask;
  std::optional<Raster> sigma;
  if (!options.mask_path.empty()) {
    mask = read_raster(options.mask_path);
  }
  if (!options.sigma_path.empty()) {
    sigma = read_raster(options.sigma_path);
  }
  const Raster* mask_pointer = mask.has_value() ? &*mask : nullptr;
  const Comparison comparison =
      compare_rasters(estimate, truth, mask_pointer, sigma.has_value() ? &*sigma : nullptr);
  if (comparison.expected == 0) {
    throw HostError(ExitCode::kInput, mask.has_value()
                                          ? options.mask_path + ": no cell is 1 where " +
                                                options.truth_path + " has a value"
                                          : options.truth_path + ": no cell has a value");
  }

  const Limit limits[] = {
      {"rmse_m", options.max_rmse_m, comparison.rmse_m, false},
      {"rmse_cells", options.max_rmse_cells, comparison.rmse_m / comparison.cell_m, false},
      {"abs_bias_m", options.max_abs_bias_m, std::fabs(comparison.bias_m), false},
      {"abs_bias_cells", options.max_abs_bias_cells,
       std::fabs(comparison.bias_m) / comparison.cell_m, false},
      {"p95_m", options.max_p95_m, comparison.p95_m, false},
      {"coverage", options.min_coverage, comparison.compared == 0 ? kNoValue : comparison.coverage,
       true}};
  std::vector<const Limit*> missed;
  for (const Limit& limit : limits) {
    if (!limit.limit.has_value()) {
      continue;
    }
    // Asked positively, so that a NaN misses.
    const bool met = limit.at_least ? limit.value >= *limit.limit : limit.value <= *limit.limit;
    if (!met) {
      missed.push_back(&limit);
    }
  }

  if (!options.difference_png.empty() || !options.difference_asc.empty()) {
    const Raster difference = depth_difference(estimate, truth, mask_pointer);
    if (!options.difference_asc.empty()) {
      write_esri_ascii(difference, options.difference_asc);
    }
    if (!options.difference_png.empty()) {
      write_file_whole(options.difference_png,
                       render::difference_png(difference, render::PictureOptions()));
    }
  }

  if (options.json) {
    nlohmann::ordered_json json = to_json(comparison);
    json["passed"] = missed.empty();
    json["missed"] = nlohmann::ordered_json::array();
    for (const Limit* limit : missed) {
      json["missed"].push_back({{"name", limit->name},
                                {"limit", *limit->limit},
                                {"value", number_or_null(limit->value)}});
    }
    std::printf("%s\n", json.dump(2).c_str());
  } else {
    print_text(comparison);
  }
  for (const Limit* limit : missed) {
    std::fprintf(stderr, "leadline: compare: %s is %.6g, the limit is %s %.6g\n", limit->name,
                 limit->value, limit->at_least ? "at least" : "at most", *limit->limit);
  }
  return static_cast<int>(missed.empty() ? ExitCode::kOk : ExitCode::kComparisonFailed);
}

}  // namespace leadline::host
