#include "host_tools/table/run_table.hpp"

#include <iostream>

#include "host_tools/exit_codes.hpp"
#include "host_tools/map_config.hpp"
#include "host_tools/table/generator.hpp"
#include "host_tools/table/table_io.hpp"

namespace leadline::host {

int run_table(const TableOptions& options) {
  const bool show = !options.show_path.empty();
  if (show == !options.config_path.empty()) {
    throw HostError(ExitCode::kUsage, show ? "give either --config or --show, not both"
                                           : "nothing to do: give --config FILE or --show FILE");
  }
  if (show) {
    if (!options.out_path.empty()) {
      throw HostError(ExitCode::kUsage, "--out goes with --config: --show writes nothing");
    }
    const model::LocalizationTable table = load_table(options.show_path);
    std::cout << (options.json ? table_to_json(table) : table_to_text(table)) << "\n";
    return 0;
  }
  const MapConfig config = load_beam_config(options.config_path);
  const GeneratedTable generated = generate_table(beam_description(config.sonar));
  if (!options.out_path.empty()) {
    save_table(options.out_path, generated.table);
  }
  if (options.out_path != "-") {
    std::cout << (options.json ? table_to_json(generated.table) : generated.report) << "\n";
  }
  return 0;
}

}  // namespace leadline::host
