#include "host_tools/command_line.hpp"

#include <cmath>
#include <cstdlib>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "firmware/config/program.hpp"
#include "host_tools/commands.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

constexpr const char* kProgram = "leadline";

/// "did you mean" for a first word that is no subcommand; "" when there is nothing to say.
std::string subcommand_hint(const CLI::App& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') {
    return "";
  }
  std::vector<std::string> names;
  for (const CLI::App* const sub : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (sub->get_name() == argv[1]) {
      return "";
    }
    names.push_back(sub->get_name());
  }
  const std::string near = closest_name(argv[1], names);
  return "there is no command \"" + printable(argv[1]) + "\"" +
         (near.empty() ? "" : "; did you mean \"" + near + "\"?");
}

bool finite_or_text(const std::string& value) {
  char* end = nullptr;
  const double number = std::strtod(value.c_str(), &end);
  return std::isfinite(number) || end != value.c_str() + value.size();
}

/// What the parser takes and nobody means: "" (the parser then leaves the default) and numbers that are none, NaN and
/// infinities ("nan" as a name: ./nan). Names and titles may be anything. "" when there is nothing to say.
std::string value_problem(const CLI::App& app) {
  for (const CLI::Option* const option : app.get_options()) {
    for (const std::string& value : option->results()) {
      const bool text = option->get_type_name() == "TEXT";
      if (!text && value.empty()) {
        return option->get_name() + ": has an empty value";
      }
      if (!text && !finite_or_text(value)) {
        return option->get_name() + " " + printable(value) + ": has to be a finite number";
      }
    }
  }
  for (const CLI::App* const sub : app.get_subcommands()) {
    if (std::string problem = value_problem(*sub); !problem.empty()) {
      return problem;
    }
  }
  return "";
}

}  // namespace

std::unique_ptr<CLI::App> make_command_line(CommandRun* run) {
  auto app = std::make_unique<CLI::App>(
      "Leadline turns sonar pings into a voxel model of what is certain, and the model into a "
      "depth "
      "map.",
      "leadline");
  app->set_version_flag("--version", std::string("leadline ") + LEADLINE_VERSION);
  app->require_subcommand(1);
  app->footer(
      "A first map, from nothing:\n"
      "  leadline simulate --out survey\n"
      "  leadline replay survey/survey.lll --out map\n"
      "  leadline compare map/depth.asc survey/truth.asc --sigma map/sigma.asc\n"
      "  leadline render map --out pictures\n\n"
      "`leadline COMMAND --help` explains a command with examples.\n"
      "Exit status: 0 done (rejected rows are counted), 2 usage or configuration, 3 input,\n"
      "4 output, 5 comparison failed, 1 internal error.");

  add_map_command(app.get(), run);
  add_grid_command(app.get(), run);
  add_query_command(app.get(), run);
  add_compare_command(app.get(), run);
  add_table_command(app.get(), run);
  add_render_command(app.get(), run);
  add_simulate_command(app.get(), run);
  add_scene_command(app.get(), run);
  add_emulate_command(app.get(), run);
  add_receive_command(app.get(), run);
  add_monitor_command(app.get(), run);
  add_replay_command(app.get(), run);
  add_export_command(app.get(), run);
  add_decode_command(app.get(), run);
  add_probe_command(app.get(), run);
  add_import_command(app.get(), run);
  add_survey_command(app.get(), run);
  add_crosslines_command(app.get(), run);
  add_calibrate_command(app.get(), run);
  add_store_command(app.get(), run);
  add_config_command(app.get(), run);
  add_link_sim_command(app.get(), run);
  add_key_command(app.get(), run);
  add_command_command(app.get(), run);
  return app;
}

int run_command_line(int argc, char** argv) {
  CommandRun run;
  const std::unique_ptr<CLI::App> app = make_command_line(&run);
  try {
    app->parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {
      return checked_output(kProgram, app->exit(error));  // --help, --version
    }
    const std::string hint = subcommand_hint(*app, argc, argv);
    print_error(kProgram, hint.empty() ? error.what() : hint);
    std::cerr << "Run `leadline --help` or `leadline COMMAND --help`.\n";
    return static_cast<int>(ExitCode::kUsage);
  }
  if (const std::string problem = value_problem(*app); !problem.empty()) {
    print_error(kProgram, problem);
    return static_cast<int>(ExitCode::kUsage);
  }
  return checked_output(kProgram, run_guarded(kProgram, run));
}

}  // namespace leadline::host
