// OctoMap as a sonar mapper, for comparisons: how a ping becomes rays and how a column's depth is read.
// Header only: the library is a dependency of benches and tools, not of the tests' support library.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include <octomap/octomap.h>

#include "host_tools/sim/vec3.hpp"

namespace leadline::test {

/// Unit vectors that fill a cone about `axis`: one ray, or rings of 6, 12 and 18 at thirds of the
/// half-angle around it.
inline std::vector<host::Vec3> ray_bundle(host::Vec3 axis, int rays, double half_angle_rad) {
  std::vector<host::Vec3> directions = {axis};
  if (rays == 1) {
    return directions;
  }
  const host::Basis basis = host::basis_about(axis);
  for (int ring = 1; ring <= 3; ++ring) {
    const double off = half_angle_rad * ring / 3.0;
    for (int i = 0; i < 6 * ring; ++i) {
      const double turn = 2.0 * 3.141592653589793 * i / (6.0 * ring);
      directions.push_back(std::cos(off) * axis + std::sin(off) * (std::cos(turn) * basis.side +
                                                                   std::sin(turn) * basis.other));
    }
  }
  return directions;
}

/// End of a ray; coordinates from the grid's corner, because OctoMap's keys are 16 bits around zero.
inline octomap::point3d ray_end(host::Vec3 origin, host::Vec3 direction, double range) {
  const host::Vec3 end = origin + range * direction;
  return {static_cast<float>(end.x), static_cast<float>(end.y), static_cast<float>(end.z)};
}

/// What a column of OctoMap's voxels says about its surface. It has no rule of its own for that; the
/// caller takes the better one.
struct OctomapColumn {
  double top = 0;             ///< centre of the shallowest occupied voxel
  double weighted_depth = 0;  ///< sum of depth * (occupancy - 1/2) over occupied voxels
  double weight = 0;          ///< sum of occupancy - 1/2; 0: nothing occupied
  [[nodiscard]] double mean() const { return weighted_depth / weight; }
};

/// Columns of `tree` over north x east cells from its origin: index n * east + e.
inline std::vector<OctomapColumn> octomap_columns(const octomap::OcTree& tree, int north, int east,
                                                  double cell_m) {
  std::vector<OctomapColumn> columns(static_cast<std::size_t>(north) *
                                     static_cast<std::size_t>(east));
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (!tree.isNodeOccupied(*leaf)) {
      continue;
    }
    // A pruned leaf stands for all the voxels below it.
    const double half = leaf.getSize() / 2;
    const int count = static_cast<int>(std::lround(leaf.getSize() / cell_m));
    const double weight = leaf->getOccupancy() - 0.5;
    for (int i = 0; i < count; ++i) {
      for (int j = 0; j < count; ++j) {
        const int n = static_cast<int>(std::floor((leaf.getX() - half) / cell_m + i + 0.5));
        const int e = static_cast<int>(std::floor((leaf.getY() - half) / cell_m + j + 0.5));
        if (n < 0 || e < 0 || n >= north || e >= east) {
          continue;
        }
        OctomapColumn& column =
            columns[static_cast<std::size_t>(n) * static_cast<std::size_t>(east) +
                    static_cast<std::size_t>(e)];
        for (int k = 0; k < count; ++k) {
          const double depth = leaf.getZ() - half + (k + 0.5) * cell_m;
          column.top = column.weight > 0 ? std::min(column.top, depth) : depth;
          column.weight += weight;
          column.weighted_depth += weight * depth;
        }
      }
    }
  }
  return columns;
}

}  // namespace leadline::test
