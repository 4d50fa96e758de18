// `leadline-vehicle`: command line, signals, and the order of things; the work is in vehicle_loop.hpp.
#include <csignal>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "firmware/config/program.hpp"
#include "firmware/config/text.hpp"
#include "firmware/config/tide_file.hpp"
#include "firmware/config/vehicle_file.hpp"
#include "firmware/keys/command_key.hpp"
#include "firmware/keys/small_file.hpp"
#include "firmware/linux/check_config.hpp"
#include "firmware/linux/command_port.hpp"
#include "firmware/linux/monotonic.hpp"
#include "firmware/linux/page_file.hpp"
#include "firmware/linux/real_time.hpp"
#include "firmware/linux/recorder.hpp"
#include "firmware/linux/summary.hpp"
#include "firmware/linux/timing.hpp"
#include "firmware/linux/vehicle_loop.hpp"

namespace {

using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::LoopSummary;
using leadline::host::RealTimeReport;
using leadline::host::Recorder;
using leadline::host::VehicleFile;

constexpr const char* kProgram = "leadline-vehicle";
constexpr const char* kLockstep = "lockstep:";

// As on every target: one large static object, no heap.
leadline::firmware::Vehicle the_vehicle;

/// Orders to stop so far: one stops in order, a second one cuts the draining short.
volatile std::sig_atomic_t stop_orders = 0;
void order_stop(int /*signal*/) { stop_orders = stop_orders + 1; }

struct Options {
  std::string config_path;
  std::string clock;
  std::string log_path;
  std::string link;
  std::vector<std::string> ports;
  double drain_s = 5;
  int priority = 20;
  bool timing = false;
  bool check_config = false;
  bool help_config = false;
  bool json = false;
};

void add_options(CLI::App* app, Options* options) {
  app->add_option("--config", options->config_path, "vehicle.toml; --help-config shows every key");
  app->add_flag("--help-config", options->help_config, "print a commented vehicle.toml and stop");
  app->add_flag("--check-config", options->check_config,
                "print the resolved configuration, its memory and its work bound, and stop");
  app->add_flag("--json", options->json, "print --check-config and the summary as one JSON object");
  app->add_option("--log", options->log_path,
                  "log file, instead of [log] path; \"\" records nothing");
  app->add_option("--port", options->ports, "N=URI: another device for port N (may be repeated)")
      ->type_name("N=URI")
      ->allow_extra_args(false);
  app->add_option("--link", options->link, "URI of the link, instead of [link] uri")
      ->type_name("URI");
  app->add_option("--clock", options->clock,
                  "lockstep:PATH: time from an emulator that listens at PATH, instead of the clock")
      ->type_name("lockstep:PATH");
  app->add_option("--drain-s", options->drain_s,
                  "after SIGINT or SIGTERM: seconds that queued changes may take to leave")
      ->check(CLI::Range(0.0, 86400.0))
      ->capture_default_str();
  app->add_option("--priority", options->priority,
                  "SCHED_FIFO priority of the vehicle's thread, where permitted; 0: none")
      ->check(CLI::Range(0, 99))
      ->capture_default_str();
  app->add_flag("--timing", options->timing,
                "after the summary: how long cycles took and how late they began");
  app->footer(
      "Flies until SIGINT or SIGTERM, then sends what is queued, ends the log, and prints a "
      "summary; a\n"
      "second signal cuts the sending short. URIs: serial:PATH:BAUD, udp:HOST:PORT, "
      "tcp:HOST:PORT,\n"
      "can:can0, modbus-rtu:PATH:BAUD:8N1@ADDRESS, modbus-tcp:HOST:PORT@ADDRESS, gpio:CHIP:LINE,\n"
      "file:PATH; udp:@:PORT and tcp:@:PORT listen.\n"
      "Exit status: 0 done, 2 usage or configuration, 3 input (a table, the emulator), 4 output "
      "(the\n"
      "log cannot be created, or lost records; the store lacks something), 1 internal error.");
}

leadline::hal::UriSpec uri_of(const std::string& option, const std::string& text) {
  leadline::hal::UriResult result = leadline::hal::parse_uri(text);
  if (!result.ok()) {
    throw HostError(ExitCode::kUsage, option + ": " + result.error);
  }
  return result.spec;
}

void override_port(const std::string& text, VehicleFile* file) {
  const std::size_t equals = text.find('=');
  const std::string number = text.substr(0, equals);
  const bool digit = number.size() == 1 && number[0] >= '0' && number[0] <= '9';
  const std::size_t index = digit ? static_cast<std::size_t>(number[0] - '0') : SIZE_MAX;
  if (equals == std::string::npos || index >= file->port_uris.size()) {
    throw HostError(ExitCode::kUsage, "--port " + leadline::host::printable(text) +
                                          ": has to be N=URI, N from 0 to " +
                                          std::to_string(file->port_uris.size() - 1));
  }
  file->port_uris[index] = uri_of("--port " + number, text.substr(equals + 1));
}

/// The configuration, with what the command line says otherwise.
VehicleFile resolve(const Options& options, bool log_given) {
  if (options.config_path.empty()) {
    throw HostError(ExitCode::kUsage,
                    "--config is required (--help-config prints one to begin with)");
  }
  VehicleFile file = leadline::host::load_vehicle_file(options.config_path);
  for (const std::string& port : options.ports) {
    override_port(port, &file);
  }
  if (!options.link.empty()) {
    file.link_uri = uri_of("--link", options.link);
  }
  if (log_given) {
    file.log.path = options.log_path;
  }
  return file;
}

std::string lockstep_path(const std::string& clock) {
  if (clock.empty()) {
    return "";
  }
  if (clock.rfind(kLockstep, 0) != 0 || clock == kLockstep) {
    throw HostError(ExitCode::kUsage,
                    "--clock " + leadline::host::printable(clock) + ": has to be lockstep:PATH");
  }
  return clock.substr(std::string(kLockstep).size());
}

/// Null without [commands]: all are refused.
std::unique_ptr<leadline::host::CommandPort> make_command_port(const VehicleFile& file) {
  const leadline::host::CommandsConfig& commands = file.commands;
  if (commands.key_path.empty()) {
    return nullptr;
  }
  const leadline::host::CommandKey key = leadline::host::load_command_key(commands.key_path);
  if (key.vehicle() != commands.vehicle) {
    throw HostError(ExitCode::kUsage,
                    commands.key_path + ": is the key of vehicle " + std::to_string(key.vehicle()) +
                        ", this one is [commands] vehicle = " + std::to_string(commands.vehicle));
  }
  auto port = std::make_unique<leadline::host::CommandPort>(key, commands.counter_path);
  std::cerr << kProgram << ": commands: key " << leadline::host::hex_of(key.id()) << ", vehicle "
            << key.vehicle() << ", last counter " << port->last_counter() << "\n";
  return port;
}

int fly(VehicleFile& file, const Options& options) {
  leadline::host::LoopOptions loop_options;
  loop_options.lockstep_path = lockstep_path(options.clock);
  loop_options.drain_us = static_cast<std::int64_t>(options.drain_s * 1e6);
  // Another number for every start; under the virtual clock every run is the same run.
  file.config.session = loop_options.lockstep_path.empty()
                            ? static_cast<std::uint32_t>(leadline::host::utc_us() / 1'000'000)
                            : 1;
  const auto tables = leadline::host::load_tables(&file);
  leadline::host::configure_vehicle(file, tables, the_vehicle, options.config_path);
  std::unique_ptr<Recorder> recorder;
  if (!file.log.path.empty()) {
    recorder = std::make_unique<Recorder>(file.log.path, file.log.max_bytes);
  }
  std::unique_ptr<leadline::host::PageFile> pages;
  if (!file.store.path.empty()) {
    pages = std::make_unique<leadline::host::PageFile>(file.store.path, file.config, tables);
    if (pages->pages_found() > 0) {
      std::cerr << kProgram << ": store " << pages->path() << ": resumes a map of "
                << pages->pages_found() << " tiles\n";
    }
    std::cerr << leadline::host::window_warning(file.config.model);
  }
  const std::unique_ptr<leadline::host::CommandPort> commands = make_command_port(file);
  leadline::host::VehicleLoop loop(file, tables, the_vehicle, recorder.get(), pages.get(),
                                   commands.get(), loop_options);
  RealTimeReport real_time;
  if (loop_options.lockstep_path.empty()) {
    // After the recorder and the ports have made their threads: those keep ordinary priority.
    real_time = leadline::host::ask_for_real_time(options.priority);
    std::cerr << kProgram << ": " << real_time.text() << "\n";
  }
  const LoopSummary summary = loop.run(stop_orders);
  const bool recorded = recorder == nullptr || recorder->finish();
  const leadline::host::RunReport report = {summary, real_time, recorder.get(),
                                            options.timing ? &loop.timing() : nullptr};
  std::cout << leadline::host::summary_text(the_vehicle, report, options.json);
  return static_cast<int>(recorded && summary.stored ? ExitCode::kOk : ExitCode::kOutput);
}

int run(const Options& options, bool log_given) {
  if (options.help_config) {
    std::cout << leadline::host::vehicle_example();
    return 0;
  }
  VehicleFile file = resolve(options, log_given);
  // Under the virtual clock the vehicle's time is taken for UTC.
  const bool real = lockstep_path(options.clock).empty();
  const std::int64_t now_us = real ? leadline::host::monotonic_us() : 0;
  leadline::host::load_tide(&file, real ? leadline::host::utc_us() - now_us : 0, now_us);
  if (!options.check_config) {
    return fly(file, options);
  }
  (void)lockstep_path(options.clock);
  const auto tables = leadline::host::load_tables(&file);
  leadline::host::configure_vehicle(file, tables, the_vehicle, options.config_path);
  (void)make_command_port(file);  // says which key, or what is wrong with it
  std::cout << (options.json ? leadline::host::check_report_json(file, the_vehicle)
                             : leadline::host::check_report_text(file, the_vehicle));
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  leadline::host::ignore_write_signals();
  std::signal(SIGINT, order_stop);
  std::signal(SIGTERM, order_stop);

  CLI::App app("Maps while it dives: sonar and navigation in, depth-map deltas out.", kProgram);
  app.set_version_flag("--version", std::string(kProgram) + " " + LEADLINE_VERSION);
  Options options;
  add_options(&app, &options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {
      return leadline::host::checked_output(kProgram, app.exit(error));  // --help, --version
    }
    leadline::host::print_error(kProgram, error.what());
    std::cerr << "Run `leadline-vehicle --help`.\n";
    return static_cast<int>(ExitCode::kUsage);
  }
  const bool log_given = app.count("--log") > 0;
  return leadline::host::checked_output(
      kProgram, leadline::host::run_guarded(kProgram, [&] { return run(options, log_given); }));
}
