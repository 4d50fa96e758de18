// Answers of a Keller transmitter, cut at will, and the polls in between: every sample is sound, requests are
// whole, and none is sent while an answer is due.
#include "hal/attitude/keller.hpp"
#include "tests/support/nav_check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using leadline::test::require;
  if (size < 1) {
    return 0;
  }
  leadline::hal::KellerConfig config;
  config.bus = (data[0] & 1U) != 0 ? leadline::hal::KellerBus::kKellerBus
                                   : leadline::hal::KellerBus::kModbusRtu;
  if ((data[0] & 8U) != 0) {
    config.bus = leadline::hal::KellerBus::kEither;
  }
  config.gauge_pressure = (data[0] & 2U) != 0;
  config.pressure_only = (data[0] & 4U) != 0;
  leadline::hal::KellerCodec codec(config);
  std::uint32_t records = 0;
  std::int64_t last_request_us = -config.poll_interval_us;
  leadline::base::NavSample sample{};
  for (std::size_t i = 1; i < size; ++i) {
    const auto t_us = static_cast<std::int64_t>(i * 1000);
    std::uint8_t request[8];
    const std::size_t asked = codec.request(t_us, request, sizeof request);
    require(asked == 0 || (asked >= 4 && asked <= sizeof request));
    if (asked > 0) {
      require(t_us - last_request_us >= config.poll_interval_us);
      last_request_us = t_us;
    }
    if (!codec.feed(data[i], t_us, sample)) {
      continue;
    }
    do {
      ++records;
      leadline::test::require_sound(sample);
    } while (codec.next(sample));
  }
  require(codec.counters().records == records);
  codec.restart();
  return 0;
}
