#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/topside/replay.hpp"

namespace leadline::host {

void add_replay_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<ReplayOptions>();
  CLI::App* const command = app->add_subcommand(
      "replay", "Run the vehicle's pipeline over a recorded log: the same map, bit for bit");
  command->add_option("log", options->log_path, "Log of leadline-vehicle or `leadline simulate`")
      ->type_name("FILE")
      ->required();
  command
      ->add_option("--out", options->out_dir,
                   "Write the map as `leadline map` does, with pings.csv and map.toml")
      ->type_name("DIR");
  command->add_flag("--json", options->json, "Print one JSON object");
  command->footer(
      "The log holds configuration, tables, times and every byte that came in: nothing else is "
      "needed.\n"
      "Exit status 5: map, cells of the link or its bytes differ from the log's end record. Gaps "
      "are\n"
      "reported on standard error; a log that ends early is replayed as far as it goes.\n\n"
      "Examples:\n"
      "  leadline replay survey.lll\n"
      "  leadline replay survey.lll --out map && leadline render map --out pictures");
  command->callback([options, run] { *run = [options] { return run_replay(*options); }; });
}

}  // namespace leadline::host
