// CAN frames of NMEA 2000, cut at will: every sample is sound, and the books add up.
#include "hal/attitude/nmea2000.hpp"
#include "tests/support/nav_check.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using leadline::test::require;
  if (size < 1) {
    return 0;
  }
  leadline::hal::Nmea2000Config config;
  config.use_variation = (data[0] & 1U) != 0;
  config.yaw_true = (data[0] & 2U) != 0;
  config.heave_up = (data[0] & 4U) != 0;
  config.source = (data[0] & 8U) != 0 ? 0x23 : leadline::hal::kAnyN2kSource;
  leadline::hal::Nmea2000Codec codec(config);
  std::uint32_t records = 0;
  leadline::base::NavSample sample{};
  for (std::size_t i = 1; i < size; ++i) {
    // Frames arrive a millisecond apart where nothing was lost.
    const auto t_us = static_cast<std::int64_t>((i - 1) / 16 * 1000);
    if (!codec.feed(data[i], t_us, sample)) {
      continue;
    }
    do {
      ++records;
      leadline::test::require_sound(sample);
    } while (codec.next(sample));
  }
  codec.restart();
  const auto& counters = codec.counters();
  require(counters.records == records && counters.no_data <= records);
  require(counters.frames * 16 + counters.skipped_bytes == size - 1);
  require(records + counters.ignored <= counters.frames);
  return 0;
}
