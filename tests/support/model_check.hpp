// What tests of the whole model look at, and a small survey for it.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "model/base/ping.hpp"
#include "model/base/pose.hpp"
#include "model/model.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace leadline::test {

using Vector = std::array<double, 3>;

inline constexpr model::Rule kRules[] = {model::Rule::kLogOdds, model::Rule::kWeightedMean,
                                         model::Rule::kCertaintyFactor, model::Rule::kRecursive};

/// With one table, which has to be taken.
inline void configure(model::Model& which, const model::ModelConfig& config,
                      const model::LocalizationTable& table) {
  assert_int_equal(which.configure(config, &table, sizeof(table)), base::Status::kOk);
}

struct Touched {
  std::int32_t n, e, k;
  model::Voxel voxel;
};

/// Every voxel with evidence.
inline std::vector<Touched> touched(const model::Model& which) {
  std::vector<Touched> list;
  const model::Grid& grid = which.grid();
  for (std::int32_t n = 0; n < grid.north_cells(); ++n) {
    for (std::int32_t e = 0; e < grid.east_cells(); ++e) {
      const model::Voxel* const voxels = grid.column_voxels(grid.column_index(n, e));
      for (std::int32_t k = 0; k < grid.depth_cells(); ++k) {
        if (voxels[k].hit != 0 || voxels[k].miss != 0) {
          list.push_back({n, e, k, voxels[k]});
        }
      }
    }
  }
  return list;
}

/// Weighted centre of the hits, and their variance per axis, cells.
struct Blob {
  Vector centre{};
  Vector variance{};
  double mass = 0.0;
};

/// O(grid).
inline Blob blob_of_hits(const model::Model& which) {
  Blob blob;
  const std::vector<Touched> list = touched(which);
  for (int pass = 0; pass < 2; ++pass) {
    for (const Touched& at : list) {
      const Vector position = {at.n + 0.5, at.e + 0.5, at.k + 0.5};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (pass == 0) {
          blob.centre[axis] += at.voxel.hit * position[axis];
        } else {
          const double apart = position[axis] - blob.centre[axis];
          blob.variance[axis] += at.voxel.hit * apart * apart / blob.mass;
        }
      }
      blob.mass += pass == 0 ? at.voxel.hit : 0.0;
    }
    for (double& centre : blob.centre) {
      centre /= pass == 0 ? std::max(blob.mass, 1.0) : 1.0;
    }
  }
  return blob;
}

/// Position of the transducer, metres.
inline Vector metres(const base::Pose& pose) {
  Vector position{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    position[axis] = static_cast<double>(pose.position_um[axis]) * 1e-6;
  }
  return position;
}

/// Unit vector of the beam, from the very formula of the contract.
inline Vector beam_vector(const base::Pose& pose, const base::Ping& ping) {
  const auto rad = [](base::Bam32 angle) { return angle * (6.283185307179586 / 4294967296.0); };
  const double az = rad(ping.azimuth_bam32);
  const double el = rad(ping.elevation_bam32);
  const double r = rad(pose.attitude.roll_bam32);
  const double p = rad(pose.attitude.pitch_bam32);
  const double h = rad(pose.attitude.heading_bam32);
  const Vector v = {std::cos(el) * std::cos(az), std::cos(el) * std::sin(az), std::sin(el)};
  const double y = std::cos(r) * v[1] - std::sin(r) * v[2];
  const double z = std::sin(r) * v[1] + std::cos(r) * v[2];
  const double x = std::cos(p) * v[0] + std::sin(p) * z;
  return {std::cos(h) * x - std::sin(h) * y, std::sin(h) * x + std::cos(h) * y,
          std::cos(p) * z - std::sin(p) * v[0]};
}

/// Pings and the poses of their head.
struct Survey {
  std::vector<base::Ping> pings;
  std::vector<base::Pose> poses;
};

/// Random near-vertical pings over a tilted, rippled bottom.
inline Survey survey(std::uint64_t stream, int count, double north, double east) {
  Random random(stream);
  Survey result;
  for (int i = 0; i < count; ++i) {
    base::Pose pose = pose_at(north * random.uniform(), east * random.uniform(), 0.5);
    pose.t_us = i * 100'000LL;
    pose.attitude = base::Attitude{bam(3 * random.normal()), bam(3 * random.normal()),
                                   static_cast<base::Bam32>(random.next())};
    base::Ping ping = ping_along(0, 90, 0);
    const Vector u = beam_vector(pose, ping);
    // Intersection with the bottom along the axis, by iteration.
    double range = 18.0;
    for (int step = 0; step < 30; ++step) {
      const double n = metres(pose)[0] + range * u[0];
      const double e = metres(pose)[1] + range * u[1];
      const double bottom = 18.0 + 0.1 * n + 1.5 * std::sin(e / 5.0);
      range += (bottom - 0.5 - range * u[2]) / u[2];
    }
    ping = ping_along(0, 90, range + 0.3 * random.normal());
    ping.t_transmit_us = pose.t_us;
    result.pings.push_back(ping);
    result.poses.push_back(pose);
  }
  return result;
}

/// Every ping has to be fused.
inline void run(model::Model& which, const Survey& data) {
  for (std::size_t i = 0; i < data.pings.size(); ++i) {
    assert_int_equal(which.integrate(data.pings[i], data.poses[i]), model::PingResult::kFused);
  }
}

}  // namespace leadline::test
