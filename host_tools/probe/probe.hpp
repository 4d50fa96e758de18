// `leadline probe`: what talks at a port, and what it says.
#pragma once

#include <string>
#include <vector>

namespace leadline::host {

struct ProbeOptions {
  std::string uri;
  std::string driver;  ///< this one only; "": every one that this build carries
  std::string model;   ///< --ask: of variant_names() (firmware/config/port_section.hpp); "": each
  bool ask = false;  ///< also sends the requests of devices that wait for them, one after the other
  double seconds = 10.0;      ///< of listening, after the asking; 0: until a signal comes
  double max_range_m = 20.0;  ///< asked of heads
  bool json = false;
};

/// The command. Every codec hears every byte; each record is a line as of `decode`, the driver's name in front
/// (JSON: key "driver"). At the end a line for each driver that found intact frames. A file ends by itself.
///
/// Asking: each driver whose device waits for requests, each kind of device in turn, until one answers; that
/// one goes on being asked. Other devices may take a foreign request amiss: nothing is sent without `ask`.
///
/// Returns 0 when a driver found an intact frame. Throws HostError: kUsage (port, driver), kInput: nothing was
/// recognised, or the port is not there.
int run_probe(const ProbeOptions& options);

}  // namespace leadline::host
