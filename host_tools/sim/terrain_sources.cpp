#include "host_tools/sim/terrain_sources.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/geotiff.hpp"
#include "host_tools/sim/exact_math.hpp"
#include "host_tools/sim/random.hpp"
#include "host_tools/sim/require.hpp"

namespace leadline::host {
namespace {

// Depths are kept to 1/1024 m: finer than any grid shows, and coarse enough that no rounding of the
// last bit survives.
double snap(double depth_m) { return std::floor(depth_m * 1024.0 + 0.5) / 1024.0; }

// 0 below `low`, 1 above `high`, smooth between.
double smooth_step(double low, double high, double x) {
  const double t = std::clamp((x - low) / (high - low), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

// Random value of a lattice point in [-1, 1), the same whatever order the points are visited in.
double lattice_value(std::uint64_t seed, int octave, std::int64_t i, std::int64_t j) {
  std::uint64_t key = seed;
  key = key * 0x9E3779B97F4A7C15ULL + static_cast<std::uint64_t>(octave);
  key = key * 0x9E3779B97F4A7C15ULL + static_cast<std::uint64_t>(i + 4096);
  key = key * 0x9E3779B97F4A7C15ULL + static_cast<std::uint64_t>(j + 4096);
  return Random(key).uniform(-1.0, 1.0);
}

// Value noise, one octave: bilinear between lattice points with smooth weights.
double value_noise(std::uint64_t seed, int octave, double x, double y) {
  const double i = std::floor(x);
  const double j = std::floor(y);
  const double a = smooth_step(0.0, 1.0, x - i);
  const double b = smooth_step(0.0, 1.0, y - j);
  const auto at = [&](std::int64_t di, std::int64_t dj) {
    return lattice_value(seed, octave, static_cast<std::int64_t>(i) + di,
                         static_cast<std::int64_t>(j) + dj);
  };
  return (1.0 - a) * ((1.0 - b) * at(0, 0) + b * at(0, 1)) +
         a * ((1.0 - b) * at(1, 0) + b * at(1, 1));
}

// One feature's frame: its centre and the direction of its long axis.
struct Place {
  double x;
  double y;
  exact::SinCos direction;

  // Coordinates along and across the feature.
  double along(double px, double py) const {
    return (px - x) * direction.cos + (py - y) * direction.sin;
  }
  double across(double px, double py) const {
    return (py - y) * direction.cos - (px - x) * direction.sin;
  }
};

// Replaces the NaNs of a rows x columns field by the mean of their known neighbours, front by front.
void fill_unknown(std::vector<double>* values, std::size_t rows, std::size_t columns) {
  std::vector<std::size_t> unknown;
  for (std::size_t k = 0; k < values->size(); ++k) {
    if (std::isnan((*values)[k])) {
      unknown.push_back(k);
    }
  }
  while (!unknown.empty()) {
    std::vector<std::pair<std::size_t, double>> front;
    std::vector<std::size_t> rest;
    for (const std::size_t k : unknown) {
      const std::size_t row = k / columns;
      const std::size_t column = k % columns;
      double sum = 0.0;
      int count = 0;
      for (std::size_t r = row > 0 ? row - 1 : 0; r <= std::min(row + 1, rows - 1); ++r) {
        for (std::size_t c = column > 0 ? column - 1 : 0; c <= std::min(column + 1, columns - 1);
             ++c) {
          const double value = (*values)[r * columns + c];
          if (!std::isnan(value)) {
            sum += value;
            ++count;
          }
        }
      }
      if (count > 0) {
        front.emplace_back(k, sum / count);
      } else {
        rest.push_back(k);
      }
    }
    for (const auto& [k, value] : front) {
      (*values)[k] = value;
    }
    unknown.swap(rest);
  }
}

// Resamples `count_in` equal intervals to `count_out` over the same extent: for each output the first
// input index and the weights (sum 1) from there on. Coarsening averages what an output covers,
// refining interpolates between centres.
struct Taps {
  std::size_t first = 0;
  std::vector<double> weights;
};
std::vector<Taps> make_taps(std::size_t count_in, std::size_t count_out) {
  const double ratio = static_cast<double>(count_in) / static_cast<double>(count_out);
  const double last_index = static_cast<double>(count_in - 1);
  std::vector<Taps> taps(count_out);
  for (std::size_t k = 0; k < count_out; ++k) {
    Taps& tap = taps[k];
    if (ratio < 1.0) {
      const double centre =
          std::clamp((static_cast<double>(k) + 0.5) * ratio - 0.5, 0.0, last_index);
      const double low = std::min(std::floor(centre), std::max(0.0, last_index - 1.0));
      tap.first = static_cast<std::size_t>(low);
      tap.weights.push_back(1.0 - (centre - low));
      if (low < last_index) {
        tap.weights.push_back(centre - low);
      }
      continue;
    }
    const double begin = static_cast<double>(k) * ratio;
    const double end = begin + ratio;
    tap.first = static_cast<std::size_t>(std::floor(begin));
    for (double index = std::floor(begin); index < end && index <= last_index; index += 1.0) {
      const double covered = std::min(end, index + 1.0) - std::max(begin, index);
      tap.weights.push_back(std::max(0.0, covered) / ratio);
    }
  }
  return taps;
}

struct Part {
  std::size_t first_row;
  std::size_t first_column;
  std::size_t rows;
  std::size_t columns;
};

// The part that the options name, or the largest central one of the terrain's shape.
Part choose_part(std::size_t all_rows, std::size_t all_columns, const std::string& name,
                 const RasterTerrainOptions& options) {
  if (options.rows == 0 && options.columns == 0) {
    require(options.first_row == 0, "first_row", static_cast<double>(options.first_row),
            "given together with rows and columns");
    require(options.first_column == 0, "first_column", static_cast<double>(options.first_column),
            "given together with rows and columns");
    Part part{0, 0, all_rows, all_columns};
    if (options.north_count != 0 && options.east_count != 0) {
      part.rows = std::min(all_rows, std::max<std::size_t>(1, all_columns * options.north_count /
                                                                  options.east_count));
      part.columns = std::min(all_columns, std::max<std::size_t>(1, all_rows * options.east_count /
                                                                        options.north_count));
      part.first_row = (all_rows - part.rows) / 2;
      part.first_column = (all_columns - part.columns) / 2;
    }
    return part;
  }
  const auto inside = [](std::size_t first, std::size_t count, std::size_t all) {
    return count >= 1 && first < all && count <= all - first;
  };
  if (!inside(options.first_row, options.rows, all_rows) ||
      !inside(options.first_column, options.columns, all_columns)) {
    throw std::invalid_argument(
        "terrain: the part of " + std::to_string(options.rows) + " rows from row " +
        std::to_string(options.first_row) + " and " + std::to_string(options.columns) +
        " columns from column " + std::to_string(options.first_column) + " is not inside " + name +
        " (" + std::to_string(all_rows) + " rows, " + std::to_string(all_columns) +
        " columns); 0 rows and 0 columns from row 0, column 0 take the largest central part");
  }
  return {options.first_row, options.first_column, options.rows, options.columns};
}

}  // namespace

Terrain make_procedural_terrain(const ProceduralOptions& options) {
  require(options.north_count >= 16 && options.north_count <= 8192, "north_count",
          static_cast<double>(options.north_count), "16 .. 8192");
  require(options.east_count >= 16 && options.east_count <= 8192, "east_count",
          static_cast<double>(options.east_count), "16 .. 8192");
  require(options.cell_m > 0.0 && std::isfinite(options.cell_m), "cell_m", options.cell_m,
          "positive");
  require(options.relief_cells > 0.0 && std::isfinite(options.relief_cells), "relief_cells",
          options.relief_cells, "positive");
  require(std::isfinite(options.shallowest_depth_m), "shallowest_depth_m",
          options.shallowest_depth_m, "finite");

  // Everything is composed in cells, in a frame where the shorter side has length `extent`.
  const double rows = static_cast<double>(options.north_count);
  const double columns = static_cast<double>(options.east_count);
  const double extent = std::min(rows, columns);
  const double relief = options.relief_cells;
  Random random(options.seed, 0x7E44A1);

  // The four features share out the quadrants, so that none hides another; which gets which is drawn.
  int quadrant[4] = {0, 1, 2, 3};
  for (int k = 3; k > 0; --k) {
    std::swap(quadrant[k], quadrant[random.next_u64() % static_cast<std::uint64_t>(k + 1)]);
  }
  const auto place_in = [&](int which) {
    const double u = (which / 2 == 0 ? 0.28 : 0.72) + random.uniform(-0.05, 0.05);
    const double v = (which % 2 == 0 ? 0.28 : 0.72) + random.uniform(-0.05, 0.05);
    return Place{u * rows, v * columns, exact::sin_cos(random.uniform(0.0, 2.0 * exact::kPi))};
  };
  const Place seamount = place_in(quadrant[0]);
  const Place scarp = place_in(quadrant[1]);
  const Place ripples = place_in(quadrant[2]);
  const Place wreck = place_in(quadrant[3]);
  const exact::SinCos dip = exact::sin_cos(random.uniform(0.0, 2.0 * exact::kPi));
  const std::uint64_t noise_seed = random.next_u64();

  std::vector<double> depth(options.north_count * options.east_count);
  for (std::size_t i = 0; i < options.north_count; ++i) {
    for (std::size_t j = 0; j < options.east_count; ++j) {
      const double x = static_cast<double>(i) + 0.5;
      const double y = static_cast<double>(j) + 0.5;
      // Gentle slope: a sixth of the relief across the extent.
      double height =
          -relief / 6.0 * (dip.cos * (x - 0.5 * rows) + dip.sin * (y - 0.5 * columns)) / extent;
      // Roughness: five octaves down to about two cells, each half as high.
      double amplitude = 0.075 * relief;
      double frequency = 5.0 / extent;
      for (int octave = 0; octave < 5 && frequency < 0.5; ++octave) {
        height += amplitude * value_noise(noise_seed, octave, x * frequency, y * frequency);
        amplitude *= 0.5;
        frequency *= 2.0;
      }
      // Seamount: a bell with a crater in its top.
      const double sx = x - seamount.x;
      const double sy = y - seamount.y;
      const double radius2 = (sx * sx + sy * sy) / (extent * extent);
      height += 0.75 * relief * exact::exp(-radius2 / (2.0 * 0.105 * 0.105));
      height -= 0.20 * relief * exact::exp(-radius2 / (2.0 * 0.035 * 0.035));
      // Fault scarp: a steep step along a line, fading towards its ends and behind.
      const double fault_along = scarp.along(x, y) / extent;
      const double fault_across = scarp.across(x, y);
      const double fade = exact::exp(-fault_along * fault_along / (2.0 * 0.20 * 0.20));
      const double behind = fault_across > 0.0 ? exact::exp(-fault_across / (0.18 * extent)) : 1.0;
      height += 0.28 * relief * fade * behind * smooth_step(-1.5, 1.5, fault_across);
      // Sand ripples: steep on one side, as currents leave them, crests a little sinuous.
      const double ripple_along = ripples.along(x, y);
      const double ripple_across = ripples.across(x, y);
      const double field =
          exact::exp(-(ripple_along * ripple_along + ripple_across * ripple_across) /
                     (2.0 * 0.14 * 0.14 * extent * extent));
      const double phase = (ripple_along + 1.5 * exact::sin(ripple_across * 0.12)) / 9.0;
      const double saw = phase - std::floor(phase);
      const double crest =
          saw < 0.7 ? smooth_step(0.0, 0.7, saw) : 1.0 - smooth_step(0.7, 1.0, saw);
      height += 0.07 * relief * field * (crest - 0.5);
      // Wreck: a hull tapering to both ends, a deck house, and a scour pit around it.
      const double hull_along = wreck.along(x, y) / (0.13 * extent);
      const double hull_across = wreck.across(x, y) / (0.030 * extent);
      const double width = std::max(0.0, 1.0 - hull_along * hull_along);
      const double pit =
          exact::exp(-0.5 * (hull_along * hull_along / 1.2 + hull_across * hull_across / 6.0));
      height -= 0.06 * relief * pit;
      if (std::fabs(hull_along) < 1.0 && std::fabs(hull_across) < std::sqrt(width)) {
        height += 0.17 * relief;
        if (hull_along > -0.55 && hull_along < -0.2 && std::fabs(hull_across) < 0.6) {
          height += 0.08 * relief;
        }
      }
      depth[i * options.east_count + j] = -height;
    }
  }
  const auto extremes = std::minmax_element(depth.begin(), depth.end());
  const double low = *extremes.first;
  const double scale = relief / (*extremes.second - low) * options.cell_m;
  for (double& value : depth) {
    value = snap(options.shallowest_depth_m + (value - low) * scale);
  }
  return Terrain(options.north_count, options.east_count, options.cell_m, 0.0, 0.0,
                 std::move(depth));
}

Terrain make_plane_terrain(const PlaneOptions& options) {
  require(options.slope_deg >= 0.0 && options.slope_deg < 80.0, "slope_deg", options.slope_deg,
          "0 .. below 80");
  require(std::isfinite(options.dip_azimuth_deg) && std::fabs(options.dip_azimuth_deg) <= 1e6,
          "dip_azimuth_deg", options.dip_azimuth_deg, "finite");
  require(options.north_count >= 2 && options.north_count <= 8192, "north_count",
          static_cast<double>(options.north_count), "2 .. 8192");
  require(options.east_count >= 2 && options.east_count <= 8192, "east_count",
          static_cast<double>(options.east_count), "2 .. 8192");
  const double fall = exact::tan(options.slope_deg * exact::kRadPerDeg);
  const exact::SinCos dip = exact::sin_cos(options.dip_azimuth_deg * exact::kRadPerDeg);
  std::vector<double> depth;
  depth.reserve(options.north_count * options.east_count);
  for (std::size_t i = 0; i < options.north_count; ++i) {
    for (std::size_t j = 0; j < options.east_count; ++j) {
      depth.push_back(fall * options.cell_m *
                      (dip.cos * static_cast<double>(i) + dip.sin * static_cast<double>(j)));
    }
  }
  if (!depth.empty()) {
    const double low = *std::min_element(depth.begin(), depth.end());
    for (double& value : depth) {
      value += options.shallowest_depth_m - low;
    }
  }
  return Terrain(options.north_count, options.east_count, options.cell_m, 0.0, 0.0,
                 std::move(depth));
}

Terrain make_raster_terrain(const Raster& raster, const std::string& name,
                            const RasterTerrainOptions& options) {
  const std::size_t all_rows = static_cast<std::size_t>(raster.rows);
  const std::size_t all_columns = static_cast<std::size_t>(raster.columns);
  require(options.north_count != 1 && options.north_count <= 8192, "north_count",
          static_cast<double>(options.north_count), "2 .. 8192, or 0 for the raster's");
  require(options.east_count != 1 && options.east_count <= 8192, "east_count",
          static_cast<double>(options.east_count), "2 .. 8192, or 0 for the raster's");
  const Part cut = choose_part(all_rows, all_columns, name, options);
  const std::size_t rows = cut.rows;
  const std::size_t columns = cut.columns;
  require(options.cell_m >= 0.0 && std::isfinite(options.cell_m), "cell_m", options.cell_m,
          "positive, or 0 for the raster's");
  require(options.relief_cells >= 0.0 && std::isfinite(options.relief_cells), "relief_cells",
          options.relief_cells, "positive, or 0 for the raster's");

  std::vector<double> part(rows * columns);
  std::size_t unknown_count = 0;
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < columns; ++c) {
      const double elevation_m =
          raster.at(static_cast<int>(cut.first_row + r), static_cast<int>(cut.first_column + c));
      // South to north, as Terrain wants it.
      part[(rows - 1 - r) * columns + c] = elevation_m;
      unknown_count += std::isnan(elevation_m) ? 1 : 0;
    }
  }
  if (unknown_count * 4 > part.size()) {
    throw HostError(ExitCode::kInput,
                    name + ": " + std::to_string(unknown_count) + " of " +
                        std::to_string(part.size()) +
                        " cells have no elevation; at most a quarter can be filled. Choose a part "
                        "of the raster that is covered");
  }
  fill_unknown(&part, rows, columns);

  const std::size_t north_count = options.north_count != 0 ? options.north_count : rows;
  const std::size_t east_count = options.east_count != 0 ? options.east_count : columns;
  const double cell_m = options.cell_m > 0.0 ? options.cell_m
                                             : raster.cell_m * static_cast<double>(rows) /
                                                   static_cast<double>(north_count);
  const std::vector<Taps> north_taps = make_taps(rows, north_count);
  const std::vector<Taps> east_taps = make_taps(columns, east_count);
  std::vector<double> narrowed(rows * east_count);
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t j = 0; j < east_count; ++j) {
      double sum = 0.0;
      for (std::size_t k = 0; k < east_taps[j].weights.size(); ++k) {
        sum += east_taps[j].weights[k] * part[r * columns + east_taps[j].first + k];
      }
      narrowed[r * east_count + j] = sum;
    }
  }
  std::vector<double> depth(north_count * east_count);
  for (std::size_t i = 0; i < north_count; ++i) {
    for (std::size_t j = 0; j < east_count; ++j) {
      double sum = 0.0;
      for (std::size_t k = 0; k < north_taps[i].weights.size(); ++k) {
        sum += north_taps[i].weights[k] * narrowed[(north_taps[i].first + k) * east_count + j];
      }
      depth[i * east_count + j] = -sum;
    }
  }
  const auto extremes = std::minmax_element(depth.begin(), depth.end());
  const double low = *extremes.first;
  const double relief_m = *extremes.second - low;
  double scale = 1.0;
  if (options.relief_cells > 0.0) {
    if (!(relief_m > 0.0)) {
      throw HostError(ExitCode::kInput,
                      name + ": is flat, so its relief cannot be scaled to a number of cells");
    }
    scale = options.relief_cells * cell_m / relief_m;
  }
  const double top_m = options.shallowest_depth_m.value_or(low);
  for (double& value : depth) {
    value = top_m + (value - low) * scale;
  }
  return Terrain(north_count, east_count, cell_m, 0.0, 0.0, std::move(depth));
}

Terrain load_raster_terrain(const std::string& path, const RasterTerrainOptions& options) {
  return make_raster_terrain(read_raster(path), path, options);
}

Raster terrain_elevation(const Terrain& terrain) {
  Raster raster =
      make_raster(static_cast<int>(terrain.east_count()), static_cast<int>(terrain.north_count()),
                  terrain.origin_east_m(), terrain.origin_north_m(), terrain.cell_m());
  for (std::size_t i = 0; i < terrain.north_count(); ++i) {
    for (std::size_t j = 0; j < terrain.east_count(); ++j) {
      raster.at(static_cast<int>(terrain.north_count() - 1 - i), static_cast<int>(j)) =
          -terrain.depth_at_cell_m(i, j);
    }
  }
  return raster;
}

}  // namespace leadline::host
