#include <map>
#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/import/survey_command.hpp"

namespace leadline::host {
namespace {

struct Arguments {
  SurveyOptions options;
  std::vector<double> lever_arm_m;
  std::vector<double> boresight_deg;
  std::vector<std::string> flips;
  double delay_ms = 0;
  bool level = false;
};

int run(const Arguments& arguments) {
  SurveyOptions options = arguments.options;
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
  geometry.use_attitude = !arguments.level;
  return run_survey(options);
}

}  // namespace

void add_survey_command(CLI::App* app, CommandRun* run_later) {
  const auto arguments = std::make_shared<Arguments>();
  SurveyOptions& options = arguments->options;
  SurveyGeometry& geometry = options.geometry;
  CLI::App* const command = app->add_subcommand(
      "survey", "Make pings and poses of a survey's recordings: XTF (R2Sonic), SonTek .sum");
  command->add_option("files", options.paths, "Recordings, .xtf or .sum: one line each")
      ->type_name("FILE")
      ->required();
  command->add_option("--out", options.out_path, "Pings, CSV as `leadline map` reads it")
      ->type_name("FILE");
  command->add_option("--lat", options.origin_lat_deg, "Origin of north and east, degrees")
      ->type_name("DEG")
      ->check(CLI::Range(-85.0, 85.0));
  command->add_option("--lon", options.origin_lon_deg, "(default: the first position)")
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
      ->add_option("--profile", options.profile_path,
                   "Sound speed by depth, lines of depth_m,speed_m_s: bends the rays")
      ->type_name("FILE");
  command->add_option("--max-angle", geometry.max_angle_deg, "Leave out beams beyond, degrees")
      ->type_name("DEG");
  command->add_option("--min-quality", geometry.min_quality, "Leave out beams below, 0 to 255");
  command->add_option("--beam", geometry.beams, "Only this beam; repeatable")->type_name("N");
  command->add_option("--cell", options.spread_cell_m, "Cell of the spread, metres")
      ->type_name("M")
      ->check(CLI::Range(0.01, 1000.0));
  command->add_option("--min-soundings", options.spread_min_soundings, "Soundings of such a cell")
      ->check(CLI::Range(2, 1'000'000));
  command->add_flag("--fit-lever-arm", options.fit_lever_arm,
                    "Find forward and right of the lever arm from the soundings");
  command->add_flag("--accept-signs", options.accept_signs,
                    "Go on where another sign makes the soundings agree better");
  command->add_flag("--no-check", options.no_check, "Do not try the other signs");
  command->add_flag("--json", options.json, "Print one JSON object");
  command->footer(
      "Every beam is placed with the attitude at its transmission and at its reception. The signs "
      "of\n"
      "roll, pitch and heave are tried both ways: when soundings of one cell agree better with one "
      "of\n"
      "them turned round, the command ends with exit status 3 and says so.\n\n"
      "Examples:\n"
      "  leadline survey line.xtf --out pings.csv\n"
      "  leadline survey line.xtf --profile svp.csv --lever-arm 5.3 1.2 3.4 --out pings.csv\n"
      "  leadline survey *.sum --lat 52.34 --lon 12.99 --vertical none --out pings.csv");
  command->callback(
      [arguments, run_later] { *run_later = [arguments] { return run(*arguments); }; });
}

}  // namespace leadline::host
