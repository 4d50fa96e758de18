#include "firmware/config/block_file.hpp"

#include <algorithm>
#include <cstring>

#include "firmware/config/entry_list.hpp"
#include "firmware/config/exit_codes.hpp"
#include "firmware/config/survey_sections.hpp"
#include "firmware/config/text.hpp"
#include "model/base/crc32c.hpp"
#include "model/base/status.hpp"

namespace leadline::host {
namespace {

using firmware::ConfigBlock;

constexpr std::string_view kMagic = "LLB1";

std::uint32_t baud_of(const hal::UriSpec& uri) {
  const bool line =
      uri.scheme == hal::UriScheme::kSerial || uri.scheme == hal::UriScheme::kModbusRtu;
  return line ? uri.baud : 0;
}

template <std::size_t kCount>
std::string text_of(const char (&text)[kCount]) {
  return {text, std::find(text, text + kCount, '\0')};
}

template <typename T>
std::string triple(const T (&values)[3]) {
  return "[" + std::to_string(values[0]) + ", " + std::to_string(values[1]) + ", " +
         std::to_string(values[2]) + "]";
}

double degrees_of(base::Bam32 angle) {
  return static_cast<std::int32_t>(angle) * (360.0 / 4294967296.0);
}

void add_survey(const BlockFile& file, EntryList* list) {
  const firmware::VehicleConfig& config = file.block.config;
  list->in("block");
  list->integer("bytes", static_cast<std::int64_t>(file.size_bytes));
  list->integer("version", firmware::kConfigBlockVersion);
  list->integer("schema_version", config.schema_version);
  list->scaled("period_ms", file.block.cycle_us, 1e3);
  list->integer("link_baud", file.block.link_baud);
  list->in("survey");
  list->text("id", hex_text(config.survey_id, 1));
  list->text("name", text_of(config.survey_name));
  list->integer("session", config.session);
  list->text("vertical_datum", text_of(config.vertical_datum));
  list->integer("epsg", config.epsg);
  const model::ModelConfig& model = config.model;
  list->in("grid");
  list->integer("cell_mm", model.cell_mm);
  list->raw("size", triple(model.size));
  list->raw("origin_mm", triple(model.origin_mm));
  list->in("model");
  list->text("rule", rule_name(model.rule));
  list->scaled("k_p", model.k_p_q16, 65536);
  list->text("no_return", model.no_return == model::NoReturnPolicy::kEmpty ? "empty" : "ignore");
  list->scaled("min_range_mm", model.min_range_um, 1e3);
  list->scaled("max_range_mm", model.max_range_um, 1e3);
  list->scaled("detect_range_mm", model.detect_range_um, 1e3);
  list->raw("sigma_position_mm", triple(model.sigma_position_mm));
  list->raw("sigma_correlated_mm", triple(model.sigma_correlated_mm));
  list->integer("ping_voxel_budget", model.work_budget_voxels);
  list->integer("voxel_budget", config.cycle_voxel_budget);
  list->integer("tile_budget", config.cycle_tile_budget);
  list->scaled("extract_interval_s", config.extract_interval_us, 1e6);
}

void add_navigation(const firmware::VehicleConfig& config, EntryList* list) {
  const firmware::NavigationConfig& navigation = config.navigation;
  list->in("navigation");
  list->flag("has_origin", navigation.has_origin != 0);
  list->scaled("lat", navigation.origin_latitude_e9deg, 1e9);
  list->scaled("lon", navigation.origin_longitude_e9deg, 1e9);
  list->number("magnetic_variation_deg",
               degrees_of(static_cast<base::Bam32>(navigation.magnetic_variation_bam32)));
  list->integer("surface_pressure_pa", navigation.surface_pressure_pa);
  list->scaled("water_density_kg_m3", navigation.water_density_g_m3, 1e3);
  list->scaled("gravity_m_s2", navigation.gravity_um_s2, 1e6);
  list->integer("sigma_fix_mm", navigation.sigma_fix_mm);
  list->integer("sigma_depth_mm", navigation.sigma_depth_mm);
  list->integer("sigma_attitude_urad", navigation.sigma_attitude_urad);
  list->integer("sigma_heading_urad", navigation.sigma_heading_urad);
  list->integer("acceleration_mm_s2", navigation.acceleration_mm_s2);
  list->integer("angular_acceleration_urad_s2", navigation.angular_acceleration_urad_s2);
  list->scaled("max_gap_ms", navigation.max_gap_us, 1e3);
  list->scaled("max_wait_ms", navigation.max_wait_us, 1e3);
  list->in("water");
  list->integer("sound_speed_mm_s", config.sound_speed_mm_s);
  list->flag("sound_speed_known", config.water.speed_known != 0);
  list->integer("sound_speed_points", config.water.point_count);
  list->integer("tide_points", config.water.tide_count);
}

void add_devices(const ConfigBlock& block, EntryList* list) {
  const firmware::VehicleConfig& config = block.config;
  for (int i = 0; i < std::min<int>(config.mount_count, firmware::kMaxMounts); ++i) {
    const firmware::MountConfig& mount = config.mounts[i];
    list->in("mount", i);
    list->raw("lever_arm_mm", triple(mount.lever_arm_mm));
    list->number("roll_deg", degrees_of(mount.boresight.roll_bam32));
    list->number("pitch_deg", degrees_of(mount.boresight.pitch_bam32));
    list->number("heading_deg", degrees_of(mount.boresight.heading_bam32));
    list->integer("table", mount.table == firmware::kNoTable ? -1 : mount.table);
  }
  for (int i = 0; i < std::min<int>(config.port_count, firmware::kMaxPorts); ++i) {
    const firmware::PortConfig& port = config.ports[i];
    list->in("port", i);
    list->text("driver", firmware::driver_name(port.driver));
    list->integer("baud", block.port_baud[i]);
    list->integer("mount", port.mount == firmware::kNoMount ? -1 : port.mount);
    list->text("switches", hex_text(port.switches, 4));
    list->scaled("latency_ms", port.latency_us, 1e3);
    list->integer("byte_time_ns", port.byte_time_ns);
    list->scaled("interval_ms", port.ping_interval_us, 1e3);
    list->scaled("min_range_mm", port.min_range_um, 1e3);
    list->scaled("max_range_mm", port.max_range_um, 1e3);
    list->flag("profile", port.profile != 0);
    list->integer("gain_plus_1", port.gain_plus_1);
    list->integer("frequency_khz", port.frequency_khz);
    list->integer("address", port.address);
    list->integer("variant_plus_1", port.variant_plus_1);
    list->integer("scan_first_grad", port.scan_first_grad);
    list->integer("scan_last_grad", port.scan_last_grad);
    list->integer("scan_step_grad", port.scan_step_grad);
    list->integer("intensity", static_cast<std::int64_t>(port.intensity_scale));
    list->integer("intensity_step_mdb", port.intensity_step_mdb);
  }
  list->in("link");
  list->integer("rate_bytes_s", config.link.rate_bytes_s);
  list->integer("mtu_bytes", config.link.mtu_bytes);
  list->scaled("status_interval_s", config.link.status_interval_us, 1e6);
  list->scaled("hello_interval_s", config.link.hello_interval_us, 1e6);
  list->scaled("max_tile_age_s", config.link.max_tile_age_us, 1e6);
  list->scaled("coarse_wait_s", config.link.coarse_wait_us, 1e6);
  for (std::size_t i = 0; i < block.table_count; ++i) {
    const firmware::TableBlock& table = block.tables[i];
    list->in("table", static_cast<int>(i));
    list->integer("bytes", static_cast<std::int64_t>(table.size_bytes));
    list->text("crc32c", hex_text(base::crc32c(table.bytes, table.size_bytes), 8));
  }
}

std::vector<ConfigEntry> entries_of(const BlockFile& file) {
  EntryList list;
  add_survey(file, &list);
  add_navigation(file.block.config, &list);
  add_devices(file.block, &list);
  return list.entries();
}

}  // namespace

std::string compile_block(const VehicleFile& file,
                          const std::vector<model::LocalizationTable>& tables,
                          std::uint32_t session, const std::string& name) {
  if (!file.tide_path.empty()) {
    throw HostError(ExitCode::kUsage,
                    name + ":" + std::to_string(file.tide_line) + ": [navigation] tide_file = \"" +
                        printable(file.tide_path) +
                        "\": its lines are of UTC, and a vehicle without files has no clock of the "
                        "day; give tide_m");
  }
  ConfigBlock block{};
  block.config = file.config;
  block.config.session = session;
  block.cycle_us = file.cycle_us;
  for (std::size_t i = 0; i < file.port_uris.size(); ++i) {
    block.port_baud[i] = baud_of(file.port_uris[i]);
  }
  block.link_baud = baud_of(file.link_uri);
  block.table_count = tables.size();
  for (std::size_t i = 0; i < tables.size(); ++i) {
    block.tables[i] = {&tables[i], sizeof tables[i]};
  }
  std::string bytes(firmware::config_block_bytes(block), '\0');
  const auto size = firmware::encode_config_block(
      block, reinterpret_cast<std::uint8_t*>(bytes.data()), bytes.size());
  if (!size.ok()) {
    throw HostError(ExitCode::kUsage,
                    name + ": no block can be made of it: " + base::status_text(size.status()));
  }
  (void)parse_block(bytes, name);  // by the reader that will take it
  return bytes;
}

bool is_block(std::string_view bytes) { return bytes.substr(0, kMagic.size()) == kMagic; }

BlockFile parse_block(std::string_view bytes, const std::string& name) {
  BlockFile file;
  file.size_bytes = bytes.size();
  file.storage.resize(bytes.size() / sizeof(std::uint64_t) + 1);
  std::memcpy(file.storage.data(), bytes.data(), bytes.size());
  const auto* const begin = reinterpret_cast<const std::uint8_t*>(file.storage.data());
  const base::Status status = firmware::read_config_block(begin, bytes.size(), file.block);
  if (status != base::Status::kOk) {
    throw HostError(ExitCode::kInput,
                    name + (is_block(bytes) ? ": the block is of no use: " +
                                                  std::string(base::status_text(status))
                                            : ": is no configuration block (it does not begin "
                                              "with LLB1)"));
  }
  return file;
}

std::string block_to_text(const BlockFile& file) { return entries_to_toml(entries_of(file)); }

std::string block_to_json(const BlockFile& file) {
  return entries_to_json(entries_of(file)) + "\n";
}

}  // namespace leadline::host
