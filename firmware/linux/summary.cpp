#include "firmware/linux/summary.hpp"

#include <array>
#include <cstdio>
#include <utility>
#include <vector>

#include "firmware/config/text.hpp"
#include "firmware/pipeline/drivers.hpp"
#include "model/model.hpp"

namespace leadline::host {
namespace {

std::string number(std::uint64_t value) { return std::to_string(value); }

std::string hex(std::uint64_t value) {
  std::array<char, 24> text{};
  std::snprintf(text.data(), text.size(), "0x%016llx", static_cast<unsigned long long>(value));
  return text.data();
}

using Rows = std::vector<std::pair<std::string, std::string>>;

std::string object(const Rows& rows) {
  std::string out = "{";
  for (const auto& [name, value] : rows) {
    out += (out.size() == 1 ? "\"" : ", \"") + name + "\": " + value;
  }
  return out + "}";
}

Rows losses(const firmware::VehicleCounters& counters) {
  Rows rows;
  for (int i = 0; i < static_cast<int>(firmware::PingLoss::kCount); ++i) {
    rows.emplace_back(ping_loss_name(static_cast<firmware::PingLoss>(i)),
                      number(counters.pings_lost[i]));
  }
  return rows;
}

Rows outcomes(const model::ModelCounters& counters) {
  Rows rows;
  for (int i = 0; i < static_cast<int>(model::PingResult::kCount); ++i) {
    rows.emplace_back(ping_result_name(static_cast<model::PingResult>(i)),
                      number(counters.pings[i]));
  }
  return rows;
}

Rows port_rows(const firmware::Vehicle& vehicle, int port) {
  const firmware::PortTally& tally = vehicle.counters().ports[port];
  return {{"driver", json_string(driver_name(vehicle.config().ports[port].driver))},
          {"bytes", number(tally.bytes)},
          {"records", number(tally.records)},
          {"rejected", number(tally.rejected)}};
}

/// name: value, and groups as name.part: value.
void add_lines(const std::string& prefix, const Rows& rows, std::string* out) {
  for (const auto& [name, value] : rows) {
    *out += prefix + name + ": " + value + "\n";
  }
}

}  // namespace

std::string summary_text(const firmware::Vehicle& vehicle, const RunReport& report, bool json) {
  const LoopSummary& summary = report.summary;
  const Recorder* const recorder = report.recorder;
  const firmware::VehicleCounters& counters = vehicle.counters();
  const RecorderReport recorded = recorder != nullptr ? recorder->report() : RecorderReport{};
  const auto text = [&](const std::string& value) { return json ? json_string(value) : value; };
  Rows rows = {
      {"cycles", number(summary.cycles)},
      {"cycle_max_us", number(static_cast<std::uint64_t>(summary.cycle_max_us))},
      {"overruns", number(summary.overruns)},
      {"memory_locked", report.real_time.memory_locked ? "true" : "false"},
      {"scheduling", text(report.real_time.scheduling())},
      {"pings_in", number(counters.pings_in)},
      {"pings_pending", number(counters.pings_pending)},
      {"pings_mapped", number(counters.pings_mapped)},
      {"pings_synced", number(counters.pings_synced)},
      {"nav_samples", number(counters.nav_samples)},
      {"line_records", number(counters.line_records)},
      {"bytes_over_limit", number(counters.bytes_over_limit)},
      {"cells_sent", number(counters.cells_sent)},
      {"downlink_bytes", number(counters.downlink_bytes)},
      {"delta_bytes", number(counters.delta_bytes)},
      {"drained", summary.drained ? "true" : "false"},
      {"stored", summary.stored ? "true" : "false"},
      {"tiles_saved", number(vehicle.pager().counters().tiles_saved)},
      {"tiles_loaded", number(vehicle.pager().counters().tiles_loaded)},
      {"tiles_evicted", number(vehicle.pager().counters().tiles_evicted)},
      {"saves_failed", number(vehicle.pager().counters().saves_failed)},
      {"pages_lost", number(vehicle.pager().counters().pages_lost)},
      {"returns_without_tile", number(counters.returns_lost)},
      {"pings_without_tile",
       number(counters.pings_lost[static_cast<int>(firmware::PingLoss::kAbsentTile)])},
      {"map_hash", text(hex(vehicle.map_hash()))},
      {"cells_hash", text(hex(vehicle.cells_hash()))},
      {"log", recorder != nullptr ? text(recorder->path()) : (json ? "null" : "none")},
      {"log_bytes", number(recorded.bytes_written)},
      {"records_lost", number(recorded.records_lost)},
  };
  const estimator::UtcReading utc = vehicle.utc_clock().utc_at(summary.t_us);
  if (utc.sure) {
    rows.emplace_back("utc_us", number(static_cast<std::uint64_t>(utc.utc_us)));
    rows.emplace_back("utc_error_us", number(static_cast<std::uint64_t>(utc.error_us)));
  }
  if (json) {
    rows.emplace_back("pings_lost", object(losses(counters)));
    rows.emplace_back("pings", object(outcomes(vehicle.model().counters())));
    std::string ports;
    for (int port = 0; port < vehicle.config().port_count; ++port) {
      ports += (port == 0 ? "" : ", ") + object(port_rows(vehicle, port));
    }
    rows.emplace_back("ports", "[" + ports + "]");
    if (report.timing != nullptr) {
      rows.emplace_back("timing", timing_json(*report.timing));
    }
    return object(rows) + "\n";
  }
  std::string out;
  add_lines("", rows, &out);
  add_lines("pings_lost.", losses(counters), &out);
  add_lines("pings.", outcomes(vehicle.model().counters()), &out);
  for (int port = 0; port < vehicle.config().port_count; ++port) {
    add_lines("port " + std::to_string(port) + " ", port_rows(vehicle, port), &out);
  }
  if (report.timing != nullptr) {
    out += timing_text(*report.timing);
  }
  return out;
}

}  // namespace leadline::host
