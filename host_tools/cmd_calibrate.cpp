#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/calibrate_command.hpp"
#include "host_tools/commands.hpp"
#include "host_tools/import/survey_arguments.hpp"
#include "host_tools/options.hpp"

namespace leadline::host {
namespace {

struct Arguments {
  CalibrateOptions options;
  std::vector<std::string> fit;
};

/// Soundings of a pings file are placed already.
constexpr const char* kOfRecordings[] = {"--lat",
                                         "--lon",
                                         "--lever-arm",
                                         "--boresight",
                                         "--draft",
                                         "--vertical",
                                         "--flip",
                                         "--level",
                                         "--heading-offset",
                                         "--attitude-delay",
                                         "--position-delay",
                                         "--profile",
                                         "--min-quality",
                                         "--beam"};

int run(const Arguments& arguments, const SurveyArguments& survey, const CLI::App& command) {
  for (const char* const option : kOfRecordings) {
    if (is_pings_path(survey.survey.paths.front()) && command.count(option) > 0) {
      usage_error(std::string(option) + ": is for recordings; pings (.csv) are placed already");
    }
  }
  CalibrateOptions options = arguments.options;
  options.survey = resolved_survey(survey);
  if (!arguments.fit.empty()) {
    options.settings.fit = {};
  }
  for (const std::string& name : arguments.fit) {
    for (std::size_t p = 0; p < kAlignmentParameters; ++p) {
      options.settings.fit[p] = options.settings.fit[p] || name == kAlignmentTraits[p].name;
    }
  }
  return run_calibrate(options);
}

}  // namespace

void add_calibrate_command(CLI::App* app, CommandRun* run_later) {
  const auto arguments = std::make_shared<Arguments>();
  const auto survey = std::make_shared<SurveyArguments>();
  CalibrationSettings& settings = arguments->options.settings;
  CLI::App* const command = app->add_subcommand(
      "calibrate", "Patch test: a head's boresight, latency, lever arm from lines that overlap");
  command
      ->add_option("files", survey->survey.paths,
                   "Pings (.csv, as for `leadline map`) or recordings (.xtf, .sum): one line each")
      ->type_name("FILE")
      ->required();
  std::vector<std::string> names;
  for (const AlignmentTraits& traits : kAlignmentTraits) {
    names.emplace_back(traits.name);
  }
  command
      ->add_option("--fit", arguments->fit,
                   "What is looked for, repeatable (default: all but position_latency)")
      ->check(CLI::IsMember(names));
  add_survey_arguments(command, survey);
  command->add_option("--cell", settings.cell_m, "Cell that one plane is fitted to, metres")
      ->type_name("M")
      ->check(CLI::Range(0.01, 1000.0))
      ->capture_default_str();
  command->add_option("--min-soundings", settings.min_soundings, "Soundings of such a cell")
      ->check(CLI::Range(6, 1'000'000))
      ->capture_default_str();
  command->add_flag(
      "--no-check", arguments->options.no_check,
      "Do not try the signs of roll and pitch turned round (takes a third of the time)");
  command->add_flag("--json", arguments->options.json, "Print one JSON object");
  command->footer(
      "Wanted are lines that cover the same ground: one there and back for roll and pitch, over a\n"
      "slope or an object; side by side for heading; with roll and pitch of their own for "
      "latency.\n"
      "What the soundings do not show is named and gets no number. A pings file's poses are of "
      "the\n"
      "head's mount: what is found is what its boresight and lever arm lack.\n\n"
      "Examples:\n"
      "  leadline calibrate north.xtf south.xtf\n"
      "  leadline calibrate line*.xtf --fit roll --fit pitch --lever-arm 0.75 1.5 0\n"
      "  leadline calibrate pings.csv --cell 2 --json");
  command->callback([arguments, survey, command, run_later] {
    *run_later = [arguments, survey, command] { return run(*arguments, *survey, *command); };
  });
}

}  // namespace leadline::host
