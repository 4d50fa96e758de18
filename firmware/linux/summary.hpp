// What a run of leadline-vehicle came to, for people and for scripts.
#pragma once

#include <string>

#include "firmware/linux/real_time.hpp"
#include "firmware/linux/recorder.hpp"
#include "firmware/linux/timing.hpp"
#include "firmware/linux/vehicle_loop.hpp"
#include "firmware/pipeline/vehicle.hpp"

namespace leadline::host {

/// What the program knows besides the vehicle. `recorder` and `timing` may be null.
struct RunReport {
  const LoopSummary& summary;
  const RealTimeReport& real_time;
  const Recorder* recorder;
  const LoopTiming* timing;
};

/// Lines `name: value`, or one JSON object. Every ping is accounted for: pings_in = pings_pending +
/// pings_mapped + all of pings_lost, pings_mapped = all of pings; every record of a port is a ping, a sample
/// or an edge.
[[nodiscard]] std::string summary_text(const firmware::Vehicle& vehicle, const RunReport& report,
                                       bool json);

}  // namespace leadline::host
