// Recordings of devices: the files that other programs write, taken apart into what the devices sent and
// when.
//
//   container      how it is told                          what comes out                 times
//   raw bytes      nothing else fits                       the bytes                      none
//   CAN text       a line of hal/can_text.hpp (nmea2000)   frames of hal/can_frame.hpp    of the lines
//   tlog           u64 BE time, MAVLink frame (mavlink)    the frames                     of the frames
//   ping-viewer    its own heading (ping1d, ping360)       the frames                     of day
//   XTF            a file that begins with 0x7B (r2sonic)  BTH0 packets                   of the packets
//
// A `.svlog` is Ping frames one behind the other: raw bytes.
//
// Damage inside a container costs the piece that it hit; the search for the next one goes on byte by
// byte and what was passed over is counted.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware/pipeline/drivers.hpp"
#include "host_tools/import/byte_source.hpp"
#include "model/base/units.hpp"

namespace leadline::host {

/// A piece of a recording: bytes that arrived together, at least one.
struct RecordedBytes {
  std::optional<base::TimeUs> t_us;  ///< the recording's own clock
  std::vector<std::uint8_t> bytes;
};

/// One file, read forwards. Errors: HostError kInput naming the file.
class Recording {
 public:
  virtual ~Recording() = default;
  /// False at the end.
  virtual bool next(RecordedBytes* piece) = 0;
  /// In words, for people.
  [[nodiscard]] virtual const char* container() const = 0;
  /// What of the container was not usable, by reason; the device's own bytes are the codec's to judge.
  [[nodiscard]] const std::map<std::string, std::uint64_t>& rejected() const { return rejected_; }

 protected:
  std::map<std::string, std::uint64_t> rejected_;
};

/// Tells the container from the first bytes and from what the driver's devices are recorded in.
[[nodiscard]] std::unique_ptr<Recording> open_recording(ByteSource source, firmware::Driver driver);

}  // namespace leadline::host
