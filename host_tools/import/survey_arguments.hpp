// The options that tell where a head sits on its vehicle and which soundings count, shared by `leadline survey`
// and `leadline calibrate`.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "host_tools/import/survey_command.hpp"

namespace CLI {
class App;
}  // namespace CLI

namespace leadline::host {

/// As the command line gives them. Shared with the parser, which fills it.
struct SurveyArguments {
  SurveyOptions survey;
  std::vector<double> lever_arm_m;
  std::vector<double> boresight_deg;
  std::vector<std::string> flips;
  double delay_ms = 0;
  double position_delay_ms = 0;
  bool level = false;
};

/// Adds origin, geometry, profile and the choice of beams to `command`.
void add_survey_arguments(CLI::App* command, const std::shared_ptr<SurveyArguments>& arguments);

/// `arguments.survey` with the rest put into its geometry.
[[nodiscard]] SurveyOptions resolved_survey(const SurveyArguments& arguments);

}  // namespace leadline::host
