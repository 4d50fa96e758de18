#include <algorithm>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/emulate/device_command.hpp"
#include "host_tools/emulate/emulate_command.hpp"
#include "host_tools/emulate/lone_devices.hpp"
#include "host_tools/exit_codes.hpp"

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

namespace {

constexpr const char* kOneDevice = "One device (with DEVICE)";
constexpr const char* kFleet = "The devices of a vehicle (without DEVICE)";

/// Options of one device; `options` outlives the parsing.
void add_device_options(CLI::App* command, EmulateDeviceOptions* options) {
  command->add_option("device", options->device, "Play this device alone:\n" + lone_device_names())
      ->type_name("DEVICE");
  const auto add = [&](const char* name, auto* value, const char* help, const char* type) {
    return command->add_option(name, *value, help)->type_name(type)->group(kOneDevice);
  };
  add("--port", &options->port_uri,
      "Where: pty: (its name is printed), pty:LINK, serial:, udp:, tcp:, can:, file:", "URI");
  add("--model", &options->model,
      "Which cerulean, imagenex or tritech; the error of a wrong one lists them", "NAME");
  add("--bottom", &options->scene.bottom_m, "Flat bottom below the device, m", "M")
      ->capture_default_str();
  add("--depth", &options->scene.depth_m, "Device below the surface, m", "M")
      ->capture_default_str();
  add("--roll", &options->scene.attitude.roll_deg, "Mean roll", "DEG")->capture_default_str();
  add("--pitch", &options->scene.attitude.pitch_deg, "Mean pitch", "DEG")->capture_default_str();
  add("--heading", &options->scene.attitude.heading_deg, "Mean heading", "DEG")
      ->capture_default_str();
  add("--swing", &options->scene.swing_deg,
      "Amplitude of roll; pitch has half of it, heading a quarter; 0: still", "DEG")
      ->capture_default_str();
  add("--seconds", &options->seconds, "End after so much of the device's time; 0: on Ctrl-C", "S")
      ->capture_default_str();
  add("--drop", &options->drop, "Share of the bytes that are lost", "X")->capture_default_str();
  add("--corrupt", &options->corrupt, "Share of the bytes that are changed", "X")
      ->capture_default_str();
}

/// Options that mean something only with the other kind of emulation are mistakes of whoever gave them.
void refuse_other_kind(const CLI::App& command, bool device) {
  for (const CLI::Option* const option : command.get_options()) {
    const bool foreign = option->get_group() == (device ? kFleet : kOneDevice);
    if (foreign && option->count() > 0) {
      throw HostError(ExitCode::kUsage,
                      "emulate: " + option->get_name() +
                          (device ? ": is of a whole vehicle, not of one DEVICE"
                                  : ": needs a DEVICE, such as `leadline emulate ping1d`"));
    }
  }
}

}  // namespace

void add_emulate_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<EmulateOptions>();
  const auto device = std::make_shared<EmulateDeviceOptions>();
  CLI::App* const command = app->add_subcommand(
      "emulate",
      "Be the vehicle's devices on a survey, or one of them: they speak their protocols at real "
      "ports");
  add_device_options(command, device.get());
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
  command
      ->add_option("--speed", options->speed,
                   "Times real time; default 1, with --lockstep as fast as both can")
      ->type_name("X");
  command
      ->add_option("--lockstep", options->lockstep_path,
                   "Virtual time for `leadline-vehicle --clock lockstep:PATH`")
      ->type_name("PATH");
  command->add_option("--wait", options->wait_s, "Lockstep: how long to wait for the vehicle")
      ->type_name("S")
      ->capture_default_str();
  command->add_flag("--json", options->json, "Print the summary as one JSON object");
  for (const char* const name : {"--terrain", "--set", "--write-config", "--out", "--ports",
                                 "--udp", "--link", "--log", "--lockstep", "--wait", "--json"}) {
    command->get_option(name)->group(kFleet);
  }
  command->footer(mission_settings_help() +
                  "\nExamples:\n"
                  "  leadline emulate --write-config dive --ports dive/ports\n"
                  "  leadline emulate --ports dive/ports --out dive --lockstep dive/clock &\n"
                  "  leadline-vehicle --config dive/vehicle.toml --clock lockstep:dive/clock\n"
                  "  leadline emulate --udp 127.0.0.1:9090 --speed 4 --set lost_byte=0.001\n"
                  "  leadline emulate vectornav --port pty:/tmp/imu --swing 5\n"
                  "  leadline emulate ping360 --port udp:@:9092 --bottom 3 --drop 0.001");
  command->callback([options, device, command, run] {
    *run = [options, device, command] {
      refuse_other_kind(*command, !device->device.empty());
      if (device->device.empty()) {
        return run_emulate(*options);
      }
      if (device->port_uri.empty()) {
        throw HostError(ExitCode::kUsage, "emulate: --port is required with a DEVICE");
      }
      device->speed = options->speed.value_or(1.0);
      device->seed = options->mission.seed;
      return run_emulate_device(*device);
    };
  });
}

}  // namespace leadline::host
