// TSS1 lines, cut at will.
#include "hal/attitude/tss1.hpp"
#include "tests/support/nav_sample_check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) {
    return 0;
  }
  leadline::hal::Tss1Config config;
  config.euler_roll = (data[0] & 1U) != 0;
  leadline::hal::Tss1Codec codec(config);
  leadline::test::check_codec(codec, data + 1, size - 1);
  return 0;
}
