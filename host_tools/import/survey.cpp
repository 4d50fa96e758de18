#include "host_tools/import/survey.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>

#include "estimator/pose_history.hpp"
#include "firmware/config/input_file.hpp"
#include "hal/heads/r2sonic.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/import/pd0_line.hpp"
#include "host_tools/import/sontek.hpp"
#include "host_tools/import/xtf.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

using estimator::PoseHistory;

constexpr double kDegPerBam = 360.0 / 4294967296.0;
constexpr std::size_t kMinCellsToTell = 20;

double degrees_of(base::Bam32 angle) {
  return kDegPerBam * static_cast<double>(static_cast<std::int32_t>(angle));
}

Attitude attitude_of(const base::Pose& pose) {
  return {degrees_of(pose.attitude.roll_bam32), degrees_of(pose.attitude.pitch_bam32),
          degrees_of(pose.attitude.heading_bam32)};
}

/// What a line's samples say at any instant; attitude and position come at times of their own.
class LineNavigation {
 public:
  LineNavigation(const SurveyLine& line, const estimator::LocalPlane& plane,
                 const SurveyGeometry& geometry)
      : geometry_(geometry),
        attitude_storage_(std::max<std::size_t>(line.attitudes.size(), 1)),
        position_storage_(std::max<std::size_t>(line.positions.size(), 1)),
        attitudes_(attitude_storage_.data(), attitude_storage_.size(), geometry.max_gap_us),
        positions_(position_storage_.data(), position_storage_.size(), geometry.max_gap_us) {
    if (line.attitudes.empty() || line.positions.empty()) {
      throw HostError(ExitCode::kInput, line.name + ": no " +
                                            (line.positions.empty() ? "position" : "attitude") +
                                            " in the file: pings cannot be placed");
    }
    for (const base::NavSample& sample : line.attitudes) {
      base::Pose pose{};
      pose.t_us = sample.t_us - geometry.attitude_delay_us;
      pose.attitude = sample.attitude;
      pose.position_um[base::kDown] = sample.heave_um;
      (void)attitudes_.push(pose);  // a repeated stamp is counted there and not needed here
    }
    for (std::size_t i = 0; i < line.positions.size(); ++i) {
      push_position(line, i, plane);
    }
  }
  LineNavigation(const LineNavigation&) = delete;
  LineNavigation& operator=(const LineNavigation&) = delete;

  /// Heading from grid north. `convergence_deg` is that of the place.
  [[nodiscard]] bool attitude_at(base::TimeUs t_us, double convergence_deg, Attitude* attitude,
                                 double* heave_m) const {
    const auto pose = attitudes_.at(t_us);
    if (!pose.ok()) {
      return false;
    }
    *attitude = attitude_of(pose.value());
    attitude->roll_deg *= geometry_.use_attitude ? geometry_.roll_sign : 0.0;
    attitude->pitch_deg *= geometry_.use_attitude ? geometry_.pitch_sign : 0.0;
    attitude->heading_deg += geometry_.heading_offset_deg - convergence_deg;
    *heave_m =
        geometry_.heave_sign * 1e-6 * static_cast<double>(pose.value().position_um[base::kDown]);
    return true;
  }

  /// The place at heave 0, and how far grid north turns there.
  [[nodiscard]] bool place_at(base::TimeUs t_us, Vec3* place_m, double* convergence_deg) const {
    const auto pose = positions_.at(t_us);
    if (!pose.ok()) {
      return false;
    }
    *convergence_deg = degrees_of(pose.value().attitude.heading_bam32);
    const std::int64_t* const um = pose.value().position_um;
    *place_m = {1e-6 * static_cast<double>(um[0]), 1e-6 * static_cast<double>(um[1]),
                geometry_.draft_m};
    if (geometry_.vertical == VerticalSource::kHeight) {
      place_m->z += 1e-6 * static_cast<double>(um[2]);
    }
    return true;
  }

 private:
  void push_position(const SurveyLine& line, std::size_t i, const estimator::LocalPlane& plane) {
    const base::NavSample& sample = line.positions[i];
    const auto point = plane.to_plane({sample.latitude_e9deg, sample.longitude_e9deg});
    if (!point.ok()) {
      throw HostError(ExitCode::kInput,
                      line.name + ": position " +
                          json_number(1e-9 * static_cast<double>(sample.latitude_e9deg)) + ", " +
                          json_number(1e-9 * static_cast<double>(sample.longitude_e9deg)) +
                          " is too far from the survey's origin");
    }
    base::Pose pose{};
    pose.t_us = sample.t_us - geometry_.position_delay_us;
    pose.position_um[0] = point.value().north_um;
    pose.position_um[1] = point.value().east_um;
    pose.position_um[2] = std::llround(-1e6 * line.heights_m[i]);
    pose.attitude.heading_bam32 = static_cast<base::Bam32>(point.value().convergence_bam32);
    (void)positions_.push(pose);
  }

  const SurveyGeometry& geometry_;
  std::vector<base::Pose> attitude_storage_;
  std::vector<base::Pose> position_storage_;
  PoseHistory attitudes_;
  PoseHistory positions_;
};

/// v of length one with v.a and v.b given, on the side of a x b.
std::optional<Vec3> two_cones(Vec3 a, double on_a, Vec3 b, double on_b, bool down) {
  const double k = dot(a, b);
  const double rest = 1.0 - k * k;
  const Vec3 within = ((on_a - k * on_b) / rest) * a + ((on_b - k * on_a) / rest) * b;
  const double missing = 1.0 - dot(within, within);
  if (!(missing >= 0.0)) {
    return std::nullopt;
  }
  const Vec3 normal = normalized(cross(a, b));
  return within + ((down ? 1.0 : -1.0) * std::sqrt(missing)) * normal;
}

/// The straight line to the end of the bent ray: direction and range; false when there is none.
bool refract(const SurveyGeometry& geometry, const SurveyBeam& beam, double head_depth_m, Vec3* v,
             double* range_m) {
  if (geometry.profile == nullptr) {
    return true;
  }
  const double horizontal = std::hypot(v->x, v->y);
  const double from_down_rad = exact::atan2(horizontal, v->z);
  estimator::RayLaunch launch{};
  launch.head_depth_um = std::llround(head_depth_m * 1e6);
  launch.from_down_bam32 =
      static_cast<base::Bam32>(std::llround(from_down_rad / (2.0 * exact::kPi) * 4294967296.0));
  launch.told_speed_mm_s = beam.told_speed_mm_s;
  launch.two_way_ns = std::llround(2e12 * beam.range_m / beam.told_speed_mm_s);
  const auto end = estimator::trace_ray(*geometry.profile, launch);
  if (!end.ok()) {
    return false;
  }
  const double across_m = 1e-6 * static_cast<double>(end.value().across_um);
  const double down_m = 1e-6 * static_cast<double>(end.value().down_um);
  *range_m = std::hypot(across_m, down_m);
  if (*range_m > 0.0) {
    const double side = horizontal > 0.0 ? across_m / horizontal : 0.0;
    *v = (1.0 / *range_m) * Vec3{side * v->x, side * v->y, down_m};
  }
  return true;
}

/// Turns one beam into a row; false, and counted, when it cannot be.
class RowBuilder {
 public:
  RowBuilder(const SurveyGeometry& geometry, const LineNavigation& navigation, SurveyCounts* counts)
      : geometry_(geometry),
        navigation_(navigation),
        forward_(world_from_vehicle(geometry.boresight, {1, 0, 0})),
        right_(world_from_vehicle(geometry.boresight, {0, 1, 0})),
        least_down_(exact::cos(geometry.max_angle_deg * exact::kRadPerDeg)),
        counts_(counts) {}

  bool build(const SurveyBeam& beam, SurveyRow* row) {
    counts_->beams += 1;
    if (beam.quality < geometry_.min_quality) {
      counts_->low_quality += 1;
      return false;
    }
    if (!geometry_.beams.empty() && std::find(geometry_.beams.begin(), geometry_.beams.end(),
                                              beam.beam) == geometry_.beams.end()) {
      counts_->other_beams += 1;
      return false;
    }
    if (beam.direction.z < least_down_) {
      counts_->too_steep += 1;
      return false;
    }
    Attitude sent;
    Attitude heard;
    double heave_sent_m = 0;
    double heave_heard_m = 0;
    double heave_m = 0;
    double convergence_deg = 0;
    const base::TimeUs middle_us =
        beam.t_transmit_us + (beam.t_receive_us - beam.t_transmit_us) / 2;
    if (!navigation_.place_at(middle_us, &row->head_m, &convergence_deg) ||
        !navigation_.attitude_at(beam.t_transmit_us, convergence_deg, &sent, &heave_sent_m) ||
        !navigation_.attitude_at(beam.t_receive_us, convergence_deg, &heard, &heave_heard_m) ||
        !navigation_.attitude_at(middle_us, convergence_deg, &row->attitude, &heave_m)) {
      counts_->without_pose += 1;
      return false;
    }
    if (geometry_.vertical == VerticalSource::kHeave) {
      row->head_m.z += 0.5 * (heave_sent_m + heave_heard_m);
    }
    row->head_m = row->head_m + world_from_vehicle(row->attitude, geometry_.lever_arm_m);
    const std::optional<Vec3> launched =
        two_cones(world_from_vehicle(sent, forward_), beam.direction.x,
                  world_from_vehicle(heard, right_), beam.direction.y, beam.direction.z >= 0);
    Vec3 v = launched.value_or(Vec3{});
    double range_m = beam.range_m;
    if (!launched || !refract(geometry_, beam, row->head_m.z, &v, &range_m)) {
      counts_->refracted_away += 1;
      return false;
    }
    row->t_us = middle_us;
    row->range_m = range_m;
    row->beam = beam_angles({dot(v, world_from_vehicle(row->attitude, {1, 0, 0})),
                             dot(v, world_from_vehicle(row->attitude, {0, 1, 0})),
                             dot(v, world_from_vehicle(row->attitude, {0, 0, 1}))});
    const Vec3 end = row->head_m + range_m * v;
    row->end = {end.x, end.y, end.z};
    row->beam_number = beam.beam;
    counts_->rows += 1;
    return true;
  }

 private:
  const SurveyGeometry& geometry_;
  const LineNavigation& navigation_;
  Vec3 forward_;  // the head's axes on the vehicle
  Vec3 right_;
  double least_down_;
  SurveyCounts* counts_;
};

/// Median of `values`, which get reordered; of an even number the upper one of the middle two.
double median_of(std::vector<double>* values) {
  const auto middle = values->begin() + static_cast<std::ptrdiff_t>(values->size() / 2);
  std::nth_element(values->begin(), middle, values->end());
  return *middle;
}

struct Moments {
  std::size_t count = 0;
  double mean = 0;
  double squares = 0;  // of the distances from the mean

  void add(double value) {
    count += 1;
    const double before = value - mean;
    mean += before / static_cast<double>(count);
    squares += before * (value - mean);
  }
};

bool ends_with(const std::string& text, const std::string& tail) {
  return text.size() >= tail.size() &&
         text.compare(text.size() - tail.size(), tail.size(), tail) == 0;
}

void take_pings(hal::R2SonicCodec* codec, const XtfItem& item, SurveyLine* line) {
  base::Ping ping{};
  for (std::size_t i = 0; i < item.size_bytes; ++i) {
    if (!codec->feed(item.bytes[i], item.t_us, ping)) {
      continue;
    }
    do {
      SurveyBeam beam{};
      beam.t_transmit_us = ping.t_transmit_us;
      beam.t_receive_us = ping.t_receive_us;
      beam.direction =
          vehicle_direction({degrees_of(ping.azimuth_bam32), degrees_of(ping.elevation_bam32)});
      beam.range_m = 1e-6 * static_cast<double>(ping.range_um);
      beam.told_speed_mm_s = ping.sound_speed_mm_s;
      beam.beam = codec->beam().beam;
      beam.quality = ping.quality;
      line->beams.push_back(beam);
    } while (codec->next(ping));
  }
}

SurveyLine read_xtf_line(const std::string& path, std::string* notice) {
  XtfReader reader(path);
  hal::R2SonicCodec codec{hal::R2SonicConfig{}};
  SurveyLine line;
  line.name = path;
  XtfItem item{};
  while (reader.next(&item)) {
    if (item.kind == XtfItemKind::kR2Sonic) {
      take_pings(&codec, item, &line);
    } else if (item.sample.kind == base::NavKind::kAttitude) {
      line.attitudes.push_back(item.sample);
    } else {
      line.positions.push_back(item.sample);
      line.heights_m.push_back(item.height_m);
    }
  }
  const XtfStats& stats = reader.stats();
  const std::uint32_t damaged = hal::rejected(codec.counters());
  if (line.beams.empty()) {
    throw HostError(ExitCode::kInput, path + ": no R2Sonic beam in it (" +
                                          std::to_string(stats.packets) + " packets, " +
                                          std::to_string(stats.heads) + " of a head)");
  }
  const auto say = [notice](const std::string& text) {
    *notice += (notice->empty() ? "" : "; ") + text;
  };
  if (damaged + stats.unusable != 0) {
    say(std::to_string(damaged + stats.unusable) + " packets damaged");
  }
  if (stats.skipped_bytes != 0) {
    say(std::to_string(stats.skipped_bytes) + " bytes belong to no packet");
  }
  if (stats.cut) {
    say("the last packet is cut off");
  }
  const XtfMounting& mounting = reader.mounting();
  if (mounting.stated) {
    std::string text = "the recorder was told that the head sits (forward, starboard, down, m)";
    for (const double value : {mounting.forward_m, mounting.starboard_m, mounting.down_m}) {
      text += " ";
      append_fixed(&text, value, 3);
    }
    text += " turned by (roll, pitch, heading, deg)";
    for (const double value : {mounting.roll_deg, mounting.pitch_deg, mounting.heading_deg}) {
      text += " ";
      append_fixed(&text, value, 2);
    }
    say(text + "; not used unless given as options");
  }
  return line;
}

}  // namespace

void build_rows(const SurveyLine& line, const estimator::LocalPlane& plane,
                const SurveyGeometry& geometry, std::vector<SurveyRow>* rows,
                SurveyCounts* counts) {
  const LineNavigation navigation(line, plane, geometry);
  RowBuilder builder(geometry, navigation, counts);
  rows->reserve(rows->size() + line.beams.size());
  for (std::size_t i = 0; i < line.beams.size(); ++i) {
    SurveyRow row{};
    if (builder.build(line.beams[i], &row)) {
      row.index = i;
      rows->push_back(row);
    }
  }
}

CellSpread cell_spread(const std::vector<SurveyRow>& rows, double cell_m,
                       std::size_t min_soundings) {
  std::map<std::pair<std::int64_t, std::int64_t>, Moments> cells;
  for (const SurveyRow& row : rows) {
    cells[{static_cast<std::int64_t>(std::floor(row.end.north_m / cell_m)),
           static_cast<std::int64_t>(std::floor(row.end.east_m / cell_m))}]
        .add(row.end.depth_m);
  }
  std::vector<double> deviations;
  for (const auto& [key, moments] : cells) {
    if (moments.count >= min_soundings && moments.count > 1) {
      deviations.push_back(std::sqrt(moments.squares / static_cast<double>(moments.count)));
    }
  }
  CellSpread spread;
  spread.cells = deviations.size();
  if (!deviations.empty()) {
    spread.median_m = median_of(&deviations);
  }
  return spread;
}

namespace {

CellSpread spread_with(const std::vector<SurveyLine>& lines, const estimator::LocalPlane& plane,
                       const SurveyGeometry& geometry, double cell_m, std::size_t min_soundings) {
  std::vector<SurveyRow> rows;
  SurveyCounts counts;
  for (const SurveyLine& line : lines) {
    build_rows(line, plane, geometry, &rows, &counts);
  }
  return cell_spread(rows, cell_m, min_soundings);
}

}  // namespace

Vec3 fit_lever_arm(const std::vector<SurveyLine>& lines, const estimator::LocalPlane& plane,
                   const SurveyGeometry& geometry, double cell_m, std::size_t min_soundings) {
  constexpr double kLast_m = 0.05;
  constexpr double kFarthest_m = 10.0;
  SurveyGeometry best = geometry;
  const auto spread_of = [&](const SurveyGeometry& trial) {
    const CellSpread spread = spread_with(lines, plane, trial, cell_m, min_soundings);
    return spread.cells >= kMinCellsToTell ? spread.median_m : HUGE_VAL;
  };
  double best_m = spread_of(best);
  for (double step_m = 1.0; step_m >= kLast_m; step_m *= 0.5) {
    for (bool better = true; better;) {
      better = false;
      for (const Vec3 step :
           {Vec3{step_m, 0, 0}, Vec3{-step_m, 0, 0}, Vec3{0, step_m, 0}, Vec3{0, -step_m, 0}}) {
        SurveyGeometry trial = best;
        trial.lever_arm_m = trial.lever_arm_m + step;
        const Vec3 moved = trial.lever_arm_m - geometry.lever_arm_m;
        const double spread_m = norm(moved) > kFarthest_m ? HUGE_VAL : spread_of(trial);
        if (spread_m < best_m) {
          best_m = spread_m;
          best = trial;
          better = true;
        }
      }
    }
  }
  return best.lever_arm_m;
}

SignCheck check_signs(const std::vector<SurveyLine>& lines, const estimator::LocalPlane& plane,
                      const SurveyGeometry& geometry, double cell_m, std::size_t min_soundings) {
  SurveyGeometry roll = geometry;
  roll.roll_sign = -roll.roll_sign;
  SurveyGeometry pitch = geometry;
  pitch.pitch_sign = -pitch.pitch_sign;
  SurveyGeometry heave = geometry;
  heave.heave_sign = -heave.heave_sign;
  SurveyGeometry level = geometry;
  level.use_attitude = false;

  struct Variant {
    const char* name;
    const SurveyGeometry* geometry;
    bool is_flip;
  };
  std::vector<Variant> variants = {{"as given", &geometry, false},
                                   {"roll flipped", &roll, true},
                                   {"pitch flipped", &pitch, true}};
  if (geometry.vertical == VerticalSource::kHeave) {
    variants.push_back({"heave flipped", &heave, true});
  }
  variants.push_back({"without roll and pitch", &level, false});

  SignCheck check;
  for (const Variant& variant : variants) {
    check.trials.push_back({variant.name,
                            spread_with(lines, plane, *variant.geometry, cell_m, min_soundings),
                            variant.is_flip});
  }
  const CellSpread given = check.trials.front().spread;
  check.can_tell = given.cells >= kMinCellsToTell;
  for (const SignTrial& trial : check.trials) {
    if (check.can_tell && trial.is_flip && trial.spread.cells >= kMinCellsToTell &&
        trial.spread.median_m < (1.0 - kWrongSignShare) * given.median_m) {
      check.wrong.push_back(trial.name);
    }
  }
  return check;
}

estimator::SoundSpeedProfile read_sound_speed_profile(const std::string& path) {
  std::ifstream file = open_input(path);
  std::vector<estimator::SoundSpeedPoint> points;
  std::string text;
  for (std::uint64_t line = 1; std::getline(file, text); ++line) {
    if (text.empty() || text[0] == '#' || text.find_first_of("0123456789") == std::string::npos) {
      continue;
    }
    const std::size_t comma = text.find(',');
    std::int64_t depth_um = 0;
    std::int64_t speed_mm_s = 0;
    if (comma == std::string::npos ||
        decimal_to_scaled(std::string_view(text).substr(0, comma), 6, false, &depth_um) !=
            DecimalStatus::kOk ||
        decimal_to_scaled(std::string_view(text).substr(comma + 1), 3, false, &speed_mm_s) !=
            DecimalStatus::kOk) {
      throw HostError(ExitCode::kInput, path + ":" + std::to_string(line) + ": value \"" +
                                            printable(text) + "\": expected depth_m,speed_m_s");
    }
    const std::int64_t limit = 2 * std::int64_t{estimator::kMaxSoundSpeed_mm_s};
    points.push_back(
        {depth_um, static_cast<std::int32_t>(std::clamp<std::int64_t>(speed_mm_s, 0, limit))});
  }
  estimator::SoundSpeedProfile profile;
  const base::Status status = profile.set(points.data(), points.size());
  if (status != base::Status::kOk) {
    throw HostError(ExitCode::kInput,
                    path + ": " + std::to_string(points.size()) +
                        " points cannot be a profile: 1 to 64 points, depths that increase, speeds "
                        "from 1300 to 1700 m/s");
  }
  return profile;
}

SurveyLine read_survey_line(const std::string& path, std::string* notice) {
  notice->clear();
  if (ends_with(path, ".sum")) {
    return read_sontek_line(path, notice);
  }
  if (ends_with(path, ".xtf") || ends_with(path, ".XTF")) {
    return read_xtf_line(path, notice);
  }
  for (const char* const ending : {".pd0", ".PD0", ".enx", ".ENX", ".enr", ".ENR", ".000"}) {
    if (ends_with(path, ending)) {
      return read_pd0_line(path, notice);
    }
  }
  throw HostError(ExitCode::kInput, path +
                                        ": what kind of file is it? Expected .xtf (R2Sonic), .sum "
                                        "(SonTek) or .pd0, .enx, .enr, .000 (PD0)");
}

}  // namespace leadline::host
