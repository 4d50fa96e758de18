#include <iostream>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/map_config.hpp"
#include "host_tools/table/beam_pattern.hpp"
#include "host_tools/table/generator.hpp"
#include "host_tools/table/table_io.hpp"

namespace leadline::host {
namespace {

struct TableOptions {
  std::string config_path;
  std::string show_path;
  std::string out_path;
  bool json = false;
};

int run_table(const TableOptions& options) {
  if (options.config_path.empty() == options.show_path.empty()) {
    throw HostError(ExitCode::kUsage,
                    "table: give either --config FILE (compute a table) or --show FILE (read one)");
  }
  if (!options.show_path.empty()) {
    if (!options.out_path.empty()) {
      throw HostError(ExitCode::kUsage, "table: --show only reads; --out goes with --config");
    }
    const model::LocalizationTable table = load_table(options.show_path);
    std::cout << (options.json ? table_to_json(table) : table_to_text(table)) << "\n";
    return static_cast<int>(ExitCode::kOk);
  }
  const MapConfig config = load_map_config(options.config_path);
  const GeneratedTable generated = generate_table(beam_description(config.sonar));
  if (!options.out_path.empty()) {
    save_table(options.out_path, generated.table);
  }
  // With the table itself on standard output the report would end up in the middle of it.
  if (options.out_path != "-") {
    std::cout << (options.json ? table_to_json(generated.table) : generated.report) << "\n";
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace

void add_table_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<TableOptions>();
  CLI::App* const command =
      app->add_subcommand("table", "Compute a beam's localization table, or show what one holds");
  command->add_option("--config", options->config_path, "map.toml: its [sonar] describes the beam")
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
      "Examples:\n"
      "  leadline table --config map.toml\n"
      "  leadline table --config map.toml --out beam.llt\n"
      "  leadline table --show beam.llt --json");
  command->callback([options, run] { *run = [options] { return run_table(*options); }; });
}

}  // namespace leadline::host
