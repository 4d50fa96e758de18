// Any bytes as vehicle.toml. What must hold: only HostError kUsage with a printable message comes out; a
// configuration that is accepted is inside the limits that the vehicle's code relies on; and what is
// written as the resolved configuration reads back to the same values.
#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>

#include "firmware/config/exit_codes.hpp"
#include "firmware/config/vehicle_file.hpp"
#include "firmware/pipeline/sound_path.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::firmware::Driver;
using leadline::firmware::VehicleConfig;
using leadline::fuzz::require;
using leadline::host::ExitCode;
using leadline::host::HostError;
using leadline::host::parse_vehicle_file;
using leadline::host::vehicle_file_to_json;
using leadline::host::vehicle_file_to_toml;
using leadline::host::VehicleFile;

void check_ports(const VehicleFile& file) {
  const VehicleConfig& config = file.config;
  require(config.port_count >= 1 && config.port_count <= leadline::firmware::kMaxPorts, "ports");
  require(file.port_uris.size() == config.port_count, "a URI for each port");
  for (int i = 0; i < config.port_count; ++i) {
    const auto& port = config.ports[i];
    require(port.driver != Driver::kNone, "a driver for each port");
    const bool head = leadline::firmware::is_head(port.driver);
    require(
        port.mount < config.mount_count || (!head && port.mount == leadline::firmware::kNoMount),
        "mounts that exist");
    require(!head || config.mounts[port.mount].table < config.table_count, "tables of heads");
    require(port.latency_us >= -1'000'000 && port.latency_us <= 10'000'000, "latency");
    if (!leadline::firmware::is_head(port.driver)) {
      continue;
    }
    require(port.min_range_um >= 0 && port.min_range_um < port.max_range_um, "ranges");
    require(port.ping_interval_us >= 0 && port.ping_interval_us <= 60'000'000, "interval");
    require(port.scan_first_grad >= 0 && port.scan_first_grad < 400, "first angle");
    require(port.scan_last_grad >= 0 && port.scan_last_grad < 400, "last angle");
    require(port.driver != Driver::kPing360 || port.scan_step_grad >= 1, "step");
  }
}

void check(const VehicleFile& file) {
  const VehicleConfig& config = file.config;
  require(config.mount_count >= 1 && config.mount_count <= leadline::firmware::kMaxMounts,
          "mounts");
  require(config.table_count >= 1 && config.table_count <= leadline::firmware::kMaxTables &&
              file.table_paths.size() == config.table_count,
          "a path for each table");
  check_ports(file);
  leadline::model::ModelConfig model = config.model;
  model.work_budget_voxels = 0;
  require(leadline::model::check_config(model) == leadline::base::Status::kOk,
          "the model's limits");
  leadline::firmware::SoundPath path;
  require(path.configure(config) == leadline::base::Status::kOk, "sound speeds");
  const auto& navigation = config.navigation;
  require(navigation.gravity_um_s2 >= 9'000'000 && navigation.gravity_um_s2 <= 10'000'000, "g");
  require(navigation.water_density_g_m3 >= 900'000, "density");
  require(navigation.sigma_attitude_urad >= 1 && navigation.sigma_heading_urad >= 1, "sigmas");
  require(navigation.max_gap_us >= 1000 && navigation.max_wait_us >= 0, "waits");
  require(config.link.rate_bytes_s >= 10, "rate");
  require(config.link.mtu_bytes >= 128 && config.link.mtu_bytes <= 1400, "mtu");
  require(config.link.status_interval_us >= 1 && config.link.hello_interval_us >= 1, "intervals");
  require(config.link.max_tile_age_us <= 60'000'000, "tile age");
  require(file.cycle_us >= 1000 && file.cycle_us <= 1'000'000, "period");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  VehicleFile file;
  try {
    file = parse_vehicle_file(text, "f.toml", "");
  } catch (const HostError& error) {
    require(error.code() == ExitCode::kUsage, "only configuration errors");
    leadline::fuzz::require_message(error.what(), "f.toml");
    return 0;
  }
  check(file);
  const std::string resolved = vehicle_file_to_toml(file);
  std::string again;
  try {
    again = vehicle_file_to_toml(parse_vehicle_file(resolved, "r.toml", ""));
  } catch (const HostError& error) {
    std::fprintf(stderr, "%s\n%s\n", resolved.c_str(), error.what());
    require(false, "the resolved configuration is accepted");
  }
  require(again == resolved, "the resolved configuration reads back to the same values");
  require(vehicle_file_to_json(file).back() == '}', "JSON is closed");
  return 0;
}
