#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/export/export.hpp"
#include "host_tools/store/store_command.hpp"

namespace leadline::host {
namespace {

constexpr const char* kMapHelp =
    "A store's survey (FILE.lls, FILE.lls#N), or any other map with sigma";

void add_list(CLI::App* store, CommandRun* run) {
  const auto options = std::make_shared<StoreShowOptions>();
  CLI::App* const command = store->add_subcommand("list", "The surveys of a file");
  command->add_option("file", options->path, "The store")->type_name("FILE.lls")->required();
  command->add_flag("--json", options->json, "As a JSON array");
  command->callback([options, run] { *run = [options] { return run_store_list(*options); }; });
}

void add_show(CLI::App* store, CommandRun* run) {
  const auto options = std::make_shared<StoreShowOptions>();
  CLI::App* const command =
      store->add_subcommand("show", "One survey: its grid, what is known, its cells_hash");
  command->add_option("survey", options->path, "FILE.lls (the one saved last) or FILE.lls#N")
      ->type_name("SURVEY")
      ->required();
  command->add_flag("--json", options->json, "As a JSON object");
  command->callback([options, run] { *run = [options] { return run_store_show(*options); }; });
}

void add_export(CLI::App* store, CommandRun* run) {
  const auto options = std::make_shared<ExportOptions>();
  CLI::App* const command =
      store->add_subcommand("export", "As `leadline export`, which knows all options");
  command->add_option("survey", options->input_path, "FILE.lls or FILE.lls#N")
      ->type_name("SURVEY")
      ->required();
  command->add_option("--out", options->out_path, "File to write, its format by its ending")
      ->type_name("FILE")
      ->required();
  command->add_option("--format", options->format, "See `leadline export`")->type_name("NAME");
  command->callback([options, run] { *run = [options] { return run_export(*options); }; });
}

void add_merge(CLI::App* store, CommandRun* run) {
  const auto options = std::make_shared<StoreMergeOptions>();
  CLI::App* const command =
      store->add_subcommand("merge", "One map of several surveys, by their uncertainties");
  command->add_option("maps", options->paths, kMapHelp)->type_name("MAP...")->required();
  command->add_option("--into", options->into_path, "Store that gets the merged survey")
      ->type_name("FILE.lls");
  command->add_option("--name", options->name, "Its name (default: the maps' own)")
      ->type_name("TEXT");
  command
      ->add_option("--out", options->out_dir,
                   "Folder for rasters: depth.asc, sigma.asc, depth.tif, depth.png, disputed.asc")
      ->type_name("DIR");
  command->footer(
      "Cells that agree (within 3 sigmas) become their mean by inverse variances. Where they\n"
      "contradict each other the shallowest stays, with a sigma that covers the others, and the\n"
      "cell is marked as disputed.\n\n"
      "Examples:\n"
      "  leadline store merge monday.lls tuesday.lls --into week.lls --name week\n"
      "  leadline store merge fleet.lls#1 fleet.lls#2 --out merged");
  command->callback([options, run] { *run = [options] { return run_store_merge(*options); }; });
}

void add_difference(CLI::App* store, CommandRun* run) {
  const auto options = std::make_shared<StoreDifferenceOptions>();
  CLI::App* const command =
      store->add_subcommand("difference", "What changed between two surveys, and how surely");
  command->add_option("earlier", options->earlier_path, kMapHelp)->type_name("MAP")->required();
  command->add_option("later", options->later_path, kMapHelp)->type_name("MAP")->required();
  command
      ->add_option("--significance", options->significance_sigmas,
                   "A cell changed when it did by more sigmas than this (default 3)")
      ->type_name("SIGMAS");
  command->add_flag("--level", options->level,
                    "Take the median difference for a change of tide or datum, and remove it");
  command
      ->add_option("--out", options->out_dir,
                   "Folder for change.asc, significance.asc, change.png and difference.json")
      ->type_name("DIR");
  command->add_flag("--json", options->json, "Print difference.json");
  command->footer(
      "Deeper is positive. Areas are connected cells of one sign, four or more.\n\n"
      "Example:\n"
      "  leadline store difference march.lls april.lls --level --out scour");
  command->callback(
      [options, run] { *run = [options] { return run_store_difference(*options); }; });
}

}  // namespace

void add_store_command(CLI::App* app, CommandRun* run) {
  CLI::App* const store =
      app->add_subcommand("store", "Surveys on disk: list, show, export, merge, difference");
  store->require_subcommand(1);
  store->footer(
      "`leadline receive --store FILE.lls` fills one; `export` and `render` read FILE.lls#N.\n\n"
      "Examples:\n"
      "  leadline store list surveys.lls\n"
      "  leadline store merge surveys.lls#1 surveys.lls#2 --into surveys.lls\n"
      "  leadline store difference march.lls april.lls --out scour");
  add_list(store, run);
  add_show(store, run);
  add_export(store, run);
  add_merge(store, run);
  add_difference(store, run);
}

}  // namespace leadline::host
