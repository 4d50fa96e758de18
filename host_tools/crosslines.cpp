#include "host_tools/crosslines.hpp"

#include <algorithm>
#include <cmath>
#include <iostream>
#include <map>

#include "host_tools/exit_codes.hpp"
#include "host_tools/ping_csv.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

using CellKey = std::pair<std::int64_t, std::int64_t>;

CellKey cell_of(const Sounding& sounding, double cell_m) {
  return {static_cast<std::int64_t>(std::floor(sounding.north_m / cell_m)),
          static_cast<std::int64_t>(std::floor(sounding.east_m / cell_m))};
}

double square_distance(const Sounding& a, const Sounding& b) {
  const double north = a.north_m - b.north_m;
  const double east = a.east_m - b.east_m;
  return north * north + east * east;
}

/// Value below or at which `share` of the ascending `values` lie (nearest rank).
double rank_of(const std::vector<double>& values, double share) {
  const auto rank = static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size())));
  return values[std::min(std::max<std::size_t>(rank, 1), values.size()) - 1];
}

double median_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
}

std::vector<Sounding> read_soundings(const std::string& path) {
  PingCsvOptions options;
  options.message = [](const std::string& message) {
    std::cerr << "leadline: crosslines: " << message << "\n";
  };
  std::vector<Sounding> soundings;
  for (const PingRow& row : read_ping_csv(path, options, nullptr)) {
    const auto sounding = on_axis_sounding(row);
    if (sounding) {
      soundings.push_back(*sounding);
    }
  }
  return soundings;
}

struct LineComparison {
  std::string name;
  CrossingStatistics statistics;
};

std::string fixed_text(double value, int digits) {
  std::string text;
  append_fixed(&text, value, digits);
  return text;
}

const char* order_name(std::size_t order) {
  return order < kSurveyOrders.size() ? kSurveyOrders[order].name : "none";
}

void print_text(const std::vector<LineComparison>& comparisons) {
  std::cout << "| crossing | pairs | median m | robust sigma m | rms m | 95 % m | S-44 order |\n"
               "|---|---|---|---|---|---|---|\n";
  for (const LineComparison& comparison : comparisons) {
    const CrossingStatistics& figures = comparison.statistics;
    std::cout << "| " << comparison.name << " | " << figures.count;
    if (figures.count == 0) {
      std::cout << " | | | | | |\n";
      continue;
    }
    for (const double value :
         {figures.median_m, figures.robust_sigma_m, figures.rms_m, figures.p95_m}) {
      std::cout << " | " << fixed_text(value, 3);
    }
    std::cout << " | " << order_name(figures.order) << " |\n";
  }
  const CrossingStatistics& all = comparisons.back().statistics;
  std::cout << "\n" << comparisons.back().name << ", within the limits of";
  for (std::size_t i = 0; i < kSurveyOrders.size(); ++i) {
    std::cout << (i == 0 ? " " : ", ") << kSurveyOrders[i].name << ": "
              << fixed_text(100.0 * all.within[i], 1) << " %";
  }
  std::cout << "\n";
}

void print_json(const std::vector<LineComparison>& comparisons) {
  std::cout << "{";
  for (std::size_t i = 0; i < comparisons.size(); ++i) {
    const CrossingStatistics& figures = comparisons[i].statistics;
    std::cout << (i == 0 ? "\n  " : ",\n  ") << json_string(comparisons[i].name)
              << ": {\"pairs\": " << figures.count
              << ", \"median_m\": " << json_number(figures.median_m)
              << ", \"robust_sigma_m\": " << json_number(figures.robust_sigma_m)
              << ", \"rms_m\": " << json_number(figures.rms_m)
              << ", \"p95_m\": " << json_number(figures.p95_m) << ", \"within\": {";
    for (std::size_t order = 0; order < kSurveyOrders.size(); ++order) {
      std::cout << (order == 0 ? "" : ", ") << json_string(kSurveyOrders[order].name) << ": "
                << json_number(figures.within[order]);
    }
    std::cout << "}, \"order\": " << json_string(order_name(figures.order)) << "}";
  }
  std::cout << "\n}\n";
}

std::size_t required_order(const CrosslinesOptions& options) {
  for (std::size_t i = 0; i < kSurveyOrders.size(); ++i) {
    if (options.require_order == kSurveyOrders[i].name) {
      return i;
    }
  }
  if (!options.require_order.empty()) {
    throw HostError(ExitCode::kUsage, "--order " + options.require_order +
                                          ": expected Exclusive, Special, 1a, 1b or 2");
  }
  return kSurveyOrders.size();
}

std::vector<LineComparison> compare_lines(const CrosslinesOptions& options) {
  std::vector<std::vector<Sounding>> lines;
  for (const std::string& path : options.paths) {
    lines.push_back(read_soundings(path));
  }
  const double allowance = options.map_path.empty() ? std::sqrt(2.0) : 1.0;
  std::vector<Crossing> all;
  std::vector<LineComparison> comparisons;
  const auto take = [&](const std::string& name, const std::vector<Crossing>& found) {
    comparisons.push_back({name, statistics_of(found, allowance)});
    all.insert(all.end(), found.begin(), found.end());
  };
  if (!options.map_path.empty()) {
    const Raster elevation = read_esri_ascii(options.map_path);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      take(options.paths[i], against_map(lines[i], elevation));
    }
  } else {
    for (std::size_t i = 0; i < lines.size(); ++i) {
      for (std::size_t j = i + 1; j < lines.size(); ++j) {
        take(options.paths[i] + " - " + options.paths[j],
             crossings(lines[i], lines[j], options.radius_m));
      }
    }
  }
  if (all.empty()) {
    throw HostError(ExitCode::kInput, options.paths.front() +
                                          ": no crossing: no sounding has one of another line "
                                          "(or a known cell of the map) near it");
  }
  comparisons.push_back({"all", statistics_of(all, allowance)});
  return comparisons;
}

}  // namespace

std::vector<Crossing> crossings(const std::vector<Sounding>& first,
                                const std::vector<Sounding>& second, double radius_m) {
  std::map<CellKey, std::vector<const Sounding*>> cells;
  for (const Sounding& sounding : second) {
    cells[cell_of(sounding, radius_m)].push_back(&sounding);
  }
  std::vector<Crossing> found;
  for (const Sounding& sounding : first) {
    const CellKey centre = cell_of(sounding, radius_m);
    const Sounding* nearest = nullptr;
    double nearest_square = radius_m * radius_m;
    for (std::int64_t row = -1; row <= 1; ++row) {
      for (std::int64_t column = -1; column <= 1; ++column) {
        const auto cell = cells.find({centre.first + row, centre.second + column});
        if (cell == cells.end()) {
          continue;
        }
        for (const Sounding* const other : cell->second) {
          const double square = square_distance(sounding, *other);
          if (square <= nearest_square && (nearest == nullptr || square < nearest_square)) {
            nearest = other;
            nearest_square = square;
          }
        }
      }
    }
    if (nearest != nullptr) {
      found.push_back(
          {sounding.depth_m - nearest->depth_m, 0.5 * (sounding.depth_m + nearest->depth_m)});
    }
  }
  return found;
}

std::vector<Crossing> against_map(const std::vector<Sounding>& soundings, const Raster& elevation) {
  std::vector<Crossing> found;
  for (const Sounding& sounding : soundings) {
    const double column = std::floor((sounding.east_m - elevation.west_m) / elevation.cell_m);
    const double row = std::floor((elevation.north_m() - sounding.north_m) / elevation.cell_m);
    if (!(column >= 0 && column < elevation.columns && row >= 0 && row < elevation.rows)) {
      continue;
    }
    const double depth_m = -elevation.at(static_cast<int>(row), static_cast<int>(column));
    if (!std::isnan(depth_m)) {
      found.push_back({sounding.depth_m - depth_m, depth_m});
    }
  }
  return found;
}

CrossingStatistics statistics_of(const std::vector<Crossing>& crossings, double allowance) {
  CrossingStatistics figures;
  figures.count = crossings.size();
  if (crossings.empty()) {
    return figures;
  }
  std::vector<double> differences;
  std::vector<double> sizes;
  double squares = 0;
  for (const Crossing& crossing : crossings) {
    differences.push_back(crossing.difference_m);
    sizes.push_back(std::fabs(crossing.difference_m));
    squares += crossing.difference_m * crossing.difference_m;
  }
  const auto count = static_cast<double>(crossings.size());
  figures.median_m = median_of(differences);
  figures.rms_m = std::sqrt(squares / count);
  std::sort(sizes.begin(), sizes.end());
  figures.p95_m = rank_of(sizes, 0.95);
  for (double& difference : differences) {
    difference = std::fabs(difference - figures.median_m);
  }
  figures.robust_sigma_m = 1.4826 * median_of(differences);
  for (std::size_t order = 0; order < kSurveyOrders.size(); ++order) {
    std::size_t within = 0;
    for (const Crossing& crossing : crossings) {
      const double limit_m = allowance * std::hypot(kSurveyOrders[order].a_m,
                                                    kSurveyOrders[order].b * crossing.depth_m);
      within += std::fabs(crossing.difference_m) <= limit_m ? 1 : 0;
    }
    figures.within[order] = static_cast<double>(within) / count;
    if (figures.within[order] >= 0.95 && figures.order == kSurveyOrders.size()) {
      figures.order = order;
    }
  }
  return figures;
}

int run_crosslines(const CrosslinesOptions& options) {
  if (options.map_path.empty() && options.paths.size() < 2) {
    throw HostError(ExitCode::kUsage, "crosslines: two files or more, or --map, are needed");
  }
  const std::size_t required = required_order(options);
  const std::vector<LineComparison> comparisons = compare_lines(options);
  if (options.json) {
    print_json(comparisons);
  } else {
    print_text(comparisons);
  }
  const std::size_t met = comparisons.back().statistics.order;
  if (!options.require_order.empty() && met > required) {
    std::cerr << "leadline: crosslines: order " << options.require_order << " is not met ("
              << order_name(met) << ")\n";
    return static_cast<int>(ExitCode::kComparisonFailed);
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
