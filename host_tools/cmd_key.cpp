#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/topside/command_command.hpp"

namespace leadline::host {

void add_key_command(CLI::App* app, CommandRun* run) {
  CLI::App* const key = app->add_subcommand("key", "The key that a vehicle's commands need");
  key->require_subcommand(1);
  key->footer(
      "The file goes to the vehicle as it is ([commands] key in vehicle.toml) and stays here for "
      "`leadline command`, "
      "at\n"
      "both ends with mode 0600. Whoever has it commands the vehicle.\n\n"
      "Examples:\n"
      "  leadline key new command.key --vehicle 1\n"
      "  leadline key advance command.key --by 1000");
  const auto options = std::make_shared<KeyOptions>();
  CLI::App* const make = key->add_subcommand("new", "Make one, and say what to copy where");
  make->add_option("file", options->path, "File to write, for its owner alone")
      ->type_name("FILE")
      ->required();
  make->add_option("--vehicle", options->vehicle, "Number of the vehicle that it is for")
      ->type_name("N")
      ->check(CLI::Range(1, 65535))
      ->capture_default_str();
  make->callback([options, run] { *run = [options] { return run_key_new(*options); }; });
  CLI::App* const advance = key->add_subcommand(
      "advance", "Count on from further up: the vehicle says that a counter was used before");
  advance->add_option("file", options->path, "The key")->type_name("FILE")->required();
  advance->add_option("--by", options->more, "By so many")
      ->type_name("N")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 62U))
      ->capture_default_str();
  advance->callback([options, run] { *run = [options] { return run_key_advance(*options); }; });
}

}  // namespace leadline::host
