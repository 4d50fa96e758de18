// What OctoMap makes of a survey: depth rasters for the table of toolchain/accuracy.sh.
//
//   octomap_scene --pings P.csv --config map.toml --out DIR
//
// Writes DIR/RAYS-HOW.asc (elevation, cells of the configured grid). RAYS: 1 = a ray on the axis of each
// ping; 37 = a bundle that fills the cone (one, and rings of 6, 12 and 18), all ending at the measured
// range. HOW a column's depth is read: top = centre of the shallowest occupied voxel; mean = mean of all
// occupied voxels, weighted with occupancy - 1/2. OctoMap's default sensor model. The caller takes
// whichever is best: OctoMap has no rule of its own for the depth of a column.
#include <array>
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <octomap/octomap.h>

#include "host_tools/exit_codes.hpp"
#include "host_tools/grid_baselines.hpp"
#include "host_tools/map_config.hpp"
#include "host_tools/ping_csv.hpp"
#include "host_tools/raster.hpp"

namespace {

using leadline::host::MapConfig;
using leadline::host::PingRow;
using leadline::host::Raster;

using Vec = std::array<double, 3>;

Vec cross(const Vec& a, const Vec& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

Vec unit(const Vec& v) {
  const double length = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  return {v[0] / length, v[1] / length, v[2] / length};
}

/// Unit vectors of the bundle around `axis`.
std::vector<Vec> bundle(const Vec& axis, int rays, double half_angle_rad) {
  std::vector<Vec> directions = {axis};
  if (rays == 1) {
    return directions;
  }
  const Vec away = std::fabs(axis[2]) < 0.9 ? Vec{0, 0, 1} : Vec{1, 0, 0};
  const Vec side = unit(cross(axis, away));
  const Vec other = cross(axis, side);
  for (int ring = 1; ring <= 3; ++ring) {
    const double off = half_angle_rad * ring / 3.0;
    for (int i = 0; i < 6 * ring; ++i) {
      const double turn = 2.0 * 3.141592653589793 * i / (6.0 * ring);
      Vec direction{};
      for (std::size_t k = 0; k < 3; ++k) {
        direction[k] = std::cos(off) * axis[k] +
                       std::sin(off) * (std::cos(turn) * side[k] + std::sin(turn) * other[k]);
      }
      directions.push_back(direction);
    }
  }
  return directions;
}

/// Metres from the grid's corner: OctoMap keys are 16 bits around zero.
octomap::point3d point(const Vec& position, const Vec& direction, double range) {
  return {static_cast<float>(position[0] + range * direction[0]),
          static_cast<float>(position[1] + range * direction[1]),
          static_cast<float>(position[2] + range * direction[2])};
}

struct Columns {
  Raster top;
  Raster mean;
};

Columns depth_of_columns(const octomap::OcTree& tree, const MapConfig& config) {
  const double cell_m = config.grid.cell_mm * 1e-3;
  Raster empty =
      leadline::host::make_raster(config.grid.size[1], config.grid.size[0],
                                  static_cast<double>(config.grid.origin_mm[1]) * 1e-3,
                                  static_cast<double>(config.grid.origin_mm[0]) * 1e-3, cell_m);
  Columns columns{empty, empty};
  struct Sum {
    double weight = 0;
    double weighted_depth = 0;
    double top = 0;
    bool any = false;
  };
  std::map<std::size_t, Sum> sums;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (!tree.isNodeOccupied(*leaf)) {
      continue;
    }
    // A pruned leaf stands for all the voxels below it.
    const double half = leaf.getSize() / 2;
    const int count = static_cast<int>(std::lround(leaf.getSize() / cell_m));
    const double weight = leaf->getOccupancy() - 0.5;
    for (int n = 0; n < count; ++n) {
      for (int e = 0; e < count; ++e) {
        const double north = leaf.getX() - half + (n + 0.5) * cell_m;
        const double east = leaf.getY() - half + (e + 0.5) * cell_m;
        const int row = empty.rows - 1 - static_cast<int>(std::floor(north / cell_m));
        const int column = static_cast<int>(std::floor(east / cell_m));
        if (!empty.contains(row, column)) {
          continue;
        }
        Sum& sum = sums[empty.index(row, column)];
        for (int d = 0; d < count; ++d) {
          const double depth = leaf.getZ() - half + (d + 0.5) * cell_m;
          sum.top = sum.any ? std::min(sum.top, depth) : depth;
          sum.any = true;
          sum.weight += weight;
          sum.weighted_depth += weight * depth;
        }
      }
    }
  }
  const double origin_down_m = static_cast<double>(config.grid.origin_mm[2]) * 1e-3;
  for (const auto& [index, sum] : sums) {
    columns.top.values[index] = -(origin_down_m + sum.top);
    columns.mean.values[index] = -(origin_down_m + sum.weighted_depth / sum.weight);
  }
  return columns;
}

int run(const std::string& pings, const std::string& config_path, const std::string& out) {
  const MapConfig config = leadline::host::load_map_config(config_path);
  if (config.sonar.beam != leadline::host::BeamKind::kCone) {
    std::fprintf(stderr, "octomap_scene: wants a beam_half_angle_deg\n");
    return 2;
  }
  const std::vector<PingRow> rows = leadline::host::read_ping_csv(pings, {}, nullptr);
  std::filesystem::create_directories(out);
  for (const int rays : {1, 37}) {
    octomap::OcTree tree(config.grid.cell_mm * 1e-3);
    for (const PingRow& row : rows) {
      const auto hit = leadline::host::on_axis_sounding(row);
      const auto range_mm = row.range_um / 1000;
      if (!hit || range_mm < config.sonar.min_range_mm || range_mm > config.sonar.max_range_mm) {
        continue;
      }
      Vec position{};
      for (std::size_t k = 0; k < 3; ++k) {
        position[k] = static_cast<double>(row.position_um[k]) * 1e-6 -
                      static_cast<double>(config.grid.origin_mm[k]) * 1e-3;
      }
      const double range_m = static_cast<double>(row.range_um) * 1e-6;
      const Vec axis = unit({hit->north_m - static_cast<double>(row.position_um[0]) * 1e-6,
                             hit->east_m - static_cast<double>(row.position_um[1]) * 1e-6,
                             hit->depth_m - static_cast<double>(row.position_um[2]) * 1e-6});
      octomap::Pointcloud cloud;
      for (const Vec& direction :
           bundle(axis, rays, config.sonar.beam_half_angle_deg * 3.141592653589793 / 180)) {
        cloud.push_back(point(position, direction, range_m));
      }
      tree.insertPointCloud(cloud, point(position, axis, 0), -1, true);
    }
    tree.updateInnerOccupancy();
    const Columns columns = depth_of_columns(tree, config);
    const std::string stem = out + "/" + std::to_string(rays);
    leadline::host::write_esri_ascii(columns.top, stem + "-top.asc");
    leadline::host::write_esri_ascii(columns.mean, stem + "-mean.asc");
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  std::map<std::string, std::string> options;
  for (int i = 1; i + 1 < argc; i += 2) {
    options[argv[i]] = argv[i + 1];
  }
  if (argc != 7 ||
      options.count("--pings") + options.count("--config") + options.count("--out") != 3) {
    std::fprintf(stderr, "usage: octomap_scene --pings P.csv --config map.toml --out DIR\n");
    return 2;
  }
  try {
    return run(options["--pings"], options["--config"], options["--out"]);
  } catch (const leadline::host::HostError& error) {
    std::fprintf(stderr, "octomap_scene: %s\n", error.what());
    return static_cast<int>(error.code());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "octomap_scene: %s\n", error.what());
    return 1;
  }
}
