#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "host_tools/commands.hpp"
#include "host_tools/decode/decode.hpp"
#include "host_tools/decode/decoder.hpp"

namespace leadline::host {
void add_decode_command(CLI::App* app, CommandRun* run) {
  const auto options = std::make_shared<DecodeOptions>();
  CLI::App* const command =
      app->add_subcommand("decode", "Print what a recording of a device says");
  command->add_option("--driver", options->driver, "What the device is:\n" + driver_names_help())
      ->type_name("NAME")
      ->required();
  command
      ->add_option("file", options->path,
                   "The device's bytes as they came (- is standard input), or a recording:\n"
                   "nmea2000 takes candump in both its layouts and canboat text, ping1d and\n"
                   "ping360 ping-viewer logs, mavlink .tlog, r2sonic XTF")
      ->type_name("FILE")
      ->required();
  command->add_flag("--json", options->json, "One JSON object a line");
  command->footer(
      "A line is a record: ping, attitude, heading, position, depth, pressure, velocity, "
      "altitude,\n"
      "rates, heave, time, water or other. Keys end in their unit; what a record could hold but\n"
      "does not know is null, and `valid` says whether its own measure is known. A ping has\n"
      "range_mm for each beam, or samples with angle_deg. heave_m is counted as the device does "
      "(up,\n"
      "with kongsberg down), heave_down_m down; *_sigma_* are one sigma, where the device says it. "
      "The\n"
      "last line is the summary: frames, rejected by reason (can_fd: longer than eight bytes).\n\n"
      "t_us is the recording's own time where it has one (microseconds since 1970; since midnight\n"
      "in a ping-viewer log), otherwise the device's own clock where the record carries one,\n"
      "otherwise null. Lengths are made with 1500 m/s where the device does not say its own.\n\n"
      "Examples:\n"
      "  leadline decode --driver ping360 frames.bin --json\n"
      "  candump -L can0 | leadline decode --driver nmea2000 - --json");
  command->callback([options, run] { *run = [options] { return run_decode(*options); }; });
}

}  // namespace leadline::host
