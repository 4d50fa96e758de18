// VectorNav text and binary frames, cut at will.
#include "hal/attitude/vectornav.hpp"
#include "tests/support/nav_sample_check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) {
    return 0;
  }
  leadline::hal::VectorNavConfig config;
  // Without checksums the fuzzer gets to the fields of the text.
  config.accept_unchecked = (data[0] & 1U) != 0;
  config.true_heading = (data[0] & 2U) != 0;
  leadline::hal::VectorNavCodec codec(config);
  leadline::test::check_codec(codec, data + 1, size - 1);
  return 0;
}
