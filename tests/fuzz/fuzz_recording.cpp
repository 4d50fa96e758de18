// Files of other programs, as bytes that mean no good: every container that `import` and `decode` know (ping-viewer,
// CAN text, MAVLink telemetry log, XTF, raw streams of .svlog and .83P) gives pieces until it ends, never more bytes
// than the file has but where text stands for frames, and what it gives lives in the driver's codec and makes records
// that can be printed.
#include <cstdint>
#include <memory>

#include "hal/can_frame.hpp"
#include "host_tools/decode/decoder.hpp"
#include "host_tools/exit_codes.hpp"
#include "host_tools/import/recording.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::firmware::Driver;
using leadline::fuzz::require;
using leadline::host::ByteSource;
using leadline::host::Decoder;
using leadline::host::RecordedBytes;
using leadline::host::Recording;

constexpr Driver kDrivers[] = {Driver::kPing1d,   Driver::kPing360, Driver::kNmea2000,
                               Driver::kMavlink,  Driver::kR2sonic, Driver::kCerulean,
                               Driver::kDeltat83p};

/// Whose frames are printed with what is beside the record.
constexpr Driver kLines[] = {Driver::kNmea, Driver::kTss1, Driver::kVectornav, Driver::kWldvl};

Driver driver_of(std::uint8_t choice) {
  return choice < 0xF0 ? kDrivers[choice % std::size(kDrivers)]
                       : kLines[choice % std::size(kLines)];
}

void read_all(Recording& recording, Driver driver, std::size_t size) {
  std::size_t records = 0;
  Decoder decoder(driver, [&records](const nlohmann::ordered_json& record) {
    require(record.dump().size() > 2);
    ++records;
  });
  RecordedBytes piece;
  std::size_t bytes = 0;
  while (recording.next(&piece)) {
    require(!piece.bytes.empty());
    bytes += piece.bytes.size();
    // The shortest line that is a frame has seven characters.
    require(bytes <= size * leadline::hal::kCanFrame_bytes);
    require(driver == Driver::kNmea2000 || bytes <= size);
    decoder.feed(piece.bytes.data(), piece.bytes.size(), piece.t_us);
  }
  decoder.finish();
  require(decoder.records() == records);
  require(!recording.next(&piece));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) {
    return 0;
  }
  const Driver driver = driver_of(data[0]);
  try {
    const std::unique_ptr<Recording> recording =
        leadline::host::open_recording(ByteSource(data + 1, size - 1), driver);
    read_all(*recording, driver, size - 1);
  } catch (const leadline::host::HostError&) {
    // Of a file that is not what it begins as; named, not crashed.
  }
  return 0;
}
