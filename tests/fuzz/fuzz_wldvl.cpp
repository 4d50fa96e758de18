// Reports of a Water Linked DVL in all formats, cut at will.
#include "hal/attitude/wldvl.hpp"
#include "tests/support/nav_sample_check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) {
    return 0;
  }
  leadline::hal::WlDvlConfig config;
  config.require_checksum = (data[0] & 1U) != 0;
  config.pd4_ship_axes = (data[0] & 2U) != 0;
  config.pd4_good_status = static_cast<std::uint8_t>(data[0] >> 7U);
  leadline::hal::WlDvlCodec codec(config);
  leadline::test::check_codec(codec, data + 1, size - 1);
  return 0;
}
