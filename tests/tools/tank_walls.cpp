// Are the two walls of a tank straight in a saved model, and how far apart do they stand?
//
//   tank_walls MAP DOWN_M FROM_M TO_M
//
// Takes the horizontal slice of voxels at DOWN_M. In every row of voxels from FROM_M to TO_M north, each side of
// the head (east below and above 0) has its wall where the occupied voxels lie (hits outweigh misses):
// their mean east, weighted with the hits. A line through each side's places by least squares says the
// rest. Prints a table row for each wall and the distance between them, across their mean direction in
// the middle of the rows.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <string>
#include <vector>

#include "host_tools/model_file.hpp"

namespace {

using leadline::host::SavedModel;

struct Place {
  double north_m;
  double east_m;
};

struct Line {
  double east_m;  // in the middle of the rows
  double slope;   // east over north
  double rms_m;   // distances from it
  double worst_m;
};

/// Where the wall of one side stands, row by row; rows without one are left out.
std::vector<Place> wall_places(const SavedModel& saved, double down_m, double from_m, double to_m,
                               bool east_side) {
  const auto& grid = saved.config.grid;
  const double cell_m = 1e-3 * grid.cell_mm;
  const auto low_m = [&](int axis) { return 1e-3 * static_cast<double>(grid.origin_mm[axis]); };
  const auto layer = static_cast<std::int64_t>(std::floor((down_m - low_m(2)) / cell_m));
  std::vector<Place> places;
  if (layer < 0 || layer >= grid.size[2]) {
    return places;
  }
  for (std::int64_t n = 0; n < grid.size[0]; ++n) {
    const double north_m = low_m(0) + (static_cast<double>(n) + 0.5) * cell_m;
    if (north_m < from_m || north_m > to_m) {
      continue;
    }
    double weight = 0;
    double sum_m = 0;
    for (std::int64_t e = 0; e < grid.size[1]; ++e) {
      const double east_m = low_m(1) + (static_cast<double>(e) + 0.5) * cell_m;
      const auto& voxel = saved.voxel(n, e, layer);
      if ((east_m > 0) == east_side && voxel.hit > voxel.miss) {
        weight += voxel.hit;
        sum_m += voxel.hit * east_m;
      }
    }
    if (weight > 0) {
      places.push_back({north_m, sum_m / weight});
    }
  }
  return places;
}

Line line_through(const std::vector<Place>& places, double middle_m) {
  double n = 0;
  double e = 0;
  for (const Place& place : places) {
    n += place.north_m / static_cast<double>(places.size());
    e += place.east_m / static_cast<double>(places.size());
  }
  double nn = 0;
  double ne = 0;
  for (const Place& place : places) {
    nn += (place.north_m - n) * (place.north_m - n);
    ne += (place.north_m - n) * (place.east_m - e);
  }
  Line line{};
  line.slope = ne / nn;
  line.east_m = e + line.slope * (middle_m - n);
  const double across = 1.0 / std::hypot(1.0, line.slope);
  for (const Place& place : places) {
    const double off_m =
        across * (place.east_m - line.east_m - line.slope * (place.north_m - middle_m));
    line.rms_m += off_m * off_m / static_cast<double>(places.size());
    line.worst_m = std::fmax(line.worst_m, std::fabs(off_m));
  }
  line.rms_m = std::sqrt(line.rms_m);
  return line;
}

int run(const std::vector<std::string>& arguments) {
  const SavedModel saved = leadline::host::load_model_file(arguments[0]);
  const double down_m = std::atof(arguments[1].c_str());
  const double from_m = std::atof(arguments[2].c_str());
  const double to_m = std::atof(arguments[3].c_str());
  Line lines[2];
  std::printf(
      "| wall | rows | direction deg | rms from its line m | worst m |\n|---|---|---|---|---|\n");
  for (const bool east_side : {false, true}) {
    const std::vector<Place> places = wall_places(saved, down_m, from_m, to_m, east_side);
    if (places.size() < 3) {
      std::fprintf(stderr, "tank_walls: %zu rows with a wall: too few for a line\n", places.size());
      return 3;
    }
    Line& line = lines[east_side ? 1 : 0];
    line = line_through(places, 0.5 * (from_m + to_m));
    std::printf("| %s | %zu | %.1f | %.4f | %.4f |\n", east_side ? "right" : "left", places.size(),
                std::atan(line.slope) * 57.29577951308232, line.rms_m, line.worst_m);
  }
  const double slope = 0.5 * (lines[0].slope + lines[1].slope);
  std::printf("\ndistance between the walls: %.3f m\n",
              (lines[1].east_m - lines[0].east_m) / std::hypot(1.0, slope));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) {
    std::fprintf(stderr, "usage: tank_walls MAP DOWN_M FROM_M TO_M\n");
    return 2;
  }
  try {
    return run({argv + 1, argv + argc});
  } catch (const std::exception& error) {
    std::fprintf(stderr, "tank_walls: %s\n", error.what());
    return 3;
  }
}
