// From what a survey recorded to soundings in the world: the poses of each ping by interpolation, lever arm,
// boresight, attitude at transmission and at reception, the bent ray. And the question whether the signs
// were right, put to the soundings themselves.
//
// Direction. Transmitter and receiver stand at two attitudes. The transmitter fixes the angle from its
// forward axis a (as it was when it sent), the receiver that from its starboard axis b (as it was when the
// echo came): v.a and v.b are what the beam's direction in the mount's frame says, and the down-looking v
// of length one with both is taken (two cones about a and b). The place is the middle of the two.
//
// Refraction (estimator/refraction.hpp) bends the ray in its vertical plane, launched with the sound speed
// that the head steered with. Without a profile the range stays the head's own, along a straight line.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "estimator/geodesy.hpp"
#include "estimator/refraction.hpp"
#include "host_tools/grid_baselines.hpp"
#include "host_tools/sim/vec3.hpp"
#include "model/base/nav_sample.hpp"

namespace leadline::host {

/// One beam as recorded.
struct SurveyBeam {
  base::TimeUs t_transmit_us;
  base::TimeUs t_receive_us;
  Vec3 direction;  ///< unit vector in the head's frame (forward, right, down)
  double range_m;  ///< along a straight line, with the told speed
  std::int32_t told_speed_mm_s;
  std::uint16_t beam;
  std::uint8_t quality;  ///< 0 .. 255
};

/// A recording without a pause: one file.
struct SurveyLine {
  std::string name;
  std::vector<SurveyBeam> beams;           ///< in order of time
  std::vector<base::NavSample> attitudes;  ///< roll, pitch, heading, heave
  std::vector<base::NavSample> positions;  ///< geodetic
  std::vector<double> heights_m;           ///< of the positions
};

enum class VerticalSource : std::uint8_t {
  kNone,    ///< the head stays at its draft
  kHeave,   ///< the motion sensor's heave
  kHeight,  ///< minus the height of the positions
};

struct SurveyGeometry {
  Vec3 lever_arm_m;    ///< of the head from the place of the positions; forward, right, down
  Attitude boresight;  ///< of the head on the vehicle
  double draft_m = 0;  ///< of that place below the surface
  VerticalSource vertical = VerticalSource::kHeave;
  bool use_attitude = true;  ///< false: roll and pitch 0 (heading stays)
  double roll_sign = 1;
  double pitch_sign = 1;
  double heave_sign = 1;
  double heading_offset_deg = 0;       ///< added: declination, a compass's deviation
  std::int64_t attitude_delay_us = 0;  ///< the attitude of a stamp was true that much earlier
  std::int64_t position_delay_us = 0;  ///< the same of the position
  double max_angle_deg = 90;           ///< beams farther from the head's down axis are left out
  std::vector<unsigned> beams;         ///< only these numbers; empty: all
  unsigned min_quality = 1;
  std::int64_t max_gap_us = 1'000'000;                    ///< longest interpolation
  const estimator::SoundSpeedProfile* profile = nullptr;  ///< null: straight lines
};

/// A row of the pings file, and where its end lies.
struct SurveyRow {
  base::TimeUs t_us;
  Vec3 head_m;        ///< north, east, down
  Attitude attitude;  ///< of the vehicle, between transmission and reception
  BeamAngles beam;    ///< in the vehicle's frame, of the straight line to the end
  double range_m;
  Sounding end;
  std::uint16_t beam_number;
  std::size_t index;  ///< of the beam in its line
};

struct SurveyCounts {
  std::uint64_t beams = 0;
  std::uint64_t rows = 0;
  std::uint64_t without_pose = 0;
  std::uint64_t too_steep = 0;  ///< beyond max_angle_deg
  std::uint64_t low_quality = 0;
  std::uint64_t other_beams = 0;     ///< not among SurveyGeometry::beams
  std::uint64_t refracted_away = 0;  ///< trace_ray() gave no end, or the beam looks up
};

/// Appends the rows of `line`. Throws HostError kInput: no attitude, no position,
/// or one too far from the plane's origin.
void build_rows(const SurveyLine& line, const estimator::LocalPlane& plane,
                const SurveyGeometry& geometry, std::vector<SurveyRow>* rows, SurveyCounts* counts);

/// How far soundings of one cell lie apart: median over the cells of the standard deviation of depth.
struct CellSpread {
  double median_m = kNoValue;
  std::size_t cells = 0;  ///< with enough soundings
};
[[nodiscard]] CellSpread cell_spread(const std::vector<SurveyRow>& rows, double cell_m,
                                     std::size_t min_soundings);

/// The same soundings made with one thing turned round.
struct SignTrial {
  std::string name;  ///< "as given", "roll flipped", ...
  CellSpread spread;
  bool is_flip = false;  ///< one of the signs; the rest is for comparison
};

struct SignCheck {
  std::vector<SignTrial> trials;  ///< the first is "as given"
  bool can_tell = false;          ///< enough cells
  /// Names of flips that make the soundings agree better than they do as given by kWrongSignShare.
  std::vector<std::string> wrong;
};

/// A flipped sign is called right when it takes that share of the spread away. What is less may be
/// another error of the geometry (a lever arm of 1.4 m in the recording of host_tools/SURVEYS.md moved
/// the spread with pitch flipped by 6 %); a wrong roll sign there takes 88 %.
inline constexpr double kWrongSignShare = 0.15;

/// Builds all lines with each sign flipped in turn. Costs five times build_rows().
[[nodiscard]] SignCheck check_signs(const std::vector<SurveyLine>& lines,
                                    const estimator::LocalPlane& plane,
                                    const SurveyGeometry& geometry, double cell_m,
                                    std::size_t min_soundings);

/// The lever arm, forward and starboard, with which soundings of one cell agree best: a search that halves
/// its steps from 1 m to 0.05 m, from the given one, not farther than 10 m. Roll and pitch make the head
/// of such an arm rise and fall, which is what it sees; down does not show and stays. Some 40 times the
/// cost of build_rows().
[[nodiscard]] Vec3 fit_lever_arm(const std::vector<SurveyLine>& lines,
                                 const estimator::LocalPlane& plane, const SurveyGeometry& geometry,
                                 double cell_m, std::size_t min_soundings);

/// "depth_m,speed_m_s" in every line, depths increasing; lines that start with # and a header without
/// digits are skipped. Throws HostError kInput with file, line and value.
[[nodiscard]] estimator::SoundSpeedProfile read_sound_speed_profile(const std::string& path);

/// An XTF recording of an R2Sonic, a SonTek .sum, PD0 (pd0_line.hpp): by the file's name. Throws HostError kInput. `notice` gets
/// one line on what was odd, "" when nothing was.
[[nodiscard]] SurveyLine read_survey_line(const std::string& path, std::string* notice);

}  // namespace leadline::host
