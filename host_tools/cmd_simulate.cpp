#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/emulate/simulate_flight.hpp"
#include "host_tools/sim/scenario.hpp"

namespace leadline::host {
namespace {

struct SimulateArguments {
  FlightOptions flight;
  std::string preset;  ///< not empty: the scene writer, as before 0.2
};

int run(const SimulateArguments& arguments) {
  if (arguments.preset.empty()) {
    return run_simulated_flight(arguments.flight);
  }
  const MissionOptions& mission = arguments.flight.mission;
  SimulateOptions scene;
  scene.preset = arguments.preset;
  scene.terrain = mission.terrain;
  scene.seed = mission.seed;
  scene.settings = mission.settings;
  scene.out_dir = arguments.flight.out_dir;
  scene.json = arguments.flight.json;
  return run_simulate(scene);
}

}  // namespace

void add_simulate_command(CLI::App* app, CommandRun* run_later) {
  const auto arguments = std::make_shared<SimulateArguments>();
  CLI::App* const command = app->add_subcommand(
      "simulate", "Fly an emulated vehicle without waiting: devices, pipeline, log, truth");
  add_mission_options(command, &arguments->flight.mission);
  command
      ->add_option("--out", arguments->flight.out_dir,
                   "Folder for the results, created when needed")
      ->type_name("DIR")
      ->required();
  command
      ->add_option("--preset", arguments->preset,
                   "No flight but a scene: the same as `leadline scene --preset NAME`")
      ->type_name("NAME");
  command->add_flag("--json", arguments->flight.json, "Print the summary as one JSON object");
  command->footer(
      "DIR receives survey.lll (the log) with the vehicle.toml and beam.llt that it flew with, "
      "truth.asc\n"
      "and touched.asc for `leadline compare`, and pings.csv and map.toml for `leadline map` and\n"
      "`grid`. The same options give the same bytes everywhere.\n\n" +
      mission_settings_help() +
      "\nExamples:\n"
      "  leadline simulate --out survey && leadline replay survey/survey.lll --out map\n"
      "  leadline simulate --terrain dem.tif --set line_spacing_m=6 --set lost_byte=0.001 --out s");
  command->callback(
      [arguments, run_later] { *run_later = [arguments] { return run(*arguments); }; });
}

}  // namespace leadline::host
