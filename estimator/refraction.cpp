#include "estimator/refraction.hpp"

#include <cmath>

#include "model/base/angle.hpp"
#include "model/base/fixed.hpp"

namespace leadline::estimator {
namespace {

using base::Result;
using base::Status;

constexpr std::int64_t kMaxTwoWay_ns = 40'000'000'000;
constexpr float kUmPerM = 1e6F;

bool is_speed(std::int32_t speed_mm_s) {
  return speed_mm_s >= kMinSoundSpeed_mm_s && speed_mm_s <= kMaxSoundSpeed_mm_s;
}

float metres_per_s(std::int32_t speed_mm_s) { return static_cast<float>(speed_mm_s) * 1e-3F; }
float metres(std::int64_t length_um) { return static_cast<float>(length_um) * 1e-6F; }
std::int64_t micrometres(float length_m) {
  return static_cast<std::int64_t>(length_m * kUmPerM + (length_m < 0.0F ? -0.5F : 0.5F));
}

/// Cosine of the ray's angle where its sine is `sine`; 0 where it cannot get.
float cosine_of(float sine) {
  const float square = (1.0F - sine) * (1.0F + sine);
  return square > 0.0F ? std::sqrt(square) : 0.0F;
}

/// A ray on its way down.
struct Ray {
  float slowness;  ///< p, seconds a metre
  float time_s;    ///< left
  float across_m;
  float down_m;
  float speed;   ///< where it is
  float cosine;  ///< of its angle there
};

/// What lies below the ray, down to where the gradient changes.
struct Layer {
  float thickness_m;  ///< 0: without end
  float speed_below;  ///< at its lower side
};

enum class Step : std::uint8_t { kThrough, kEnded, kFlat };

/// Takes the ray through the whole layer if it gets there in its time.
bool passes(const Layer& layer, Ray& ray) {
  const float cosine = cosine_of(ray.slowness * layer.speed_below);
  if (cosine < kMinCosine) {
    return false;
  }
  const float across =
      layer.thickness_m * ray.slowness * (ray.speed + layer.speed_below) / (ray.cosine + cosine);
  const float chord = std::sqrt(across * across + layer.thickness_m * layer.thickness_m);
  const float mean_speed = std::sqrt(ray.speed * layer.speed_below);
  const float q = 0.5F * chord * (layer.speed_below - ray.speed) / (layer.thickness_m * mean_speed);
  if (!(q >= -kMaxBend && q <= kMaxBend)) {
    return false;
  }
  const float q2 = q * q;
  // arsinh(q) / q; the next term is below 3e-8
  const float arc =
      1.0F -
      q2 * (1.0F / 6.0F - q2 * (3.0F / 40.0F - q2 * (5.0F / 112.0F - q2 * (35.0F / 1152.0F))));
  const float time_s = chord / mean_speed * arc;
  if (time_s > ray.time_s) {
    return false;
  }
  ray.time_s -= time_s;
  ray.across_m += across;
  ray.down_m += layer.thickness_m;
  ray.speed = layer.speed_below;
  ray.cosine = cosine;
  return true;
}

/// Spends the ray's time within the layer; false where the ray becomes too flat.
bool ends(const Layer& layer, Ray& ray) {
  const float gradient =
      layer.thickness_m > 0.0F ? (layer.speed_below - ray.speed) / layer.thickness_m : 0.0F;
  const float h = gradient * ray.time_s;
  if (!(h >= -kMaxBend && h <= kMaxBend)) {
    return false;
  }
  const float h2 = h * h;
  const float sinh_part = 1.0F + h2 * (1.0F / 6.0F + h2 * (1.0F / 120.0F));   // sinh h / h
  const float cosh_part = 0.5F + h2 * (1.0F / 24.0F + h2 * (1.0F / 720.0F));  // (cosh h - 1) / h^2
  const float stretch = 1.0F + h2 * cosh_part - ray.cosine * h * sinh_part;
  const float length = ray.speed * ray.time_s / stretch;
  const float down = length * (ray.cosine * sinh_part - h * cosh_part);
  const float speed = ray.speed / stretch;
  if (!(down >= 0.0F) || cosine_of(ray.slowness * speed) < kMinCosine) {
    return false;
  }
  ray.across_m += length * sinh_part * ray.slowness * ray.speed;
  ray.down_m += down;
  ray.time_s = 0.0F;
  return true;
}

Step advance(const Layer& layer, Ray& ray) {
  if (layer.thickness_m > 0.0F && passes(layer, ray)) {
    return Step::kThrough;
  }
  return ends(layer, ray) ? Step::kEnded : Step::kFlat;
}

RayEnd end_of(const Ray& ray, const SoundSpeedProfile& profile, float head_speed) {
  RayEnd end{};
  end.across_um = micrometres(ray.across_m);
  end.down_um = micrometres(ray.down_m);
  const float share = metres_per_s(profile.sigma_mm_s()) / head_speed;
  end.sigma_across_um = micrometres(2.0F * share * ray.across_m);
  if (ray.down_m > 0.0F) {
    const float slope = ray.across_m / ray.down_m;
    const float part = 1.0F - slope * slope;
    end.sigma_down_um = micrometres(share * ray.down_m * (part < 0.0F ? -part : part));
  }
  return end;
}

}  // namespace

Status SoundSpeedProfile::set_uniform(std::int32_t speed_mm_s) {
  const SoundSpeedPoint point{0, speed_mm_s};
  return set(&point, 1);
}

Status SoundSpeedProfile::set(const SoundSpeedPoint* points, std::size_t count) {
  if (points == nullptr || count == 0 || count > kMaxProfilePoints) {
    return Status::kInvalidArgument;
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (!is_speed(points[i].speed_mm_s) || points[i].depth_um < -base::kMaxVertical_um ||
        points[i].depth_um > base::kMaxVertical_um) {
      return Status::kOutOfRange;
    }
    if (i > 0 && points[i].depth_um <= points[i - 1].depth_um) {
      return Status::kInvalidArgument;
    }
  }
  for (std::size_t i = 0; i < count; ++i) {
    points_[i] = points[i];
  }
  count_ = count;
  return Status::kOk;
}

std::int32_t SoundSpeedProfile::speed_at_mm_s(std::int64_t depth_um) const {
  if (count_ == 0) {
    return 0;
  }
  std::size_t below = 0;
  while (below < count_ && points_[below].depth_um <= depth_um) {
    ++below;
  }
  if (below == 0) {
    return points_[0].speed_mm_s;
  }
  if (below == count_) {
    return points_[count_ - 1].speed_mm_s;
  }
  const SoundSpeedPoint& a = points_[below - 1];
  const SoundSpeedPoint& b = points_[below];
  const std::int64_t rise = static_cast<std::int64_t>(b.speed_mm_s) - a.speed_mm_s;
  return a.speed_mm_s +
         static_cast<std::int32_t>(rise * (depth_um - a.depth_um) / (b.depth_um - a.depth_um));
}

Result<RayEnd> trace_ray(const SoundSpeedProfile& profile, const RayLaunch& launch) {
  if (profile.size() == 0) {
    return Status::kNotReady;
  }
  if (launch.two_way_ns < 0 || launch.two_way_ns > kMaxTwoWay_ns ||
      launch.from_down_bam32 > base::kBam32QuarterTurn ||
      (launch.told_speed_mm_s != 0 && !is_speed(launch.told_speed_mm_s))) {
    return Status::kInvalidArgument;
  }
  const std::int32_t head_speed_mm_s = profile.speed_at_mm_s(launch.head_depth_um);
  const std::int32_t told_mm_s =
      launch.told_speed_mm_s != 0 ? launch.told_speed_mm_s : head_speed_mm_s;
  const float sine = static_cast<float>(base::sin_q30(launch.from_down_bam32)) /
                     static_cast<float>(base::kOne_q30);

  Ray ray{};
  ray.slowness = sine / metres_per_s(told_mm_s);
  ray.time_s = static_cast<float>(launch.two_way_ns) * 0.5e-9F;
  ray.speed = metres_per_s(head_speed_mm_s);
  ray.cosine = cosine_of(ray.slowness * ray.speed);
  if (ray.cosine < kMinCosine) {
    return Status::kOutOfRange;
  }
  const float head_speed = ray.speed;

  std::int64_t depth_um = launch.head_depth_um;
  for (std::size_t i = 0; i < profile.size(); ++i) {
    const SoundSpeedPoint& below = profile.point(i);
    if (below.depth_um <= depth_um) {
      continue;
    }
    const Layer layer{metres(below.depth_um - depth_um), metres_per_s(below.speed_mm_s)};
    const Step step = advance(layer, ray);
    if (step != Step::kThrough) {
      return step == Step::kEnded ? Result<RayEnd>(end_of(ray, profile, head_speed))
                                  : Result<RayEnd>(Status::kOutOfRange);
    }
    depth_um = below.depth_um;
  }
  if (advance(Layer{0.0F, ray.speed}, ray) != Step::kEnded) {
    return Status::kOutOfRange;
  }
  return end_of(ray, profile, head_speed);
}

StraightRay straight_ray(const RayEnd& end) {
  const float across = metres(end.across_um);
  const float down = metres(end.down_um);
  return {micrometres(std::sqrt(across * across + down * down)),
          base::atan2_bam32(end.across_um, end.down_um)};
}

}  // namespace leadline::estimator
