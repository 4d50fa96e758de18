// `leadline survey`: recordings of a survey become one pings file for `leadline map` and `leadline grid`.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_tools/import/survey.hpp"

namespace leadline::host {

struct SurveyOptions {
  std::vector<std::string> paths;        ///< .xtf, .sum; one line each
  std::string out_path;                  ///< the pings file; "" = only the figures
  std::string profile_path;              ///< sound speed profile; "" = straight lines
  std::optional<double> origin_lat_deg;  ///< origin of north and east; default: the first position
  std::optional<double> origin_lon_deg;
  SurveyGeometry geometry;
  double spread_cell_m = 0.5;
  std::size_t spread_min_soundings = 10;
  bool fit_lever_arm = false;  ///< forward and starboard, from the soundings themselves
  bool accept_signs = false;   ///< a wrong sign is a warning instead of the end
  bool no_check = false;       ///< do not try the other signs
  bool json = false;
};

/// What a survey's options name, read. Not copied: the geometry points to the profile.
struct SurveyInput {
  SurveyInput() = default;
  SurveyInput(const SurveyInput&) = delete;
  SurveyInput& operator=(const SurveyInput&) = delete;

  std::vector<SurveyLine> lines;
  estimator::LocalPlane plane;
  estimator::SoundSpeedProfile profile;
  SurveyGeometry geometry;
};

/// Fills a fresh `input`; what was odd about a file goes to stderr as `command`'s. Throws HostError kInput,
/// kUsage (one of lat and lon, no place on Earth).
void read_survey(const SurveyOptions& options, const char* command, SurveyInput* input);

/// The command. Prints what became of the beams, and how far soundings of a cell lie apart as given, with
/// each sign flipped and without attitude. Returns 0. Throws HostError: kInput (files; a flipped sign
/// agrees better: with the numbers), kUsage (one of lat and lon), kOutput.
int run_survey(const SurveyOptions& options);

}  // namespace leadline::host
