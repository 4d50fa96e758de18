// 83P packets: every record is within what the sonar can measure, and the counters account for every byte
// and record.
#include <cstdint>

#include "hal/heads/deltat83p.hpp"
#include "tests/support/fuzz_heads.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) {
    return 0;
  }
  leadline::hal::Deltat83pConfig config;
  config.positive_to_starboard = (data[0] & 1U) != 0;
  config.roll_positive = (data[0] & 2U) != 0;
  leadline::hal::Deltat83pCodec codec(config);
  leadline::fuzz::drive_head<leadline::hal::Deltat83pCodec, false>(codec, data + 1, size - 1, 0);
  return 0;
}
