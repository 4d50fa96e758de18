// `leadline`: command line, exit codes, and nothing else.
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <iostream>
#include <new>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/text.hpp"

namespace {

using leadline::host::CommandRun;
using leadline::host::ExitCode;
using leadline::host::HostError;

int status_of(ExitCode code) { return static_cast<int>(code); }

/// Every line of a message gets the prefix, so that logs of several programs stay readable.
void print_error(const std::string& message) {
  std::string::size_type begin = 0;
  while (begin <= message.size()) {
    const auto end = std::min(message.find('\n', begin), message.size());
    std::cerr << "leadline: error: " << message.substr(begin, end - begin) << "\n";
    begin = end + 1;
  }
}

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

/// Runs what was asked for; everything thrown ends here.
int run_guarded(const CommandRun& run) {
  try {
    return run();
  } catch (const HostError& error) {
    print_error(error.what());
    return status_of(error.code());
  } catch (const std::bad_alloc&) {
    print_error("out of memory");
  } catch (const std::exception& error) {
    print_error(std::string("internal: ") + error.what());
  }
  return status_of(ExitCode::kInternal);
}

/// Standard output is a result too: what could not be written must not look like success.
int checked_output(int status) {
  std::cout.flush();
  const bool written = std::cout.good() && std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
  if (written || status != status_of(ExitCode::kOk)) {
    return status;
  }
  print_error("cannot write standard output");
  return status_of(ExitCode::kOutput);
}

}  // namespace

int main(int argc, char** argv) {
  // A closed pipe and a file that reaches its size limit are errors of a write, reported as such.
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);

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
      "  leadline map --pings survey/pings.csv --config survey/map.toml --out map\n"
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

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {
      return checked_output(app.exit(error));  // --help, --version
    }
    const std::string hint = subcommand_hint(app, argc, argv);
    print_error(hint.empty() ? error.what() : hint);
    std::cerr << "Run `leadline --help` or `leadline COMMAND --help`.\n";
    return status_of(ExitCode::kUsage);
  }
  return checked_output(run_guarded(run));
}
