// A Cerulean head's bytes with requests in between: every record is within what a head can measure, and the
// counters account for every byte and record.
#include <cstdint>

#include "hal/heads/cerulean.hpp"
#include "tests/support/fuzz_heads.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) {
    return 0;
  }
  leadline::hal::CeruleanConfig config;
  config.head = static_cast<leadline::hal::CeruleanHead>(data[0] % 5);
  config.profile = (data[0] & 8U) != 0;
  config.points = static_cast<leadline::hal::CeruleanPoints>((data[0] >> 4U) % 3);
  config.full_scale_mdb = data[1] * 1000;
  leadline::hal::CeruleanCodec codec(config);
  codec.set_utc_offset(1'700'000'000'000'000, data[1]);
  leadline::fuzz::drive_head(codec, data + 2, size - 2, leadline::hal::kMaxCeruleanBins);
  return 0;
}
