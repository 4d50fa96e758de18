// `leadline map`: pings and a configuration become a folder of results.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "host_tools/survey_map.hpp"

namespace leadline::host {

struct MapOptions {
  std::string pings_path;  ///< "-" is standard input
  std::string config_path;
  std::string out_dir;
  bool strict = false;                   ///< the first row that cannot be used ends the run
  std::uint32_t work_budget_voxels = 0;  ///< refuse a configuration whose bound is over; 0 = none
  bool json = false;                     ///< print stats.json instead of a summary
};

/// What stats.json holds.
struct MapStats {
  std::uint64_t pings = 0;  ///< rows integrated; with `rejected` all rows of the file
  /// Reason -> rows: those of PingCsvReader and of SurveyMap::integrate.
  std::map<std::string, std::uint64_t> rejected;
  SurveyMapCounters counters;
  double integrate_seconds = 0;  ///< CPU of integration and of any extraction that it feeds back
  double extract_seconds = 0;    ///< CPU of the final extraction of the whole grid
};

/// The text of stats.json.
[[nodiscard]] std::string format_stats_json(const MapStats& stats);

/// The command. Leaves model.llm, depth.asc, sigma.asc, depth.tif, depth.png, stats.json in out_dir, all or none;
/// notices and rejected rows go to standard error, the summary to standard output. Returns 0. Throws
/// HostError: kUsage (configuration), kInput (pings; no row within the range limits), kOutput.
int run_map(const MapOptions& options);

}  // namespace leadline::host
