#include <algorithm>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/emulate/emulate_command.hpp"

namespace leadline::host {

void add_mission_options(CLI::App* command, MissionOptions* mission) {
  command
      ->add_option("--terrain", mission->terrain,
                   "procedural (default), plane, or a raster that GDAL reads")
      ->type_name("FILE");
  command->add_option("--seed", mission->seed, "Seed of every random choice")
      ->type_name("N")
      ->capture_default_str();
  command->add_option("--set", mission->settings, "KEY=VALUE, may be repeated; keys are below")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
}

std::string mission_settings_help() {
  std::string text = "Settings (--set KEY=VALUE):\n";
  for (const SettingInfo& setting : mission_settings()) {
    std::string key = setting.key;
    key.resize(std::max<std::size_t>(key.size(), 24), ' ');
    text += "  " + key + setting.help + "\n";
  }
  return text;
}

void add_emulate_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<EmulateOptions>();
  CLI::App* const command = app->add_subcommand(
      "emulate", "Fly a survey as the vehicle's devices: they speak their protocols at real ports");
  add_mission_options(command, &options->mission);
  command
      ->add_option("--write-config", options->write_config_dir,
                   "Write vehicle.toml, the beam's table and truth.asc there, and do not fly")
      ->type_name("DIR");
  command
      ->add_option("--out", options->out_dir,
                   "After the flight: truth.asc, touched.asc, emulate.json")
      ->type_name("DIR");
  command
      ->add_option("--ports", options->ports_dir,
                   "Folder for links to the serial lines (ptys), named like the devices")
      ->type_name("DIR")
      ->capture_default_str();
  command
      ->add_option(
          "--udp", options->udp,
          "Instead: heads answer at HOST:PORT and the numbers behind, sensors send to those "
          "behind")
      ->type_name("HOST:PORT");
  command
      ->add_option("--link", options->link_uri, "--write-config: where the vehicle sends its map")
      ->type_name("URI")
      ->capture_default_str();
  command->add_option("--log", options->log_path, "--write-config: the vehicle's log")
      ->type_name("FILE")
      ->capture_default_str();
  command->add_option("--speed", options->speed, "Times real time")
      ->type_name("X")
      ->capture_default_str();
  command
      ->add_option("--lockstep", options->lockstep_path,
                   "Virtual time for `leadline-vehicle --clock lockstep:PATH`, as fast as both can")
      ->type_name("PATH");
  command->add_option("--wait", options->wait_s, "Lockstep: how long to wait for the vehicle")
      ->type_name("S")
      ->capture_default_str();
  command->add_flag("--json", options->json, "Print the summary as one JSON object");
  command->footer(mission_settings_help() +
                  "\nExamples:\n"
                  "  leadline emulate --write-config dive --ports dive/ports\n"
                  "  leadline emulate --ports dive/ports --out dive --lockstep dive/clock &\n"
                  "  leadline-vehicle --config dive/vehicle.toml --clock lockstep:dive/clock\n"
                  "  leadline emulate --udp 127.0.0.1:9090 --speed 4 --set lost_byte=0.001");
  command->callback([options, run] { *run = [options] { return run_emulate(*options); }; });
}

}  // namespace leadline::host
