// NMEA text, cut at will: every sample is within the ranges of its record, carries nothing but the fields
// that it names, and every '$' ends in exactly one counter.
#include <cstdint>

#include "hal/attitude/nmea.hpp"
#include "tests/support/nav_check.hpp"

namespace {

using leadline::base::NavSample;
using leadline::hal::NmeaCodec;
using leadline::hal::NmeaConfig;
using leadline::test::require;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) {
    return 0;
  }
  NmeaConfig config;
  // Without checksums the fuzzer gets to the fields.
  config.require_checksum = (data[0] & 1U) != 0;
  config.use_variation = (data[0] & 2U) != 0;
  config.prdid_true = (data[0] & 4U) != 0;
  config.gauge_pressure = (data[0] & 8U) != 0;
  NmeaCodec codec(config);
  std::uint32_t records = 0;
  std::uint32_t starts = 0;
  for (std::size_t i = 1; i < size; ++i) {
    starts += data[i] == '$' ? 1U : 0U;
    NavSample sample{};
    if (codec.feed(data[i], static_cast<std::int64_t>(i), sample)) {
      ++records;
      leadline::test::require_sound(sample);
    }
  }
  codec.restart();
  const auto& c = codec.counters();
  require(c.records + c.no_data == records);
  require(starts == c.records + c.ignored + c.no_data + c.bad_checksum + c.no_checksum +
                        c.bad_field + c.bad_byte + c.too_long + c.unfinished);
  return 0;
}
