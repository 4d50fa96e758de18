// A sonar's beam: from what a data sheet says to the two-way pattern, cut where the localization
// table ends.
//
// The cut (method 1.1): at the second null of the pattern, so that the first sidelobe is inside;
// where no second null exists below 90 degrees, at the first angle where the two-way pattern falls
// under -30 dB; `max_half_angle_deg` caps either, and kMaxEnvelope_deg caps everything. What lies
// outside is the discarded energy. A cone ends by itself.
//
// Same numbers on every host: see table_math.hpp.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "host_tools/map_config.hpp"
#include "model/localization_table.hpp"

namespace leadline::host {

/// Widest envelope of a table, off axis: beyond it the tangents, in which the vehicle computes,
/// grow without bound. Energy outside counts as discarded.
inline constexpr double kMaxEnvelope_deg = 80.0;
/// Narrowest: 0.01 degrees is a tenth of the narrowest sonar beam built.
inline constexpr double kMinEnvelope_deg = 0.01;

/// One row of a measured pattern.
struct PatternRow {
  double off_axis_deg;  ///< 0 .. 90, ascending
  double two_way_db;    ///< relative to the axis, -300 .. 0
};

/// A beam as the data sheet describes it. Only the fields of its `kind` are read.
struct BeamDescription {
  model::BeamKind kind = model::BeamKind::kCone;
  /// kCone: two-way weight (cos t - cos T) / (1 - cos T), T this angle; 0.01 .. 90.
  double half_angle_deg = 3.0;
  /// kPiston: one-way |2 J1(u) / u|^2, u = pi D/L sin t, two-way its square; 1 .. 10,000.
  double piston_diameter_mm = 0.0;
  /// kRectangle: one-way sinc^2(pi A/L s) per axis, s the direction cosine along that axis, two-way
  /// the square of the product; 1 .. 10,000.
  double aperture_along_mm = 0.0;
  double aperture_across_mm = 0.0;
  double frequency_hz = 0.0;                 ///< kPiston, kRectangle; 100 .. 1e8
  double sound_speed_mm_s = 1500000.0;       ///< kPiston, kRectangle; 2e5 .. 6e6
  std::vector<PatternRow> rows;              ///< kMeasured, see parse_pattern()
  std::optional<double> max_half_angle_deg;  ///< any kind; over 0 .. 90
  double sigma_pointing_deg = 0.0;           ///< per axis, isotropic; 0 .. 45
  double sigma_range_mm = 0.0;               ///< 0 .. 1e6
  double detection_fraction = 0.1;  ///< share of the echo at which the head fires; over 0, below 1
};

/// Reads a measured pattern. Text; `#` starts a comment, empty lines are skipped. An optional first
/// row, the word `one_way` or `two_way` (the default), says what the levels are: one-way levels are
/// doubled. Every other row is `off_axis_deg level_db`, separated by blanks or one comma; angles
/// ascend from 0 and end at 90 or before, levels are relative to the axis (row 0 may have any
/// level, it is subtracted), and none exceeds it. 2 to 10,000 rows. Between rows the level in dB is
/// linear in the square of the angle, as a main lobe is; after the last row the beam is taken to be
/// silent. Throws HostError kUsage as `NAME:LINE: value: reason`.
[[nodiscard]] std::vector<PatternRow> parse_pattern(std::string_view text, const std::string& name);
/// The same from a file (kUsage when it cannot be read: it is part of the configuration).
[[nodiscard]] std::vector<PatternRow> load_pattern(const std::string& path);

/// The description in a survey's configuration; reads the pattern file where there is one.
[[nodiscard]] BeamDescription beam_description(const SonarConfig& sonar);

/// Why the envelope ends where it does.
enum class BeamCut {
  kConeEdge,       ///< the cone's weight is zero there
  kSecondNull,     ///< second null of the pattern
  kMinus30dB,      ///< first fall under -30 dB two-way
  kEndOfPattern,   ///< last row of a measured pattern, still above -30 dB
  kMaxHalfAngle,   ///< max_half_angle_deg
  kWidestEnvelope  ///< kMaxEnvelope_deg
};
[[nodiscard]] const char* beam_cut_text(BeamCut cut);

/// The two-way pattern. Immutable, reentrant.
class BeamPattern {
 public:
  /// Throws HostError kUsage naming the value that is outside its limits.
  explicit BeamPattern(const BeamDescription& beam);

  /// Two-way intensity, 1 on the axis, towards the direction with these direction cosines along the
  /// two axes (sum of squares at most 1). The cut is not applied.
  [[nodiscard]] double two_way(double cosine_along, double cosine_across) const;
  /// The factor of one axis (0 along, 1 across); of an axisymmetric beam, the pattern itself.
  [[nodiscard]] double axis_two_way(std::size_t axis, double direction_cosine) const;

  [[nodiscard]] bool two_axis() const { return beam_.kind == model::BeamKind::kRectangle; }
  /// Half-angle of the cut along axis 0 or 1, equal when axisymmetric. The envelope of two axes is
  /// the rectangle of tangents, as on a flat bottom.
  [[nodiscard]] double envelope_rad(std::size_t axis) const { return envelope_rad_[axis]; }
  [[nodiscard]] BeamCut cut(std::size_t axis) const { return cut_[axis]; }
  /// Share of the two-way energy over the hemisphere that lies outside the envelope, 0 .. 1.
  /// Sidelobes after the 20th (piston) or the 32nd (rectangle) are left out: under 0.2 ppm.
  [[nodiscard]] double discarded_fraction() const { return discarded_fraction_; }
  /// Second moment of tan(off-axis angle) along one axis over the energy inside the envelope.
  /// Axisymmetric: half of E[tan^2]; two-axis: over the axis's own factor, as density per angle.
  [[nodiscard]] double variance(std::size_t axis) const { return variance_[axis]; }

 private:
  void choose_cut(std::size_t axis);
  double radial_energy(double to_rad) const;
  double rectangle_energy(bool inside) const;
  double measured(double sine) const;
  double first_fall_rad(std::size_t axis) const;

  BeamDescription beam_;
  double wave_factor_[2] = {0.0, 0.0};  ///< pi * aperture / wavelength
  double cos_cone_ = 0.0;
  double sin_cone_ = 0.0;
  std::vector<double> row_rad_;
  std::vector<double> row_log_;
  double envelope_rad_[2] = {0.0, 0.0};
  BeamCut cut_[2] = {BeamCut::kConeEdge, BeamCut::kConeEdge};
  double discarded_fraction_ = 0.0;
  double variance_[2] = {0.0, 0.0};
};

}  // namespace leadline::host
