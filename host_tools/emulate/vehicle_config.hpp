// The configuration that fits an emulated vehicle: vehicle.toml and the localization table of its heads.
#pragma once

#include <string>
#include <vector>

#include "host_tools/emulate/mission.hpp"
#include "host_tools/map_config.hpp"
#include "host_tools/table/generator.hpp"

namespace leadline::host {

/// Where the vehicle of the mission finds its devices and its surface.
struct MissionLinks {
  std::vector<std::string> port_uris;  ///< parallel to fleet_ports()
  std::string link_uri;
  std::string log_path;    ///< "" = no log
  std::string table_path;  ///< as written in the file: relative to it
};

/// One table stands for all heads (the vehicle's model takes one): the beam of the first, its range and
/// the pointing errors that attitude, heading and mounting come to.
[[nodiscard]] SonarConfig mission_sonar(const Mission& mission);
[[nodiscard]] GeneratedTable mission_table(const Mission& mission);

/// The text of vehicle.toml.
[[nodiscard]] std::string mission_vehicle_toml(const Mission& mission, const Terrain& ground,
                                               const MissionLinks& links);

}  // namespace leadline::host
