#include "model/column_depth.hpp"

#include "model/base/fixed.hpp"

namespace leadline::model {
namespace {

using base::clamp;
using base::max_of;
using base::min_of;

// A voxel that was seen empty this many times more often than occupied is no surface.
constexpr std::uint32_t kVetoRatio = 4;
constexpr std::uint32_t kRescaleAbove = 49152;
constexpr int kIterations = 4;

std::uint32_t vetoed(const Voxel& voxel) {
  return voxel.miss > kVetoRatio * voxel.hit ? 0U : voxel.hit;
}

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
  return ColumnDepth{sum == 0 ? kUnknownDepth : static_cast<std::int32_t>(moment / sum), mass, false};
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

ColumnDepth column_depth(const Voxel* voxels, std::int32_t depth_cells, DepthMethod method) {
  // Two guard cells on either side so that smoothing needs no special cases.
  std::uint32_t padded[kMaxDepthCells + 4];
  std::uint32_t* const hits = padded + 2;
  padded[0] = padded[1] = 0;
  std::uint32_t mass = 0;
  for (std::int32_t k = 0; k < depth_cells; ++k) {
    hits[k] = vetoed(voxels[k]);
    mass += hits[k];
  }
  hits[depth_cells] = hits[depth_cells + 1] = 0;
  if (mass == 0) {
    return ColumnDepth{kUnknownDepth, 0, false};
  }
  if (method == DepthMethod::kFirstMoment) {
    return first_moment(voxels, depth_cells, mass);
  }
  if (method == DepthMethod::kUpperCrossing) {
    return upper_crossing(voxels, depth_cells, mass);
  }

  const auto smooth = [hits](std::int32_t k) {
    return hits[k - 2] + 2 * hits[k - 1] + 3 * hits[k] + 2 * hits[k + 1] + hits[k + 2];
  };
  std::uint32_t peak = 0;
  std::int32_t peak_k = 0;
  for (std::int32_t k = 0; k < depth_cells; ++k) {
    const std::uint32_t value = smooth(k);
    if (value > peak) {
      peak = value;
      peak_k = k;
    }
  }
  const std::uint32_t floor = peak / 10;
  std::int32_t top = peak_k;
  std::int32_t bottom = peak_k;
  while (top > 0 && smooth(top - 1) > floor) {
    --top;
  }
  while (bottom < depth_cells - 1 && smooth(bottom + 1) > floor) {
    ++bottom;
  }
  std::int64_t sum = 0;
  std::int64_t moment1 = 0;
  std::int64_t moment2 = 0;
  for (std::int32_t k = top; k <= bottom; ++k) {
    const std::int64_t offset = k - peak_k;
    const std::int64_t weight = hits[k];
    sum += weight;
    moment1 += weight * offset;
    moment2 += weight * offset * offset;
  }
  if (sum == 0) {
    return ColumnDepth{kUnknownDepth, mass, false};
  }
  const std::int64_t mean_q8 = moment1 * 256 / sum;
  const std::int64_t variance_q16 = max_of<std::int64_t>(0, moment2 * 65536 / sum - mean_q8 * mean_q8);
  const std::int64_t sigma_q8 = base::sqrt_u64(static_cast<std::uint64_t>(variance_q16));
  const std::int64_t wide_q8 = clamp<std::int64_t>((sigma_q8 * 7) >> 1, 3 * 256, 64 * 256);

  std::int64_t estimate_q8 = 256 * peak_k + 128 + mean_q8;
  const std::int64_t bottom_q8 = 256 * static_cast<std::int64_t>(depth_cells);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const std::int64_t window_q8 = max_of<std::int64_t>(
        256, min_of(wide_q8, min_of(estimate_q8, bottom_q8 - estimate_q8)));
    const std::int64_t window2 = window_q8 * window_q8;
    const auto first = static_cast<std::int32_t>(max_of<std::int64_t>(0, (estimate_q8 - window_q8) >> 8));
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
    if (move == 0) {
      break;
    }
  }

  bool multi = false;
  for (std::int32_t k = 0; k < depth_cells; ++k) {
    const bool apart = k < top - 2 || k > bottom + 2;
    multi = multi || (apart && 4 * smooth(k) > peak);
  }
  return ColumnDepth{static_cast<std::int32_t>(estimate_q8), mass, multi};
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
