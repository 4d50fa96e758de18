// `leadline replay`: the vehicle's own pipeline over the bytes that it recorded. A log replays to the same
// map and the same link bytes, on every machine.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "host_tools/topside/flight_log.hpp"
#include "host_tools/topside/soundings.hpp"

namespace leadline::host {

struct ReplayOptions {
  std::string log_path;
  std::string out_dir;  ///< "" = no files
  bool json = false;
};

struct ReplayResult {
  std::uint64_t cycles = 0;
  proto::LogEnd now{};                ///< as the replay has it
  std::optional<proto::LogEnd> then;  ///< as the flight had it; unset: the log ends early
  firmware::LogFindings log{};

  /// Map, link bytes and link cells are those of the flight.
  [[nodiscard]] bool same() const { return then && firmware::same_results(*then, now); }
};

/// Runs every cycle of `log` through the vehicle. `soundings` may be null.
[[nodiscard]] ReplayResult replay_flight(FlightLog* log, firmware::Vehicle* vehicle,
                                         Soundings* soundings);

/// The command. Prints `map_hash=... link_hash=...` and what the log lacks. Returns 0, or 5 when the end
/// record of the flight says otherwise. Throws HostError: kInput, kOutput.
int run_replay(const ReplayOptions& options);

}  // namespace leadline::host
