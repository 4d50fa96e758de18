#include "host_tools/grid_baselines.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>

#include <nlohmann/json.hpp>

#include "host_tools/exit_codes.hpp"
#include "host_tools/geotiff.hpp"
#include "host_tools/map_config.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/progress.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

constexpr double kBestNeedsCoverage = 0.95;

/// Most columns of a grid: every cell keeps a list of its soundings (24 bytes when empty).
constexpr std::uint64_t kMaxGridCells = std::uint64_t{1} << 25U;

double radians(base::Bam32 angle_bam32) {
  constexpr double kRadPerLsb = 3.14159265358979323846 / 2147483648.0;
  return static_cast<double>(static_cast<std::int32_t>(angle_bam32)) * kRadPerLsb;
}

/// Window of +-reach cells around a cell, cut at the raster's edge.
struct Window {
  int first_row, last_row, first_column, last_column;
};

Window window_around(const Raster& geometry, int row, int column, int reach) {
  return {std::max(0, row - reach), std::min(geometry.rows - 1, row + reach),
          std::max(0, column - reach), std::min(geometry.columns - 1, column + reach)};
}

Raster empty_like(const Raster& geometry) {
  return make_raster(geometry.columns, geometry.rows, geometry.west_m, geometry.south_m,
                     geometry.cell_m);
}

double sum_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) {
    sum += value;
  }
  return sum;
}

/// Columns of the voxel grid as a raster.
Raster raster_of(const GridConfig& grid) {
  Raster geometry;
  geometry.columns = grid.size[base::kEast];
  geometry.rows = grid.size[base::kNorth];
  geometry.west_m = static_cast<double>(grid.origin_mm[base::kEast]) / 1000.0;
  geometry.south_m = static_cast<double>(grid.origin_mm[base::kNorth]) / 1000.0;
  geometry.cell_m = grid.cell_mm / 1000.0;
  return geometry;
}

std::vector<Baseline> chosen_baselines(const std::vector<std::string>& names) {
  if (names.empty()) {
    return all_baselines();
  }
  std::vector<Baseline> chosen;
  for (const std::string& name : names) {
    const auto found = std::find_if(all_baselines().begin(), all_baselines().end(),
                                    [&](const Baseline& b) { return b.name() == name; });
    if (found == all_baselines().end()) {
      std::string known;
      for (const Baseline& baseline : all_baselines()) {
        known += (known.empty() ? "" : ", ") + baseline.name();
      }
      throw HostError(ExitCode::kUsage,
                      "--method " + printable(name) + ": unknown (known: " + known + ")");
    }
    chosen.push_back(*found);
  }
  return chosen;
}

}  // namespace

std::optional<Sounding> on_axis_sounding(const PingRow& ping) {
  if (!ping.has_range) {
    return std::nullopt;
  }
  const double azimuth = radians(ping.azimuth_bam32);
  const double elevation = radians(ping.elevation_bam32);
  const double forward = std::cos(elevation) * std::cos(azimuth);
  const double right = std::cos(elevation) * std::sin(azimuth);
  const double down = std::sin(elevation);
  // v_NED = Rz(heading) Ry(pitch) Rx(roll) v_FRD
  const double roll = radians(ping.attitude.roll_bam32);
  const double pitch = radians(ping.attitude.pitch_bam32);
  const double heading = radians(ping.attitude.heading_bam32);
  const double rolled_right = right * std::cos(roll) - down * std::sin(roll);
  const double rolled_down = right * std::sin(roll) + down * std::cos(roll);
  const double level_forward = forward * std::cos(pitch) + rolled_down * std::sin(pitch);
  const double level_down = -forward * std::sin(pitch) + rolled_down * std::cos(pitch);
  const double north = level_forward * std::cos(heading) - rolled_right * std::sin(heading);
  const double east = level_forward * std::sin(heading) + rolled_right * std::cos(heading);
  const double range_m = static_cast<double>(ping.range_um) * 1e-6;
  return Sounding{static_cast<double>(ping.position_um[base::kNorth]) * 1e-6 + range_m * north,
                  static_cast<double>(ping.position_um[base::kEast]) * 1e-6 + range_m * east,
                  static_cast<double>(ping.position_um[base::kDown]) * 1e-6 + range_m * level_down};
}

SoundingBins::SoundingBins(const Raster& geometry) : geometry_(geometry) {
  geometry_.values.clear();
  depths_m_.resize(static_cast<std::size_t>(geometry.columns) *
                   static_cast<std::size_t>(geometry.rows));
}

bool SoundingBins::add(const Sounding& sounding) {
  const double column = std::floor((sounding.east_m - geometry_.west_m) / geometry_.cell_m);
  const double row_from_south =
      std::floor((sounding.north_m - geometry_.south_m) / geometry_.cell_m);
  const bool inside = column >= 0.0 && column < geometry_.columns && row_from_south >= 0.0 &&
                      row_from_south < geometry_.rows && std::isfinite(sounding.depth_m);
  if (!inside) {
    ++outside_;
    return false;
  }
  const int row = geometry_.rows - 1 - static_cast<int>(row_from_south);
  depths_m_[geometry_.index(row, static_cast<int>(column))].push_back(sounding.depth_m);
  ++count_;
  return true;
}

Raster grid_mean(const SoundingBins& bins) {
  Raster result = empty_like(bins.geometry());
  for (int row = 0; row < result.rows; ++row) {
    for (int column = 0; column < result.columns; ++column) {
      const std::vector<double>& depths_m = bins.depths_m(row, column);
      if (!depths_m.empty()) {
        result.at(row, column) = -sum_of(depths_m) / static_cast<double>(depths_m.size());
      }
    }
  }
  return result;
}

Raster grid_gaussian(const SoundingBins& bins, double sigma_cells) {
  const int reach = static_cast<int>(std::ceil(2.5 * sigma_cells));
  std::vector<double> weight_of(static_cast<std::size_t>(reach) + 1);
  for (int d = 0; d <= reach; ++d) {
    weight_of[static_cast<std::size_t>(d)] = std::exp(-0.5 * d * d / (sigma_cells * sigma_cells));
  }
  // All soundings of a cell have one weight, so their number and sum are all that matters.
  Raster sum_m = empty_like(bins.geometry());
  Raster count = sum_m;
  for (int row = 0; row < sum_m.rows; ++row) {
    for (int column = 0; column < sum_m.columns; ++column) {
      const std::vector<double>& depths_m = bins.depths_m(row, column);
      sum_m.at(row, column) = sum_of(depths_m);
      count.at(row, column) = static_cast<double>(depths_m.size());
    }
  }
  Raster result = empty_like(bins.geometry());
  for (int row = 0; row < result.rows; ++row) {
    for (int column = 0; column < result.columns; ++column) {
      const Window window = window_around(result, row, column, reach);
      double total_m = 0.0;
      double weight = 0.0;
      for (int r = window.first_row; r <= window.last_row; ++r) {
        const double row_weight = weight_of[static_cast<std::size_t>(std::abs(r - row))];
        for (int c = window.first_column; c <= window.last_column; ++c) {
          const double w = row_weight * weight_of[static_cast<std::size_t>(std::abs(c - column))];
          total_m += w * sum_m.at(r, c);
          weight += w * count.at(r, c);
        }
      }
      if (weight > 0.0) {
        result.at(row, column) = -total_m / weight;
      }
    }
  }
  return result;
}

Raster grid_median(const SoundingBins& bins, int radius_cells) {
  Raster result = empty_like(bins.geometry());
  std::vector<double> gathered_m;
  for (int row = 0; row < result.rows; ++row) {
    for (int column = 0; column < result.columns; ++column) {
      const Window window = window_around(result, row, column, radius_cells);
      gathered_m.clear();
      for (int r = window.first_row; r <= window.last_row; ++r) {
        for (int c = window.first_column; c <= window.last_column; ++c) {
          const std::vector<double>& depths_m = bins.depths_m(r, c);
          gathered_m.insert(gathered_m.end(), depths_m.begin(), depths_m.end());
        }
      }
      if (gathered_m.empty()) {
        continue;
      }
      const auto middle =
          gathered_m.begin() + static_cast<std::ptrdiff_t>((gathered_m.size() - 1) / 2);
      std::nth_element(gathered_m.begin(), middle, gathered_m.end());
      result.at(row, column) = -*middle;
    }
  }
  return result;
}

std::string Baseline::name() const {
  char text[32];
  switch (kind) {
    case Kind::kMean:
      return "mean";
    case Kind::kGaussian:
      std::snprintf(text, sizeof text, "gaussian-%g", sigma_cells);
      return text;
    case Kind::kMedian:
      std::snprintf(text, sizeof text, "median-%d", radius_cells);
      return text;
  }
  return "unknown";
}

const std::vector<Baseline>& all_baselines() {
  static const std::vector<Baseline> baselines = {
      {Baseline::Kind::kMean, 0.0, 0},     {Baseline::Kind::kGaussian, 1.0, 0},
      {Baseline::Kind::kGaussian, 1.5, 0}, {Baseline::Kind::kGaussian, 2.0, 0},
      {Baseline::Kind::kGaussian, 3.0, 0}, {Baseline::Kind::kMedian, 0.0, 1},
      {Baseline::Kind::kMedian, 0.0, 2},   {Baseline::Kind::kMedian, 0.0, 3}};
  return baselines;
}

Raster grid_baseline(const SoundingBins& bins, const Baseline& baseline) {
  switch (baseline.kind) {
    case Baseline::Kind::kMean:
      return grid_mean(bins);
    case Baseline::Kind::kGaussian:
      return grid_gaussian(bins, baseline.sigma_cells);
    case Baseline::Kind::kMedian:
      return grid_median(bins, baseline.radius_cells);
  }
  return grid_mean(bins);
}

std::optional<std::size_t> best_baseline(const std::vector<Baseline>& baselines,
                                         const std::vector<Comparison>& comparisons) {
  std::optional<std::size_t> best;
  for (std::size_t i = 0; i < baselines.size(); ++i) {
    const bool competes =
        baselines[i].kind != Baseline::Kind::kMean && comparisons[i].coverage >= kBestNeedsCoverage;
    if (competes && (!best.has_value() || comparisons[i].rmse_m < comparisons[*best].rmse_m)) {
      best = i;
    }
  }
  return best;
}

int run_grid(const GridOptions& options) {
  const std::vector<Baseline> baselines = chosen_baselines(options.methods);
  if (!options.mask_path.empty() && options.truth_path.empty()) {
    throw HostError(ExitCode::kUsage, "--mask needs --truth: without a truth nothing is compared");
  }
  if (options.out_dir.empty() && options.truth_path.empty()) {
    throw HostError(ExitCode::kUsage, "nothing to do: give --out DIR, --truth FILE or both");
  }
  const MapConfig config = load_map_config(options.config_path);
  const std::uint64_t cells = static_cast<std::uint64_t>(config.grid.size[base::kNorth]) *
                              static_cast<std::uint64_t>(config.grid.size[base::kEast]);
  if (cells > kMaxGridCells) {
    throw HostError(ExitCode::kUsage, options.config_path + ": [grid] size has " +
                                          std::to_string(cells) + " columns, the limit is " +
                                          std::to_string(kMaxGridCells));
  }
  std::unique_ptr<OutputDir> out;
  if (!options.out_dir.empty()) {
    out = std::make_unique<OutputDir>(options.out_dir);
  }
  const Raster geometry = raster_of(config.grid);
  std::optional<Raster> truth;
  std::optional<Raster> mask;
  if (!options.truth_path.empty()) {
    truth = read_raster(options.truth_path);
    if (!same_geometry(*truth, geometry)) {
      throw HostError(ExitCode::kInput, options.truth_path + " has " + describe_geometry(*truth) +
                                            ", [grid] of " + options.config_path + " has " +
                                            describe_geometry(geometry));
    }
  }
  if (!options.mask_path.empty()) {
    mask = read_raster(options.mask_path);
  }

  SoundingBins bins(geometry);
  PingCsvOptions csv_options;
  csv_options.strict = options.strict;
  csv_options.message = [](const std::string& text) {
    std::fprintf(stderr, "leadline: %s\n", text.c_str());
  };
  PingCsvReader reader(options.pings_path, csv_options);
  {
    Progress progress("reading pings", reader.bytes_total());
    PingRow row{};
    while (reader.next(&row)) {
      if (const std::optional<Sounding> sounding = on_axis_sounding(row)) {
        bins.add(*sounding);
      }
      progress.update(reader.bytes_read());
    }
  }
  const PingCsvStats& stats = reader.stats();
  if (bins.count() == 0) {
    throw HostError(ExitCode::kInput,
                    options.pings_path + ": none of " + std::to_string(bins.outside()) +
                        " soundings lies in the grid (" + describe_geometry(geometry) + ")");
  }

  nlohmann::ordered_json json;
  json["pings"] = stats.accepted;
  json["no_return"] = stats.no_return;
  json["rejected"] = stats.rejected;
  json["soundings"] = bins.count();
  json["outside"] = bins.outside();
  json["methods"] = nlohmann::ordered_json::array();
  std::vector<Comparison> comparisons;
  {
    Progress progress("gridding", baselines.size());
    for (const Baseline& baseline : baselines) {
      const Raster raster = grid_baseline(bins, baseline);
      nlohmann::ordered_json entry;
      entry["name"] = baseline.name();
      entry["cells_known"] = raster.known_count();
      if (truth.has_value()) {
        const Comparison c =
            compare_rasters(raster, *truth, mask.has_value() ? &*mask : nullptr, nullptr);
        if (c.expected == 0) {
          throw HostError(ExitCode::kInput, "no cell counts: the mask is 1 nowhere where " +
                                                options.truth_path + " has a value");
        }
        comparisons.push_back(c);
        const std::pair<const char*, double> figures[] = {
            {"rmse_cells", c.rmse_m / c.cell_m},
            {"bias_cells", c.bias_m / c.cell_m},
            {"debiased_rmse_cells", c.debiased_rmse_m() / c.cell_m},
            {"p95_cells", c.p95_m / c.cell_m},
            {"coverage", c.coverage}};
        for (const auto& [name, value] : figures) {
          entry[name] = std::isfinite(value) ? nlohmann::ordered_json(value)
                                             : nlohmann::ordered_json(nullptr);
        }
      }
      if (out) {
        out->write(baseline.name() + ".asc", format_esri_ascii(raster));
      }
      json["methods"].push_back(entry);
      progress.update_now(json["methods"].size());
    }
  }
  std::size_t best = baselines.size();
  if (truth.has_value()) {
    best = best_baseline(baselines, comparisons).value_or(best);
    json["best"] = best < baselines.size() ? nlohmann::ordered_json(baselines[best].name())
                                           : nlohmann::ordered_json(nullptr);
  }
  if (out) {
    out->write("grid.json", json.dump(2) + "\n");
    out->commit();
  }

  if (options.json) {
    std::printf("%s\n", json.dump(2).c_str());
    return static_cast<int>(ExitCode::kOk);
  }
  std::printf("%zu soundings in the grid, %zu outside; %llu rows without a return\n", bins.count(),
              bins.outside(), static_cast<unsigned long long>(stats.no_return));
  for (std::size_t i = 0; i < baselines.size(); ++i) {
    const std::string name = baselines[i].name();
    if (!truth.has_value()) {
      std::printf("%-13s %zu cells\n", name.c_str(),
                  json["methods"][i]["cells_known"].get<std::size_t>());
      continue;
    }
    const Comparison& c = comparisons[i];
    std::printf("%-13s rmse %.3f  bias %+.3f  debiased %.3f  p95 %.3f cells  coverage %.2f %%%s\n",
                name.c_str(), c.rmse_m / c.cell_m, c.bias_m / c.cell_m,
                c.debiased_rmse_m() / c.cell_m, c.p95_m / c.cell_m, 100.0 * c.coverage,
                best == i ? "  <- best" : "");
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
