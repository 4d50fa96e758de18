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
  std::string log_path;  ///< "" = no log
};

/// Name of the table of a kind of head, beside vehicle.toml.
[[nodiscard]] const char* table_name(HeadKind kind);
/// The beam of a kind of head, its range, and the pointing errors that attitude, heading and mounting come
/// to.
[[nodiscard]] SonarConfig mission_sonar(const Mission& mission, HeadKind kind);

/// A table of the mission's heads.
struct MissionTable {
  std::string name;
  model::LocalizationTable table{};
};
/// One for each kind of head, in the order in which vehicle.toml first names them.
[[nodiscard]] std::vector<MissionTable> mission_tables(const Mission& mission);

/// The text of vehicle.toml.
[[nodiscard]] std::string mission_vehicle_toml(const Mission& mission, const Terrain& ground,
                                               const MissionLinks& links);

}  // namespace leadline::host
