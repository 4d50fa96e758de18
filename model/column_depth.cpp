#include "model/column_depth.hpp"

#include "model/base/fixed.hpp"
#include "model/column_kernels.hpp"

namespace leadline::model {
namespace {

using base::clamp;
using base::max_of;
using base::min_of;

constexpr int kIterations = 3;
// Width of the window, however narrow or wide the run is: 3 and 64 cells.
constexpr std::int64_t kNarrowest_q8 = 768;
constexpr std::int64_t kWidest_q8 = 16384;
constexpr std::int64_t kSettled_q8 = 8;  // a move below 1/32 cell ends the iteration

// S in Q8, unknown = 128.
std::int32_t signal_q8(const Voxel& voxel) {
  const std::int32_t certainty = voxel.hit + voxel.miss;
  return certainty == 0 ? 128 : (voxel.hit * 256) / certainty;
}

ColumnDepth first_moment(const Voxel* voxels, std::int32_t depth_cells, std::uint32_t mass) {
  constexpr std::int32_t kThreshold_q8 = 179;  // the source's 0.7
  std::int64_t sum = 0;
  std::int64_t moment = 0;
  for (std::int32_t k = 0; k < depth_cells; ++k) {
    const std::int32_t s = signal_q8(voxels[k]);
    if (s > kThreshold_q8) {
      sum += s;
      moment += static_cast<std::int64_t>(s) * (256 * k + 128);
    }
  }
  return ColumnDepth{sum == 0 ? kUnknownDepth : static_cast<std::int32_t>(moment / sum), mass,
                     false};
}

ColumnDepth upper_crossing(const Voxel* voxels, std::int32_t depth_cells, std::uint32_t mass) {
  constexpr std::int32_t kHalf_q8 = 128;
  std::int32_t before = kHalf_q8;
  for (std::int32_t k = 0; k < depth_cells; ++k) {
    const std::int32_t s = signal_q8(voxels[k]);
    if (s > kHalf_q8) {
      const std::int32_t back = before < kHalf_q8 ? 256 * (s - kHalf_q8) / (s - before) : 0;
      return ColumnDepth{256 * k + 128 - back, mass, false};
    }
    before = s;
  }
  return ColumnDepth{kUnknownDepth, mass, false};
}

}  // namespace

ColumnDepth column_depth(const Voxel* voxels, std::int32_t depth_cells, DepthMethod method,
                         Rule rule) {
  std::uint16_t padded[kMaxDepthCells + 2 * kProfileGuard];
  std::uint16_t smoothed[kMaxDepthCells + 8];
  std::uint16_t* const hits = padded + kProfileGuard;
  const ProfileSummary profile = gather_profile(voxels, depth_cells, rule, hits, smoothed);
  const std::uint32_t mass = profile.mass;
  const std::uint32_t peak = profile.peak;
  if (mass == 0) {
    return ColumnDepth{kUnknownDepth, 0, false};
  }
  if (method == DepthMethod::kFirstMoment) {
    return first_moment(voxels, depth_cells, mass);
  }
  if (method == DepthMethod::kUpperCrossing) {
    return upper_crossing(voxels, depth_cells, mass);
  }

  std::int32_t peak_k = 0;
  while (smoothed[peak_k] != peak) {
    ++peak_k;
  }
  const std::uint32_t floor = peak / 10;
  std::int32_t top = peak_k;
  std::int32_t bottom = peak_k;
  while (top > 0 && smoothed[top - 1] > floor) {
    --top;
  }
  while (bottom < depth_cells - 1 && smoothed[bottom + 1] > floor) {
    ++bottom;
  }
  std::uint64_t sum = 0;
  std::int64_t moment1 = 0;
  std::int64_t moment2 = 0;
  for (std::int32_t k = top; k <= bottom; ++k) {
    const std::int32_t offset = k - peak_k;
    const std::int64_t weighted = static_cast<std::int64_t>(hits[k]) * offset;
    sum += hits[k];
    moment1 += weighted;
    moment2 += weighted * offset;
  }
  if (sum == 0) {
    return ColumnDepth{kUnknownDepth, mass, false};
  }
  const auto total = static_cast<std::int64_t>(sum);
  const std::int64_t mean_q8 = moment1 * 256 / total;
  const std::int64_t variance_q16 =
      max_of<std::int64_t>(0, moment2 * 65536 / total - mean_q8 * mean_q8);
  const std::int64_t sigma_q8 = base::sqrt_u64(static_cast<std::uint64_t>(variance_q16));
  const std::int64_t wide_q8 = clamp<std::int64_t>((sigma_q8 * 7) >> 1, kNarrowest_q8, kWidest_q8);

  std::int64_t estimate_q8 = 256 * peak_k + 128 + mean_q8;
  const std::int64_t bottom_q8 = 256 * static_cast<std::int64_t>(depth_cells);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const std::int64_t window_q8 =
        max_of<std::int64_t>(256, min_of(wide_q8, min_of(estimate_q8, bottom_q8 - estimate_q8)));
    const std::int64_t window2 = window_q8 * window_q8;
    const auto first =
        static_cast<std::int32_t>(max_of<std::int64_t>(0, (estimate_q8 - window_q8) >> 8));
    const auto last = static_cast<std::int32_t>(
        min_of<std::int64_t>(depth_cells - 1, (estimate_q8 + window_q8) >> 8));
    std::int64_t weight_sum = 0;
    std::int64_t weight_moment = 0;
    for (std::int32_t k = first; k <= last; ++k) {
      const std::int64_t offset = 256 * static_cast<std::int64_t>(k) + 128 - estimate_q8;
      // 28 bits at most, shifted so that weight * offset * count stays within 63.
      const std::int64_t taper = max_of<std::int64_t>(0, window2 - offset * offset) >> 8;
      const std::int64_t weight = static_cast<std::int64_t>(hits[k]) * taper;
      weight_sum += weight;
      weight_moment += weight * offset;
    }
    if (weight_sum == 0) {
      break;
    }
    const std::int64_t move = weight_moment / weight_sum;
    estimate_q8 += move;
    if (move > -kSettled_q8 && move < kSettled_q8) {
      break;
    }
  }

  std::uint32_t second = 0;
  for (std::int32_t k = 0; k < top - 2; ++k) {
    second = max_of<std::uint32_t>(second, smoothed[k]);
  }
  for (std::int32_t k = bottom + 3; k < depth_cells; ++k) {
    second = max_of<std::uint32_t>(second, smoothed[k]);
  }
  return ColumnDepth{static_cast<std::int32_t>(estimate_q8), mass, 4 * second > peak};
}

bool rescale_column(Voxel* voxels, std::int32_t depth_cells) {
  std::uint32_t largest = 0;
  for (std::int32_t k = 0; k < depth_cells; ++k) {
    largest = max_of<std::uint32_t>(largest, max_of(voxels[k].hit, voxels[k].miss));
  }
  if (largest < kRescaleAbove) {
    return false;
  }
  for (std::int32_t k = 0; k < depth_cells; ++k) {
    const auto round = static_cast<std::uint32_t>(k & 1);
    voxels[k].hit = static_cast<std::uint16_t>((voxels[k].hit + round) >> 1U);
    voxels[k].miss = static_cast<std::uint16_t>((voxels[k].miss + round) >> 1U);
  }
  return true;
}

}  // namespace leadline::model
