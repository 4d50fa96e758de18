// `leadline table`: makes, shows and checks localization tables.
#pragma once

#include <string>

namespace leadline::host {

struct TableOptions {
  std::string config_path;  ///< map.toml whose [sonar] describes the beam; "" with show_path
  std::string out_path;     ///< where the block goes (`.llt`); "" = only the report
  std::string show_path;    ///< an existing block to check and describe instead; "" = none
  bool json = false;        ///< one JSON object on standard output instead of text
};

/// The command; returns 0. Throws HostError: kUsage (neither or both of config and show, out with
/// show; configuration, pattern file), kInput (the block to show is damaged, truncated, of another
/// version), kOutput.
int run_table(const TableOptions& options);

}  // namespace leadline::host
