#include "host_tools/sim/terrain.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

namespace leadline::host {
namespace {

// Where a ray leaves the interval [low, high] along one axis, in ray parameter; +inf if it never does.
double exit_parameter(double position, double step, double low, double high) {
  if (step > 0.0) {
    return (high - position) / step;
  }
  if (step < 0.0) {
    return (low - position) / step;
  }
  return HUGE_VAL;
}

struct Span {
  std::size_t index;
  double exit;
};

// The block along one axis that the ray is in just after parameter `probe`, and where it leaves it.
Span span_ahead(double position, double step, double probe, double block, std::size_t count) {
  double index = std::floor((position + probe * step) / block);
  double exit = exit_parameter(position, step, index * block, (index + 1.0) * block);
  if (exit <= probe) {
    index += step > 0.0 ? 1.0 : -1.0;
    exit = exit_parameter(position, step, index * block, (index + 1.0) * block);
  }
  index = std::clamp(index, 0.0, static_cast<double>(count - 1));
  return {static_cast<std::size_t>(index), exit};
}

// Narrows [enter, leave] to the part of the ray with low <= position <= high; false if none.
bool clip_axis(double position, double step, double low, double high, double* enter,
               double* leave) {
  if (step == 0.0) {
    return position >= low && position <= high;
  }
  double first = (low - position) / step;
  double last = (high - position) / step;
  if (first > last) {
    std::swap(first, last);
  }
  *enter = std::max(*enter, first);
  *leave = std::min(*leave, last);
  return *enter <= *leave;
}

}  // namespace

Terrain::Terrain(std::size_t north_count, std::size_t east_count, double cell_m,
                 double origin_north_m, double origin_east_m, std::vector<double> depth_m)
    : north_count_(north_count),
      east_count_(east_count),
      cell_m_(cell_m),
      origin_north_m_(origin_north_m),
      origin_east_m_(origin_east_m),
      depth_m_(std::move(depth_m)) {
  if (north_count < 2 || east_count < 2) {
    throw std::invalid_argument("terrain: needs at least 2 x 2 cells, got " +
                                std::to_string(north_count) + " x " + std::to_string(east_count));
  }
  if (!(cell_m > 0.0) || !std::isfinite(cell_m)) {
    throw std::invalid_argument("terrain: cell size must be positive, got " +
                                std::to_string(cell_m) + " m");
  }
  if (!std::isfinite(origin_north_m) || !std::isfinite(origin_east_m)) {
    throw std::invalid_argument("terrain: origin is not finite");
  }
  if (depth_m_.size() != north_count * east_count) {
    throw std::invalid_argument("terrain: " + std::to_string(depth_m_.size()) + " depths for " +
                                std::to_string(north_count) + " x " + std::to_string(east_count) +
                                " cells");
  }
  for (std::size_t k = 0; k < depth_m_.size(); ++k) {
    if (!std::isfinite(depth_m_[k])) {
      throw std::invalid_argument("terrain: depth of cell (" + std::to_string(k / east_count) +
                                  ", " + std::to_string(k % east_count) + ") is not finite");
    }
  }
  const auto extremes = std::minmax_element(depth_m_.begin(), depth_m_.end());
  shallowest_m_ = *extremes.first;
  deepest_m_ = *extremes.second;
  build_pyramid();
}

void Terrain::build_pyramid() {
  Level base{north_count_ - 1, east_count_ - 1, {}};
  base.shallowest_m.resize(base.north_count * base.east_count);
  for (std::size_t i = 0; i < base.north_count; ++i) {
    for (std::size_t j = 0; j < base.east_count; ++j) {
      base.shallowest_m[i * base.east_count + j] =
          std::min(std::min(depth_at_cell_m(i, j), depth_at_cell_m(i, j + 1)),
                   std::min(depth_at_cell_m(i + 1, j), depth_at_cell_m(i + 1, j + 1)));
    }
  }
  levels_.push_back(std::move(base));
  while (levels_.back().north_count > 1 || levels_.back().east_count > 1) {
    const Level& fine = levels_.back();
    Level coarse{(fine.north_count + 1) / 2, (fine.east_count + 1) / 2, {}};
    coarse.shallowest_m.assign(coarse.north_count * coarse.east_count, HUGE_VAL);
    for (std::size_t i = 0; i < fine.north_count; ++i) {
      for (std::size_t j = 0; j < fine.east_count; ++j) {
        double& target = coarse.shallowest_m[(i / 2) * coarse.east_count + j / 2];
        target = std::min(target, fine.shallowest_m[i * fine.east_count + j]);
      }
    }
    levels_.push_back(std::move(coarse));
  }
}

bool Terrain::contains(double north_m, double east_m) const {
  return north_m >= south_m() && north_m <= this->north_m() && east_m >= west_m() &&
         east_m <= this->east_m();
}

double Terrain::depth_m(double north_m, double east_m) const {
  const double u =
      std::clamp((north_m - south_m()) / cell_m_, 0.0, static_cast<double>(north_count_ - 1));
  const double v =
      std::clamp((east_m - west_m()) / cell_m_, 0.0, static_cast<double>(east_count_ - 1));
  const std::size_t i = std::min(static_cast<std::size_t>(u), north_count_ - 2);
  const std::size_t j = std::min(static_cast<std::size_t>(v), east_count_ - 2);
  const double a = u - static_cast<double>(i);
  const double b = v - static_cast<double>(j);
  return (1.0 - a) * ((1.0 - b) * depth_at_cell_m(i, j) + b * depth_at_cell_m(i, j + 1)) +
         a * ((1.0 - b) * depth_at_cell_m(i + 1, j) + b * depth_at_cell_m(i + 1, j + 1));
}

// First parameter in [enter, leave] where the ray is on or below patch (i, j). `local` and `step` are
// in cells from the south-west centre for x and y, in metres for z.
std::optional<double> Terrain::hit_patch(std::size_t i, std::size_t j, Vec3 local, Vec3 step,
                                         double enter, double leave) const {
  const double d00 = depth_at_cell_m(i, j);
  const double dn = depth_at_cell_m(i + 1, j) - d00;
  const double de = depth_at_cell_m(i, j + 1) - d00;
  const double twist = depth_at_cell_m(i + 1, j + 1) - d00 - dn - de;
  const double a = local.x - static_cast<double>(i);
  const double b = local.y - static_cast<double>(j);
  // f(s) = ray depth - surface depth = c0 + c1 s + c2 s^2; above the bottom while negative.
  const double c0 = local.z - (d00 + dn * a + de * b + twist * a * b);
  const double c1 = step.z - (dn * step.x + de * step.y + twist * (a * step.y + b * step.x));
  const double c2 = -twist * step.x * step.y;
  if (c0 + enter * (c1 + enter * c2) >= 0.0) {
    return enter;
  }
  // Roots in the form that does not cancel: q/c2 and c0/q.
  const double discriminant = c1 * c1 - 4.0 * c2 * c0;
  if (discriminant < 0.0) {
    return std::nullopt;
  }
  const double q = -0.5 * (c1 + std::copysign(std::sqrt(discriminant), c1));
  double best = HUGE_VAL;
  if (c2 != 0.0) {
    const double root = q / c2;
    if (root >= enter && root <= leave) {
      best = root;
    }
  }
  if (q != 0.0) {
    const double root = c0 / q;
    if (root >= enter && root <= leave) {
      best = std::min(best, root);
    }
  }
  if (best <= leave) {
    return best;
  }
  return std::nullopt;
}

std::optional<double> Terrain::intersect(Vec3 origin, Vec3 direction, double max_range_m) const {
  // Horizontal units are cells counted from the south-west centre, the parameter stays in metres.
  const Vec3 local{(origin.x - south_m()) / cell_m_, (origin.y - west_m()) / cell_m_, origin.z};
  const Vec3 step{direction.x / cell_m_, direction.y / cell_m_, direction.z};
  double enter = 0.0;
  double leave = max_range_m;
  const double north_limit = static_cast<double>(north_count_ - 1);
  const double east_limit = static_cast<double>(east_count_ - 1);
  if (!clip_axis(local.x, step.x, 0.0, north_limit, &enter, &leave) ||
      !clip_axis(local.y, step.y, 0.0, east_limit, &enter, &leave)) {
    return std::nullopt;
  }
  const double entry_depth_m = local.z + enter * step.z;
  if (entry_depth_m > depth_m(origin.x + enter * direction.x, origin.y + enter * direction.y)) {
    return std::nullopt;  // starts in the ground, or hits the cut face of the terrain block
  }
  // Open water above the shallowest point needs no walk.
  if (step.z > 0.0) {
    enter = std::max(enter, (shallowest_m_ - local.z) / step.z);
  } else if (entry_depth_m < shallowest_m_) {
    return std::nullopt;
  }
  double s = enter;
  std::size_t level = std::min<std::size_t>(2, levels_.size() - 1);
  while (s <= leave) {
    // Block that holds the ray just after s. A point on a border counts as the block ahead: the probe
    // is nudged forward, and a block that the ray still leaves before the probe (it creeps along a
    // border at a grazing angle) is stepped over. `out` is therefore well beyond s and the walk ends.
    const Level& grid = levels_[level];
    const double block = static_cast<double>(std::size_t{1} << level);
    const double probe = s + 1e-9 * (cell_m_ + s);
    const Span north = span_ahead(local.x, step.x, probe, block, grid.north_count);
    const Span east = span_ahead(local.y, step.y, probe, block, grid.east_count);
    const double out = std::min(std::max(std::min(north.exit, east.exit), probe), leave);
    const std::size_t i = north.index;
    const std::size_t j = east.index;
    const double deepest_on_ray_m = local.z + step.z * (step.z > 0.0 ? out : s);
    if (deepest_on_ray_m < grid.shallowest_m[i * grid.east_count + j]) {
      if (out >= leave) {
        return std::nullopt;
      }
      s = out;
      level = std::min(level + 1, levels_.size() - 1);
      continue;
    }
    if (level > 0) {
      --level;
      continue;
    }
    const std::optional<double> hit = hit_patch(i, j, local, step, s, out);
    if (hit) {
      return hit;
    }
    if (out >= leave) {
      return std::nullopt;
    }
    s = out;
  }
  return std::nullopt;
}

}  // namespace leadline::host
