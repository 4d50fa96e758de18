#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/topside/link_sim.hpp"

namespace leadline::host {

void add_link_sim_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<LinkSimOptions>();
  CLI::App* const command = app->add_subcommand(
      "link-sim", "Send a recorded survey's map over a bad line, in simulated time");
  command->add_option("log", options->log_path, "Log of leadline-vehicle or `leadline simulate`")
      ->type_name("FILE")
      ->required();
  command->add_option("--rate", options->rate_baud, "Of the line, 10 bits a byte (9600)")
      ->type_name("BAUD");
  command->add_option("--loss", options->loss, "Fraction of the frames that is lost, each way")
      ->type_name("P");
  command
      ->add_option("--reorder", options->reorder,
                   "Fraction that arrives behind up to three of its followers")
      ->type_name("P");
  command->add_option("--dup", options->duplicate, "Fraction that arrives twice")->type_name("P");
  command->add_option("--seed", options->seed, "Of the line's luck (1)")->type_name("N");
  command
      ->add_option("--seeds", options->seeds,
                   "So many runs, from --seed on: prints their spread as a JSON object (1)")
      ->type_name("N");
  command->add_option("--mtu", options->mtu_bytes, "Largest frame, 128 to 1400 (the log's)")
      ->type_name("BYTES");
  command->add_option("--delay-ms", options->delay_ms, "One way, besides what the bytes take (5)")
      ->type_name("MS");
  command->add_flag("--join", options->join,
                    "The topside starts without the vehicle's hello and has to ask for it");
  command->add_flag("--json", options->json, "Print one JSON object");
  command->footer(
      "The log is replayed to its end; then the map stands still, every tile that is known is owed "
      "to a\n"
      "topside that has none, and the vehicle's own link code sends them to the topside's own "
      "receiver.\n"
      "Both ways lose, reorder and double frames alike; bytes count with their framing. The same "
      "is done\n"
      "first without loss: `lossless_bytes`.\n\n"
      "Exit status 5: the maps did not become equal within an hour.\n\n"
      "Example:\n"
      "  leadline link-sim --rate 1200 --loss 0.3 --reorder 0.05 --dup 0.05 --seed 7 survey.lll "
      "--json");
  command->callback([options, run] { *run = [options] { return run_link_sim(*options); }; });
}

}  // namespace leadline::host
