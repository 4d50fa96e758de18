// A PNI device that says anything at all while it is being set up and asked: requests are whole frames that
// fit, and every sample is within its ranges.
#include <array>

#include "hal/attitude/trax.hpp"
#include "hal/checksums.hpp"
#include "tests/support/nav_sample_check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using leadline::hal::TraxCodec;
  using leadline::test::require;
  if (size < 1) {
    return 0;
  }
  leadline::hal::TraxConfig config;
  config.poll = (data[0] & 1U) != 0;
  config.keep_distorted = (data[0] & 2U) != 0;
  config.with_rates = (data[0] & 4U) != 0;
  config.with_distortion = (data[0] & 8U) != 0;
  TraxCodec codec(config);
  std::int64_t t_us = 0;
  std::uint32_t records = 0;
  for (std::size_t i = 1; i < size; ++i) {
    t_us += 1'000 + (i % 97 == 0 ? 700'000 : 0);
    leadline::base::NavSample sample{};
    bool more = codec.feed(data[i], t_us, sample);
    for (; more; more = codec.next(sample)) {
      leadline::test::check_sample(sample);
      ++records;
    }
    std::array<std::uint8_t, TraxCodec::kMaxRequest_bytes> out{};
    const std::size_t request = codec.request(t_us, out.data(), out.size());
    require(request == 0 || (request >= 5 && request <= out.size() && out[1] == request));
    require(leadline::hal::crc16_xmodem(out.data(), request) == 0);
  }
  codec.restart();
  require(codec.counters().records == records);
  return 0;
}
