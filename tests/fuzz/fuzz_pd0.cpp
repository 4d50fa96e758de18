// PD0 ensembles, cut at will.
#include "hal/attitude/pd0.hpp"
#include "tests/support/nav_sample_check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) {
    return 0;
  }
  leadline::hal::Pd0Config config;
  config.velocity_of_bottom = (data[0] & 1U) != 0;
  config.euler_pitch = (data[0] & 2U) != 0;
  config.true_heading = (data[0] & 4U) != 0;
  leadline::hal::Pd0Codec codec(config);
  leadline::test::check_codec(codec, data + 1, size - 1);
  return 0;
}
