#include "host_tools/table/beam_profile.hpp"

#include <cmath>

#include "host_tools/table/table_math.hpp"

namespace leadline::host {
namespace {

double gauss(double x, double variance) { return exact::exp_fast(-x * x / (2.0 * variance)); }

}  // namespace

BeamProfile::BeamProfile(const BeamPattern& pattern, std::size_t axis, double beam_share)
    : pattern_(&pattern),
      axis_(axis),
      beam_share_(beam_share),
      sigma_tan_(std::sqrt(pattern.variance(axis))),
      edge_m_(exact::tan(pattern.envelope_rad(axis)) / sigma_tan_) {
  const double scale = std::sqrt(beam_share) / sigma_tan_;
  for (const exact::Node& node : exact::gauss_nodes(0.0, pattern.envelope_rad(axis), 20)) {
    const exact::SinCos t = exact::sin_cos(node.x);
    const double ring = pattern.two_axis() ? 1.0 : t.sin;
    const double energy = node.weight * ring * pattern.axis_two_way(axis, t.sin);
    samples_.push_back({scale * t.sin / t.cos, energy});
  }
  peak_ = unscaled(0.0);
}

double BeamProfile::beam_density(double m) const {
  if (m > edge_m_) {
    return 0.0;
  }
  // Energy per solid angle (per angle, for one axis of two) over the plane of tangents.
  const double tangent = m * sigma_tan_;
  const double cos2 = 1.0 / (1.0 + tangent * tangent);
  const double cosine = std::sqrt(cos2);
  const double area = pattern_->two_axis() ? cos2 : cos2 * cosine;
  return area * pattern_->axis_two_way(axis_, tangent * cosine);
}

double BeamProfile::unscaled(double m) const {
  if (beam_share_ <= 0.0) {
    return gauss(m, 1.0);
  }
  if (beam_share_ >= 1.0) {
    return beam_density(m);
  }
  const double variance = 1.0 - beam_share_;
  double sum = 0.0;
  for (const Sample& sample : samples_) {
    if (pattern_->two_axis()) {
      sum += sample.energy * (gauss(m - sample.m, variance) + gauss(m + sample.m, variance));
    } else {
      sum += sample.energy * gauss(m - sample.m, variance) *
             exact::bessel_i0e(m * sample.m / variance);
    }
  }
  return sum;
}

}  // namespace leadline::host
