// vehicle.toml: what a vehicle is configured with, as the integers that it runs on, plus what only the
// program around it needs (where the ports are, which files to read and write).
//
// The tables [grid] [sonar] [model] [frame] and the sigmas of [navigation] mean what they mean in
// map.toml (survey_sections.hpp); only the beam does not stand here: it comes with the mount's table,
// made by `leadline table`. firmware/vehicle.example.toml shows every key with its unit, default and
// limits, and `leadline-vehicle --help-config` prints it.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "firmware/config/survey_sections.hpp"
#include "firmware/pipeline/config.hpp"
#include "hal/linux/uri.hpp"
#include "model/localization_table.hpp"

namespace leadline::host {

inline constexpr std::int64_t kVehicleSchemaVersion = 1;

/// [log]
struct LogConfig {
  std::string path;  ///< required by nothing: "" = no log. Relative: to the TOML file
  /// Mapping goes on, recording stops there; 1,000,000 .. 10^15, default 0 = until the disk is full.
  std::int64_t max_bytes = 0;
};

/// [store]
struct StoreConfig {
  std::string path;  ///< "" = no store. Relative: to the TOML file
  /// Tiles of 16 x 16 columns whose voxels are in memory at the same time; default: as many as fit.
  std::int64_t window_tiles = 0;
};

/// [commands]
struct CommandsConfig {
  std::string key_path;       ///< "" = every command is refused. Relative: to the TOML file
  std::string counter_path;   ///< default: key_path and ".taken"
  std::uint16_t vehicle = 1;  ///< 1 .. 65535; the key has to be for the same
};

/// A vehicle.toml after checking.
struct VehicleFile {
  firmware::VehicleConfig config{};
  std::vector<hal::UriSpec> port_uris;  ///< parallel to config.ports
  /// Parallel to them: the program starts without the device and takes it when it comes.
  std::vector<bool> port_optional;
  hal::UriSpec link_uri;
  bool link_optional = false;            ///< [link] optional; the same for the link
  std::vector<std::string> mount_names;  ///< parallel to config.mounts
  std::vector<std::string> table_paths;  ///< parallel to table numbers; resolved
  std::string tide_path;                 ///< [navigation] tide_file; see tide_file.hpp. "": none
  std::uint32_t tide_line = 0;           ///< where that stands
  LogConfig log;
  StoreConfig store;
  CommandsConfig commands;
  std::int32_t cycle_us = 20'000;       ///< [cycle] period_ms; 1 .. 1000, default 20
  std::uint32_t ping_voxel_budget = 0;  ///< [cycle]; config.model.work_budget_voxels
  bool voxel_budget_given = false;      ///< [cycle] voxel_budget; else set_default_budget() sets it
  bool tile_budget_given = false;       ///< [cycle] tile_budget; else set_m7_defaults() may set it
  bool extract_interval_given = false;  ///< [cycle] extract_interval_s; the same
  FrameConfig frame;                    ///< for the topside; part of it is in config as well
  GridConfig grid;                      ///< as written
  SonarRanges ranges;
  NavigationSigmas sigmas;
  ModelConfig model;
};

/// Reads and checks `path`. Throws HostError kUsage with every finding, a line each:
/// `FILE:LINE: [table] key = value: reason`.
[[nodiscard]] VehicleFile load_vehicle_file(const std::string& path);
/// The same over text; `base_dir` is where relative paths start ("" leaves them).
[[nodiscard]] VehicleFile parse_vehicle_file(std::string_view text, const std::string& name,
                                             const std::string& base_dir);

/// Every value after defaults, as TOML that parse_vehicle_file(..., "") reads back to the same.
[[nodiscard]] std::string vehicle_file_to_toml(const VehicleFile& file);
[[nodiscard]] std::string vehicle_file_to_json(const VehicleFile& file);

/// The blocks of table_paths, and the default of [cycle] voxel_budget that follows from them. Throws HostError
/// kInput: what is wrong with one and what to do.
[[nodiscard]] std::vector<model::LocalizationTable> load_tables(VehicleFile* file);

/// Pings of the worst kind that the default of [cycle] voxel_budget has room for. Most pings write a small part
/// of the worst one's voxels; of the worst, 256 take 32 cycles.
inline constexpr std::uint32_t kDefaultBudget_pings = 8;
/// Sets the default of [cycle] voxel_budget unless the file has one; `tables` by table number.
void set_default_budget(const std::vector<model::LocalizationTable>& tables, VehicleFile* file);

/// firmware/vehicle.example.toml, built in.
[[nodiscard]] const char* vehicle_example();

}  // namespace leadline::host
