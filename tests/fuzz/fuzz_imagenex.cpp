// An Imagenex head's bytes with commands in between: every record is within what a head can measure, and the
// counters account for every byte and record.
#include <cstdint>

#include "hal/heads/imagenex.hpp"
#include "tests/support/fuzz_heads.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) {
    return 0;
  }
  leadline::hal::ImagenexConfig config;
  config.model = static_cast<leadline::hal::ImagenexModel>(data[0] % 5);
  config.profile = (data[0] & 8U) != 0;
  config.clockwise = (data[0] & 16U) != 0;
  config.max_range_um = data[1] * std::int64_t{500'000};
  leadline::hal::ImagenexCodec codec(config);
  leadline::fuzz::drive_head(codec, data + 2, size - 2, leadline::hal::kMaxImagenexPoints);
  return 0;
}
