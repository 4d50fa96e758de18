#include "host_tools/render/surface.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace leadline::host::render {
namespace {

constexpr double kRadPerDeg = 3.14159265358979323846 / 180.0;

/// Weights of a Catmull-Rom spline for the four samples around a point, `t` in 0 .. 1 behind the second
/// of them.
std::array<double, 4> spline_weights(double t) {
  return {0.5 * (-t + 2.0 * t * t - t * t * t), 0.5 * (2.0 - 5.0 * t * t + 3.0 * t * t * t),
          0.5 * (t + 4.0 * t * t - 3.0 * t * t * t), 0.5 * (-t * t + t * t * t)};
}

/// Difference quotient along one axis, one-sided where a neighbour is unknown, 0 where both are.
double slope(float before, float here, float after, double spacing) {
  const bool has_before = !std::isnan(before);
  const bool has_after = !std::isnan(after);
  if (has_before && has_after) {
    return (static_cast<double>(after) - before) / (2.0 * spacing);
  }
  if (has_after) {
    return (static_cast<double>(after) - here) / spacing;
  }
  if (has_before) {
    return (static_cast<double>(here) - before) / spacing;
  }
  return 0.0;
}

}  // namespace

Raster display_median(const Raster& raster, int radius_cells) {
  if (radius_cells <= 0) {
    return raster;
  }
  Raster result = raster;
  std::vector<double> window;
  for (int row = 0; row < raster.rows; ++row) {
    for (int column = 0; column < raster.columns; ++column) {
      if (std::isnan(raster.at(row, column))) {
        continue;
      }
      window.clear();
      for (int r = row - radius_cells; r <= row + radius_cells; ++r) {
        for (int c = column - radius_cells; c <= column + radius_cells; ++c) {
          if (raster.contains(r, c) && !std::isnan(raster.at(r, c))) {
            window.push_back(raster.at(r, c));
          }
        }
      }
      const auto middle = window.begin() + static_cast<std::ptrdiff_t>(window.size() / 2);
      std::nth_element(window.begin(), middle, window.end());
      double value = *middle;
      if (window.size() % 2 == 0) {
        value = 0.5 * (value + *std::max_element(window.begin(), middle));
      }
      result.at(row, column) = value;
    }
  }
  return result;
}

Raster display_dilation(const Raster& raster, int passes) {
  Raster current = raster;
  for (int pass = 0; pass < passes; ++pass) {
    Raster next = current;
    for (int row = 0; row < raster.rows; ++row) {
      for (int column = 0; column < raster.columns; ++column) {
        if (!std::isnan(current.at(row, column))) {
          continue;
        }
        double sum = 0.0;
        int count = 0;
        for (int r = row - 1; r <= row + 1; ++r) {
          for (int c = column - 1; c <= column + 1; ++c) {
            if (raster.contains(r, c) && !std::isnan(current.at(r, c))) {
              sum += current.at(r, c);
              ++count;
            }
          }
        }
        if (count > 0) {
          next.at(row, column) = sum / count;
        }
      }
    }
    current = std::move(next);
  }
  return current;
}

double SmoothSurface::at(double column, double row) const {
  const double column_floor = std::floor(column);
  const double row_floor = std::floor(row);
  if (!(column_floor >= 0.0 && column_floor < raster_.columns && row_floor >= 0.0 &&
        row_floor < raster_.rows)) {
    return kNoValue;
  }
  const double under = raster_.at(static_cast<int>(row_floor), static_cast<int>(column_floor));
  if (std::isnan(under)) {
    return kNoValue;
  }
  // Cell centres lie at halves.
  const double x = column - 0.5;
  const double y = row - 0.5;
  const int first_column = static_cast<int>(std::floor(x)) - 1;
  const int first_row = static_cast<int>(std::floor(y)) - 1;
  const std::array<double, 4> wx = spline_weights(x - std::floor(x));
  const std::array<double, 4> wy = spline_weights(y - std::floor(y));
  double sum = 0.0;
  for (int j = 0; j < 4; ++j) {
    const int r = std::clamp(first_row + j, 0, raster_.rows - 1);
    for (int i = 0; i < 4; ++i) {
      const int c = std::clamp(first_column + i, 0, raster_.columns - 1);
      const double value = raster_.at(r, c);
      sum += wx[static_cast<std::size_t>(i)] * wy[static_cast<std::size_t>(j)] *
             (std::isnan(value) ? under : value);
    }
  }
  return sum;
}

Lattice sample_surface(const Raster& raster, int columns, int rows) {
  Lattice lattice;
  lattice.columns = columns;
  lattice.rows = rows;
  lattice.step_cells = static_cast<double>(raster.columns) / columns;
  lattice.values.resize(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  const SmoothSurface surface(raster);
  for (int row = 0; row < rows; ++row) {
    const double y = (row + 0.5) * raster.rows / rows;
    for (int column = 0; column < columns; ++column) {
      const double x = (column + 0.5) * raster.columns / columns;
      lattice.values[lattice.index(row, column)] = static_cast<float>(surface.at(x, y));
    }
  }
  return lattice;
}

std::vector<float> relief_light(const Lattice& height, double spacing_m, double exaggeration,
                                const Light& light) {
  struct Lamp {
    double x, y, z, weight;
  };
  std::vector<Lamp> lamps;
  // The side lamps turn most slopes' brightness into a function of their direction, which one lamp
  // alone cannot (it cannot tell apart slopes that mirror each other about its direction).
  const double turns_deg[] = {0.0, -50.0, 50.0, 110.0};
  const double weights[] = {0.58, 0.17, 0.17, 0.08};
  for (std::size_t i = 0; i < 4; ++i) {
    const double azimuth = (light.azimuth_deg + turns_deg[i]) * kRadPerDeg;
    const double elevation = light.elevation_deg * kRadPerDeg;
    lamps.push_back({std::cos(elevation) * std::sin(azimuth),
                     std::cos(elevation) * std::cos(azimuth), std::sin(elevation), weights[i]});
  }
  const double level = std::sin(light.elevation_deg * kRadPerDeg);
  constexpr double kAmbient = 0.22;
  constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> result(height.values.size(), kUnknown);
  for (int row = 0; row < height.rows; ++row) {
    for (int column = 0; column < height.columns; ++column) {
      const float here = height.at(row, column);
      if (std::isnan(here)) {
        continue;
      }
      const float west = column > 0 ? height.at(row, column - 1) : kUnknown;
      const float east = column + 1 < height.columns ? height.at(row, column + 1) : kUnknown;
      const float north = row > 0 ? height.at(row - 1, column) : kUnknown;
      const float south = row + 1 < height.rows ? height.at(row + 1, column) : kUnknown;
      const double dx = slope(west, here, east, spacing_m) * exaggeration;
      const double dy = slope(south, here, north, spacing_m) * exaggeration;
      const double length = std::sqrt(dx * dx + dy * dy + 1.0);
      double sum = 0.0;
      for (const Lamp& lamp : lamps) {
        sum += lamp.weight * std::max(0.0, (-dx * lamp.x - dy * lamp.y + lamp.z) / length);
      }
      result[height.index(row, column)] =
          static_cast<float>(kAmbient + (1.0 - kAmbient) * sum / std::max(level, 0.05));
    }
  }
  return result;
}

Raster sky_share(const Raster& elevation, double exaggeration, int reach_cells) {
  constexpr int kDirections = 16;
  Raster result = elevation;
  for (int row = 0; row < elevation.rows; ++row) {
    for (int column = 0; column < elevation.columns; ++column) {
      const double here = elevation.at(row, column);
      if (std::isnan(here)) {
        result.at(row, column) = 1.0;
        continue;
      }
      double sum = 0.0;
      for (int direction = 0; direction < kDirections; ++direction) {
        const double angle = direction * 360.0 / kDirections * kRadPerDeg;
        const double step_x = std::cos(angle);
        const double step_y = std::sin(angle);
        double steepest = 0.0;
        // Distances grow by a third: near cells decide, far ones need no more than a look.
        for (double distance = 1.0; distance <= reach_cells; distance *= 1.33) {
          const int c = column + static_cast<int>(std::lround(step_x * distance));
          const int r = row + static_cast<int>(std::lround(step_y * distance));
          if (!elevation.contains(r, c)) {
            break;
          }
          const double rise = elevation.at(r, c) - here;
          // False for an unknown cell.
          if (rise > steepest * distance) {
            steepest = rise / distance;
          }
        }
        const double tangent = steepest * exaggeration / elevation.cell_m;
        sum += 1.0 - tangent / std::sqrt(1.0 + tangent * tangent);
      }
      result.at(row, column) = sum / kDirections;
    }
  }
  return result;
}

double readable_exaggeration(const Raster& elevation) {
  std::vector<double> slopes;
  for (int row = 0; row < elevation.rows; ++row) {
    for (int column = 0; column < elevation.columns; ++column) {
      // Over three cells: noise between neighbours is not relief.
      const int c = column + 3;
      const int r = row + 3;
      if (!elevation.contains(r, c)) {
        continue;
      }
      const double dx =
          (elevation.at(row, c) - elevation.at(row, column)) / (3.0 * elevation.cell_m);
      const double dy =
          (elevation.at(r, column) - elevation.at(row, column)) / (3.0 * elevation.cell_m);
      const double steepness = std::sqrt(dx * dx + dy * dy);
      if (!std::isnan(steepness)) {
        slopes.push_back(steepness);
      }
    }
  }
  if (slopes.empty()) {
    return 1.0;
  }
  const auto high = slopes.begin() + static_cast<std::ptrdiff_t>(slopes.size() * 9 / 10);
  std::nth_element(slopes.begin(), high, slopes.end());
  constexpr double kWanted = 0.84;  // tan 40 deg
  const double wanted = *high > 0.0 ? kWanted / *high : 1.0;
  double chosen = 1.0;
  for (const double decade : {1.0, 10.0}) {
    for (const double step : {1.0, 1.5, 2.0, 3.0, 5.0, 7.0}) {
      if (decade * step <= wanted) {
        chosen = decade * step;
      }
    }
  }
  return wanted >= 100.0 ? 100.0 : chosen;
}

}  // namespace leadline::host::render
