#include "firmware/config/vehicle_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <utility>

#include "firmware/config/entry_list.hpp"
#include "firmware/config/exit_codes.hpp"
#include "firmware/config/port_section.hpp"
#include "firmware/config/table_file.hpp"
#include "firmware/config/text.hpp"
#include "model/capacity.hpp"
#include "model/model.hpp"

namespace leadline::host {
namespace {

using firmware::MountConfig;

constexpr double kBamPerDegree = 4294967296.0 / 360.0;
constexpr double kUradPerDegree = 3.14159265358979323846 / 180.0 * 1e6;

std::vector<KnownTable> known_tables() {
  std::vector<std::string> navigation = navigation_sigma_keys();
  for (const char* const key :
       {"magnetic_variation_deg", "surface_pressure_pa", "water_density_kg_m3", "gravity_m_s2",
        "sigma_fix_mm", "sigma_depth_mm", "sigma_attitude_deg", "sigma_heading_deg",
        "acceleration_mm_s2", "angular_acceleration_deg_s2", "max_gap_ms", "max_wait_ms", "tide_m",
        "tide_file"}) {
    navigation.emplace_back(key);
  }
  std::vector<std::string> sonar = sonar_range_keys();
  sonar.emplace_back("sound_speed_known");
  return {
      {"",
       {"schema_version", "survey", "grid", "sonar", "navigation", "model", "frame", "cycle",
        "mount", "port", "link", "log", "store", "commands", "sound_speed"},
       false},
      {"survey", {"id", "name"}, false},
      {"grid", grid_keys(), false},
      {"sonar", sonar, false},
      {"navigation", navigation, false},
      {"model", model_keys(), false},
      {"frame", frame_keys(), false},
      {"cycle",
       {"period_ms", "voxel_budget", "tile_budget", "extract_interval_s", "ping_voxel_budget"},
       false},
      {"sound_speed", {"depth_m", "speed_m_s"}, true},
      {"mount", {"name", "lever_arm_mm", "boresight_deg", "table"}, true},
      {"port", port_keys(), true},
      {"link",
       {"uri", "optional", "rate_bytes_s", "baud", "mtu_bytes", "status_interval_s",
        "hello_interval_s", "max_tile_age_s", "coarse_wait_s"},
       false},
      {"log", {"path", "max_bytes"}, false},
      {"store", {"path", "window_tiles"}, false},
      {"commands", {"key", "counter", "vehicle"}, false},
  };
}

base::Bam32 bam32_of(double degrees) {
  return static_cast<base::Bam32>(std::llround(degrees * kBamPerDegree));
}

/// As somebody would have written it: the shortest that becomes the same angle.
double degrees_of(base::Bam32 angle) {
  return shortest_number(static_cast<std::int32_t>(angle) / kBamPerDegree,
                         [angle](double degrees) { return bam32_of(degrees) == angle; });
}

/// Default beside the field it belongs to: what stands in the example file.
void set_defaults(VehicleFile* file) {
  firmware::VehicleConfig& config = file->config;
  config.schema_version = firmware::kVehicleConfigSchemaVersion;
  config.survey_id = 1;
  config.cycle_tile_budget = 16;
  firmware::NavigationConfig& navigation = config.navigation;
  navigation.surface_pressure_pa = 101'325;
  navigation.water_density_g_m3 = 1'029'000;
  navigation.gravity_um_s2 = 9'806'650;
  navigation.sigma_fix_mm = 1500;
  navigation.sigma_depth_mm = 50;
  navigation.sigma_attitude_urad = 3491;
  navigation.sigma_heading_urad = 34'907;
  navigation.acceleration_mm_s2 = 200;
  navigation.angular_acceleration_urad_s2 = 174'533;
  navigation.max_gap_us = 1'000'000;
  navigation.max_wait_us = 500'000;
  config.link.rate_bytes_s = 125'000;
  config.link.mtu_bytes = 1200;
  config.link.status_interval_us = 1'000'000;
  config.link.hello_interval_us = 30'000'000;
  config.link.max_tile_age_us = 1'500'000;
  config.link.coarse_wait_us = 5'000'000;
}

void read_survey(TomlReader* reader, VehicleFile* file) {
  const TomlSection section = reader->section("survey");
  read_whole(section, "id", {0, 9'007'199'254'740'991}, &file->config.survey_id);
  std::string name;
  section.read_text("name", firmware::kMaxConfigText_bytes, &name);
  name.copy(file->config.survey_name, firmware::kMaxConfigText_bytes);
}

/// How many of a [[table]] there are; too many and none are findings.
bool check_count(TomlReader* reader, const char* name, std::size_t count, int most) {
  if (count > static_cast<std::size_t>(most)) {
    reader->find_missing("[[" + std::string(name) + "]]: " + std::to_string(count) +
                         " of them, at most " + std::to_string(most) + " are possible");
    return false;
  }
  const bool other =
      count == 0 && reader->root().has(name);  // no [[table]]: found by the check of keys
  if (count == 0 && !other) {
    reader->find_missing("a table [[" + std::string(name) + "]] is missing");
  }
  return count > 0;
}

void read_sound_speed_point(const TomlSection& section, firmware::WaterConfig* water) {
  for (const char* const key : {"depth_m", "speed_m_s"}) {
    if (!section.has(key)) {
      section.find_missing(std::string(key) + " is missing");
    }
  }
  firmware::SoundSpeedEntry entry{};
  read_scaled(section, "depth_m", {0, 12'000}, 1e3, &entry.depth_mm);
  read_scaled(section, "speed_m_s", {1300, 1700}, 1e3, &entry.speed_mm_s);
  if (water->point_count > 0 && section.has("depth_m") &&
      entry.depth_mm <= water->points[water->point_count - 1].depth_mm) {
    section.refuse("depth_m", "has to be below the point before it");
  }
  water->points[water->point_count] = entry;
  ++water->point_count;
}

void read_sound_speeds(TomlReader* reader, VehicleFile* file) {
  firmware::WaterConfig& water = file->config.water;
  const TomlSection sonar = reader->section("sonar");
  bool known = sonar.has("sound_speed_mm_s");
  sonar.read_bool("sound_speed_known", &known);
  water.speed_known = known ? 1 : 0;
  const std::vector<TomlSection> sections = reader->sections("sound_speed");
  if (sections.empty() ||
      !check_count(reader, "sound_speed", sections.size(), firmware::kMaxSoundSpeedPoints)) {
    return;
  }
  for (const TomlSection& section : sections) {
    read_sound_speed_point(section, &water);
  }
}

void read_tide(const TomlSection& section, const std::string& base_dir, VehicleFile* file) {
  firmware::WaterConfig& water = file->config.water;
  std::int32_t tide_mm = 0;
  read_scaled(section, "tide_m", {-100, 100}, 1e3, &tide_mm);
  if (tide_mm != 0) {
    water.tide_count = 1;
    water.tide[0] = {0, tide_mm};
  }
  section.read_path("tide_file", base_dir, &file->tide_path);
  file->tide_line = section.line("tide_file");
  if (section.has("tide_m") && section.has("tide_file")) {
    section.find("tide_file", "tide_m and tide_file say the same: give one of them");
  }
}

void read_navigation(TomlReader* reader, const std::string& base_dir, VehicleFile* file) {
  read_navigation_sigmas(reader, &file->sigmas);
  const TomlSection section = reader->section("navigation");
  firmware::NavigationConfig& navigation = file->config.navigation;
  double variation_deg = 0;
  if (section.read_number("magnetic_variation_deg", {-180, 180}, &variation_deg)) {
    navigation.magnetic_variation_bam32 =
        static_cast<std::int32_t>(bam32_of(variation_deg));  // -180 and 180 are the same angle
  }
  read_whole(section, "surface_pressure_pa", {0, 200'000}, &navigation.surface_pressure_pa);
  read_scaled(section, "water_density_kg_m3", {900, 1300}, 1e3, &navigation.water_density_g_m3);
  read_scaled(section, "gravity_m_s2", {9, 10}, 1e6, &navigation.gravity_um_s2);
  read_whole(section, "sigma_fix_mm", {1, 1'000'000}, &navigation.sigma_fix_mm);
  read_whole(section, "sigma_depth_mm", {1, 100'000}, &navigation.sigma_depth_mm);
  const auto read_angle = [&](const char* key, const Limits& limits, std::int32_t* urad) {
    read_scaled(section, key, limits, kUradPerDegree, urad);
    *urad = std::max(*urad, 1);
  };
  read_angle("sigma_attitude_deg", {0, 45, true}, &navigation.sigma_attitude_urad);
  read_angle("sigma_heading_deg", {0, 90, true}, &navigation.sigma_heading_urad);
  read_whole(section, "acceleration_mm_s2", {1, 100'000}, &navigation.acceleration_mm_s2);
  read_angle("angular_acceleration_deg_s2", {0, 3600, true},
             &navigation.angular_acceleration_urad_s2);
  read_scaled(section, "max_gap_ms", {1, 60'000}, 1e3, &navigation.max_gap_us);
  read_scaled(section, "max_wait_ms", {0, 10'000}, 1e3, &navigation.max_wait_us);
  read_tide(section, base_dir, file);
}

void read_frame_of_vehicle(TomlReader* reader, VehicleFile* file) {
  file->frame = read_frame(reader);
  const FrameConfig& frame = file->frame;
  file->config.epsg = frame.epsg.value_or(0);
  frame.vertical_datum.value_or("").copy(file->config.vertical_datum,
                                         firmware::kMaxConfigText_bytes);
  if (!frame.lat_deg || !frame.lon_deg) {
    return;
  }
  firmware::NavigationConfig& navigation = file->config.navigation;
  const double lon_deg = *frame.lon_deg > 180 ? *frame.lon_deg - 360 : *frame.lon_deg;
  navigation.has_origin = 1;
  navigation.origin_latitude_e9deg = std::llround(*frame.lat_deg * 1e9);
  navigation.origin_longitude_e9deg = std::llround(lon_deg * 1e9);
}

/// Normal gravity on the WGS 84 ellipsoid (Somigliana; NIMA TR8350.2, equation 4-1), micrometres per
/// second squared: 9.7803 m/s^2 at the equator, 9.8322 at the poles.
std::int32_t normal_gravity_um_s2(double latitude_deg) {
  constexpr double kAtEquator_m_s2 = 9.7803253359;
  constexpr double kSomigliana = 0.00193185265241;
  constexpr double kEccentricity2 = 0.00669437999013;
  const double sine = std::sin(latitude_deg * (kUradPerDegree * 1e-6));
  const double square = sine * sine;
  return static_cast<std::int32_t>(
      std::llround(1e6 * kAtEquator_m_s2 * (1.0 + kSomigliana * square) /
                   std::sqrt(1.0 - kEccentricity2 * square)));
}

/// Where the survey is known to be, its own gravity is the default.
void default_gravity(TomlReader* reader, VehicleFile* file) {
  if (file->frame.lat_deg && !reader->section("navigation").has("gravity_m_s2")) {
    file->config.navigation.gravity_um_s2 = normal_gravity_um_s2(*file->frame.lat_deg);
  }
}

constexpr std::uint32_t kMostBudget_voxels = 16'777'216;

void read_cycle(TomlReader* reader, VehicleFile* file) {
  const TomlSection section = reader->section("cycle");
  read_scaled(section, "period_ms", {1, 1000}, 1e3, &file->cycle_us);
  file->voxel_budget_given = section.has("voxel_budget");
  file->tile_budget_given = section.has("tile_budget");
  file->extract_interval_given = section.has("extract_interval_s");
  read_whole(section, "voxel_budget", {0, kMostBudget_voxels}, &file->config.cycle_voxel_budget);
  read_whole(section, "tile_budget", {1, 4096}, &file->config.cycle_tile_budget);
  read_scaled(section, "extract_interval_s", {0, 60}, 1e6, &file->config.extract_interval_us);
  read_whole(section, "ping_voxel_budget", {0, kMostBudget_voxels}, &file->ping_voxel_budget);
}

/// Number of a table's path, which is added when it is new.
std::uint8_t table_number(const std::string& path, std::vector<std::string>* paths) {
  const auto known = std::find(paths->begin(), paths->end(), path);
  const auto number = static_cast<std::uint8_t>(known - paths->begin());
  if (known == paths->end()) {
    paths->push_back(path);
  }
  return number;
}

void read_mount(const TomlSection& section, const std::string& base_dir, VehicleFile* file) {
  MountConfig mount{};
  std::string name;
  if (!section.has("name")) {
    section.find_missing("name is missing");
  } else if (section.read_text("name", 32, &name)) {
    const auto& names = file->mount_names;
    if (name.empty() || std::find(names.begin(), names.end(), name) != names.end()) {
      section.refuse("name", "every mount has a name of its own");
    }
  }
  const Limits arm_mm = {-100'000, 100'000};
  std::int64_t lever_arm_mm[3] = {0, 0, 0};
  section.read_integers("lever_arm_mm", {arm_mm, arm_mm, arm_mm}, lever_arm_mm,
                        "[forward, right, down]");
  for (std::size_t axis = 0; axis < 3; ++axis) {
    mount.lever_arm_mm[axis] = static_cast<std::int32_t>(lever_arm_mm[axis]);
  }
  double boresight_deg[3] = {0, 0, 0};
  section.read_numbers("boresight_deg", {-360, 360}, boresight_deg, "[roll, pitch, heading]");
  mount.boresight = {bam32_of(boresight_deg[0]), bam32_of(boresight_deg[1]),
                     bam32_of(boresight_deg[2])};
  std::string table;
  mount.table = firmware::kNoTable;
  if (!section.has("table")) {
    // Missing where a head uses the mount: found when the ports are known.
  } else if (section.read_path("table", base_dir, &table)) {
    mount.table = table_number(table, &file->table_paths);
    if (file->table_paths.size() > firmware::kMaxTables) {
      section.refuse("table", "at most " + std::to_string(firmware::kMaxTables) +
                                  " tables, and this would be one more");
    }
  }
  file->config.mounts[file->mount_names.size()] = mount;
  file->mount_names.push_back(name);
}

void read_mounts(TomlReader* reader, const std::string& base_dir, VehicleFile* file) {
  const std::vector<TomlSection> sections = reader->sections("mount");
  if (!check_count(reader, "mount", sections.size(), firmware::kMaxMounts)) {
    return;
  }
  for (const TomlSection& section : sections) {
    read_mount(section, base_dir, file);
  }
  file->config.mount_count = static_cast<std::uint16_t>(sections.size());
  file->config.table_count = static_cast<std::uint16_t>(file->table_paths.size());
}

/// Two that read one serial line would each get a part of its bytes.
void check_own_line(const TomlSection& section, const hal::UriSpec& uri,
                    const std::vector<hal::UriSpec>& ports) {
  for (std::size_t k = 0; k < ports.size(); ++k) {
    if (uri.scheme == hal::UriScheme::kSerial && ports[k].scheme == hal::UriScheme::kSerial &&
        uri.path == ports[k].path) {
      section.refuse("uri", "port " + std::to_string(k) +
                                " is on this line already: one port for all that it says");
      return;
    }
  }
}

void read_ports(TomlReader* reader, VehicleFile* file) {
  const std::vector<TomlSection> sections = reader->sections("port");
  if (!check_count(reader, "port", sections.size(), firmware::kMaxPorts)) {
    return;
  }
  const PortContext context = {file->mount_names, file->ranges};
  for (const TomlSection& section : sections) {
    PortSection port = read_port(section, context);
    const std::uint8_t mount = port.config.mount;
    if (firmware::is_head(port.config.driver) && mount < file->mount_names.size() &&
        file->config.mounts[mount].table == firmware::kNoTable) {
      section.find_missing("its mount \"" + printable(file->mount_names[mount]) +
                           "\" has no table: the beam, made by `leadline table`");
    }
    check_own_line(section, port.uri, file->port_uris);
    file->config.ports[file->port_uris.size()] = port.config;
    file->port_uris.push_back(std::move(port.uri));
    file->port_optional.push_back(port.optional);
  }
  file->config.port_count = static_cast<std::uint16_t>(sections.size());
}

void read_link(TomlReader* reader, VehicleFile* file) {
  const TomlSection section = reader->section("link");
  firmware::LinkConfig& link = file->config.link;
  if (!section.exists()) {
    if (!reader->root().has("link")) {
      reader->find_missing("the table [link] with uri is missing");
    }
    return;
  }
  read_uri(section, &file->link_uri);
  check_own_line(section, file->link_uri, file->port_uris);
  section.read_bool("optional", &file->link_optional);
  read_whole(section, "rate_bytes_s", {10, 125'000'000}, &link.rate_bytes_s);
  std::int64_t baud = 0;
  if (section.read_integer("baud", {100, 1'250'000'000}, &baud)) {
    link.rate_bytes_s = static_cast<std::uint32_t>(baud / 10);  // start bit, eight, stop bit
  }
  if (section.has("baud") && section.has("rate_bytes_s")) {
    section.find("baud", "baud and rate_bytes_s say the same: give one of them");
  }
  read_whole(section, "mtu_bytes", {128, 1400}, &link.mtu_bytes);
  const auto read_seconds = [&](const char* key, std::uint32_t* value_us) {
    double seconds = 0;
    if (section.read_number(key, {0, 3600, true}, &seconds)) {
      *value_us = static_cast<std::uint32_t>(std::max(1LL, std::llround(seconds * 1e6)));
    }
  };
  read_seconds("status_interval_s", &link.status_interval_us);
  read_seconds("hello_interval_s", &link.hello_interval_us);
  read_scaled(section, "max_tile_age_s", {0, 60}, 1e6, &link.max_tile_age_us);
  read_scaled(section, "coarse_wait_s", {0, 3600}, 1e6, &link.coarse_wait_us);
}

void read_log(TomlReader* reader, const std::string& base_dir, VehicleFile* file) {
  const TomlSection section = reader->section("log");
  if (!section.exists()) {
    return;
  }
  if (!section.has("path")) {
    section.find_missing("path is missing");
  }
  section.read_path("path", base_dir, &file->log.path);
  section.read_integer("max_bytes", {0, 1e15}, &file->log.max_bytes);
  if (file->log.max_bytes != 0 && file->log.max_bytes < 1'000'000) {
    section.refuse("max_bytes", "has to be 0 (no limit) or at least 1000000");
  }
}

std::int64_t tile_voxels(std::int64_t depth_cells) {
  return std::int64_t{model::kTileCells} * model::kTileCells * depth_cells;
}

/// Pages of the model's memory; one more is the blank one of absent tiles.
std::uint32_t most_window_tiles(std::int64_t depth_cells) {
  const std::int64_t pages =
      std::int64_t{model::kVoxelCapacity} / std::max<std::int64_t>(tile_voxels(depth_cells), 1);
  return static_cast<std::uint32_t>(std::max<std::int64_t>(pages - 1, 0));
}

void read_store(TomlReader* reader, const std::string& base_dir, VehicleFile* file) {
  const TomlSection section = reader->section("store");
  if (!section.exists()) {
    return;
  }
  if (!section.has("path")) {
    section.find_missing("path is missing");
  }
  section.read_path("path", base_dir, &file->store.path);
  for (const std::string* other : {&file->log.path, &file->commands.key_path}) {
    if (!file->store.path.empty() && file->store.path == *other) {
      section.refuse("path", "is the name of another file of this configuration");
    }
  }
  constexpr double kLeastWindow_tiles = 9;
  const std::int64_t depth_cells = file->grid.size[2];
  const std::uint32_t most_tiles = most_window_tiles(depth_cells);
  if (most_tiles == 0 && section.has("path")) {
    section.refuse("path", "no store: memory does not hold one tile of " +
                               std::to_string(tile_voxels(depth_cells)) + " voxels");
  }
  if (section.read_integer("window_tiles", {kLeastWindow_tiles, double{model::kTileCapacity}},
                           &file->store.window_tiles) &&
      file->store.window_tiles > most_tiles) {
    section.refuse("window_tiles", "memory holds " + std::to_string(most_tiles) + " tiles of " +
                                       std::to_string(tile_voxels(depth_cells)) + " voxels");
  }
}

void read_commands(TomlReader* reader, const std::string& base_dir, VehicleFile* file) {
  const TomlSection section = reader->section("commands");
  if (!section.exists()) {
    return;
  }
  if (!section.has("key")) {
    section.find_missing("key is missing");
  }
  CommandsConfig& commands = file->commands;
  section.read_path("key", base_dir, &commands.key_path);
  commands.counter_path = commands.key_path + ".taken";
  section.read_path("counter", base_dir, &commands.counter_path);
  read_whole(section, "vehicle", {1, 65'535}, &commands.vehicle);
}

/// The window that [store] asks for, or as many tiles as fit.
void set_window(VehicleFile* file) {
  if (file->store.path.empty()) {
    return;
  }
  model::ModelConfig& model = file->config.model;
  const auto tiles = [&model](int axis) {
    return static_cast<std::uint32_t>((model.size[axis] + model::kTileCells - 1) /
                                      model::kTileCells);
  };
  const auto asked = static_cast<std::uint32_t>(file->store.window_tiles);
  model.resident_tiles =
      asked != 0 ? asked : std::min(tiles(0) * tiles(1), most_window_tiles(model.size[2]));
  file->store.window_tiles = model.resident_tiles;
  file->config.has_store = 1;
}

// ---- Writing ------------------------------------------------------------------------------------

std::string text_of(const char (&text)[firmware::kMaxConfigText_bytes]) {
  return {text, std::find(text, text + sizeof text, '\0')};
}

void add_survey(const VehicleFile& file, EntryList* list) {
  list->in("");
  list->integer("schema_version", kVehicleSchemaVersion);
  list->in("survey");
  list->integer("id", static_cast<std::int64_t>(file.config.survey_id));
  list->text("name", text_of(file.config.survey_name));
  list->in("grid");
  list->integer("cell_mm", file.grid.cell_mm);
  list->raw("size", array_text(file.grid.size));
  list->raw("origin_mm", array_text(file.grid.origin_mm));
  list->in("sonar");
  list->integer("min_range_mm", file.ranges.min_range_mm);
  list->integer("max_range_mm", file.ranges.max_range_mm);
  list->text("no_return", no_return_name(file.ranges.no_return));
  if (file.ranges.detect_range_mm) {
    list->integer("detect_range_mm", *file.ranges.detect_range_mm);
  }
  list->integer("sound_speed_mm_s", file.ranges.sound_speed_mm_s);
  list->flag("sound_speed_known", file.config.water.speed_known != 0);
  for (int i = 0; i < file.config.water.point_count; ++i) {
    const firmware::SoundSpeedEntry& point = file.config.water.points[i];
    list->in("sound_speed", i);
    list->scaled("depth_m", point.depth_mm, 1e3);
    list->scaled("speed_m_s", point.speed_mm_s, 1e3);
  }
}

void add_navigation(const VehicleFile& file, EntryList* list) {
  const firmware::NavigationConfig& navigation = file.config.navigation;
  list->in("navigation");
  list->raw("sigma_position_mm", array_text(file.sigmas.sigma_position_mm));
  list->raw("sigma_correlated_mm", array_text(file.sigmas.sigma_correlated_mm));
  list->number("magnetic_variation_deg",
               degrees_of(static_cast<base::Bam32>(navigation.magnetic_variation_bam32)));
  list->integer("surface_pressure_pa", navigation.surface_pressure_pa);
  list->scaled("water_density_kg_m3", navigation.water_density_g_m3, 1e3);
  list->scaled("gravity_m_s2", navigation.gravity_um_s2, 1e6);
  list->integer("sigma_fix_mm", navigation.sigma_fix_mm);
  list->integer("sigma_depth_mm", navigation.sigma_depth_mm);
  list->scaled("sigma_attitude_deg", navigation.sigma_attitude_urad, kUradPerDegree);
  list->scaled("sigma_heading_deg", navigation.sigma_heading_urad, kUradPerDegree);
  list->integer("acceleration_mm_s2", navigation.acceleration_mm_s2);
  list->scaled("angular_acceleration_deg_s2", navigation.angular_acceleration_urad_s2,
               kUradPerDegree);
  list->scaled("max_gap_ms", navigation.max_gap_us, 1e3);
  list->scaled("max_wait_ms", navigation.max_wait_us, 1e3);
  if (file.tide_path.empty()) {
    const firmware::WaterConfig& water = file.config.water;
    list->scaled("tide_m", water.tide_count != 0 ? water.tide[0].height_mm : 0, 1e3);
  } else {
    list->text("tide_file", file.tide_path);
  }
}

void add_model(const VehicleFile& file, EntryList* list) {
  list->in("model");
  list->text("rule", rule_name(file.model.rule));
  list->number("k_p", file.model.k_p);
  list->in("frame");
  if (file.frame.lat_deg) {
    list->number("lat", *file.frame.lat_deg);
  }
  if (file.frame.lon_deg) {
    list->number("lon", *file.frame.lon_deg);
  }
  if (file.frame.epsg) {
    list->integer("epsg", *file.frame.epsg);
  }
  if (file.frame.vertical_datum) {
    list->text("vertical_datum", *file.frame.vertical_datum);
  }
  list->in("cycle");
  list->scaled("period_ms", file.cycle_us, 1e3);
  list->integer("voxel_budget", file.config.cycle_voxel_budget);
  list->integer("tile_budget", file.config.cycle_tile_budget);
  list->scaled("extract_interval_s", file.config.extract_interval_us, 1e6);
  list->integer("ping_voxel_budget", file.ping_voxel_budget);
}

void add_mounts(const VehicleFile& file, EntryList* list) {
  for (std::size_t i = 0; i < file.mount_names.size(); ++i) {
    const MountConfig& mount = file.config.mounts[i];
    list->in("mount", static_cast<int>(i));
    list->text("name", file.mount_names[i]);
    list->raw("lever_arm_mm", array_text(mount.lever_arm_mm));
    const double boresight_deg[3] = {degrees_of(mount.boresight.roll_bam32),
                                     degrees_of(mount.boresight.pitch_bam32),
                                     degrees_of(mount.boresight.heading_bam32)};
    list->raw("boresight_deg", array_text(boresight_deg));
    if (mount.table != firmware::kNoTable) {
      list->text("table", file.table_paths[mount.table]);
    }
  }
}

std::vector<ConfigEntry> entries_of(const VehicleFile& file) {
  EntryList list;
  add_survey(file, &list);
  add_navigation(file, &list);
  add_model(file, &list);
  add_mounts(file, &list);
  for (std::size_t i = 0; i < file.port_uris.size(); ++i) {
    list.in("port", static_cast<int>(i));
    add_port({file.config.ports[i], file.port_uris[i], file.port_optional[i]}, file.mount_names,
             &list);
  }
  const firmware::LinkConfig& link = file.config.link;
  list.in("link");
  list.text("uri", hal::uri_text(file.link_uri));
  list.flag("optional", file.link_optional);
  list.integer("rate_bytes_s", link.rate_bytes_s);
  list.integer("mtu_bytes", link.mtu_bytes);
  list.scaled("status_interval_s", link.status_interval_us, 1e6);
  list.scaled("hello_interval_s", link.hello_interval_us, 1e6);
  list.scaled("max_tile_age_s", link.max_tile_age_us, 1e6);
  list.scaled("coarse_wait_s", link.coarse_wait_us, 1e6);
  if (!file.log.path.empty()) {
    list.in("log");
    list.text("path", file.log.path);
    list.integer("max_bytes", file.log.max_bytes);
  }
  if (!file.store.path.empty()) {
    list.in("store");
    list.text("path", file.store.path);
    list.integer("window_tiles", file.store.window_tiles);
  }
  if (!file.commands.key_path.empty()) {
    list.in("commands");
    list.text("key", file.commands.key_path);
    list.text("counter", file.commands.counter_path);
    list.integer("vehicle", file.commands.vehicle);
  }
  return list.entries();
}

}  // namespace

VehicleFile parse_vehicle_file(std::string_view text, const std::string& name,
                               const std::string& base_dir) {
  VehicleFile file;
  set_defaults(&file);
  TomlReader reader(text, name, known_tables());
  reader.read_schema_version(kVehicleSchemaVersion);
  read_survey(&reader, &file);
  file.grid = read_grid(&reader);
  // Of water, as the codecs have it.
  read_sonar_ranges(&reader, file.grid, {1'300'000, 1'700'000}, &file.ranges);
  read_sound_speeds(&reader, &file);
  read_navigation(&reader, base_dir, &file);
  file.model = read_model(&reader);
  read_frame_of_vehicle(&reader, &file);
  default_gravity(&reader, &file);
  read_cycle(&reader, &file);
  read_mounts(&reader, base_dir, &file);
  read_ports(&reader, &file);
  read_link(&reader, &file);
  read_log(&reader, base_dir, &file);
  read_commands(&reader, base_dir, &file);
  read_store(&reader, base_dir, &file);
  reader.finish();
  file.config.sound_speed_mm_s = static_cast<std::int32_t>(file.ranges.sound_speed_mm_s);
  file.config.model = to_model_config(file.grid, file.ranges, file.sigmas, file.model, name,
                                      !file.store.path.empty());
  set_window(&file);
  file.config.model.work_budget_voxels = file.ping_voxel_budget;
  return file;
}

VehicleFile load_vehicle_file(const std::string& path) {
  return parse_vehicle_file(read_config_text(path), path,
                            std::filesystem::path(path).parent_path().string());
}

std::string vehicle_file_to_toml(const VehicleFile& file) {
  return entries_to_toml(entries_of(file));
}

std::string vehicle_file_to_json(const VehicleFile& file) {
  return entries_to_json(entries_of(file));
}

std::vector<model::LocalizationTable> load_tables(VehicleFile* file) {
  std::vector<model::LocalizationTable> tables;
  tables.reserve(file->table_paths.size());
  for (const std::string& path : file->table_paths) {
    tables.push_back(load_table(path));
  }
  set_default_budget(tables, file);
  return tables;
}

void set_default_budget(const std::vector<model::LocalizationTable>& tables, VehicleFile* file) {
  if (file->voxel_budget_given) {
    return;
  }
  const model::ModelConfig& config = file->config.model;
  std::uint64_t later = 0;
  for (const firmware::PortConfig& port : file->config.ports) {
    later = std::max(later, static_cast<std::uint64_t>(std::max(port.max_returns, 1) - 1));
  }
  std::uint64_t ping_voxels = 0;
  for (const model::LocalizationTable& table : tables) {
    const model::Scale scale = model::sensor_scale(config, table, config.max_range_um);
    const model::WorkBound bound = model::work_bound(scale);
    ping_voxels = std::max(ping_voxels, bound.total_voxels + later * bound.behind_voxels);
  }
  file->config.cycle_voxel_budget = static_cast<std::uint32_t>(
      std::min<std::uint64_t>(kDefaultBudget_pings * ping_voxels, kMostBudget_voxels));
}

}  // namespace leadline::host
