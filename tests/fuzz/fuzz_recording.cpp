// Files of other programs, as bytes that mean no good: every container that `import` and `decode` know (ping-viewer,
// CAN text, MAVLink telemetry log, XTF, raw streams of .svlog and .83P) gives pieces until it ends, never more bytes
// than the file has but where text stands for frames, and what it gives lives in the driver's codec.
#include <cstdint>
#include <cstdlib>
#include <memory>

#include "firmware/pipeline/device_port.hpp"
#include "hal/can_frame.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/import/recording.hpp"

namespace {

using leadline::firmware::DevicePort;
using leadline::firmware::DeviceRecord;
using leadline::firmware::Driver;
using leadline::firmware::RecordKind;
using leadline::host::ByteSource;
using leadline::host::RecordedBytes;
using leadline::host::Recording;

constexpr Driver kDrivers[] = {Driver::kPing1d,   Driver::kPing360, Driver::kNmea2000,
                               Driver::kMavlink,  Driver::kR2sonic, Driver::kCerulean,
                               Driver::kDeltat83p};

DevicePort port;

void require(bool condition) {
  if (!condition) {
    std::abort();
  }
}

void read_all(Recording& recording, Driver driver, std::size_t size) {
  require(port.configure_decoding(driver));
  RecordedBytes piece;
  DeviceRecord record{};
  std::size_t bytes = 0;
  std::int64_t t_us = 0;
  while (recording.next(&piece)) {
    require(!piece.bytes.empty());
    bytes += piece.bytes.size();
    // The shortest line that is a frame has seven characters.
    require(bytes <= size * leadline::hal::kCanFrame_bytes);
    require(driver == Driver::kNmea2000 || bytes <= size);
    t_us = piece.t_us.value_or(t_us + 1000);
    for (const std::uint8_t byte : piece.bytes) {
      for (RecordKind kind = port.feed(byte, t_us, record); kind != RecordKind::kNone;
           kind = port.next(record)) {
      }
    }
  }
  require(!recording.next(&piece));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) {
    return 0;
  }
  const Driver driver = kDrivers[data[0] % std::size(kDrivers)];
  try {
    const std::unique_ptr<Recording> recording =
        leadline::host::open_recording(ByteSource(data + 1, size - 1), driver);
    read_all(*recording, driver, size - 1);
  } catch (const leadline::host::HostError&) {
    // Of a file that is not what it begins as; named, not crashed.
  }
  return 0;
}
