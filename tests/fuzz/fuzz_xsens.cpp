// Xsens messages, cut at will.
#include "hal/attitude/xsens.hpp"
#include "tests/support/nav_sample_check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) {
    return 0;
  }
  leadline::hal::XsensConfig config;
  config.true_heading = (data[0] & 1U) != 0;
  config.body_frd = (data[0] & 2U) != 0;
  config.check_status = (data[0] & 4U) != 0;
  config.use_pressure = (data[0] & 8U) != 0;
  leadline::hal::XsensCodec codec(config);
  leadline::test::check_codec(codec, data + 1, size - 1);
  return 0;
}
