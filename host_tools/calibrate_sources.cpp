#include "host_tools/calibrate_sources.hpp"

#include <algorithm>
#include <cmath>

namespace leadline::host {
namespace {

double component(const Alignment& alignment, AlignmentParameter parameter) {
  return alignment[static_cast<std::size_t>(parameter)];
}

double signed_degrees(base::Bam32 angle) {
  return 360.0 / 4294967296.0 * static_cast<double>(static_cast<std::int32_t>(angle));
}

/// From a to b the short way, degrees.
double turn_deg(double a, double b) { return std::remainder(b - a, 360.0); }

}  // namespace

void SoundingGroups::add(bool new_line, std::int64_t t_us, double heading_deg) {
  const std::int64_t stretch = t_us / kBlock_us;
  const bool first = blocks_.empty();
  const bool new_pass = new_line || std::fabs(turn_deg(course_deg_, heading_deg)) > kPassTurn_deg;
  const std::uint32_t block = first ? 0 : blocks_.back();
  const std::uint32_t pass = first ? 0 : passes_.back();
  blocks_.push_back(!first && (new_pass || stretch != stretch_) ? block + 1 : block);
  passes_.push_back(!first && new_pass ? pass + 1 : pass);
  course_deg_ = first || new_pass ? heading_deg : course_deg_;
  stretch_ = stretch;
}

PingSoundings::Stand PingSoundings::stand_of(const PingRow& row) {
  return {row.t_us,
          {1e-6 * static_cast<double>(row.position_um[0]),
           1e-6 * static_cast<double>(row.position_um[1]),
           1e-6 * static_cast<double>(row.position_um[2])},
          {signed_degrees(row.attitude.roll_bam32), signed_degrees(row.attitude.pitch_bam32),
           signed_degrees(row.attitude.heading_bam32)}};
}

SurveyGeometry aligned(const SurveyGeometry& geometry, const Alignment& alignment, SignFlip flip) {
  SurveyGeometry result = geometry;
  result.boresight.roll_deg += component(alignment, AlignmentParameter::kRoll);
  result.boresight.pitch_deg += component(alignment, AlignmentParameter::kPitch);
  result.boresight.heading_deg += component(alignment, AlignmentParameter::kHeading);
  result.lever_arm_m.x += component(alignment, AlignmentParameter::kForward);
  result.lever_arm_m.y += component(alignment, AlignmentParameter::kStarboard);
  result.attitude_delay_us +=
      std::llround(1000.0 * component(alignment, AlignmentParameter::kLatency));
  result.position_delay_us +=
      std::llround(1000.0 * component(alignment, AlignmentParameter::kPositionLatency));
  result.roll_sign *= flip == SignFlip::kRoll ? -1.0 : 1.0;
  result.pitch_sign *= flip == SignFlip::kPitch ? -1.0 : 1.0;
  return result;
}

RecordedSoundings::RecordedSoundings(const std::vector<SurveyLine>& lines,
                                     const estimator::LocalPlane& plane,
                                     const SurveyGeometry& geometry)
    : lines_(lines), plane_(plane), geometry_(geometry) {
  for (const SurveyLine& line : lines) {
    std::size_t now = 0;
    for (std::size_t i = 0; i < line.beams.size(); ++i) {
      const std::int64_t t_us = line.beams[i].t_transmit_us;
      while (now + 1 < line.attitudes.size() && line.attitudes[now + 1].t_us <= t_us) {
        ++now;
      }
      groups_.add(i == 0, t_us,
                  line.attitudes.empty()
                      ? 0.0
                      : signed_degrees(line.attitudes[now].attitude.heading_bam32));
    }
  }
}

void RecordedSoundings::place(const Alignment& alignment, SignFlip flip,
                              std::vector<Sounding>* soundings) const {
  const SurveyGeometry geometry = aligned(geometry_, alignment, flip);
  soundings->assign(blocks().size(), {kNoValue, kNoValue, kNoValue});
  std::size_t first = 0;
  for (const SurveyLine& line : lines_) {
    std::vector<SurveyRow> rows;
    SurveyCounts counts;
    build_rows(line, plane_, geometry, &rows, &counts);
    for (const SurveyRow& row : rows) {
      (*soundings)[first + row.index] = row.end;
    }
    first += line.beams.size();
  }
}

void PingSoundings::add_line(const std::vector<PingRow>& rows) {
  stands_.emplace_back();
  std::vector<Stand>& stands = stands_.back();
  const double least_down = std::cos(geometry_.max_angle_deg * exact::kRadPerDeg);
  bool new_line = true;
  for (const PingRow& row : rows) {
    const Stand stand = stand_of(row);
    if (stands.empty() || row.t_us > stands.back().t_us) {
      stands.push_back(stand);
    }
    const Vec3 direction =
        vehicle_direction({signed_degrees(row.azimuth_bam32), signed_degrees(row.elevation_bam32)});
    if (!row.has_range || direction.z < least_down) {
      continue;
    }
    beams_.push_back({stand, direction, 1e-6 * static_cast<double>(row.range_um),
                      stands_.size() - 1, stands.size() - 1});
    groups_.add(new_line, row.t_us, stand.attitude.heading_deg);
    new_line = false;
  }
}

bool PingSoundings::change(const Beam& beam, std::int64_t delay_us, Stand* change) const {
  const std::vector<Stand>& stands = stands_[beam.line];
  const Stand& from = stands[beam.stand];
  *change = {};
  if (delay_us == 0) {
    return true;
  }
  const std::int64_t t_us = from.t_us + delay_us;
  const auto behind =
      std::upper_bound(stands.begin(), stands.end(), t_us,
                       [](std::int64_t instant, const Stand& s) { return instant < s.t_us; });
  if (behind == stands.begin() || behind == stands.end()) {
    return false;
  }
  // Whatever lies between the ping and that instant must hang together, too.
  const auto first = static_cast<std::size_t>(behind - stands.begin()) - 1;
  for (std::size_t i = std::min(first, beam.stand); i < std::max(first + 1, beam.stand); ++i) {
    if (!hang_together(stands[i], stands[i + 1])) {
      return false;
    }
  }
  const Stand& a = stands[first];
  const Stand& b = *behind;
  const double share = static_cast<double>(t_us - a.t_us) / static_cast<double>(b.t_us - a.t_us);
  const auto turned = [share](double start, double low, double high) {
    return turn_deg(start, low) + share * turn_deg(low, high);
  };
  change->position_m = (a.position_m - from.position_m) + share * (b.position_m - a.position_m);
  change->attitude = {
      turned(from.attitude.roll_deg, a.attitude.roll_deg, b.attitude.roll_deg),
      turned(from.attitude.pitch_deg, a.attitude.pitch_deg, b.attitude.pitch_deg),
      turned(from.attitude.heading_deg, a.attitude.heading_deg, b.attitude.heading_deg)};
  return true;
}

bool PingSoundings::hang_together(const Stand& a, const Stand& b) const {
  return b.t_us - a.t_us <= geometry_.max_gap_us &&
         std::max({std::fabs(turn_deg(a.attitude.roll_deg, b.attitude.roll_deg)),
                   std::fabs(turn_deg(a.attitude.pitch_deg, b.attitude.pitch_deg)),
                   std::fabs(turn_deg(a.attitude.heading_deg, b.attitude.heading_deg))}) <=
             kMaxTurn_deg;
}

void PingSoundings::place(const Alignment& alignment, SignFlip flip,
                          std::vector<Sounding>* soundings) const {
  const SurveyGeometry geometry = aligned(geometry_, alignment, flip);
  soundings->assign(beams_.size(), {kNoValue, kNoValue, kNoValue});
  for (std::size_t i = 0; i < beams_.size(); ++i) {
    const Beam& beam = beams_[i];
    Stand turned{};
    Stand moved{};
    if (!change(beam, geometry.attitude_delay_us, &turned) ||
        !change(beam, geometry.position_delay_us, &moved)) {
      continue;
    }
    const Attitude attitude = {
        geometry.roll_sign * (beam.reported.attitude.roll_deg + turned.attitude.roll_deg),
        geometry.pitch_sign * (beam.reported.attitude.pitch_deg + turned.attitude.pitch_deg),
        beam.reported.attitude.heading_deg + turned.attitude.heading_deg};
    const Vec3 on_vehicle = world_from_vehicle(geometry.boresight, beam.direction);
    const Vec3 end = (beam.reported.position_m + moved.position_m) +
                     world_from_vehicle(attitude, geometry.lever_arm_m + beam.range_m * on_vehicle);
    (*soundings)[i] = {end.x, end.y, end.z};
  }
}

}  // namespace leadline::host
