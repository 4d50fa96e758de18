// Where on a sloping bottom a sonar measures its range: geometry of the first return on a plane.
//
// A plane at perpendicular distance d whose normal is inclined by i to the beam axis: a ray whose
// direction makes the angle n with the normal meets it at range d / cos n. The echo therefore
// arrives in the order of n, and "the fraction f of the echo has arrived" means that a cap of
// directions about the normal, of half-angle n0(i), holds the fraction f of the beam's two-way
// energy. The cap is integrated in the coordinates v (direction cosine across the plane of
// incidence) and a (angle in that plane), in which solid angle is dv da exactly: for a given v it
// is the interval |a - i| <= acos(cos n / sqrt(1 - v^2)), and the energy in it is a difference of
// two cumulative sums. That gives n0 to 5e-4 of the beam's half-angle where the plane faces the
// beam, to 1e-5 on slopes.
//
// Same numbers on every host: see table_math.hpp.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "host_tools/table/beam_pattern.hpp"

namespace leadline::host {

/// Rays nearer to grazing than this cosine do not return: keeps the mean of 1/cos finite.
inline constexpr double kMinReturnCosine = 0.02;

/// The first return of one beam for planes inclined in one of its axes, without pointing error.
class FirstReturn {
 public:
  /// `axis`: plane of incidence, 0 along, 1 across. 10 to 40 ms.
  FirstReturn(const BeamPattern& pattern, std::size_t axis, double detection_fraction);

  /// Half-angle of the cap about the plane's normal that holds the detection fraction, solved at
  /// this incidence (rad, 0 .. pi). About 0.1 ms.
  [[nodiscard]] double solve_cap_rad(double incidence_rad) const;
  /// The same, interpolated from nodes (error below 5e-4 of the half-angle); 0 <= incidence_rad,
  /// beyond the last node that node's value. About 0.1 us.
  [[nodiscard]] double cap_rad(double incidence_rad) const;

  /// Share of the beam's energy within the cap, 0 .. 1.
  [[nodiscard]] double arrived_fraction(double incidence_rad, double cap_rad) const;

  /// What has echoed when the cap has grown to `cap_rad`, in tan units about the beam axis: means
  /// and variances in the plane of incidence and across it.
  struct Patch {
    double mean_radial;
    double variance_radial;
    double variance_transverse;
  };
  [[nodiscard]] Patch patch(double incidence_rad, double cap_rad) const;

 private:
  // Energy, and energy times tan, tan^2 of the radial and square of the transverse coordinate.
  enum Moment : std::size_t { kEnergy, kRadial, kRadial2, kTransverse2, kMomentCount };

  struct Row {
    double r;       ///< sqrt(1 - v^2)
    double reach;   ///< the envelope is |a| <= reach
    double weight;  ///< dv
    double inverse_step;
  };

  [[nodiscard]] double cumulative(std::size_t moment, std::size_t row, double a) const;
  [[nodiscard]] double interval(std::size_t moment, double incidence_rad, double cap_rad) const;

  static constexpr std::size_t kRows = 128;
  static constexpr std::size_t kSteps = 128;
  static constexpr std::size_t kNodes = 256;

  std::vector<Row> rows_;
  /// [moment][row][step]: integral from a = 0 and integrand times the step.
  std::array<std::vector<double>, kMomentCount> sum_;
  std::array<std::vector<double>, kMomentCount> slope_;
  double total_ = 0.0;
  double fraction_;
  double reach_rad_ = 0.0;  ///< farthest direction of the envelope from the axis
  double scale_rad_;        ///< nodes lie at scale * sinh(step * index)
  double node_step_;
  std::vector<double> node_cap_rad_;
};

/// First return averaged over the pointing error (isotropic, Gaussian, sigma per axis about the
/// nominal axis) for one beam; both planes of incidence.
class AveragedFirstReturn {
 public:
  AveragedFirstReturn(const BeamPattern& pattern, double detection_fraction,
                      double sigma_pointing_rad);

  /// q(i) = 1 / E[1 / q0], q0 = cos of the cap, at least kMinReturnCosine: perpendicular distance
  /// of the plane over the range that is measured on average. Pointing error turns the plane of
  /// incidence as well; between the axes 1 / q0 goes with the squared cosine of the azimuth. About
  /// 30 us.
  [[nodiscard]] double q(std::size_t axis, double incidence_rad) const;

  [[nodiscard]] const FirstReturn& geometry(std::size_t axis) const {
    return geometry_[axis < geometry_.size() ? axis : 0];
  }

 private:
  [[nodiscard]] double inverse_q0(std::size_t axis, double incidence_rad) const;

  std::vector<FirstReturn> geometry_;  ///< one when axisymmetric
  double sigma_rad_;
};

}  // namespace leadline::host
