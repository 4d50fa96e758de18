// A localization table from formulas that fit on one page, and the records around it, for tests that
// may link vehicle code only (the generator is host code) or that want geometry without surprises.
#pragma once

#include "model/base/ping.hpp"
#include "model/base/pose.hpp"
#include "model/config.hpp"
#include "model/localization_table.hpp"

namespace leadline::test {

/// What the plain table is made of.
struct PlainBeam {
  double half_angle_along_rad = 0.05;   ///< envelope
  double half_angle_across_rad = 0.05;  ///< of the other axis; ignored unless two_axis
  double sigma_pointing_rad = 0.01;
  std::uint32_t sigma_range_um = 500'000;
  bool two_axis = false;
};

/// Valid table of a beam whose range is that of its axis: excess and shift 0, so that a plane lies at
/// range * cos(incidence) exactly. Profiles exp(-m^2/2) in every class, beam weight 1 - x, kernels
/// Gaussian and tilted to a zero first moment.
[[nodiscard]] model::LocalizationTable plain_table(const PlainBeam& beam);

/// 1 m cells, `north` x `east` x `down` of them from the origin on; ranges 0.1 m to 500 m; no
/// position error; log-odds; no work budget.
[[nodiscard]] model::ModelConfig plain_config(std::int32_t north, std::int32_t east,
                                              std::int32_t down);

/// Side of the largest square of whole tiles, and the most cells of depth that north x east cells of whole
/// tiles have voxels for: what a target has memory for differs.
[[nodiscard]] std::int32_t widest_side_cells();
[[nodiscard]] std::int32_t deepest_cells(std::int32_t north, std::int32_t east);

/// Binary angle of `degrees`, rounded, any finite number of turns.
[[nodiscard]] base::Bam32 bam(double degrees);

/// A pose at (n, e, d) metres with every validity bit, level, heading north, no position error.
[[nodiscard]] base::Pose pose_at(double north_m, double east_m, double down_m);

/// A range ping of `range_m` along (azimuth, elevation) of the mount's frame; 90 degrees is down.
[[nodiscard]] base::Ping ping_along(double azimuth_deg, double elevation_deg, double range_m);

}  // namespace leadline::test
