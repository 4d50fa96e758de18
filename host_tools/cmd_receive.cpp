#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/topside/receive_command.hpp"

namespace leadline::host {

void add_link_use_options(CLI::App* command, std::string* store_path, std::string* share_path) {
  command
      ->add_option(
          "--store", *store_path,
          "Keep the map in this file of surveys (leadline store), second by second; what it\n"
          "has of the same survey is resumed")
      ->type_name("FILE.lls");
  command
      ->add_option("--share", *share_path,
                   "Local socket of this user through which `leadline command --link unix:SOCKET` "
                   "uses the link\nmeanwhile; receive and monitor get the map there, also later")
      ->type_name("SOCKET");
}

void add_receive_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<ReceiveOptions>();
  CLI::App* const command =
      app->add_subcommand("receive", "Take a vehicle's map from its link, live");
  command
      ->add_option("--link", options->link_uri,
                   "udp:@:PORT, tcp:HOST:PORT, tcp:@:PORT, serial:PATH:BAUD or file:PATH (a log, a "
                   "capture)")
      ->type_name("URI")
      ->required();
  command
      ->add_option("--out", options->out_dir,
                   "Map and receive.json: at the end, on SIGUSR1, and --every S")
      ->type_name("DIR");
  add_link_use_options(command, &options->store_path, &options->share_path);
  command->add_option("--every", options->every_s, "Write the results every S seconds")
      ->type_name("S")
      ->check(CLI::Range(0.1, 1e6));
  command->add_option("--idle", options->idle_s, "End after S seconds of silence, once bytes came")
      ->type_name("S")
      ->check(CLI::Range(0.01, 1e6));
  command->add_option("--wait", options->wait_s, "End when nothing came for S seconds")
      ->type_name("S")
      ->check(CLI::Range(0.01, 1e6));
  command->add_option("--survey", options->survey_id, "Take this survey only, by its id")
      ->type_name("N")
      ->check(CLI::Range(std::uint64_t{0}, std::uint64_t{9'007'199'254'740'991}));
  command
      ->add_option("--compare-log", options->log_path,
                   "At the end: the vehicle's log, whose map must be this one (else exit 5)")
      ->type_name("FILE");
  command->add_flag("--no-resend", options->no_resend, "Never ask the vehicle for lost tiles");
  command->add_flag("--json", options->json, "Print receive.json at the end");
  command->footer(
      "Joins at any time: what was sent before comes on request. Ends on SIGINT or SIGTERM, with "
      "its\n"
      "results; at the end of a file; with --idle. A new survey or session begins a new map; the "
      "one\n"
      "before stays in a folder of its own inside DIR.\n\n"
      "Examples:\n"
      "  leadline receive --link udp:@:9100 --out map --every 10\n"
      "  leadline receive --link udp:@:9100 --store surveys.lls\n"
      "  leadline receive --link udp:@:9100 --out map --share $XDG_RUNTIME_DIR/leadline.sock\n"
      "  leadline receive --link file:survey.lll --out map");
  command->callback([options, run] { *run = [options] { return run_receive(*options); }; });
}

}  // namespace leadline::host
