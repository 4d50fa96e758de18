#include "host_tools/topside/replay.hpp"

#include <iostream>

#include "firmware/pipeline/log_player.hpp"
#include "firmware/pipeline/session_log.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/map_output.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/progress.hpp"
#include "host_tools/survey_map.hpp"
#include "host_tools/text.hpp"
#include "host_tools/topside/host_vehicle.hpp"

namespace leadline::host {
namespace {

/// What is wrong with the log, a line each.
std::string findings_text(const firmware::LogFindings& findings, bool has_end) {
  firmware::FindingText texts[firmware::kMaxFindingTexts];
  const std::size_t count = firmware::finding_texts(findings, has_end, texts);
  std::string text;
  for (std::size_t i = 0; i < count; ++i) {
    text += texts[i].count > 0 ? "gap: " + std::to_string(texts[i].count) + " " : "";
    text += std::string(texts[i].text) + "\n";
  }
  return text;
}

const char* same_text(const ReplayResult& result) {
  return firmware::same_as_flight_text(result.now, result.then ? &*result.then : nullptr);
}

std::string hashes_text(const proto::LogEnd& end) {
  char line[firmware::kHashLine_bytes];
  const std::size_t size = firmware::hash_line(end, line);
  return {line, size};
}

std::string result_json(const ReplayResult& result) {
  const firmware::LogFindings& log = result.log;
  const proto::LogEnd& now = result.now;
  std::string text = "{\n  \"map_hash\": \"" + hex_text(now.map_hash, 16) + "\"";
  const auto add = [&text](const char* key, const std::string& value) {
    text += std::string(",\n  \"") + key + "\": " + value;
  };
  add("link_hash", "\"" + hex_text(now.link_hash, 16) + "\"");
  add("cells_hash", "\"" + hex_text(now.cells_hash, 16) + "\"");
  add("same_as_flight", !result.then ? "null" : same_text(result));
  add("cycles", std::to_string(result.cycles));
  add("seconds", std::to_string(static_cast<double>(now.t_us) * 1e-6));
  add("pings_in", std::to_string(now.pings_in));
  add("pings_fused", std::to_string(now.pings_fused));
  add("pings_shed", std::to_string(now.pings_shed));
  add("pings_rejected", std::to_string(now.pings_rejected));
  add("cells_sent", std::to_string(now.cells_sent));
  add("downlink_bytes", std::to_string(now.downlink_bytes));
  add("damaged_places", std::to_string(log.damaged_places));
  add("missing_cycles", std::to_string(log.missing_cycles));
  add("broken_cycles", std::to_string(log.broken_cycles));
  add("recorder_lost", std::to_string(log.recorder_lost));
  return text + "\n}\n";
}

/// How a replay is not the flight, and what may be the reason; "" where nothing in the log tells one.
std::string difference_text(const ReplayResult& result, const proto::LogHeader& header) {
  if (!result.log.complete()) {
    return " (the log has gaps, see above)";
  }
  if (header.protocol_minor == proto::kProtocolMinor) {
    return result.now.map_hash == result.then->map_hash
               ? " (the map is the same, what the link said is not)"
               : "";
  }
  return " (by a program of protocol " + std::to_string(header.protocol_major) + "." +
         std::to_string(header.protocol_minor) + ", this one speaks " +
         std::to_string(proto::kProtocolMajor) + "." + std::to_string(proto::kProtocolMinor) +
         (result.now.map_hash == result.then->map_hash ? ": the map is the same)" : ")");
}

void write_results(const ReplayOptions& options, firmware::Vehicle* vehicle,
                   const Soundings& soundings, const ReplayResult& result) {
  OutputDir output(options.out_dir);
  // As it was in the end: commands may have given the map another place or name.
  firmware::VehicleConfig flown = vehicle->config();
  const estimator::LocalPlane& plane = vehicle->navigator().plane();
  if (plane.configured()) {  // by the configuration, or by the flight's first fix
    flown.navigation.has_origin = 1;
    flown.navigation.origin_latitude_e9deg = plane.origin().latitude_e9deg;
    flown.navigation.origin_longitude_e9deg = plane.origin().longitude_e9deg;
  }
  const MapConfig config = flight_map_config(flown, vehicle->model().table());
  vehicle->model().extract();
  const ModelRasters rasters = model_rasters(vehicle->model());
  output.write("model.llm", save_model(vehicle->model(), config));
  stage_map(&output, rasters.elevation, rasters.sigma, map_reference(config));
  output.write("pings.csv", soundings.csv());
  output.write("map.toml", map_config_to_toml(config));
  output.write("replay.json", result_json(result));
  output.commit();
}

}  // namespace

ReplayResult replay_flight(FlightLog* log, firmware::Vehicle* vehicle, Soundings* soundings) {
  ReplayResult result;
  Progress progress("replaying", log->size_bytes());
  FlightCycle cycle;
  while (log->next(&cycle)) {
    firmware::CycleOutput output{};
    vehicle->cycle(cycle.input, output);
    if (soundings != nullptr) {
      soundings->take(*vehicle);
    }
    result.cycles += 1;
    progress.update(log->read_bytes());
  }
  result.now = firmware::log_end_of(*vehicle, log->t_us());
  result.then = log->end();
  result.log = log->findings();
  return result;
}

int run_replay(const ReplayOptions& options) {
  FlightLog log(options.log_path);
  const HostVehicle vehicle(log.config(), log.tables(), options.log_path);
  Soundings soundings;
  const ReplayResult result =
      replay_flight(&log, &*vehicle, options.out_dir.empty() ? nullptr : &soundings);
  std::cerr << findings_text(result.log, result.then.has_value());
  if (!options.out_dir.empty()) {
    write_results(options, &*vehicle, soundings, result);
  }
  if (options.json) {
    std::cout << result_json(result);
  } else {
    std::cout << hashes_text(result.now) << " same_as_flight=" << same_text(result) << "\n";
    std::cout << result.cycles << " cycles, " << result.now.pings_in << " pings, "
              << result.now.pings_fused << " in the map; "
              << (result.same() ? "the same as when it flew"
                  : result.then ? "not the same as when it flew"
                                : "nothing to compare with: no end record")
              << "\n";
  }
  if (result.then && !result.same()) {
    std::cerr << "leadline: error: the flight ended with " << hashes_text(*result.then)
              << difference_text(result, log.header()) << "\n";
    return static_cast<int>(ExitCode::kComparisonFailed);
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
