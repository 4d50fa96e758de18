#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/config_command.hpp"

namespace leadline::host {
namespace {

void add_out(CLI::App* command, ConfigOptions* options) {
  command->add_option("--out", options->out_path, "File to write; - is standard output")
      ->type_name("FILE")
      ->required();
}

}  // namespace

void add_config_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<ConfigOptions>();
  CLI::App* const command = app->add_subcommand(
      "config", "Configuration of a vehicle without files: compile, show, migrate");
  command->require_subcommand(1);

  CLI::App* const compile = command->add_subcommand(
      "compile", "vehicle.toml and its tables into one checked block of bytes");
  compile->add_option("file", options->path, "vehicle.toml")->type_name("FILE")->required();
  add_out(compile, options.get());
  compile
      ->add_option("--session", options->session,
                   "Number of the session: another one for every survey begun anew")
      ->capture_default_str();
  compile
      ->add_option("--beams", options->beams,
                   "Beams of a transmission of heads that have many, for the estimate of the load; "
                   "default: as many "
                   "as the driver takes")
      ->check(CLI::Range(1, 16384));
  compile->callback([options, run] { *run = [options] { return run_config_compile(*options); }; });

  CLI::App* const show = command->add_subcommand("show", "What a block says");
  show->add_option("block", options->path, "A block")->type_name("FILE")->required();
  show->add_flag("--json", options->json, "Print one JSON object");
  show->callback([options, run] { *run = [options] { return run_config_show(*options); }; });

  CLI::App* const migrate = command->add_subcommand(
      "migrate", "A vehicle.toml or a block of an older schema into the newest");
  migrate->add_option("file", options->path, "vehicle.toml, or a block")
      ->type_name("FILE")
      ->required();
  add_out(migrate, options.get());
  migrate
      ->add_option("--from", options->from,
                   "Schema version of a vehicle.toml that says none (0: from before the default "
                   "of voxel_budget); default: the newest")
      ->check(CLI::Range(0, 1000));
  migrate->callback([options, run] { *run = [options] { return run_config_migrate(*options); }; });

  command->footer(
      "compile and migrate write nothing that a vehicle would refuse. compile makes depths in "
      "passes where [cycle] does\n"
      "not say otherwise (extract_interval_s = 1.5, tile_budget = 1): what a Cortex-M7 can carry; "
      "it says so, says what the\n"
      "whole comes to by estimate, and warns where that is too much. migrate keeps comments, order "
      "and layout, says\n"
      "every change, and stops at keys that it does not know.\n\n"
      "Examples:\n"
      "  leadline config compile vehicle.toml --out vehicle.llb && leadline config show "
      "vehicle.llb\n"
      "  leadline config migrate old.toml --from 0 --out vehicle.toml");
}

}  // namespace leadline::host
