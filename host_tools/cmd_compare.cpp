#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/compare.hpp"

namespace leadline::host {

void add_compare_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<CompareOptions>();
  CLI::App* const command =
      app->add_subcommand("compare", "Compare an elevation raster with the truth");
  command->add_option("estimate", options->estimate_path, "Elevation raster (depth.asc of a map)")
      ->type_name("FILE")
      ->required();
  command->add_option("truth", options->truth_path, "True elevation raster of the same cells")
      ->type_name("FILE")
      ->required();
  command->add_option("--mask", options->mask_path, "Raster that is 1 where a cell counts")
      ->type_name("FILE");
  command
      ->add_option("--sigma", options->sigma_path,
                   "Raster of stated sigmas: adds how honest they are")
      ->type_name("FILE");
  command->add_option("--max-rmse", options->max_rmse_m, "Fail over this rmse, metres")
      ->type_name("M");
  command->add_option("--max-rmse-cells", options->max_rmse_cells, "Fail over this rmse, cells")
      ->type_name("CELLS");
  command->add_option("--max-bias", options->max_abs_bias_m, "Fail over this |bias|, metres")
      ->type_name("M");
  command
      ->add_option("--max-bias-cells", options->max_abs_bias_cells, "Fail over this |bias|, cells")
      ->type_name("CELLS");
  command
      ->add_option("--max-p95", options->max_p95_m,
                   "Fail when over 5 % of the errors exceed this, metres")
      ->type_name("M");
  command
      ->add_option("--min-coverage", options->min_coverage,
                   "Fail under this share of known cells, 0 to 1")
      ->type_name("SHARE");
  command
      ->add_option("--difference-png", options->difference_png, "Write a picture of the difference")
      ->type_name("FILE");
  command
      ->add_option("--difference-asc", options->difference_asc, "Write the difference as a raster")
      ->type_name("FILE");
  command->add_flag("--json", options->json, "Print one JSON object");
  command->footer(
      "Errors are estimated depth minus true depth: deeper is positive. Exit status 5 when a limit "
      "is\n"
      "missed.\n\n"
      "Examples:\n"
      "  leadline compare map/depth.asc truth.asc --mask touched.asc --sigma map/sigma.asc\n"
      "  leadline compare map/depth.asc truth.asc --max-rmse-cells 0.5 --min-coverage 0.995\n"
      "  leadline compare map/depth.asc truth.asc --difference-png difference.png");
  command->callback([options, run] { *run = [options] { return run_compare(*options); }; });
}

}  // namespace leadline::host
