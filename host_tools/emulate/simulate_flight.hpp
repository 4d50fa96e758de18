// `leadline simulate`: the emulated devices and the vehicle's own pipeline in one process and in no time: what
// `emulate` and `leadline-vehicle` do over real ports, as a log.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "host_tools/emulate/fleet.hpp"
#include "host_tools/emulate/mission.hpp"
#include "host_tools/emulate/vehicle_config.hpp"
#include "host_tools/topside/receiver.hpp"
#include "host_tools/topside/soundings.hpp"
#include "proto/log.hpp"

namespace leadline::host {

struct FlightOptions {
  MissionOptions mission;
  std::string out_dir;  ///< required
  bool json = false;
};

/// A flight as it goes: log bytes and link bytes leave through these, in order.
struct FlightSinks {
  std::function<void(const std::uint8_t*, std::size_t)> log;
  std::function<void(const std::uint8_t*, std::size_t)> downlink;
  std::function<void(std::uint64_t done_us, std::uint64_t total_us)> progress;
};

struct FlightSummary {
  base::TimeUs flown_us = 0;
  std::uint64_t cycles = 0;
  double mean_cell_wait_s = 0.0;  ///< of a changed cell, from the change to its frame
  bool drained = false;           ///< all changes had left when it ended
  proto::LogEnd end{};
};

/// The tables' blocks, as a vehicle and a log take them.
[[nodiscard]] std::vector<std::vector<std::uint8_t>> table_bytes(
    const std::vector<MissionTable>& tables);

/// Flies the fleet with a vehicle that is configured for it, then lets the link catch up. `soundings`
/// may be null. Throws std::logic_error when the log cannot be encoded.
FlightSummary fly_in_process(Fleet* fleet, firmware::Vehicle* vehicle,
                             const std::vector<std::vector<std::uint8_t>>& tables,
                             std::int32_t cycle_us, const FlightSinks& sinks, Soundings* soundings);

/// The command. Leaves survey.lll, vehicle.toml, beam.llt, truth.asc, touched.asc, pings.csv, map.toml and
/// flight.json in out_dir, all or none. Returns 0. Throws HostError: kUsage, kInput (terrain), kOutput.
int run_simulated_flight(const FlightOptions& options);

}  // namespace leadline::host
