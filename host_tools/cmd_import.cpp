#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/import/import.hpp"

namespace leadline::host {

void add_import_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<ImportOptions>();
  CLI::App* const command = app->add_subcommand(
      "import", "Turn recordings of other programs into a log, or into soundings for `map`");
  command
      ->add_option("soundings", options->soundings,
                   "Files of soundings (SonTek .sum, XTF): writes a pings.csv for `map`, as\n"
                   "`leadline survey` does, which can do more about it")
      ->type_name("FILE");
  command
      ->add_option("--record", options->records,
                   "N=FILE: port N of the configuration (0, 1, ... in its order) hears FILE: raw\n"
                   "bytes, .svlog, ping-viewer .bin, XTF (R2Sonic), candump or canboat text,\n"
                   "MAVLink .tlog, as `leadline decode` reads them. May be repeated")
      ->type_name("N=FILE");
  command->add_option("--config", options->config_path, "vehicle.toml: who hears the recordings")
      ->type_name("FILE");
  command
      ->add_option("--shift", options->shifts,
                   "N=SECONDS: added to the times of port N's recording, where clocks differ")
      ->type_name("N=SECONDS");
  command
      ->add_option("--byte-rate", options->bytes_per_s,
                   "Pace of bytes that have no times, bytes per second (default 11520: 115200 Bd)")
      ->type_name("N");
  command->add_option("--lat", options->lat_deg, "Origin of soundings (default: the first one)")
      ->type_name("DEG");
  command->add_option("--lon", options->lon_deg, "")->type_name("DEG");
  command->add_option("--out", options->out_path, "Log or pings.csv to write")
      ->type_name("FILE")
      ->required();
  command->add_flag("--json", options->json, "Print one JSON object");
  command->footer(
      "The recordings' pieces arrive at the vehicle's ports when they were recorded; its log is\n"
      "what comes out, and replays, exports and renders like any other. Its clock starts at 0 "
      "with\n"
      "the earliest piece.\n\n"
      "Examples:\n"
      "  leadline import --config vehicle.toml --record 0=sonar.bin --record 1=rov.tlog \\\n"
      "                  --shift 0=1683158400 --out survey.lll\n"
      "  leadline import 20250117161408.sum --out pings.csv");
  command->callback([options, run] { *run = [options] { return run_import(*options); }; });
}

}  // namespace leadline::host
