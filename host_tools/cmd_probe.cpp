#include <memory>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/decode/decoder.hpp"
#include "host_tools/probe/probe.hpp"

namespace leadline::host {

void add_probe_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<ProbeOptions>();
  CLI::App* const command =
      app->add_subcommand("probe", "Say what talks at a port, and show its values live");
  command
      ->add_option("uri", options->uri,
                   "serial:PATH:BAUD, udp:, tcp:, can:, gpio:, modbus-rtu:, modbus-tcp:, file:")
      ->type_name("URI")
      ->required();
  command
      ->add_option(
          "--driver", options->driver,
          "Only this one (nmea2000 anywhere but on can: has to be named, line but on gpio:):\n" +
              driver_names_help())
      ->type_name("NAME");
  command->add_flag("--ask", options->ask,
                    "Also send the requests of devices that wait for them, one driver after the\n"
                    "other until one answers; other devices may take them amiss");
  command
      ->add_option("--model", options->model,
                   "--ask: only heads of this kind (surveyor, 881a, profiler ..): some answer\n"
                   "the requests of others")
      ->type_name("NAME");
  command
      ->add_option("--seconds", options->seconds, "How long to listen, after asking; 0: to Ctrl-C")
      ->type_name("S")
      ->capture_default_str();
  command->add_option("--max-range", options->max_range_m, "--ask: range asked of heads, m")
      ->type_name("M")
      ->capture_default_str();
  command->add_flag("--json", options->json, "One JSON object a line, as of `decode`");
  command->footer(
      "Every driver hears every byte; a line is a record, with the driver that understood it in\n"
      "front. The last lines count the intact frames of each. Exit status 3: nothing recognised.\n"
      "Ranges are made with 1500 m/s where the device does not say its own.\n\n"
      "Examples:\n"
      "  leadline probe serial:/dev/ttyUSB0:115200\n"
      "  leadline probe udp:192.168.2.2:9090 --ask --driver ping1d\n"
      "  leadline probe can:can0 --seconds 0");
  command->callback([options, run] { *run = [options] { return run_probe(*options); }; });
}

}  // namespace leadline::host
