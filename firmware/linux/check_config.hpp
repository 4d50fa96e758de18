// `leadline-vehicle --check-config`: what a configuration comes to.
#pragma once

#include <string>

#include "firmware/config/vehicle_file.hpp"
#include "firmware/pipeline/vehicle.hpp"

namespace leadline::host {

/// Configures the vehicle. Throws HostError kUsage, `config_name` in front: what it refuses and why.
void configure_vehicle(const VehicleFile& file, const std::vector<model::LocalizationTable>& tables,
                       firmware::Vehicle& vehicle, const std::string& config_name);

/// A line for whom the window may be too small for the sonar's range; "" where it cannot be.
[[nodiscard]] std::string window_warning(const model::ModelConfig& model);

/// The resolved configuration as TOML, then memory and work bound as comments of the same TOML.
[[nodiscard]] std::string check_report_text(const VehicleFile& file,
                                            const firmware::Vehicle& vehicle);
/// {"config": {...}, "memory": {...}, "work": {...}}
[[nodiscard]] std::string check_report_json(const VehicleFile& file,
                                            const firmware::Vehicle& vehicle);

}  // namespace leadline::host
