#include "host_tools/table/beam_pattern.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <system_error>

#include "firmware/config/input_file.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/table/table_math.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

constexpr double kRadPerDeg = exact::kRadPerDeg;
constexpr double kLn10Over10 = 0.230258509299404568402;
// -30 dB two-way.
constexpr double kCutLevel = 1e-3;
// How far the pattern is integrated, in its own argument: the energy beyond is under 0.2 ppm.
constexpr double kPistonReach = 64.0;
constexpr double kRectangleReach = 32.0 * exact::kPi;
constexpr std::size_t kMinPatternRows = 2;
constexpr std::size_t kMaxPatternRows = 10000;
constexpr std::uintmax_t kMaxPatternFile_bytes = 4U << 20U;

void require(bool ok, const char* name, double value, const char* limits) {
  if (!ok) {
    throw HostError(ExitCode::kUsage, std::string("beam: ") + name + " = " + json_number(value) +
                                          ": must be " + limits);
  }
}

void require_within(const char* name, double value, double low, double high, const char* limits) {
  require(value >= low && value <= high, name, value, limits);
}

double square(double x) { return x * x; }

// |2 J1(u) / u|^4
double piston_two_way(double u) {
  if (u < 1e-4) {
    return 1.0 - 0.5 * u * u;
  }
  return square(square(2.0 * exact::bessel_j1(u) / u));
}

// sinc^4
double line_two_way(double x) {
  const double magnitude = std::fabs(x);
  if (magnitude < 1e-4) {
    return 1.0 - 2.0 / 3.0 * x * x;
  }
  return square(square(exact::sin(magnitude) / magnitude));
}

[[noreturn]] void pattern_error(const std::string& name, std::size_t line, std::string_view value,
                                const std::string& reason) {
  throw HostError(ExitCode::kUsage, name + ":" + std::to_string(line) +
                                        (value.empty() ? "" : ": \"" + printable(value) + "\"") +
                                        ": " + reason);
}

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

// Words of a line, separated by blanks or single commas; more than three are not told apart.
std::vector<std::string_view> split(std::string_view line) {
  std::vector<std::string_view> words;
  std::size_t at = 0;
  while (at < line.size() && words.size() < 4) {
    while (at < line.size() && is_blank(line[at])) {
      ++at;
    }
    const std::size_t begin = at;
    while (at < line.size() && !is_blank(line[at]) && line[at] != ',') {
      ++at;
    }
    const std::size_t end = at;
    while (at < line.size() && is_blank(line[at])) {
      ++at;
    }
    const bool comma = at < line.size() && line[at] == ',';
    if (end > begin || comma) {
      words.push_back(line.substr(begin, end - begin));
    }
    at += comma ? 1 : 0;
  }
  return words;
}

double parse_number(std::string_view word, const std::string& name, std::size_t line) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size() || !std::isfinite(value)) {
    pattern_error(name, line, word, "not a number");
  }
  return value;
}

}  // namespace

std::vector<PatternRow> parse_pattern(std::string_view text, const std::string& name) {
  std::vector<PatternRow> rows;
  double factor = 1.0;
  double axis_db = 0.0;
  bool any_row = false;
  std::size_t line_number = 0;
  while (!text.empty()) {
    ++line_number;
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    line = line.substr(0, std::min(line.find('#'), line.size()));
    const std::vector<std::string_view> words = split(line);
    if (words.empty()) {
      continue;
    }
    if (!any_row && words.size() == 1 && (words[0] == "one_way" || words[0] == "two_way")) {
      any_row = true;
      factor = words[0] == "one_way" ? 2.0 : 1.0;
      continue;
    }
    any_row = true;
    if (words.size() != 2) {
      pattern_error(name, line_number, line, "expected two numbers: off_axis_deg level_db");
    }
    const double angle_deg = parse_number(words[0], name, line_number);
    const double level_db = parse_number(words[1], name, line_number);
    if (angle_deg < 0.0 || angle_deg > 90.0) {
      pattern_error(name, line_number, words[0], "off-axis angle outside 0 .. 90 degrees");
    }
    if (level_db < -300.0 || level_db > 300.0) {
      pattern_error(name, line_number, words[1], "level outside -300 .. 300 dB");
    }
    if (rows.empty() && angle_deg != 0.0) {
      pattern_error(name, line_number, words[0], "the first row must be the axis, 0 degrees");
    }
    if (!rows.empty() && angle_deg <= rows.back().off_axis_deg) {
      pattern_error(name, line_number, words[0], "off-axis angles must ascend");
    }
    axis_db = rows.empty() ? level_db : axis_db;
    const double relative_db = std::max(-300.0, factor * (level_db - axis_db));
    if (relative_db > 0.0) {
      pattern_error(name, line_number, words[1],
                    "louder than the axis: turn the pattern to its peak");
    }
    if (rows.size() == kMaxPatternRows) {
      pattern_error(name, line_number, "", "more than 10,000 rows");
    }
    rows.push_back({angle_deg, relative_db});
  }
  if (rows.size() < kMinPatternRows) {
    pattern_error(name, line_number, "",
                  "a pattern needs at least two rows: off_axis_deg level_db");
  }
  return rows;
}

std::vector<PatternRow> load_pattern(const std::string& path) {
  std::ifstream file = open_input(path, ExitCode::kUsage);
  // One byte more than allowed tells a file that is too long, whatever its size claims to be.
  std::string text(kMaxPatternFile_bytes + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (!file.eof() || file.bad()) {
    throw HostError(ExitCode::kUsage, path + ": " +
                                          (file.bad() ? "cannot be read to its end"
                                                      : "pattern file longer than 4 MiB"));
  }
  return parse_pattern(text, path);
}

BeamDescription beam_description(const SonarConfig& sonar) {
  BeamDescription beam;
  beam.half_angle_deg = sonar.beam_half_angle_deg;
  beam.piston_diameter_mm = sonar.piston_diameter_mm;
  beam.aperture_along_mm = sonar.aperture_along_mm;
  beam.aperture_across_mm = sonar.aperture_across_mm;
  beam.frequency_hz = sonar.frequency_hz;
  beam.sound_speed_mm_s = static_cast<double>(sonar.sound_speed_mm_s);
  beam.max_half_angle_deg = sonar.max_half_angle_deg;
  beam.sigma_pointing_deg = sonar.sigma_pointing_deg;
  beam.sigma_range_mm = sonar.sigma_range_mm;
  beam.detection_fraction = sonar.detection_fraction;
  // map_config names the keys of its file, the table the shapes.
  switch (sonar.beam) {
    case host::BeamKind::kCone:
      beam.kind = model::BeamKind::kCone;
      break;
    case host::BeamKind::kPiston:
      beam.kind = model::BeamKind::kPiston;
      break;
    case host::BeamKind::kAperture:
      beam.kind = model::BeamKind::kRectangle;
      break;
    case host::BeamKind::kPattern:
      beam.kind = model::BeamKind::kMeasured;
      beam.rows = load_pattern(sonar.pattern_file);
      break;
  }
  return beam;
}

const char* beam_cut_text(BeamCut cut) {
  switch (cut) {
    case BeamCut::kConeEdge:
      return "edge of the cone";
    case BeamCut::kSecondNull:
      return "second null";
    case BeamCut::kMinus30dB:
      return "-30 dB two-way";
    case BeamCut::kEndOfPattern:
      return "end of the measured pattern";
    case BeamCut::kMaxHalfAngle:
      return "max_half_angle_deg";
    case BeamCut::kWidestEnvelope:
      return "widest envelope of a table, 80 degrees";
  }
  return "unknown";
}

BeamPattern::BeamPattern(const BeamDescription& beam) : beam_(beam) {
  require_within("sigma_pointing_deg", beam.sigma_pointing_deg, 0.0, 45.0, "0 .. 45");
  require_within("sigma_range_mm", beam.sigma_range_mm, 0.0, 1e6, "0 .. 1,000,000");
  require(beam.detection_fraction > 0.0 && beam.detection_fraction < 1.0, "detection_fraction",
          beam.detection_fraction, "over 0 and below 1");
  if (beam.max_half_angle_deg) {
    require_within("max_half_angle_deg", *beam.max_half_angle_deg, kMinEnvelope_deg, 90.0,
                   "0.01 .. 90");
  }
  if (beam.kind == model::BeamKind::kPiston || beam.kind == model::BeamKind::kRectangle) {
    require_within("frequency_hz", beam.frequency_hz, 100.0, 1e8, "100 .. 100,000,000");
    require_within("sound_speed_mm_s", beam.sound_speed_mm_s, 2e5, 6e6, "200,000 .. 6,000,000");
  }
  const double waves_per_mm =
      beam.sound_speed_mm_s > 0.0 ? beam.frequency_hz / beam.sound_speed_mm_s : 0.0;
  switch (beam.kind) {
    case model::BeamKind::kCone:
      require_within("beam_half_angle_deg", beam.half_angle_deg, kMinEnvelope_deg, 90.0,
                     "0.01 .. 90");
      cos_cone_ = exact::cos(beam.half_angle_deg * kRadPerDeg);
      sin_cone_ = exact::sin(beam.half_angle_deg * kRadPerDeg);
      break;
    case model::BeamKind::kPiston:
      require_within("piston_diameter_mm", beam.piston_diameter_mm, 1.0, 1e4, "1 .. 10,000");
      wave_factor_[0] = exact::kPi * beam.piston_diameter_mm * waves_per_mm;
      wave_factor_[1] = wave_factor_[0];
      break;
    case model::BeamKind::kRectangle:
      require_within("aperture_along_mm", beam.aperture_along_mm, 1.0, 1e4, "1 .. 10,000");
      require_within("aperture_across_mm", beam.aperture_across_mm, 1.0, 1e4, "1 .. 10,000");
      wave_factor_[0] = exact::kPi * beam.aperture_along_mm * waves_per_mm;
      wave_factor_[1] = exact::kPi * beam.aperture_across_mm * waves_per_mm;
      break;
    case model::BeamKind::kMeasured:
      require(beam.rows.size() >= kMinPatternRows, "rows of the pattern",
              static_cast<double>(beam.rows.size()), "at least 2");
      for (const PatternRow& row : beam.rows) {
        // Rows may come from elsewhere than parse_pattern.
        const double before_deg = row_rad_.empty() ? -1.0 : (&row - 1)->off_axis_deg;
        require(row.off_axis_deg > before_deg && row.off_axis_deg <= 90.0 &&
                    (before_deg >= 0.0 || row.off_axis_deg == 0.0),
                "off_axis_deg of the pattern", row.off_axis_deg, "ascending from 0 to at most 90");
        require(row.two_way_db <= 0.0 && row.two_way_db >= -300.0, "two_way_db of the pattern",
                row.two_way_db, "-300 .. 0");
        row_rad_.push_back(row.off_axis_deg * kRadPerDeg);
        row_log_.push_back(row.two_way_db * kLn10Over10);
      }
      break;
  }
  choose_cut(0);
  choose_cut(1);

  if (two_axis()) {
    const double total = rectangle_energy(false);
    discarded_fraction_ = std::max(0.0, 1.0 - rectangle_energy(true) / total);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      double weight = 0.0;
      double moment = 0.0;
      for (const exact::Node& node : exact::gauss_nodes(0.0, envelope_rad_[axis], 32)) {
        const exact::SinCos a = exact::sin_cos(node.x);
        const double energy = node.weight * axis_two_way(axis, a.sin);
        weight += energy;
        moment += energy * square(a.sin / a.cos);
      }
      variance_[axis] = moment / weight;
    }
    return;
  }
  double reach_rad = 0.5 * exact::kPi;
  if (beam_.kind == model::BeamKind::kCone) {
    reach_rad = beam_.half_angle_deg * kRadPerDeg;
  } else if (beam_.kind == model::BeamKind::kPiston && wave_factor_[0] > kPistonReach) {
    reach_rad = std::max(exact::asin(kPistonReach / wave_factor_[0]), envelope_rad_[0]);
  } else if (beam_.kind == model::BeamKind::kMeasured) {
    reach_rad = row_rad_.back();
  }
  const double inside = radial_energy(envelope_rad_[0]);
  const bool all_inside = reach_rad <= envelope_rad_[0];
  discarded_fraction_ = all_inside ? 0.0 : std::max(0.0, 1.0 - inside / radial_energy(reach_rad));
  double weight = 0.0;
  double moment = 0.0;
  for (const exact::Node& node : exact::gauss_nodes(0.0, envelope_rad_[0], 64)) {
    const exact::SinCos t = exact::sin_cos(node.x);
    const double energy = node.weight * axis_two_way(0, t.sin) * t.sin;
    weight += energy;
    moment += energy * square(t.sin / t.cos);
  }
  variance_[0] = 0.5 * moment / weight;
  variance_[1] = variance_[0];
}

double BeamPattern::two_way(double cosine_along, double cosine_across) const {
  if (two_axis()) {
    return line_two_way(wave_factor_[0] * cosine_along) *
           line_two_way(wave_factor_[1] * cosine_across);
  }
  return axis_two_way(0, std::sqrt(cosine_along * cosine_along + cosine_across * cosine_across));
}

double BeamPattern::axis_two_way(std::size_t axis, double direction_cosine) const {
  const double sine = std::fabs(direction_cosine);
  switch (beam_.kind) {
    case model::BeamKind::kCone: {
      // (cos t - cos T) / (1 - cos T), both differences from sines: narrow cones keep their digits.
      const double cosine = std::sqrt(std::max(0.0, (1.0 - sine) * (1.0 + sine)));
      const double falling = (sin_cone_ - sine) * (sin_cone_ + sine) / (cosine + cos_cone_);
      return std::max(0.0, falling * (1.0 + cos_cone_) / square(sin_cone_));
    }
    case model::BeamKind::kPiston:
      return piston_two_way(wave_factor_[0] * sine);
    case model::BeamKind::kRectangle:
      return line_two_way(wave_factor_[axis] * sine);
    case model::BeamKind::kMeasured:
      return measured(sine);
  }
  return 0.0;
}

double BeamPattern::measured(double sine) const {
  const double angle_rad = exact::asin(std::min(1.0, sine));
  // The last row itself still counts; rounding of the arc sine must not silence it.
  if (angle_rad > row_rad_.back() * (1.0 + 1e-12)) {
    return 0.0;
  }
  const auto above = std::upper_bound(row_rad_.begin(), row_rad_.end(), angle_rad);
  const std::size_t right =
      std::min(static_cast<std::size_t>(above - row_rad_.begin()), row_rad_.size() - 1);
  const std::size_t left = right - 1;
  // In the square of the angle: a main lobe is nearly straight there, and smooth on the axis.
  const double left2 = square(row_rad_[left]);
  const double f = (square(angle_rad) - left2) / (square(row_rad_[right]) - left2);
  return exact::exp_fast(row_log_[left] + f * (row_log_[right] - row_log_[left]));
}

double BeamPattern::first_fall_rad(std::size_t axis) const {
  // Steps that cannot jump over a null's -30 dB neighbourhood, then bisection.
  constexpr int kSteps = 20000;
  const double limit_rad = 0.5 * exact::kPi;
  double low = 0.0;
  for (int step = 1; step <= kSteps; ++step) {
    double high = limit_rad * step / kSteps;
    if (axis_two_way(axis, exact::sin(high)) >= kCutLevel) {
      low = high;
      continue;
    }
    for (int i = 0; i < 60; ++i) {
      const double middle = 0.5 * (low + high);
      (axis_two_way(axis, exact::sin(middle)) >= kCutLevel ? low : high) = middle;
    }
    return 0.5 * (low + high);
  }
  return limit_rad;
}

void BeamPattern::choose_cut(std::size_t axis) {
  double& envelope_rad = envelope_rad_[axis];
  BeamCut& cut = cut_[axis];
  double null_argument = 0.0;
  switch (beam_.kind) {
    case model::BeamKind::kCone:
      envelope_rad = beam_.half_angle_deg * kRadPerDeg;
      cut = BeamCut::kConeEdge;
      break;
    case model::BeamKind::kPiston:
      null_argument = exact::kJ1SecondZero;
      break;
    case model::BeamKind::kRectangle:
      null_argument = 2.0 * exact::kPi;
      break;
    case model::BeamKind::kMeasured:
      envelope_rad = first_fall_rad(axis);
      cut = BeamCut::kMinus30dB;
      if (envelope_rad >= row_rad_.back()) {
        envelope_rad = row_rad_.back();
        cut = BeamCut::kEndOfPattern;
      }
      break;
  }
  if (null_argument > 0.0) {
    const bool exists = wave_factor_[axis] > null_argument;
    envelope_rad = exists ? exact::asin(null_argument / wave_factor_[axis]) : first_fall_rad(axis);
    cut = exists ? BeamCut::kSecondNull : BeamCut::kMinus30dB;
  }
  if (envelope_rad > kMaxEnvelope_deg * kRadPerDeg) {
    envelope_rad = kMaxEnvelope_deg * kRadPerDeg;
    cut = BeamCut::kWidestEnvelope;
  }
  if (beam_.max_half_angle_deg && envelope_rad > *beam_.max_half_angle_deg * kRadPerDeg) {
    envelope_rad = *beam_.max_half_angle_deg * kRadPerDeg;
    cut = BeamCut::kMaxHalfAngle;
  }
  require(envelope_rad >= kMinEnvelope_deg * kRadPerDeg, "half-angle of the envelope in degrees",
          envelope_rad / kRadPerDeg, "at least 0.01: the beam is too narrow for a table");
}

double BeamPattern::radial_energy(double to_rad) const {
  double sum = 0.0;
  for (const exact::Node& node : exact::gauss_nodes(0.0, to_rad, 128)) {
    const double sine = exact::sin(node.x);
    sum += node.weight * axis_two_way(0, sine) * sine;
  }
  return sum;
}

double BeamPattern::rectangle_energy(bool inside) const {
  // Directions as (across cosine v, angle a in the plane through the along axis): the along cosine
  // is sqrt(1 - v^2) sin a, and dv da is solid angle exactly (Archimedes).
  const auto end_rad = [&](std::size_t axis) {
    if (inside) {
      return envelope_rad_[axis];
    }
    return wave_factor_[axis] > kRectangleReach
               ? std::max(exact::asin(kRectangleReach / wave_factor_[axis]), envelope_rad_[axis])
               : 0.5 * exact::kPi;
  };
  const double tan_across = exact::tan(envelope_rad_[1]);
  const std::size_t panels = inside ? 12 : 40;
  double sum = 0.0;
  // v = v_end sin(psi): the outline may be steep where v ends.
  const double v_end = exact::sin(end_rad(1));
  for (const exact::Node& psi : exact::gauss_nodes(0.0, 0.5 * exact::kPi, panels)) {
    const exact::SinCos turn = exact::sin_cos(psi.x);
    const double v = v_end * turn.sin;
    const double r = std::sqrt((1.0 - v) * (1.0 + v));
    double a_end = end_rad(0);
    if (inside) {
      a_end = std::min(a_end, exact::acos(v / (r * tan_across)));
    }
    double line = 0.0;
    for (const exact::Node& a : exact::gauss_nodes(0.0, a_end, panels)) {
      line += a.weight * axis_two_way(0, r * exact::sin(a.x));
    }
    sum += psi.weight * v_end * turn.cos * axis_two_way(1, v) * line;
  }
  return sum;
}

}  // namespace leadline::host
