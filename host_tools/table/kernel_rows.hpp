// Range blur along a column: the Gaussian taps that the table stores, as real numbers and as
// integers.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/localization_table.hpp"

namespace leadline::host {

/// One row of taps; tap j lies at j - 6.5 - phase cells from the shell.
struct KernelTaps {
  std::array<double, model::kKernelTaps> tap;  ///< sum 1
  std::size_t first;                           ///< first tap within the cut
  std::size_t count;
};

/// Variance of a kernel level, cells^2: 0.25 * 2^(level/4).
[[nodiscard]] double kernel_variance(std::size_t level);
/// Half-width of the cut for a variance, cells: max(1.5, min(2 sigma, 7)).
[[nodiscard]] double kernel_cut(double variance);

/// Gaussian of `variance` cells^2 sampled at the voxel centres within the cut, tilted (times e^(k
/// x)) so that its first moment about the shell is zero, sum 1. `phase`: where in its voxel the
/// shell lies, 0 to 1.
[[nodiscard]] KernelTaps kernel_taps(double variance, double phase);

struct KernelRow {
  std::array<std::int16_t, model::kKernelTaps> tap_q15;
  std::uint8_t first;
  std::uint8_t count;
  double moment;  ///< first moment that rounding leaves, cells
};

/// Row [level][phase] of the table: kernel_taps at phase (p + 0.5) / 16 in integers that sum to
/// kKernelSum, with units moved between neighbours until the first moment is as small as it gets: a
/// unit moved changes it by a whole cell-unit, and it is a whole number of those, so that it is
/// zero.
[[nodiscard]] KernelRow kernel_row(std::size_t level, std::size_t phase_index);

/// Largest difference of a tap, in units of 1 / kKernelSum, between the row that the vehicle takes
/// and kernel_taps at the true phase, over all phases that take this row: what 16 phases cost.
[[nodiscard]] double kernel_row_error(std::size_t level, std::size_t phase_index,
                                      const KernelRow& row);

}  // namespace leadline::host
