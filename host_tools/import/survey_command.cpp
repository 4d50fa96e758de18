#include "host_tools/import/survey_command.hpp"

#include <algorithm>
#include <cmath>
#include <iostream>

#include "host_tools/exit_codes.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

std::string fixed_text(double value, int digits) {
  std::string text;
  append_fixed(&text, value, digits);
  return text;
}

std::string pings_csv(const std::vector<SurveyRow>& rows) {
  std::string text =
      "time_us,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,beam_az_deg,beam_el_deg,range_m\n";
  text.reserve(text.size() + rows.size() * 110);
  for (const SurveyRow& row : rows) {
    text += std::to_string(row.t_us);
    const double lengths[] = {row.head_m.x, row.head_m.y, row.head_m.z};
    const double angles[] = {row.attitude.roll_deg, row.attitude.pitch_deg,
                             row.attitude.heading_deg, row.beam.azimuth_deg,
                             row.beam.elevation_deg};
    for (const double value : lengths) {
      text += ",";
      append_fixed(&text, value, 4);
    }
    for (const double value : angles) {
      text += ",";
      append_fixed(&text, value, 5);
    }
    text += ",";
    append_fixed(&text, row.range_m, 4);
    text += "\n";
  }
  return text;
}

struct Extent {
  Vec3 low{1e30, 1e30, 1e30};
  Vec3 high{-1e30, -1e30, -1e30};
};

Extent extent_of(const std::vector<SurveyRow>& rows) {
  Extent extent;
  for (const SurveyRow& row : rows) {
    extent.low = {std::min(extent.low.x, row.end.north_m), std::min(extent.low.y, row.end.east_m),
                  std::min(extent.low.z, row.end.depth_m)};
    extent.high = {std::max(extent.high.x, row.end.north_m),
                   std::max(extent.high.y, row.end.east_m),
                   std::max(extent.high.z, row.end.depth_m)};
  }
  return extent;
}

std::string spread_text(const CellSpread& spread) {
  return spread.cells == 0 ? "no cell with enough soundings"
                           : fixed_text(100.0 * spread.median_m, 2) + " cm (" +
                                 std::to_string(spread.cells) + " cells)";
}

void print_text(const SurveyOptions& options, const SurveyCounts& counts,
                const std::vector<SurveyRow>& rows, const estimator::LocalPlane& plane,
                const SignCheck& check) {
  const Extent extent = extent_of(rows);
  std::cout << "beams          " << counts.beams << ", of which mapped " << counts.rows
            << "; left out: without pose " << counts.without_pose << ", too steep "
            << counts.too_steep << ", low quality " << counts.low_quality << ", other beams "
            << counts.other_beams << ", ray lost " << counts.refracted_away
            << "\norigin         lat "
            << json_number(1e-9 * static_cast<double>(plane.origin().latitude_e9deg)) << ", lon "
            << json_number(1e-9 * static_cast<double>(plane.origin().longitude_e9deg))
            << "\nsoundings      north " << fixed_text(extent.low.x, 1) << " .. "
            << fixed_text(extent.high.x, 1) << ", east " << fixed_text(extent.low.y, 1) << " .. "
            << fixed_text(extent.high.y, 1) << ", depth " << fixed_text(extent.low.z, 2) << " .. "
            << fixed_text(extent.high.z, 2) << " m\nspread         median of the deviations within "
            << json_number(options.spread_cell_m) << " m cells of " << options.spread_min_soundings
            << " soundings or more:\n";
  for (const SignTrial& trial : check.trials) {
    std::cout << "                 " << trial.name << ": " << spread_text(trial.spread) << "\n";
  }
  if (!options.no_check && !check.can_tell) {
    std::cout << "                 too few cells to judge the signs by\n";
  }
  if (!options.out_path.empty()) {
    std::cout << "written to     " << options.out_path << "\n";
  }
}

void print_json(const SurveyCounts& counts, const std::vector<SurveyRow>& rows,
                const estimator::LocalPlane& plane, const SignCheck& check) {
  const Extent extent = extent_of(rows);
  std::string trials;
  for (const SignTrial& trial : check.trials) {
    trials += (trials.empty() ? "" : ", ") + json_string(trial.name) +
              ": {\"median_m\": " + json_number(trial.spread.median_m) +
              ", \"cells\": " + std::to_string(trial.spread.cells) + "}";
  }
  std::string wrong;
  for (const std::string& name : check.wrong) {
    wrong += (wrong.empty() ? "" : ", ") + json_string(name);
  }
  std::cout << "{\n  \"beams\": " << counts.beams << ",\n  \"rows\": " << counts.rows
            << ",\n  \"without_pose\": " << counts.without_pose
            << ",\n  \"too_steep\": " << counts.too_steep
            << ",\n  \"low_quality\": " << counts.low_quality
            << ",\n  \"other_beams\": " << counts.other_beams
            << ",\n  \"ray_lost\": " << counts.refracted_away << ",\n  \"lat\": "
            << json_number(1e-9 * static_cast<double>(plane.origin().latitude_e9deg))
            << ",\n  \"lon\": "
            << json_number(1e-9 * static_cast<double>(plane.origin().longitude_e9deg))
            << ",\n  \"north_m\": [" << json_number(extent.low.x) << ", "
            << json_number(extent.high.x) << "],\n  \"east_m\": [" << json_number(extent.low.y)
            << ", " << json_number(extent.high.y) << "],\n  \"depth_m\": ["
            << json_number(extent.low.z) << ", " << json_number(extent.high.z)
            << "],\n  \"spread\": {" << trials
            << "},\n  \"signs_can_be_told\": " << (check.can_tell ? "true" : "false")
            << ",\n  \"better_with\": [" << wrong << "]\n}\n";
}

/// The soundings agree better with a sign turned round: that ends the command, unless it may not.
void judge(const SurveyOptions& options, const SignCheck& check) {
  for (const SignTrial& trial : check.trials) {
    if (std::find(check.wrong.begin(), check.wrong.end(), trial.name) == check.wrong.end()) {
      continue;
    }
    const std::string message = "a sign looks wrong: soundings of one cell lie " +
                                spread_text(check.trials.front().spread) + " apart as given, but " +
                                spread_text(trial.spread) + " with " + trial.name +
                                "; turn it round (--flip), or " +
                                "--accept-signs to go on as it is";
    if (!options.accept_signs) {
      throw HostError(ExitCode::kInput, message);
    }
    std::cerr << "leadline: survey: " << message << "\n";
  }
}

estimator::LocalPlane plane_of(const SurveyOptions& options, const std::vector<SurveyLine>& lines) {
  if (options.origin_lat_deg.has_value() != options.origin_lon_deg.has_value()) {
    throw HostError(ExitCode::kUsage, "--lat and --lon: an origin needs both");
  }
  estimator::Geodetic origin{};
  if (options.origin_lat_deg) {
    origin = {std::llround(*options.origin_lat_deg * 1e9),
              std::llround(*options.origin_lon_deg * 1e9)};
  } else if (!lines.front().positions.empty()) {
    origin = {lines.front().positions.front().latitude_e9deg,
              lines.front().positions.front().longitude_e9deg};
  }
  estimator::LocalPlane plane;
  if (plane.configure(origin) != base::Status::kOk) {
    throw HostError(ExitCode::kUsage,
                    "--lat, --lon: no origin can lie at " +
                        json_number(1e-9 * static_cast<double>(origin.latitude_e9deg)) + ", " +
                        json_number(1e-9 * static_cast<double>(origin.longitude_e9deg)));
  }
  return plane;
}

}  // namespace

void read_survey(const SurveyOptions& options, const char* command, SurveyInput* input) {
  input->geometry = options.geometry;
  if (!options.profile_path.empty()) {
    input->profile = read_sound_speed_profile(options.profile_path);
    input->geometry.profile = &input->profile;
  }
  for (const std::string& path : options.paths) {
    std::string notice;
    input->lines.push_back(read_survey_line(path, &notice));
    if (!notice.empty()) {
      std::cerr << "leadline: " << command << ": " << path << ": " << notice << "\n";
    }
  }
  input->plane = plane_of(options, input->lines);
}

int run_survey(const SurveyOptions& options) {
  SurveyInput input;
  read_survey(options, "survey", &input);
  const std::vector<SurveyLine>& lines = input.lines;
  const estimator::LocalPlane& plane = input.plane;
  SurveyGeometry geometry = input.geometry;
  if (options.fit_lever_arm) {
    geometry.lever_arm_m =
        fit_lever_arm(lines, plane, geometry, options.spread_cell_m, options.spread_min_soundings);
    std::cerr << "leadline: survey: soundings agree best with the head "
              << fixed_text(geometry.lever_arm_m.x, 2) << " m forward, "
              << fixed_text(geometry.lever_arm_m.y, 2) << " m to starboard\n";
  }
  std::vector<SurveyRow> rows;
  SurveyCounts counts;
  for (const SurveyLine& line : lines) {
    build_rows(line, plane, geometry, &rows, &counts);
  }
  if (rows.empty()) {
    throw HostError(ExitCode::kInput, options.paths.front() + ": none of " +
                                          std::to_string(counts.beams) +
                                          " beams can be placed (without pose " +
                                          std::to_string(counts.without_pose) + ", too steep " +
                                          std::to_string(counts.too_steep) + ", low quality " +
                                          std::to_string(counts.low_quality) + ", ray lost " +
                                          std::to_string(counts.refracted_away) + ")");
  }
  std::stable_sort(rows.begin(), rows.end(),
                   [](const SurveyRow& a, const SurveyRow& b) { return a.t_us < b.t_us; });
  SignCheck check;
  if (options.no_check) {
    check.trials.push_back({"as given",
                            cell_spread(rows, options.spread_cell_m, options.spread_min_soundings),
                            false});
  } else {
    check =
        check_signs(lines, plane, geometry, options.spread_cell_m, options.spread_min_soundings);
  }
  judge(options, check);
  if (!options.out_path.empty()) {
    write_file_whole(options.out_path, pings_csv(rows));
  }
  if (options.json) {
    print_json(counts, rows, plane, check);
  } else {
    print_text(options, counts, rows, plane, check);
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
