// Lateral weight of an event: the beam's two-way pattern, blurred by the Gaussian errors of
// pointing and position. Both are densities over the plane of tan(off-axis angle), scaled to a
// total variance of one per axis, so that one curve serves every range; what remains is the share
// of the beam in the variance.
//
// Same numbers on every host: see table_math.hpp.
#pragma once

#include <cstddef>
#include <vector>

#include "host_tools/table/beam_pattern.hpp"

namespace leadline::host {

/// The curve for one axis of a beam. Axisymmetric beams: radial, by a two-dimensional convolution;
/// two axes: along that axis, by a one-dimensional convolution of the axis's own factor.
class BeamProfile {
 public:
  /// `beam_share`: beam variance / total variance, 0 (Gaussian alone) to 1 (beam alone). `pattern`
  /// must outlive this object.
  BeamProfile(const BeamPattern& pattern, std::size_t axis, double beam_share);

  /// Weight at `m` standard deviations of the whole, m >= 0; 1 at 0. About 10 us.
  [[nodiscard]] double weight(double m) const { return unscaled(m) / peak_; }

  /// Where the beam alone ends, in its own standard deviations: the only jump, and only of share 1.
  [[nodiscard]] double edge_m() const { return edge_m_; }

 private:
  struct Sample {
    double m;  ///< off axis, in standard deviations of the whole
    double energy;
  };

  [[nodiscard]] double unscaled(double m) const;
  [[nodiscard]] double beam_density(double m) const;

  const BeamPattern* pattern_;
  std::size_t axis_;
  double beam_share_;
  double sigma_tan_;
  double edge_m_;
  double peak_ = 1.0;
  std::vector<Sample> samples_;
};

}  // namespace leadline::host
