// The vehicle's own link code and the topside's own receiver with a bad line between them, in simulated time:
// how long and how many bytes until both hold the same map. Deterministic: a seed is a run.
#pragma once

#include <cstdint>
#include <functional>

#include "firmware/pipeline/vehicle.hpp"
#include "host_tools/topside/lossy_line.hpp"
#include "host_tools/topside/receiver.hpp"
#include "model/base/units.hpp"

namespace leadline::host {

struct LinkTrialOptions {
  LineOptions line;
  base::TimeUs cycle_us = 20'000;
  /// Given up after so long.
  base::TimeUs most_us = 3'600'000'000;
  /// The line is cut between these times, counted from the start: nothing arrives either way.
  base::TimeUs cut_from_us = 0;
  base::TimeUs cut_until_us = 0;
  /// The topside knows the vehicle's hello when it starts; else it has to ask for it.
  bool introduced = true;
  /// The topside starts over with nothing at this time; 0: never.
  base::TimeUs topside_restart_us = 0;
};

struct LinkTrialResult {
  bool converged = false;
  bool hash_equal = false;       ///< cells_hash of both ends, at the end
  double seconds = 0.0;          ///< until they were equal, or until it was given up
  std::uint64_t bytes_down = 0;  ///< sent, framing included
  std::uint64_t bytes_up = 0;
  std::uint64_t frames_down = 0;
  std::uint64_t frames_up = 0;
  std::uint32_t tiles = 0;       ///< that were owed when it began
  std::uint64_t tiles_lost = 0;  ///< tiles in frames that the vehicle took for lost
  std::uint64_t most_in_1s = 0;  ///< most bytes that the vehicle sent in any second
  // Where the bytes and the time went.
  std::uint64_t delta_bytes = 0;     ///< of bytes_down, frames of cells
  std::uint64_t coarse_bytes = 0;    ///< frames of coarse tiles
  std::uint64_t status_bytes = 0;    ///< statuses and briefs
  std::uint64_t frames_dropped = 0;  ///< of frames_down, those that the line lost
  std::uint64_t cells_needless = 0;  ///< cells that came and were there already
  std::uint64_t cells_came = 0;      ///< all that came
  double idle_seconds = 0.0;         ///< the line down had nothing to carry
};

/// Lets the topside start from nothing while the vehicle, which is drained, owes every tile that it knows.
/// `t_us`: the vehicle's time, goes on. `watch` (may be null) is called after every frame that arrived, with
/// the time since the start.
[[nodiscard]] LinkTrialResult run_link_trial(
    firmware::Vehicle* vehicle, base::TimeUs* t_us, const LinkTrialOptions& options,
    const std::function<void(base::TimeUs since_us, const Receiver& receiver)>& watch = nullptr);

/// Cycles without input, whose output nobody gets, until the vehicle is drained and what it says of the silence
/// is said.
void settle_vehicle(firmware::Vehicle* vehicle, base::TimeUs* t_us, base::TimeUs cycle_us);

}  // namespace leadline::host
