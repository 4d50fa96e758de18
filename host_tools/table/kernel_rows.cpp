#include "host_tools/table/kernel_rows.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <vector>

#include "host_tools/table/table_math.hpp"

namespace leadline::host {
namespace {

constexpr std::size_t kTaps = model::kKernelTaps;
constexpr double kSum = model::kKernelSum;
constexpr double kPhases = model::kKernelPhases;

double tap_offset(std::size_t tap, double phase) {
  return static_cast<double>(tap) - (model::kKernelCentre - 0.5) - phase;
}

double phase_of(std::size_t phase_index) {
  return (static_cast<double>(phase_index) + 0.5) / kPhases;
}

}  // namespace

double kernel_variance(std::size_t level) {
  // Powers of the fourth root of two, by square roots and doublings: the same bits everywhere.
  const double root2 = std::sqrt(2.0);
  const double root4 = std::sqrt(root2);
  const std::array<double, 4> quarter = {1.0, root4, root2, root2 * root4};
  double variance = 0.25 * quarter[level % 4];
  for (std::size_t i = 0; i < level / 4; ++i) {
    variance *= 2.0;
  }
  return variance;
}

double kernel_cut(double variance) {
  return std::max(1.5, std::min(2.0 * std::sqrt(variance), 7.0));
}

KernelTaps kernel_taps(double variance, double phase) {
  KernelTaps row{};
  const double cut = kernel_cut(variance);
  std::array<double, kTaps> plain{};
  row.first = kTaps;
  for (std::size_t tap = 0; tap < kTaps; ++tap) {
    const double x = tap_offset(tap, phase);
    if (std::fabs(x) > cut) {
      continue;
    }
    plain[tap] = exact::exp_fast(-x * x / (2.0 * variance));
    row.first = std::min(row.first, tap);
    row.count = tap - row.first + 1;
  }
  // The first moment of plain * e^(tilt x) rises with the tilt and has a zero, because there are
  // taps on both sides of the shell: Newton's iteration.
  double tilt = 0.0;
  for (int iteration = 0; iteration < 30; ++iteration) {
    double moment = 0.0;
    double moment2 = 0.0;
    double sum = 0.0;
    for (std::size_t tap = row.first; tap < row.first + row.count; ++tap) {
      const double x = tap_offset(tap, phase);
      row.tap[tap] = plain[tap] * exact::exp_fast(tilt * x);
      sum += row.tap[tap];
      moment += row.tap[tap] * x;
      moment2 += row.tap[tap] * x * x;
    }
    const double step = moment / moment2;
    if (std::fabs(step) < 1e-13 || iteration == 29) {
      for (double& tap : row.tap) {
        tap /= sum;
      }
      break;
    }
    tilt -= step;
  }
  return row;
}

KernelRow kernel_row(std::size_t level, std::size_t phase_index) {
  const KernelTaps exact_row = kernel_taps(kernel_variance(level), phase_of(phase_index));
  const std::size_t end = exact_row.first + exact_row.count;
  std::array<std::int64_t, kTaps> tap{};
  const auto error = [&](std::size_t at) {
    return static_cast<double>(tap[at]) - kSum * exact_row.tap[at];
  };

  // Largest remainder: round down, then hand the missing units to the taps that lost most.
  std::int64_t missing = model::kKernelSum;
  for (std::size_t at = exact_row.first; at < end; ++at) {
    tap[at] = static_cast<std::int64_t>(std::floor(kSum * exact_row.tap[at]));
    missing -= tap[at];
  }
  for (; missing > 0; --missing) {
    std::size_t best = exact_row.first;
    for (std::size_t at = exact_row.first; at < end; ++at) {
      best = error(at) < error(best) ? at : best;
    }
    tap[best] += 1;
  }
  // Moving one unit to the next tap changes the first moment by one unit times one cell. Offsets
  // are odd multiples of 1/32 cell, so that the moment is an integer in those.
  const auto moment_32 = [&] {
    std::int64_t sum = 0;
    for (std::size_t at = 0; at < kTaps; ++at) {
      sum += tap[at] * (32 * static_cast<std::int64_t>(at) - 32 * model::kKernelCentre + 16 -
                        2 * static_cast<std::int64_t>(phase_index) - 1);
    }
    return sum;
  };
  for (std::int64_t moment = moment_32(); moment > 16 || moment < -16; moment = moment_32()) {
    std::size_t best = exact_row.first;
    double best_cost = 0.0;
    for (std::size_t at = exact_row.first; at + 1 < end; ++at) {
      // Squared error after the move, less that before it.
      const double left = error(at);
      const double right = error(at + 1);
      const double cost = moment > 0 ? 2.0 * (left - right) : 2.0 * (right - left);
      if (at == exact_row.first || cost < best_cost) {
        best = at;
        best_cost = cost;
      }
    }
    const std::int64_t to_right = moment > 0 ? -1 : 1;
    tap[best] -= to_right;
    tap[best + 1] += to_right;
  }

  KernelRow row{};
  row.first = static_cast<std::uint8_t>(exact_row.first);
  row.count = static_cast<std::uint8_t>(exact_row.count);
  for (std::size_t at = 0; at < kTaps; ++at) {
    row.tap_q15[at] = static_cast<std::int16_t>(tap[at]);
  }
  row.moment = static_cast<double>(moment_32()) / (32.0 * kSum);
  return row;
}

double kernel_row_error(std::size_t level, std::size_t phase_index, const KernelRow& row) {
  const double variance = kernel_variance(level);
  const double from = static_cast<double>(phase_index) / kPhases;
  const double to = static_cast<double>(phase_index + 1) / kPhases;
  std::vector<double> phases;
  for (int i = 0; i <= 8; ++i) {
    phases.push_back(from + (to - from) * i / 8.0);
  }
  // Where a tap crosses the cut, it appears or vanishes: both sides of that phase.
  const double cut = kernel_cut(variance);
  for (std::size_t tap = 0; tap < kTaps; ++tap) {
    for (const double side : {-cut, cut}) {
      const double phase = tap_offset(tap, 0.0) - side;
      for (const double near : {phase - 1e-9, phase + 1e-9}) {
        if (near > from && near < to) {
          phases.push_back(near);
        }
      }
    }
  }
  double worst = 0.0;
  for (const double phase : phases) {
    const KernelTaps taps = kernel_taps(variance, phase);
    for (std::size_t tap = 0; tap < kTaps; ++tap) {
      worst = std::max(worst, std::fabs(row.tap_q15[tap] - kSum * taps.tap[tap]));
    }
  }
  return worst;
}

}  // namespace leadline::host
