// `leadline`: command line, exit codes, and nothing else.
#include <iostream>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "firmware/config/program.hpp"
#include "host_tools/commands.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"

namespace {

using leadline::host::checked_output;
using leadline::host::CommandRun;
using leadline::host::ExitCode;
using leadline::host::print_error;

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
  const std::string near = leadline::host::closest_name(argv[1], names);
  return "there is no command \"" + leadline::host::printable(argv[1]) + "\"" +
         (near.empty() ? "" : "; did you mean \"" + near + "\"?");
}

}  // namespace

int main(int argc, char** argv) {
  leadline::host::ignore_write_signals();

  CLI::App app(
      "Leadline turns sonar pings into a voxel model of what is certain, and the model into a "
      "depth "
      "map.",
      "leadline");
  app.set_version_flag("--version", std::string("leadline ") + LEADLINE_VERSION);
  app.require_subcommand(1);
  app.footer(
      "A first map, from nothing:\n"
      "  leadline simulate --out survey\n"
      "  leadline replay survey/survey.lll --out map\n"
      "  leadline compare map/depth.asc survey/truth.asc --sigma map/sigma.asc\n"
      "  leadline render map --out pictures\n\n"
      "`leadline COMMAND --help` explains a command with examples.\n"
      "Exit status: 0 done (rejected rows are counted), 2 usage or configuration, 3 input,\n"
      "4 output, 5 comparison failed, 1 internal error.");

  CommandRun run;
  leadline::host::add_map_command(&app, &run);
  leadline::host::add_grid_command(&app, &run);
  leadline::host::add_query_command(&app, &run);
  leadline::host::add_compare_command(&app, &run);
  leadline::host::add_table_command(&app, &run);
  leadline::host::add_render_command(&app, &run);
  leadline::host::add_simulate_command(&app, &run);
  leadline::host::add_scene_command(&app, &run);
  leadline::host::add_emulate_command(&app, &run);
  leadline::host::add_receive_command(&app, &run);
  leadline::host::add_monitor_command(&app, &run);
  leadline::host::add_replay_command(&app, &run);
  leadline::host::add_export_command(&app, &run);
  leadline::host::add_decode_command(&app, &run);
  leadline::host::add_probe_command(&app, &run);
  leadline::host::add_import_command(&app, &run);
  leadline::host::add_survey_command(&app, &run);
  leadline::host::add_crosslines_command(&app, &run);
  leadline::host::add_calibrate_command(&app, &run);
  leadline::host::add_store_command(&app, &run);
  leadline::host::add_config_command(&app, &run);
  leadline::host::add_link_sim_command(&app, &run);
  leadline::host::add_key_command(&app, &run);
  leadline::host::add_command_command(&app, &run);

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {
      return checked_output(kProgram, app.exit(error));  // --help, --version
    }
    const std::string hint = subcommand_hint(app, argc, argv);
    print_error(kProgram, hint.empty() ? error.what() : hint);
    std::cerr << "Run `leadline --help` or `leadline COMMAND --help`.\n";
    return static_cast<int>(ExitCode::kUsage);
  }
  return checked_output(kProgram, leadline::host::run_guarded(kProgram, run));
}
