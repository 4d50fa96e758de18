#include "host_tools/map_command.hpp"

#include <array>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/map_output.hpp"
#include "host_tools/output_dir.hpp"
#include "host_tools/progress.hpp"
#include "host_tools/text.hpp"

namespace leadline::host {
namespace {

/// Rows read before they are integrated: the clock is a system call, and parsing is not to count.
constexpr std::size_t kBatchRows = 4096;

/// CPU seconds of this process so far.
double cpu_seconds() {
  timespec now{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

std::string decimals(double value, int digits) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.*f", digits, value);
  return text.data();
}

/// Reads, sorts out and integrates every row.
void integrate_all(PingCsvReader* reader, SurveyMap* map, MapStats* stats) {
  Progress progress("mapping", reader->bytes_total());
  std::vector<PingRow> batch;
  batch.reserve(kBatchRows);
  bool more = true;
  while (more) {
    batch.clear();
    PingRow row{};
    while (batch.size() < kBatchRows && (more = reader->next(&row))) {
      batch.push_back(row);
    }
    const double begin_s = cpu_seconds();
    for (const PingRow& ping : batch) {
      const char* const reason = map->integrate(ping);
      stats->pings += reason == nullptr ? 1 : 0;
      if (reason != nullptr) {
        stats->rejected[reason] += 1;
      }
    }
    stats->integrate_seconds += cpu_seconds() - begin_s;
    progress.update_now(reader->bytes_read());
  }
  for (const auto& [reason, count] : reader->stats().rejected) {
    stats->rejected[reason] += count;
  }
}

std::string rejected_text(const MapStats& stats) {
  std::string text;
  for (const auto& [reason, count] : stats.rejected) {
    text += (text.empty() ? "" : ", ") + reason + " " + std::to_string(count);
  }
  return text;
}

void print_summary(const MapOptions& options, const MapStats& stats) {
  const std::string rejected = rejected_text(stats);
  const double pings_per_s =
      stats.integrate_seconds > 0 ? static_cast<double>(stats.pings) / stats.integrate_seconds : 0;
  std::cout
      << "pings          " << stats.pings << (rejected.empty() ? "" : ", rejected: ") << rejected
      << "\nintegration    " << decimals(stats.integrate_seconds, 3) << " s CPU, "
      << decimals(pings_per_s, 0) << " pings/s; " << stats.counters.voxel_updates
      << " voxel updates, at most " << stats.counters.max_voxels_per_ping << " per ping (bound "
      << stats.counters.work_bound << ")\nmodel          "
      << decimals(100.0 * stats.counters.known_fraction, 1) << " % of the voxels known, "
      << decimals(stats.counters.entropy_bits, 0) << " bits open; map "
      << hex_text(stats.counters.map_hash, 16) << ", table "
      << hex_text(stats.counters.table_crc, 8) << "\nwritten to     " << options.out_dir
      << ": model.llm, depth.asc, sigma.asc, depth.tif, depth.png,\n               stats.json\n";
}

}  // namespace

std::string format_stats_json(const MapStats& stats) {
  std::string rejected;
  for (const auto& [reason, count] : stats.rejected) {
    rejected += (rejected.empty() ? "" : ", ") + json_string(reason) + ": " + std::to_string(count);
  }
  const SurveyMapCounters& counters = stats.counters;
  return "{\n  \"pings\": " + std::to_string(stats.pings) +                     //
         ",\n  \"rejected\": {" + rejected + "}" +                              //
         ",\n  \"voxel_updates\": " + std::to_string(counters.voxel_updates) +  //
         ",\n  \"max_voxels_per_ping\": " + std::to_string(counters.max_voxels_per_ping) +
         ",\n  \"work_bound\": " + std::to_string(counters.work_bound) +          //
         ",\n  \"integrate_seconds\": " + json_number(stats.integrate_seconds) +  //
         ",\n  \"extract_seconds\": " + json_number(stats.extract_seconds) +      //
         ",\n  \"bytes_per_voxel\": " + json_number(counters.bytes_per_voxel) +   //
         ",\n  \"entropy_bits\": " + json_number(counters.entropy_bits) +         //
         ",\n  \"known_fraction\": " + json_number(counters.known_fraction) +     //
         ",\n  \"table_crc\": " + json_string(hex_text(counters.table_crc, 8)) +  //
         ",\n  \"map_hash\": " + json_string(hex_text(counters.map_hash, 16)) + "\n}\n";
}

int run_map(const MapOptions& options) {
  const MapConfig config = load_map_config(options.config_path);
  SurveyMap map(config, options.config_path, options.work_budget_voxels);

  PingCsvOptions csv_options;
  csv_options.strict = options.strict;
  csv_options.message = [](const std::string& message) {
    std::cerr << "leadline: map: " << message << "\n";
  };
  PingCsvReader reader(options.pings_path, csv_options);
  OutputDir output(options.out_dir);

  MapStats stats;
  integrate_all(&reader, &map, &stats);
  if (stats.pings == 0) {
    throw HostError(ExitCode::kInput,
                    options.pings_path + ": no usable row (" + rejected_text(stats) +
                        "); min_range_mm = " + std::to_string(config.sonar.min_range_mm) +
                        ", max_range_mm = " + std::to_string(config.sonar.max_range_mm));
  }
  const double begin_s = cpu_seconds();
  map.extract();
  stats.extract_seconds = cpu_seconds() - begin_s;
  stats.counters = map.counters();

  output.write("model.llm", map.save());
  stage_map(&output, map.elevation(), map.sigma(), map_reference(config));
  const std::string json = format_stats_json(stats);
  output.write("stats.json", json);
  output.commit();
  if (options.json) {
    std::cout << json;
  } else {
    print_summary(options, stats);
  }
  return static_cast<int>(ExitCode::kOk);
}

}  // namespace leadline::host
