#include "host_tools/table/first_return.hpp"

#include <algorithm>
#include <cmath>

#include "host_tools/table/table_math.hpp"

namespace leadline::host {
namespace {

constexpr double kHalfPi = 0.5 * exact::kPi;

double square(double x) { return x * x; }

}  // namespace

FirstReturn::FirstReturn(const BeamPattern& pattern, std::size_t axis, double detection_fraction)
    : fraction_(detection_fraction) {
  const std::size_t other = 1 - axis;
  const double in_plane_rad = pattern.envelope_rad(axis);
  const double sin_in_plane = exact::sin(in_plane_rad);
  const double cos_in_plane = exact::cos(in_plane_rad);
  const double v_end = exact::sin(pattern.envelope_rad(other));
  const double tan_other = exact::tan(pattern.envelope_rad(other));
  for (std::vector<double>& values : sum_) {
    values.assign(kRows * (kSteps + 1), 0.0);
  }
  slope_ = sum_;
  // Three-point Gauss-Legendre on every step.
  constexpr double kGaussX = 0.77459666924148337704;
  constexpr std::array<double, 3> kGaussAt = {0.5 * (1.0 - kGaussX), 0.5, 0.5 * (1.0 + kGaussX)};
  constexpr std::array<double, 3> kGaussWeight = {5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0};

  for (std::size_t row = 0; row < kRows; ++row) {
    // v = v_end sin(psi), equal steps of psi: the rows crowd where the envelope's outline is steep.
    const double psi = kHalfPi * (static_cast<double>(row) + 0.5) / static_cast<double>(kRows);
    const exact::SinCos turn = exact::sin_cos(psi);
    const double v = v_end * turn.sin;
    const double r = std::sqrt((1.0 - v) * (1.0 + v));
    // Axisymmetric: cos(reach) = cos(T) / r; the difference of squares keeps the digits of narrow
    // beams. Two axes: the tangent across the plane, v / (r cos a), ends at the envelope's.
    const double reach =
        pattern.two_axis()
            ? std::min(in_plane_rad, exact::acos(v / (r * tan_other)))
            : exact::atan2(std::sqrt(std::max(0.0, (sin_in_plane - v) * (sin_in_plane + v))),
                           cos_in_plane);
    const double step = reach / static_cast<double>(kSteps);
    rows_.push_back({r, reach, v_end * turn.cos, 1.0 / step});

    const auto integrands = [&](double a, double* out) {
      const exact::SinCos angle = exact::sin_cos(a);
      const double in_plane_cosine = r * angle.sin;
      const double energy =
          axis == 0 ? pattern.two_way(in_plane_cosine, v) : pattern.two_way(v, in_plane_cosine);
      const double tangent = angle.sin / angle.cos;
      out[kEnergy] = energy;
      out[kRadial] = energy * tangent;
      out[kRadial2] = energy * tangent * tangent;
      out[kTransverse2] = energy * square(v / (r * angle.cos));
    };
    double at_node[kMomentCount];
    integrands(0.0, at_node);
    for (std::size_t index = 0; index <= kSteps; ++index) {
      const std::size_t at = row * (kSteps + 1) + index;
      for (std::size_t moment = 0; moment < kMomentCount; ++moment) {
        slope_[moment][at] = at_node[moment] * step;
      }
      if (index == kSteps) {
        break;
      }
      double increment[kMomentCount] = {0.0, 0.0, 0.0, 0.0};
      const double from = step * static_cast<double>(index);
      for (std::size_t g = 0; g < kGaussAt.size(); ++g) {
        double inside[kMomentCount];
        integrands(from + step * kGaussAt[g], inside);
        for (std::size_t moment = 0; moment < kMomentCount; ++moment) {
          increment[moment] += kGaussWeight[g] * step * inside[moment];
        }
      }
      for (std::size_t moment = 0; moment < kMomentCount; ++moment) {
        sum_[moment][at + 1] = sum_[moment][at] + increment[moment];
      }
      integrands(step * static_cast<double>(index + 1), at_node);
    }
    total_ += 2.0 * rows_[row].weight * sum_[kEnergy][row * (kSteps + 1) + kSteps];
  }
  reach_rad_ = in_plane_rad;
  if (pattern.two_axis()) {
    // The corner of the rectangle of tangents.
    const double x = sin_in_plane / cos_in_plane;
    reach_rad_ = exact::atan2(std::sqrt(x * x + tan_other * tan_other), 1.0);
  }

  // cap(i) bends on the scale of the beam near normal incidence and is nearly straight farther out.
  scale_rad_ = reach_rad_;
  const double last_rad = std::min(exact::kPi, kHalfPi + 1.05 * reach_rad_);
  const double ratio = last_rad / scale_rad_;
  node_step_ = exact::log(ratio + std::sqrt(ratio * ratio + 1.0)) / static_cast<double>(kNodes - 1);
  node_cap_rad_.reserve(kNodes);
  for (std::size_t node = 0; node < kNodes; ++node) {
    const double grown = exact::exp_fast(node_step_ * static_cast<double>(node));
    const double incidence_rad = scale_rad_ * 0.5 * (grown - 1.0 / grown);
    node_cap_rad_.push_back(solve_cap_rad(std::min(incidence_rad, last_rad)));
  }
}

// Integral of a moment over 0 .. |a| of one row, a within the row's reach; cubic Hermite between
// steps.
double FirstReturn::cumulative(std::size_t moment, std::size_t row, double a) const {
  const double position = std::fabs(a) * rows_[row].inverse_step;
  const std::size_t cell = std::min(static_cast<std::size_t>(position), kSteps - 1);
  const double f = position - static_cast<double>(cell);
  const std::size_t at = row * (kSteps + 1) + cell;
  const double* const sum = &sum_[moment][at];
  const double* const slope = &slope_[moment][at];
  const double rise = sum[1] - sum[0];
  const double c2 = 3.0 * rise - 2.0 * slope[0] - slope[1];
  const double c3 = slope[0] + slope[1] - 2.0 * rise;
  return sum[0] + f * (slope[0] + f * (c2 + f * c3));
}

double FirstReturn::interval(std::size_t moment, double incidence_rad, double cap_rad) const {
  const double cos_cap = exact::cos(cap_rad);
  double sum = 0.0;
  for (std::size_t row = 0; row < kRows; ++row) {
    const Row& line = rows_[row];
    if (line.r <= cos_cap) {
      continue;
    }
    const double half_rad = exact::acos(cos_cap / line.r);
    // The integral from 0 to a: odd in a for even integrands, even for the radial one, which is
    // odd.
    const auto integral_to = [&](double a) {
      const double clipped = std::clamp(a, -line.reach, line.reach);
      const double value = cumulative(moment, row, clipped);
      return clipped < 0.0 && moment != kRadial ? -value : value;
    };
    double line_sum = integral_to(incidence_rad + half_rad) - integral_to(incidence_rad - half_rad);
    // A cap about a normal behind the sonar comes round to the other side.
    const double wrapped = incidence_rad + half_rad - 2.0 * exact::kPi;
    if (wrapped > -line.reach) {
      line_sum += integral_to(wrapped) - integral_to(-line.reach);
    }
    sum += line.weight * line_sum;
  }
  return sum;
}

double FirstReturn::arrived_fraction(double incidence_rad, double cap_rad) const {
  return interval(kEnergy, incidence_rad, cap_rad) / total_;
}

double FirstReturn::solve_cap_rad(double incidence_rad) const {
  // Ridders' method: the bracket always holds, and the order of convergence is two.
  double low = std::max(0.0, incidence_rad - reach_rad_);
  double high = std::min(exact::kPi, incidence_rad + reach_rad_ * (1.0 + 1e-9));
  double f_low = arrived_fraction(incidence_rad, low) - fraction_;
  double f_high = arrived_fraction(incidence_rad, high) - fraction_;
  if (f_low >= 0.0) {
    return low;
  }
  if (f_high <= 0.0) {
    return high;
  }
  const double tolerance_rad = 1e-10 * reach_rad_;
  double best = 0.5 * (low + high);
  for (int iteration = 0; iteration < 30 && high - low > tolerance_rad; ++iteration) {
    const double middle = 0.5 * (low + high);
    const double f_middle = arrived_fraction(incidence_rad, middle) - fraction_;
    if (f_middle == 0.0) {
      return middle;
    }
    const double root = std::sqrt(f_middle * f_middle - f_low * f_high);
    const double next = middle - (middle - low) * f_middle / root;  // f rises
    const double step = std::fabs(next - best);
    best = next;
    const double f_next = arrived_fraction(incidence_rad, next) - fraction_;
    if (f_next == 0.0 || step < tolerance_rad) {
      return next;
    }
    if (f_middle < 0.0) {
      low = middle;
      f_low = f_middle;
    } else {
      high = middle;
      f_high = f_middle;
    }
    if (f_next < 0.0 && next > low) {
      low = next;
      f_low = f_next;
    } else if (f_next > 0.0 && next < high) {
      high = next;
      f_high = f_next;
    }
  }
  return best;
}

double FirstReturn::cap_rad(double incidence_rad) const {
  const double ratio = incidence_rad / scale_rad_;
  const double position = exact::log(ratio + std::sqrt(ratio * ratio + 1.0)) / node_step_;
  const double last = static_cast<double>(kNodes - 1);
  if (position >= last) {
    return node_cap_rad_.back();
  }
  const std::size_t cell = static_cast<std::size_t>(position);
  const double f = position - static_cast<double>(cell);
  // Four points; the cap is even in the incidence, and so it goes on before node 0.
  const double before = node_cap_rad_[cell == 0 ? 1 : cell - 1];
  const double v0 = node_cap_rad_[cell];
  const double v1 = node_cap_rad_[cell + 1];
  const double after = cell + 2 < kNodes ? node_cap_rad_[cell + 2] : 2.0 * v1 - v0;
  return before * (-f * (f - 1.0) * (f - 2.0) / 6.0) +
         v0 * ((f + 1.0) * (f - 1.0) * (f - 2.0) / 2.0) + v1 * (-(f + 1.0) * f * (f - 2.0) / 2.0) +
         after * ((f + 1.0) * f * (f - 1.0) / 6.0);
}

FirstReturn::Patch FirstReturn::patch(double incidence_rad, double cap_rad) const {
  const double energy = interval(kEnergy, incidence_rad, cap_rad);
  if (energy <= 0.0) {
    return {0.0, 0.0, 0.0};
  }
  const double mean = interval(kRadial, incidence_rad, cap_rad) / energy;
  const double radial2 = interval(kRadial2, incidence_rad, cap_rad) / energy;
  const double transverse2 = interval(kTransverse2, incidence_rad, cap_rad) / energy;
  return {mean, std::max(0.0, radial2 - mean * mean), transverse2};
}

AveragedFirstReturn::AveragedFirstReturn(const BeamPattern& pattern, double detection_fraction,
                                         double sigma_pointing_rad)
    : sigma_rad_(sigma_pointing_rad) {
  const std::size_t count = pattern.two_axis() ? 2 : 1;
  for (std::size_t axis = 0; axis < count; ++axis) {
    geometry_.emplace_back(pattern, axis, detection_fraction);
  }
}

double AveragedFirstReturn::inverse_q0(std::size_t axis, double incidence_rad) const {
  // The floor comes after the interpolation, which would not survive the kink.
  return 1.0 / std::max(kMinReturnCosine, exact::cos(geometry(axis).cap_rad(incidence_rad)));
}

double AveragedFirstReturn::q(std::size_t axis, double incidence_rad) const {
  if (sigma_rad_ <= 0.0) {
    return 1.0 / inverse_q0(axis, incidence_rad);
  }
  // The incidence that really was has a Rice distribution about the nominal one.
  constexpr double kReach_sigma = 7.0;
  const double low = std::max(0.0, incidence_rad - kReach_sigma * sigma_rad_);
  const double high = incidence_rad + kReach_sigma * sigma_rad_;
  const double variance = sigma_rad_ * sigma_rad_;
  double weight_sum = 0.0;
  double sum = 0.0;
  for (const exact::Node& node : exact::gauss_nodes(low, high, 14)) {
    const double r = node.x;
    const double kappa = r * incidence_rad / variance;
    const double i0 = exact::bessel_i0e(kappa);
    const double weight =
        node.weight * r * exact::exp_fast(-square(r - incidence_rad) / (2.0 * variance)) * i0;
    double inverse = inverse_q0(axis, r);
    if (geometry_.size() == 2) {
      // Mean squared sine of the azimuth, given r: von Mises, I1(k) / (k I0(k)).
      const double turned = kappa < 1e-6 ? 0.5 : exact::bessel_i1e(kappa) / (kappa * i0);
      inverse += turned * (inverse_q0(1 - axis, r) - inverse);
    }
    weight_sum += weight;
    sum += weight * inverse;
  }
  return weight_sum / sum;
}

}  // namespace leadline::host
