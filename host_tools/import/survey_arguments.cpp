#include "host_tools/import/survey_arguments.hpp"

#include <map>

#include <CLI/CLI.hpp>

namespace leadline::host {

void add_survey_arguments(CLI::App* command, const std::shared_ptr<SurveyArguments>& arguments) {
  SurveyOptions& survey = arguments->survey;
  SurveyGeometry& geometry = survey.geometry;
  command->add_option("--lat", survey.origin_lat_deg, "Origin of north and east, degrees")
      ->type_name("DEG")
      ->check(CLI::Range(-85.0, 85.0));
  command->add_option("--lon", survey.origin_lon_deg, "(default: the first position)")
      ->type_name("DEG")
      ->check(CLI::Range(-180.0, 180.0));
  command
      ->add_option("--lever-arm", arguments->lever_arm_m,
                   "Head from the place of the positions: forward right down, metres")
      ->type_name("M")
      ->expected(3);
  command
      ->add_option("--boresight", arguments->boresight_deg,
                   "Head on the vehicle: roll pitch heading, degrees")
      ->type_name("DEG")
      ->expected(3);
  command->add_option("--draft", geometry.draft_m, "Depth of the place of the positions, metres")
      ->type_name("M");
  command
      ->add_option("--vertical", geometry.vertical,
                   "What moves the head up and down: none, heave, height (of the positions)")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, VerticalSource>{{"none", VerticalSource::kNone},
                                                {"heave", VerticalSource::kHeave},
                                                {"height", VerticalSource::kHeight}}));
  command
      ->add_option("--flip", arguments->flips,
                   "Turn a sign round: roll, pitch or heave; repeatable")
      ->check(CLI::IsMember({"roll", "pitch", "heave"}));
  command->add_flag("--level", arguments->level, "Without roll and pitch");
  command
      ->add_option("--heading-offset", geometry.heading_offset_deg,
                   "Added to the heading: declination, a compass's deviation; degrees")
      ->type_name("DEG");
  command
      ->add_option("--attitude-delay", arguments->delay_ms,
                   "The attitude of a time stamp was true that much earlier; milliseconds")
      ->type_name("MS");
  command
      ->add_option("--position-delay", arguments->position_delay_ms,
                   "The position of a time stamp was true that much earlier; milliseconds")
      ->type_name("MS");
  command
      ->add_option("--profile", survey.profile_path,
                   "Sound speed by depth, lines of depth_m,speed_m_s: bends the rays")
      ->type_name("FILE");
  command->add_option("--max-angle", geometry.max_angle_deg, "Leave out beams beyond, degrees")
      ->type_name("DEG");
  command->add_option("--min-quality", geometry.min_quality, "Leave out beams below, 0 to 255");
  command->add_option("--beam", geometry.beams, "Only this beam; repeatable")->type_name("N");
}

SurveyOptions resolved_survey(const SurveyArguments& arguments) {
  SurveyOptions options = arguments.survey;
  SurveyGeometry& geometry = options.geometry;
  if (!arguments.lever_arm_m.empty()) {
    geometry.lever_arm_m = {arguments.lever_arm_m[0], arguments.lever_arm_m[1],
                            arguments.lever_arm_m[2]};
  }
  if (!arguments.boresight_deg.empty()) {
    geometry.boresight = {arguments.boresight_deg[0], arguments.boresight_deg[1],
                          arguments.boresight_deg[2]};
  }
  for (const std::string& name : arguments.flips) {
    double& sign = name == "roll" ? geometry.roll_sign
                                  : (name == "pitch" ? geometry.pitch_sign : geometry.heave_sign);
    sign = -1;
  }
  geometry.attitude_delay_us = static_cast<std::int64_t>(arguments.delay_ms * 1000.0);
  geometry.position_delay_us = static_cast<std::int64_t>(arguments.position_delay_ms * 1000.0);
  geometry.use_attitude = !arguments.level;
  return options;
}

}  // namespace leadline::host
