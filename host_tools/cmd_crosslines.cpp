#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/crosslines.hpp"

namespace leadline::host {

void add_crosslines_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<CrosslinesOptions>();
  CLI::App* const command = app->add_subcommand(
      "crosslines", "Compare soundings of lines that cross, or soundings and a map; S-44 orders");
  command->add_option("files", options->paths, "Pings, CSV as for `leadline map`: one file a line")
      ->type_name("FILE")
      ->required();
  command->add_option("--map", options->map_path, "Elevation raster to compare with instead")
      ->type_name("FILE");
  command
      ->add_option("--radius", options->radius_m,
                   "Soundings of a pair lie at most this far apart, metres")
      ->type_name("M")
      ->check(CLI::Range(0.001, 1000.0));
  command
      ->add_option("--order", options->require_order,
                   "Fail unless this order is met: Exclusive, Special, 1a, 1b, 2")
      ->type_name("NAME");
  command->add_flag("--json", options->json, "Print one JSON object");
  command->footer(
      "A difference is within an order when it is at most sqrt(2) times its total vertical "
      "uncertainty\n"
      "(both soundings may be off), against a map at most that itself; 95 % have to be.\n\n"
      "Examples:\n"
      "  leadline crosslines day1.csv day2.csv --radius 1.5\n"
      "  leadline crosslines cross.csv --map map/depth.asc --order 1a");
  command->callback([options, run] { *run = [options] { return run_crosslines(*options); }; });
}

}  // namespace leadline::host
