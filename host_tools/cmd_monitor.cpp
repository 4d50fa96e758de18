#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/monitor/monitor_command.hpp"

namespace leadline::host {

void add_monitor_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<MonitorOptions>();
  CLI::App* const command = app->add_subcommand(
      "monitor", "Watch a vehicle's map and health in a browser, live or recorded");
  CLI::Option* const map =
      command
          ->add_option("MAP", options->map_path,
                       "A log or a capture, to be played; or a survey of a store: FILE.lls for the "
                       "one saved last, FILE.lls#N")
          ->type_name("FILE");
  command
      ->add_option("--link", options->link_uri,
                   "udp:@:PORT, tcp:HOST:PORT, tcp:@:PORT, serial:PATH:BAUD; file:PATH is as FILE")
      ->type_name("URI")
      ->excludes(map);
  command->add_option("--http", options->http, "Where the page is served; port 0: any free one")
      ->type_name("ADDRESS:PORT")
      ->capture_default_str();
  command->add_option("--out", options->out_dir, "Map and receive.json, at the end and on SIGUSR1")
      ->type_name("DIR");
  add_link_use_options(command, &options->store_path, &options->share_path);
  command
      ->add_option(
          "--budget", options->budget_bytes_s,
          "What the link may carry, to be shown beside what it does, where that is not the "
          "vehicle's link.rate_bytes_s")
      ->type_name("BYTES_PER_S")
      ->check(CLI::Range(1.0, 1e9));
  command
      ->add_option("--speed", options->speed,
                   "Recordings: plays from the beginning, so many times as fast; without it the "
                   "page stands at the end")
      ->type_name("X")
      ->check(CLI::Range(0.1, 1000.0));
  command->add_flag("--no-resend", options->no_resend, "Never ask the vehicle for lost tiles");
  command->footer(
      "Prints the page's address and ends on Ctrl-C. The page is for browsers of this machine: to "
      "show "
      "it to\n"
      "another one, name an address of this machine that the other reaches (--http 10.0.0.7:8080), "
      "or 0.0.0.0 for\n"
      "all of them. There is no password: whoever reaches the address sees the map. Pages of other "
      "sites do "
      "not.\n\n"
      "In the page, H lists the keys.\n\n"
      "Examples:\n"
      "  leadline monitor --link udp:@:9100\n"
      "  leadline monitor --link udp:@:9100 --share $XDG_RUNTIME_DIR/leadline.sock\n"
      "  leadline monitor --link serial:/dev/ttyUSB0:9600 --budget 960 --out map\n"
      "  leadline monitor survey.lll --speed 10\n"
      "  leadline monitor surveys.lls#2");
  command->callback([options, run] { *run = [options] { return run_monitor(*options); }; });
}

}  // namespace leadline::host
