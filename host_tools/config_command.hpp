// `leadline config`: vehicle.toml to the block of a vehicle without files, the block as text, older ones lifted to the
// newest schema.
#pragma once

#include <cstdint>
#include <string>

namespace leadline::host {

struct ConfigOptions {
  std::string path;
  std::string out_path;       ///< "-" = standard output
  std::int64_t from = -1;     ///< migrate: version of a file that says none; -1: the newest
  std::uint32_t session = 1;  ///< compile
  int beams = 0;              ///< compile: see m7_load()
  bool json = false;
};

/// All throw HostError: kUsage (vehicle.toml), kInput (tables, blocks), kOutput.
int run_config_compile(const ConfigOptions& options);
int run_config_show(const ConfigOptions& options);
int run_config_migrate(const ConfigOptions& options);

}  // namespace leadline::host
