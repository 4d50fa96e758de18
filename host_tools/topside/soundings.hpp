// The pings that a vehicle mapped, as the rows and the configuration that `leadline map` and `grid` read: so
// that a flight can be gridded by others, and mapped again with other settings.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "firmware/pipeline/vehicle.hpp"
#include "host_tools/map_config.hpp"

namespace leadline::host {

class Soundings {
 public:
  /// Takes what the vehicle's last cycle mapped.
  void take(const firmware::Vehicle& vehicle);
  /// pings.csv: in order of time, the transducer's pose and the beam in its frame.
  [[nodiscard]] std::string csv() const;
  [[nodiscard]] std::size_t count() const { return pings_.size(); }

 private:
  std::vector<firmware::MappedPing> pings_;
};

/// A text of a vehicle's configuration; none when it is empty.
[[nodiscard]] std::optional<std::string> config_text(
    const char (&text)[firmware::kMaxConfigText_bytes]);

/// map.toml for those rows. The beam is what the table says of it: a cone as wide as its envelope.
[[nodiscard]] MapConfig flight_map_config(const firmware::VehicleConfig& config,
                                          const model::LocalizationTable& table);

}  // namespace leadline::host
