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

// Runs of a column that are looked at.
constexpr int kRuns = 4;
// No kernel is narrower than half a cell.
constexpr std::int64_t kLeastSigma_q8 = 128;
// A ping that passes adds half of what one that ends adds.
constexpr std::uint64_t kPassedFactor = 2;
// A run this many times lower than the highest is not looked at.
constexpr std::uint32_t kNegligible = 128;

// How far smoothing carries evidence.
constexpr std::int32_t kSmoothReach = 2;

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
                     false, 0};
}

ColumnDepth upper_crossing(const Voxel* voxels, std::int32_t depth_cells, std::uint32_t mass) {
  constexpr std::int32_t kHalf_q8 = 128;
  std::int32_t before = kHalf_q8;
  for (std::int32_t k = 0; k < depth_cells; ++k) {
    const std::int32_t s = signal_q8(voxels[k]);
    if (s > kHalf_q8) {
      const std::int32_t back = before < kHalf_q8 ? 256 * (s - kHalf_q8) / (s - before) : 0;
      return ColumnDepth{256 * k + 128 - back, mass, false, 0};
    }
    before = s;
  }
  return ColumnDepth{kUnknownDepth, mass, false, 0};
}

// Where evidence stands together in a column.
struct Run {
  std::int32_t top, bottom, peak_k;
  std::int64_t sum;      // of evidence
  std::int64_t mean_q8;  // from the middle of voxel peak_k
  std::int64_t sigma_q8;
};

// The run around the highest of what is left in `smoothed`.
Run find_run(const std::uint16_t* hits, const std::uint16_t* smoothed, std::int32_t depth_cells,
             std::uint32_t peak) {
  Run run{};
  while (smoothed[run.peak_k] != peak) {
    ++run.peak_k;
  }
  const std::uint32_t floor = peak / 10;
  run.top = run.peak_k;
  run.bottom = run.peak_k;
  while (run.top > 0 && smoothed[run.top - 1] > floor) {
    --run.top;
  }
  while (run.bottom < depth_cells - 1 && smoothed[run.bottom + 1] > floor) {
    ++run.bottom;
  }
  std::int64_t moment1 = 0;
  std::int64_t moment2 = 0;
  for (std::int32_t k = run.top; k <= run.bottom; ++k) {
    const std::int32_t offset = k - run.peak_k;
    const std::int64_t weighted = static_cast<std::int64_t>(hits[k]) * offset;
    run.sum += hits[k];
    moment1 += weighted;
    moment2 += weighted * offset;
  }
  if (run.sum == 0) {
    return run;
  }
  run.mean_q8 = base::quotient(moment1 * 256, run.sum);
  const std::int64_t variance_q16 =
      max_of<std::int64_t>(0, base::quotient(moment2 * 65536, run.sum) - run.mean_q8 * run.mean_q8);
  run.sigma_q8 = base::sqrt_u64(static_cast<std::uint64_t>(variance_q16));
  return run;
}

// How credible a run is among those of its column: evidence x width x hit / (hit + 2 miss). Evidence adds
// up precision, and a near false echo is precise; times the width it stands for pings. What went through a
// run speaks against it. Below 2^56.
std::uint64_t credibility(const Run& run, const Voxel* voxels, const std::uint16_t* hits) {
  std::uint64_t hit = 0;  // means over the run, weighted by evidence; below 2^42
  std::uint64_t miss = 0;
  for (std::int32_t k = run.top; k <= run.bottom; ++k) {
    hit += static_cast<std::uint64_t>(hits[k]) * hits[k];
    miss += static_cast<std::uint64_t>(hits[k]) * voxels[k].miss;
  }
  const std::uint64_t share_q12 =
      (hit << 12U) / max_of<std::uint64_t>(hit + kPassedFactor * miss, 1);
  const auto stands_for =
      static_cast<std::uint64_t>(run.sum * max_of(run.sigma_q8, kLeastSigma_q8)) >> 4U;
  return stands_for * share_q12;
}

struct Choice {
  Run best;
  bool rivalled;  // a second run, apart from it, a quarter as credible
};

// 15 bits, signed: there is an instruction for it.
std::uint32_t highest(const std::uint16_t* smoothed, std::int32_t depth_cells) {
  std::int16_t peak = 0;
  for (std::int32_t k = 0; k < depth_cells; ++k) {
    peak = max_of(peak, static_cast<std::int16_t>(smoothed[k]));
  }
  return static_cast<std::uint32_t>(peak);
}

// Clears a run and its tails, down to where they rise again or end.
void clear_hill(std::uint16_t* smoothed, std::int32_t depth_cells, const Run& run) {
  std::int32_t top = run.top;
  while (top > 0 && smoothed[top] != 0 && smoothed[top - 1] <= smoothed[top]) {
    --top;
  }
  std::int32_t bottom = run.bottom;
  while (bottom < depth_cells - 1 && smoothed[bottom] != 0 &&
         smoothed[bottom + 1] <= smoothed[bottom]) {
    ++bottom;
  }
  for (std::int32_t k = top; k <= bottom; ++k) {
    smoothed[k] = 0;
  }
}

// Clears the runs that it has seen in `smoothed`, whose highest is `first_peak`, not 0.
Choice choose_run(const Voxel* voxels, const std::uint16_t* hits, std::uint16_t* smoothed,
                  std::int32_t depth_cells, std::uint32_t first_peak) {
  // What is left to look at beside `run`, its highest; 0: nothing.
  const auto left_beside = [=](const Run& run) {
    clear_hill(smoothed, depth_cells, run);
    const std::uint32_t rest = highest(smoothed, depth_cells);
    return rest * kNegligible < first_peak ? 0 : rest;
  };
  const Run first = find_run(hits, smoothed, depth_cells, first_peak);
  std::uint32_t peak = left_beside(first);
  if (peak == 0) {
    // Most columns have one run: nothing to weigh.
    return Choice{first, false};
  }
  Run runs[kRuns] = {first};
  std::uint64_t scores[kRuns] = {credibility(first, voxels, hits)};
  int count = 1;
  int best = 0;
  for (; count < kRuns && peak != 0; ++count) {
    runs[count] = find_run(hits, smoothed, depth_cells, peak);
    peak = left_beside(runs[count]);
    scores[count] = credibility(runs[count], voxels, hits);
    best = scores[count] > scores[best] ? count : best;
  }
  Choice choice{runs[best], false};
  for (int i = 0; i < count; ++i) {
    const bool apart =
        runs[i].peak_k < choice.best.top - 2 || runs[i].peak_k > choice.best.bottom + 2;
    choice.rivalled = choice.rivalled || (apart && 4 * scores[i] > scores[best]);
  }
  return choice;
}

}  // namespace

ColumnDepth column_depth(const Voxel* column_voxels, std::int32_t column_cells, DepthMethod method,
                         Rule rule) {
  std::uint16_t padded[kMaxDepthCells + 2 * kProfileGuard];
  std::uint16_t smoothed[kMaxDepthCells + 8];
  std::uint16_t* const hits = padded + kProfileGuard;
  // Where no hit is there is no evidence: most of a deep column. Below, cells count from `above` on.
  const HitSpan span = hit_span(column_voxels, column_cells);
  const std::int32_t above = max_of(span.first - kSmoothReach, 0);
  const std::int32_t depth_cells = min_of(span.end + kSmoothReach, column_cells) - above;
  if (span.first >= span.end) {
    return ColumnDepth{kUnknownDepth, 0, false, 0};
  }
  const Voxel* const voxels = column_voxels + above;
  const ProfileSummary profile = gather_profile(voxels, depth_cells, rule, hits, smoothed);
  const std::uint32_t mass = profile.mass;
  const std::uint32_t peak = profile.peak;
  if (mass == 0) {
    return ColumnDepth{kUnknownDepth, 0, false, 0};
  }
  if (method == DepthMethod::kFirstMoment) {
    return first_moment(column_voxels, column_cells, mass);
  }
  if (method == DepthMethod::kUpperCrossing) {
    return upper_crossing(column_voxels, column_cells, mass);
  }

  const Choice choice = choose_run(voxels, hits, smoothed, depth_cells, peak);
  const Run& run = choice.best;
  if (run.sum == 0) {
    return ColumnDepth{kUnknownDepth, mass, false, 0};
  }
  const std::int64_t wide_q8 =
      clamp<std::int64_t>((run.sigma_q8 * 7) >> 1, kNarrowest_q8, kWidest_q8);

  std::int64_t estimate_q8 =
      256 * static_cast<std::int64_t>(above + run.peak_k) + 128 + run.mean_q8;
  const std::int64_t bottom_q8 = 256 * static_cast<std::int64_t>(column_cells);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const std::int64_t window_q8 =
        max_of<std::int64_t>(256, min_of(wide_q8, min_of(estimate_q8, bottom_q8 - estimate_q8)));
    const std::int64_t window2 = window_q8 * window_q8;
    const std::int32_t first =
        max_of(above, static_cast<std::int32_t>((estimate_q8 - window_q8) >> 8));
    const std::int32_t last =
        min_of(above + depth_cells - 1, static_cast<std::int32_t>((estimate_q8 + window_q8) >> 8));
    std::int64_t weight_sum = 0;
    std::int64_t weight_moment = 0;
    for (std::int32_t k = first; k <= last; ++k) {
      const std::int64_t offset = 256 * static_cast<std::int64_t>(k) + 128 - estimate_q8;
      // 28 bits at most, shifted so that weight * offset * count stays within 63.
      const std::int64_t taper = max_of<std::int64_t>(0, window2 - offset * offset) >> 8;
      const std::int64_t weight = static_cast<std::int64_t>(hits[k - above]) * taper;
      weight_sum += weight;
      weight_moment += weight * offset;
    }
    if (weight_sum == 0) {
      break;
    }
    const std::int64_t move = base::quotient(weight_moment, weight_sum);
    estimate_q8 += move;
    if (move > -kSettled_q8 && move < kSettled_q8) {
      break;
    }
  }

  const std::int64_t variance_q16 =
      max_of(run.sigma_q8, kLeastSigma_q8) * max_of(run.sigma_q8, kLeastSigma_q8);
  const auto support_q4 =
      static_cast<std::uint32_t>(min_of<std::int64_t>((run.sum * variance_q16) >> 12, UINT32_MAX));
  return ColumnDepth{static_cast<std::int32_t>(estimate_q8), mass, choice.rivalled, support_q4};
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
