// A vehicle that has flown, and the bad line that its map goes over: what the trials of the link begin with.
#pragma once

#include <cstdint>

#include "host_tools/topside/link_trial.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace leadline::test {

inline constexpr base::TimeUs kTrialCycle_us = 20'000;
inline constexpr double kBadLineLoss = 0.3;

/// Configures `vehicle` for a link of that rate, plays its flight, and drains it as if all had arrived. Returns the time
/// then.
inline base::TimeUs fly_and_settle(firmware::Vehicle* vehicle, firmware::VehicleConfig config,
                                   const Recording& flight, double bytes_per_s,
                                   std::uint16_t mtu_bytes) {
  config.link.rate_bytes_s = static_cast<std::uint32_t>(bytes_per_s);
  config.link.mtu_bytes = mtu_bytes;
  configure_rig(*vehicle, config);
  run_recording(*vehicle, flight);
  base::TimeUs t_us = flight.back().t_us;
  host::settle_vehicle(vehicle, &t_us, kTrialCycle_us);
  return t_us;
}

/// Of the frames kBadLineLoss are lost, 5 % out of order and 5 % doubled.
inline host::LinkTrialOptions bad_line(double bytes_per_s, std::uint64_t seed) {
  host::LinkTrialOptions options;
  options.line.bytes_per_s = bytes_per_s;
  options.line.loss = kBadLineLoss;
  options.line.reorder = 0.05;
  options.line.duplicate = 0.05;
  options.line.seed = seed;
  return options;
}

}  // namespace leadline::test
