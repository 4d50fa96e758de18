#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/import/survey_arguments.hpp"

namespace leadline::host {
void add_survey_command(CLI::App* app, CommandRun* run_later) {
  const auto arguments = std::make_shared<SurveyArguments>();
  SurveyOptions& options = arguments->survey;
  CLI::App* const command = app->add_subcommand(
      "survey", "Make pings and poses of a survey's recordings: XTF (R2Sonic), SonTek .sum, PD0");
  command->add_option("files", options.paths, "Recordings, .xtf, .sum, .pd0 or .enx: one line each")
      ->type_name("FILE")
      ->required();
  command->add_option("--out", options.out_path, "Pings, CSV as `leadline map` reads it")
      ->type_name("FILE");
  add_survey_arguments(command, arguments);
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
  command->callback([arguments, run_later] {
    *run_later = [arguments] { return run_survey(resolved_survey(*arguments)); };
  });
}

}  // namespace leadline::host
