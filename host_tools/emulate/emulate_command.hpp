// `leadline emulate`: the fleet behind real ports, in real time, faster, or in lockstep with a vehicle.
#pragma once

#include <optional>
#include <string>

#include "host_tools/emulate/fleet.hpp"
#include "host_tools/emulate/mission.hpp"
#include "host_tools/output_dir.hpp"

namespace leadline::host {

struct EmulateOptions {
  MissionOptions mission;
  /// Write vehicle.toml, the table and truth.asc into this folder and fly nothing.
  std::string write_config_dir;
  /// After the flight: truth.asc, touched.asc, emulate.json. "" = nothing is written.
  std::string out_dir;
  /// Folder for the symbolic links to the ptys, named like the ports; UDP instead when udp is set.
  std::string ports_dir = "ports";
  /// "HOST:PORT": heads answer at HOST:PORT, PORT + 1, ..., sensors send to the numbers behind them.
  std::string udp;
  std::string link_uri = "udp:127.0.0.1:9100";  ///< --write-config: where the vehicle sends its map
  std::string log_path = "survey.lll";          ///< --write-config
  /// Times real time; unset: 1, in lockstep as fast as both can.
  std::optional<double> speed;
  std::string lockstep_path;
  double wait_s = 30.0;  ///< lockstep: for the vehicle to come, and for each answer
  bool json = false;
};

/// emulate.json: what the world did to pings and bytes.
[[nodiscard]] std::string fleet_summary_json(const Fleet& fleet, base::TimeUs flown_us);
/// Stages truth.asc and touched.asc.
void stage_truth(OutputDir* out, const Fleet& fleet);

/// The command. Prints the ports before it starts and a summary at the end. Returns 0, also when SIGINT
/// or SIGTERM ended the flight early. Throws HostError: kUsage, kInput (terrain; the vehicle broke the
/// lockstep), kOutput.
int run_emulate(const EmulateOptions& options);

}  // namespace leadline::host
