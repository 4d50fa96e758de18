#include "host_tools/sim/echo.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "host_tools/sim/exact_math.hpp"
#include "host_tools/sim/require.hpp"

namespace leadline::host {
namespace {

double golden_angle_rad() { return exact::kPi * (3.0 - std::sqrt(5.0)); }

}  // namespace

EchoModel::EchoModel(const Terrain& terrain, const EchoSpec& spec)
    : terrain_(terrain), spec_(spec) {
  require(spec.beam_half_angle_deg > 0.0 && spec.beam_half_angle_deg < 90.0, "beam_half_angle_deg",
          spec.beam_half_angle_deg, "in (0, 90)");
  require(spec.across_half_angle_deg >= 0.0 && spec.across_half_angle_deg < 90.0,
          "across_half_angle_deg", spec.across_half_angle_deg, "0 or in (0, 90)");
  require(spec.ray_count >= 1 && spec.ray_count <= 1000000, "ray_count",
          static_cast<double>(spec.ray_count), "in [1, 1000000]");
  require(spec.detection_fraction > 0.0 && spec.detection_fraction <= 1.0, "detection_fraction",
          spec.detection_fraction, "in (0, 1]");
  require(spec.range_bin_m > 0.0 && std::isfinite(spec.range_bin_m), "range_bin_m",
          spec.range_bin_m, "positive");
  require(spec.max_range_m > 0.0 && spec.max_range_m <= 1e6, "max_range_m", spec.max_range_m,
          "in (0, 1e6]");
  min_hit_count_ = std::max<std::size_t>(1, spec.ray_count / 100);
  rays_.reserve(spec.ray_count);
  if (spec.across_half_angle_deg > 0.0) {
    fill_fan();
  } else {
    fill_cone();
  }
}

// A sunflower: equal solid angle per ray, each turned by the golden angle from the one before.
void EchoModel::fill_cone() {
  const double cos_edge = exact::cos(spec_.beam_half_angle_deg * exact::kRadPerDeg);
  const double count = static_cast<double>(spec_.ray_count);
  for (std::size_t k = 0; k < spec_.ray_count; ++k) {
    const double index = static_cast<double>(k);
    const double cos_t = 1.0 - (index + 0.5) / count * (1.0 - cos_edge);
    const double sin_t = std::sqrt(1.0 - cos_t * cos_t);
    const exact::SinCos turn = exact::sin_cos(index * golden_angle_rad());
    rays_.push_back(
        {sin_t * turn.cos, sin_t * turn.sin, cos_t, (cos_t - cos_edge) / (1.0 - cos_edge)});
  }
}

// The same flower, drawn out to an ellipse in the plane that the directions cut at unit distance.
void EchoModel::fill_fan() {
  const double tan_long = exact::tan(spec_.beam_half_angle_deg * exact::kRadPerDeg);
  const double tan_across = exact::tan(spec_.across_half_angle_deg * exact::kRadPerDeg);
  const double count = static_cast<double>(spec_.ray_count);
  for (std::size_t k = 0; k < spec_.ray_count; ++k) {
    const double index = static_cast<double>(k);
    const double r2 = (index + 0.5) / count;
    const double r = std::sqrt(r2);
    const exact::SinCos turn = exact::sin_cos(index * golden_angle_rad());
    const double side = r * turn.cos * tan_long;
    const double other = r * turn.sin * tan_across;
    const double length = std::sqrt(1.0 + side * side + other * other);
    rays_.push_back({side / length, other / length, 1.0 / length, 1.0 - r2});
  }
}

std::optional<double> EchoModel::measure(Vec3 position, Vec3 axis, TouchedMask* touched,
                                         Vec3 long_side) {
  Basis basis = basis_about(axis);
  if (spec_.across_half_angle_deg > 0.0) {
    basis.side = normalized(long_side - dot(long_side, axis) * axis);
    basis.other = cross(axis, basis.side);
  }
  arrivals_.clear();
  double total = 0.0;
  for (const Ray& ray : rays_) {
    const Vec3 direction = ray.side * basis.side + ray.other * basis.other + ray.axial * axis;
    const std::optional<double> range_m =
        terrain_.intersect(position, direction, spec_.max_range_m);
    if (!range_m) {
      continue;
    }
    arrivals_.push_back({std::floor(*range_m / spec_.range_bin_m), ray.weight});
    total += ray.weight;
    if (touched != nullptr) {
      const Vec3 hit = position + *range_m * direction;
      const double i = std::floor((hit.x - terrain_.origin_north_m()) / terrain_.cell_m());
      const double j = std::floor((hit.y - terrain_.origin_east_m()) / terrain_.cell_m());
      const std::size_t row = static_cast<std::size_t>(
          std::clamp(i, 0.0, static_cast<double>(terrain_.north_count() - 1)));
      const std::size_t column = static_cast<std::size_t>(
          std::clamp(j, 0.0, static_cast<double>(terrain_.east_count() - 1)));
      (*touched)[row * terrain_.east_count() + column] = 1;
    }
  }
  if (arrivals_.size() < min_hit_count_) {
    return std::nullopt;
  }
  // Equal bins are ordered by weight too: the sums then do not depend on how a library sorts ties.
  std::sort(arrivals_.begin(), arrivals_.end(), [](const Arrival& a, const Arrival& b) {
    return a.bin != b.bin ? a.bin < b.bin : a.weight < b.weight;
  });
  double arrived = 0.0;
  for (const Arrival& arrival : arrivals_) {
    arrived += arrival.weight;
    if (arrived >= spec_.detection_fraction * total) {
      return (arrival.bin + 0.5) * spec_.range_bin_m;
    }
  }
  // All of the energy was asked for and the sum fell short by a rounding error.
  return (arrivals_.back().bin + 0.5) * spec_.range_bin_m;
}

}  // namespace leadline::host
