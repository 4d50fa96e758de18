#include <algorithm>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/sim/scenario.hpp"

namespace leadline::host {
namespace {

std::string padded(std::string text, std::size_t width) {
  text.resize(std::max(text.size(), width), ' ');
  return text;
}

/// The help's lists come from the tables that the command itself goes by.
std::string footer() {
  std::string text =
      "DIR receives pings.csv and map.toml for `leadline map`, truth.asc and touched.asc for\n"
      "`leadline compare`. The same options give the same bytes everywhere.\n\nPresets:\n";
  for (const PresetInfo& preset : simulate_presets()) {
    text += "  " + padded(preset.name, 24) + preset.summary + "\n";
  }
  text += "\nSettings (--set KEY=VALUE):\n";
  for (const SettingInfo& setting : simulate_settings()) {
    text += "  " + padded(setting.key, 24) + setting.help + "\n";
  }
  text +=
      "\nExamples:\n"
      "  leadline scene --out survey\n"
      "  leadline scene --preset plane_slope30 --seed 7 --out plane\n"
      "  leadline scene --terrain dem.tif --set line_spacing_m=6 --set sigma_range_m=0.1 --out "
      "s";
  return text;
}

}  // namespace

void add_scene_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<SimulateOptions>();
  CLI::App* const command = app->add_subcommand(
      "scene", "Make pings with errors over a terrain, without devices: test scenes with a truth");
  command->add_option("--preset", options->preset, "Survey to start from")
      ->type_name("NAME")
      ->capture_default_str();
  command
      ->add_option("--terrain", options->terrain,
                   "procedural, plane, or a raster that GDAL reads (default: the preset's)")
      ->type_name("FILE");
  command->add_option("--seed", options->seed, "Seed of every random choice")->type_name("N");
  command->add_option("--set", options->settings, "KEY=VALUE, may be repeated")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  command->add_option("--out", options->out_dir, "Folder for the results, created when needed")
      ->type_name("DIR")
      ->required();
  command->add_flag("--json", options->json, "Print the summary as one JSON object");
  command->footer(footer());
  command->callback([options, run] { *run = [options] { return run_simulate(*options); }; });
}

}  // namespace leadline::host
