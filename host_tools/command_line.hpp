// The command line of `leadline`, so that tests reach it.
#pragma once

#include <memory>

#include "host_tools/commands.hpp"

namespace leadline::host {

/// All subcommands with their options and help. Parsing sets `*run` to what the chosen one does; both must outlive it.
[[nodiscard]] std::unique_ptr<CLI::App> make_command_line(CommandRun* run);

/// What main() does: parses, runs, says on standard error what is wrong. Returns the exit status.
[[nodiscard]] int run_command_line(int argc, char** argv);

}  // namespace leadline::host
