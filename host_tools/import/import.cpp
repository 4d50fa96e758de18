#include "host_tools/import/import.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iostream>
#include <memory>
#include <utility>

#include "firmware/config/vehicle_file.hpp"
#include "host_tools/emulate/simulate_flight.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/import/recorded_devices.hpp"
#include "host_tools/import/survey_command.hpp"
#include "host_tools/options.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/progress.hpp"
#include "host_tools/text.hpp"
#include "host_tools/topside/host_vehicle.hpp"

namespace leadline::host {
namespace {

// Longer than any survey: then two recordings count from different beginnings.
constexpr base::TimeUs kLongest_us = base::TimeUs{31} * 86'400'000'000;

/// "N=text" for a port 0 .. count - 1.
std::pair<std::size_t, std::string> port_and_text(const char* option, const std::string& given,
                                                  std::size_t count) {
  const std::size_t equals = given.find('=');
  std::size_t port = 0;
  const char* const end = given.data() + std::min(equals, given.size());
  const auto [stop, error] = std::from_chars(given.data(), end, port);
  if (equals == std::string::npos || error != std::errc() || stop != end || port >= count) {
    usage_error(std::string(option) + " " + printable(given) +
                ": expected N=..., N a port of the configuration, 0 to " +
                std::to_string(count - 1));
  }
  return {port, given.substr(equals + 1)};
}

base::TimeUs shift_us(const std::string& text) {
  double seconds = 0.0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, seconds);
  if (error != std::errc() || stop != end || !(std::fabs(seconds) < 1e11)) {
    usage_error("--shift: " + printable(text) + " is not a number of seconds");
  }
  return std::llround(seconds * 1e6);
}

std::vector<PortRecording> open_all(const ImportOptions& options, const VehicleFile& file) {
  std::vector<PortRecording> recordings;
  const std::size_t count = file.port_uris.size();
  for (const std::string& given : options.records) {
    const auto [port, path] = port_and_text("--record", given, count);
    recordings.push_back(
        {port, open_recording(ByteSource(path), file.config.ports[port].driver), 0});
  }
  for (const std::string& given : options.shifts) {
    const auto [port, text] = port_and_text("--shift", given, count);
    bool found = false;
    for (PortRecording& recording : recordings) {
      if (recording.port == port) {
        recording.shift_us = shift_us(text);
        found = true;
      }
    }
    if (!found) {
      usage_error("--shift " + printable(given) + ": that port has no --record");
    }
  }
  return recordings;
}

void check_span(const RecordedDevices& devices) {
  if (devices.piece_count() == 0) {
    throw HostError(ExitCode::kInput, "import: the recordings are empty");
  }
  if (devices.t_end_us() > kLongest_us) {
    usage_error("the recordings span " + std::to_string(devices.t_end_us() / 86'400'000'000) +
                " days: their clocks do not begin together; bring them together with --shift");
  }
}

std::string log_summary(const RecordedDevices& devices, const FlightSummary& flight) {
  return "{\n  \"recorded_bytes\": " + std::to_string(devices.bytes()) +
         ",\n  \"recorded_origin_us\": " + std::to_string(devices.t_origin_us()) +
         ",\n  \"steps_back\": " + std::to_string(devices.steps_back()) +
         ",\n  \"flown_us\": " + std::to_string(flight.flown_us) +
         ",\n  \"cycles\": " + std::to_string(flight.cycles) +
         ",\n  \"pings_in\": " + std::to_string(flight.end.pings_in) +
         ",\n  \"pings_fused\": " + std::to_string(flight.end.pings_fused) + "\n}\n";
}

std::vector<std::vector<std::uint8_t>> block_bytes(
    const std::vector<model::LocalizationTable>& tables) {
  std::vector<std::vector<std::uint8_t>> blocks;
  for (const model::LocalizationTable& table : tables) {
    const auto* const begin = reinterpret_cast<const std::uint8_t*>(&table);
    blocks.emplace_back(begin, begin + sizeof table);
  }
  return blocks;
}

int import_log(const ImportOptions& options) {
  VehicleFile file = load_vehicle_file(options.config_path);
  const std::vector<std::vector<std::uint8_t>> tables = block_bytes(load_tables(&file));
  RecordedDevices devices(open_all(options, file), file.port_uris.size(), options.bytes_per_s);
  check_span(devices);
  const HostVehicle vehicle(file.config, tables, options.config_path);

  std::string log;
  std::unique_ptr<Progress> bar;
  FlightSinks sinks;
  sinks.log = [&log](const std::uint8_t* data, std::size_t size) {
    log.append(reinterpret_cast<const char*>(data), size);
  };
  sinks.progress = [&bar](std::uint64_t done, std::uint64_t total) {
    if (!bar) {
      bar = std::make_unique<Progress>("importing", total);
    }
    bar->update(done);
  };
  const FlightSummary flight =
      fly_in_process(&devices, &*vehicle, tables, file.cycle_us, sinks, nullptr);
  bar.reset();
  write_file_whole(options.out_path, log);
  if (options.json) {
    std::cout << log_summary(devices, flight);
  } else if (options.out_path != "-") {
    std::cout << options.out_path << ": " << devices.bytes() << " recorded bytes over "
              << flight.flown_us / 1'000'000 << " s, " << flight.end.pings_in << " pings, "
              << flight.end.pings_fused << " in the map\n";
  }
  return static_cast<int>(ExitCode::kOk);
}

bool ends_with(const std::string& text, const std::string& ending) {
  return text.size() >= ending.size() &&
         text.compare(text.size() - ending.size(), ending.size(), ending) == 0;
}

/// What `leadline survey` does, without its questions.
int import_soundings(const ImportOptions& options) {
  SurveyOptions survey;
  survey.paths = options.soundings;
  survey.out_path = options.out_path;
  survey.origin_lat_deg = options.lat_deg;
  survey.origin_lon_deg = options.lon_deg;
  survey.no_check = true;
  survey.json = options.json;
  // A summary has neither heave nor height.
  const bool summaries =
      std::all_of(survey.paths.begin(), survey.paths.end(),
                  [](const std::string& path) { return ends_with(path, ".sum"); });
  survey.geometry.vertical = summaries ? VerticalSource::kNone : VerticalSource::kHeave;
  return run_survey(survey);
}

}  // namespace

int run_import(const ImportOptions& options) {
  if (options.lat_deg.has_value() != options.lon_deg.has_value()) {
    usage_error("--lat and --lon go together");
  }
  if (options.lat_deg) {
    check_limits("--lat", *options.lat_deg, {-85, 85}, "degrees");
    check_limits("--lon", *options.lon_deg, {-180, 180}, "degrees");
  }
  if (options.soundings.empty() == options.records.empty()) {
    usage_error("give recordings (--record N=FILE) or files of soundings (.sum, .xtf)");
  }
  if (!options.soundings.empty()) {
    return import_soundings(options);
  }
  if (options.config_path.empty()) {
    usage_error("--config is missing: the vehicle that hears the recordings");
  }
  if (options.bytes_per_s < 1) {
    usage_error("--byte-rate " + std::to_string(options.bytes_per_s) + ": has to be at least 1");
  }
  return import_log(options);
}

}  // namespace leadline::host
