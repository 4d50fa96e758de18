#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/grid_baselines.hpp"

namespace leadline::host {

void add_grid_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<GridOptions>();
  CLI::App* const command =
      app->add_subcommand("grid", "Grid the pings the plain ways: the baselines of the map");
  command->add_option("--pings", options->pings_path, "Pings, CSV as for `leadline map`")
      ->type_name("FILE")
      ->required();
  command->add_option("--config", options->config_path, "map.toml; [grid] and [frame] matter here")
      ->type_name("FILE")
      ->required();
  command->add_option("--out", options->out_dir, "Folder for one NAME.asc per method and grid.json")
      ->type_name("DIR");
  command
      ->add_option("--method", options->methods,
                   "mean, gaussian-1, gaussian-1.5, gaussian-2, gaussian-3, median-1, median-2 or "
                   "median-3; may be repeated (default: all)")
      ->type_name("NAME")
      ->allow_extra_args(false);
  command
      ->add_option("--truth", options->truth_path,
                   "True elevation raster: adds rmse, bias, coverage and the best method")
      ->type_name("FILE");
  command->add_option("--mask", options->mask_path, "Raster that is 1 where a cell counts")
      ->type_name("FILE");
  command->add_flag("--strict", options->strict, "Stop at the first row that cannot be used");
  command->add_flag("--json", options->json, "Print one JSON object");
  command->footer(
      "Every return becomes one point on its beam's axis; the methods average or rank the points "
      "of a\n"
      "cell and its neighbours. They know neither beam width nor which part of it answered "
      "first.\n\n"
      "Examples:\n"
      "  leadline grid --pings p.csv --config c.toml --out grids\n"
      "  leadline grid --pings p.csv --config c.toml --truth truth.asc --mask touched.asc\n"
      "  leadline grid --pings p.csv --config c.toml --method median-1 --out grids");
  command->callback([options, run] { *run = [options] { return run_grid(*options); }; });
}

}  // namespace leadline::host
