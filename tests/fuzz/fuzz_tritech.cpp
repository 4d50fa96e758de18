// SeaNet frames with requests in between: every record is within what a head can measure, and the counters
// account for every byte and record.
#include <cstdint>

#include "hal/heads/tritech.hpp"
#include "tests/support/fuzz_heads.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) {
    return 0;
  }
  leadline::hal::TritechConfig config;
  config.head = static_cast<leadline::hal::TritechHead>(data[0] % 3);
  config.high_nibble_first = (data[0] & 4U) != 0;
  config.two_channels = (data[0] & 8U) != 0;
  config.clockwise = (data[0] & 16U) != 0;
  config.max_range_um = data[1] * std::int64_t{1'000'000};
  leadline::hal::TritechCodec codec(config);
  leadline::fuzz::drive_head<leadline::hal::TritechCodec, true, false>(
      codec, data + 2, size - 2, leadline::hal::kMaxSeanetBins);
  return 0;
}
