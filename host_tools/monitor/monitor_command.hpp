// `leadline monitor`: the live map and the health of a vehicle as a page in a browser.
#pragma once

#include <string>

namespace leadline::host {

struct MonitorOptions {
  std::string link_uri;  ///< as for receive; a regular file (file:PATH) is as `map_path`; "" = none
  /// A recording that is played, or a survey of a store (FILE.lls, FILE.lls#N) that is shown; "" = none. One of both.
  std::string map_path;
  std::string http = "127.0.0.1:8080";
  std::string share_path;     ///< local socket that lends the link (topside/link_share.hpp)
  std::string store_path;     ///< surveys on disk (store/survey_store.hpp); "" = none
  std::string out_dir;        ///< map and receive.json at the end; "" = none
  double budget_bytes_s = 0;  ///< what the link may carry; 0: as the vehicle says
  double speed = 0;           ///< recordings: play from the beginning; 0: stand at the end
  bool no_resend = false;     ///< never ask the vehicle for anything
};

/// The command: until SIGINT or SIGTERM. Returns 0. Throws HostError: kUsage (URI, address, port in use, an option that
/// does not go with a recording or a stored survey), kInput (a file that cannot be read or holds no link; the store is
/// none, or has no such survey), kOutput (also when the store lacks something at the
/// end).
int run_monitor(const MonitorOptions& options);

}  // namespace leadline::host
