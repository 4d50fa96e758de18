// The vehicle as host commands run it: one static object, as on the vehicle itself.
#pragma once

#include <string>
#include <vector>

#include "firmware/pipeline/config.hpp"
#include "firmware/pipeline/vehicle.hpp"
#include "model/localization_table.hpp"

namespace leadline::host {

/// Lends out the one Vehicle of the process, configured. One at a time.
class HostVehicle {
 public:
  /// Throws HostError kInput, `name` in front: what the vehicle refuses.
  HostVehicle(const firmware::VehicleConfig& config,
              const std::vector<std::vector<std::uint8_t>>& tables, const std::string& name);
  ~HostVehicle();
  HostVehicle(const HostVehicle&) = delete;
  HostVehicle& operator=(const HostVehicle&) = delete;

  [[nodiscard]] firmware::Vehicle& operator*() const;
  [[nodiscard]] firmware::Vehicle* operator->() const { return &**this; }
};

}  // namespace leadline::host
