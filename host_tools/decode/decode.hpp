// `leadline decode`: what a recording of a device says, record by record.
#pragma once

#include <functional>
#include <string>

#include "host_tools/import/recording.hpp"

namespace leadline::host {

struct DecodeOptions {
  std::string driver;  ///< a name of firmware/pipeline/drivers.hpp
  std::string path;    ///< "-" is standard input
  bool json = false;   ///< one JSON object a line, the summary last; otherwise a line of text each
};

/// Decodes everything in `recording` and appends each record's line by calling `out`. The last line is the
/// summary:
///   {"record":"summary","driver":..,"container":..,"frames":N,"records":N,"rejected":{reason: N, ..},
///    "ignored":N,"no_data":N,"skipped_bytes":N,"bytes":N}
/// A frame that the file ends in is rejected as unfinished.
///
/// t_us: the recording's own time where it has one (since 1970; of day in a ping-viewer log); otherwise the
/// device's own clock, where the record carries one; otherwise null.
void decode_recording(Recording* recording, firmware::Driver driver, bool json,
                      const std::function<void(const std::string&)>& out);

/// The command; returns 0, also where nothing was intact: the summary says so. Throws HostError: kUsage for a
/// driver that nobody knows or that this build does not carry, kInput.
int run_decode(const DecodeOptions& options);

}  // namespace leadline::host
