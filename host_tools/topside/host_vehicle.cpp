#include "host_tools/topside/host_vehicle.hpp"

#include <stdexcept>

#include "host_tools/exit_codes.hpp"

namespace leadline::host {
namespace {

firmware::Vehicle the_vehicle;
bool vehicle_taken = false;

}  // namespace

HostVehicle::HostVehicle(const firmware::VehicleConfig& config,
                         const std::vector<std::vector<std::uint8_t>>& tables,
                         const std::string& name) {
  if (vehicle_taken) {
    throw std::logic_error("one HostVehicle at a time: the vehicle is a static object");
  }
  std::vector<firmware::TableBlock> blocks;
  for (const std::vector<std::uint8_t>& table : tables) {
    blocks.push_back({table.data(), table.size()});
  }
  const base::Status status = the_vehicle.configure(config, blocks.data(), blocks.size());
  if (status != base::Status::kOk) {
    throw HostError(ExitCode::kInput, name + ": the vehicle refuses this configuration: " +
                                          base::status_text(status));
  }
  vehicle_taken = true;
}

HostVehicle::~HostVehicle() { vehicle_taken = false; }

firmware::Vehicle& HostVehicle::operator*() const { return the_vehicle; }

}  // namespace leadline::host
