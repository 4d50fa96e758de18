// What OctoMap makes of a survey: depth rasters for the table of toolchain/accuracy.sh.
//
//   octomap_scene --pings P.csv --config map.toml --out DIR
//
// Writes DIR/RAYS-HOW.asc (elevation, cells of the configured grid). RAYS: 1 = a ray on the axis of each
// ping; 37 = a bundle that fills the cone (one, and rings of 6, 12 and 18), all ending at the measured
// range. HOW a column's depth is read: top = centre of the shallowest occupied voxel; mean = mean of all
// occupied voxels, weighted with occupancy - 1/2. OctoMap's default sensor model. The caller takes
// whichever is best: OctoMap has no rule of its own for the depth of a column.
#include <cmath>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include <octomap/octomap.h>

#include "host_tools/exit_codes.hpp"
#include "host_tools/grid_baselines.hpp"
#include "host_tools/map_config.hpp"
#include "host_tools/ping_csv.hpp"
#include "host_tools/raster.hpp"
#include "host_tools/sim/vec3.hpp"
#include "tests/tools/octomap_survey.hpp"

namespace {

using leadline::host::MapConfig;
using leadline::host::PingRow;
using leadline::host::Raster;
using leadline::host::Vec3;

struct Rasters {
  Raster top;
  Raster mean;
};

Rasters depth_of_columns(const octomap::OcTree& tree, const MapConfig& config) {
  const auto& grid = config.grid;
  const double cell_m = grid.cell_mm * 1e-3;
  Raster empty = leadline::host::make_raster(grid.size[1], grid.size[0],
                                             static_cast<double>(grid.origin_mm[1]) * 1e-3,
                                             static_cast<double>(grid.origin_mm[0]) * 1e-3, cell_m);
  Rasters rasters{empty, empty};
  const auto columns = leadline::test::octomap_columns(tree, grid.size[0], grid.size[1], cell_m);
  const double origin_down_m = static_cast<double>(grid.origin_mm[2]) * 1e-3;
  std::size_t index = 0;
  for (int n = 0; n < grid.size[0]; ++n) {
    for (int e = 0; e < grid.size[1]; ++e, ++index) {
      if (columns[index].weight > 0) {
        const int row = grid.size[0] - 1 - n;
        rasters.top.at(row, e) = -(origin_down_m + columns[index].top);
        rasters.mean.at(row, e) = -(origin_down_m + columns[index].mean());
      }
    }
  }
  return rasters;
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
      const auto local = [&](std::size_t axis) {
        return static_cast<double>(row.position_um[axis]) * 1e-6 -
               static_cast<double>(config.grid.origin_mm[axis]) * 1e-3;
      };
      const Vec3 position{local(0), local(1), local(2)};
      const double range_m = static_cast<double>(row.range_um) * 1e-6;
      const Vec3 axis = leadline::host::normalized(
          {hit->north_m - static_cast<double>(row.position_um[0]) * 1e-6,
           hit->east_m - static_cast<double>(row.position_um[1]) * 1e-6,
           hit->depth_m - static_cast<double>(row.position_um[2]) * 1e-6});
      octomap::Pointcloud cloud;
      for (const Vec3& direction : leadline::test::ray_bundle(
               axis, rays, config.sonar.beam_half_angle_deg * 3.141592653589793 / 180)) {
        cloud.push_back(leadline::test::ray_end(position, direction, range_m));
      }
      tree.insertPointCloud(cloud, leadline::test::ray_end(position, axis, 0), -1, true);
    }
    tree.updateInnerOccupancy();
    const Rasters rasters = depth_of_columns(tree, config);
    const std::string stem = out + "/" + std::to_string(rays);
    leadline::host::write_esri_ascii(rasters.top, stem + "-top.asc");
    leadline::host::write_esri_ascii(rasters.mean, stem + "-mean.asc");
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
