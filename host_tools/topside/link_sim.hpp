// `leadline link-sim`: a recorded survey's map over a bad line of any speed, in simulated time.
#pragma once

#include <cstdint>
#include <string>

namespace leadline::host {

struct LinkSimOptions {
  std::string log_path;
  double rate_baud = 9600.0;  ///< 10 bits a byte
  double loss = 0.0;
  double reorder = 0.0;
  double duplicate = 0.0;
  std::uint64_t seed = 1;
  std::uint64_t seeds =
      1;              ///< runs, from `seed` on; of more than one the spread is printed, as JSON
  int mtu_bytes = 0;  ///< 0: the log's own
  double delay_ms = 5.0;
  bool join = false;  ///< the topside knows no hello when it starts
  bool json = false;
};

/// The command. Returns 0, or 5 when the maps did not become equal. Throws HostError: kInput, kUsage.
int run_link_sim(const LinkSimOptions& options);

}  // namespace leadline::host
