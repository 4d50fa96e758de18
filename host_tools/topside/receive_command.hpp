// `leadline receive`: the live map of a vehicle from its link.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "host_tools/topside/receiver.hpp"

namespace leadline::host {

struct ReceiveOptions {
  std::string link_uri;    ///< udp:@:PORT, serial:..., tcp:..., file:PATH; see hal/linux/uri.hpp
  std::string out_dir;     ///< map and receive.json; "" = none
  std::string share_path;  ///< local socket that lends the link (topside/link_share.hpp); "" = none
  std::string store_path;  ///< surveys on disk (store/survey_store.hpp); "" = none
  std::string
      log_path;  ///< the vehicle's log, whose end record the map is compared with; "" = none
  std::optional<std::uint64_t> survey_id;
  double every_s = 0.0;    ///< write the results this often; 0 = at the end and on SIGUSR1
  double idle_s = 0.0;     ///< end after this long without a byte, once some came; 0 = never
  double wait_s = 0.0;     ///< end when nothing at all came for this long; 0 = never
  bool no_resend = false;  ///< never ask the vehicle for anything
  bool json = false;       ///< receive.json on standard output at the end
};

/// receive.json. `vehicle_cells_hash`: what the vehicle's log says, where it is known.
[[nodiscard]] std::string receive_summary_json(
    const Receiver& receiver, const std::optional<std::uint64_t>& vehicle_cells_hash,
    double seconds);

/// The command: until SIGINT, SIGTERM, the end of a file, or --idle. Returns 0; 5 when a log was given and
/// the map is not the vehicle's. Throws HostError: kUsage (the URI), kInput (another major version;
/// nothing came that makes a map; the store is none), kOutput (at once when nothing can be written at `out_dir`; at the
/// end when the store or the folder lacks something that came: everything else is written then).
int run_receive(const ReceiveOptions& options);

}  // namespace leadline::host
