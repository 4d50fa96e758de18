// `leadline import`: recordings of other programs as a log of ours, or as soundings for `map`. What and why:
// host_tools/DESIGN.md.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace leadline::host {

struct ImportOptions {
  /// "N=FILE": port N of the configuration (0, 1, ... in its order) hears FILE.
  std::vector<std::string> records;
  /// "N=SECONDS": added to the times of that port's recording.
  std::vector<std::string> shifts;
  std::string config_path;            ///< vehicle.toml
  std::int64_t bytes_per_s = 11'520;  ///< pace of bytes without times, > 0
  /// Files of soundings (SonTek .sum, XTF), instead of the above: as `leadline survey` with its defaults.
  std::vector<std::string> soundings;
  std::optional<double> lat_deg;  ///< origin of the soundings; both or none
  std::optional<double> lon_deg;
  std::string out_path;  ///< log, or pings.csv
  bool json = false;
};

/// The command; returns 0. Throws HostError: kUsage for options that do not fit, with the option named;
/// kInput; kOutput.
int run_import(const ImportOptions& options);

}  // namespace leadline::host
