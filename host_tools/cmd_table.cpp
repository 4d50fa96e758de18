#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/table/run_table.hpp"

namespace leadline::host {
void add_table_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<TableOptions>();
  CLI::App* const command =
      app->add_subcommand("table", "Compute a beam's localization table, or show what one holds");
  command
      ->add_option("--config", options->config_path,
                   "TOML file whose [sonar] describes the beam: a map.toml, or that table alone")
      ->type_name("FILE");
  command->add_option("--out", options->out_path, "Write the table here, for a vehicle")
      ->type_name("FILE");
  command->add_option("--show", options->show_path, "Check a table and show what it holds")
      ->type_name("FILE");
  command->add_flag("--json", options->json, "Print one JSON object");
  command->footer(
      "The report states the envelope and why it ends where it does, the energy left outside, and "
      "the\n"
      "worst error of every part against double precision. The same description gives the same "
      "bytes\n"
      "everywhere; results record the table's CRC.\n\n"
      "A head's beam in a file, beam.toml (`leadline map --help` has all keys):\n"
      "  [sonar]\n"
      "  beam_half_angle_deg = 12.5      # or piston_diameter_mm and frequency_hz\n"
      "  sigma_pointing_deg = 1\n"
      "  sigma_range_mm = 100\n\n"
      "Examples:\n"
      "  leadline table --config beam.toml --out ping1d.llt\n"
      "  leadline table --config map.toml\n"
      "  leadline table --config map.toml --out beam.llt\n"
      "  leadline table --show beam.llt --json");
  command->callback([options, run] { *run = [options] { return run_table(*options); }; });
}

}  // namespace leadline::host
