// NMEA text, cut at will: every sample is within the ranges of its record, carries nothing but the fields
// that it names, and every '$' ends in exactly one counter.
#include <cstdint>
#include <cstdlib>

#include "hal/attitude/nmea.hpp"

namespace {

using leadline::base::NavSample;
using leadline::hal::NmeaCodec;
using leadline::hal::NmeaConfig;

void require(bool condition) {
  if (!condition) {
    std::abort();
  }
}

bool within(std::int64_t value, std::int64_t low, std::int64_t high) {
  return value >= low && value <= high;
}

void check(const NavSample& sample) {
  const auto has = [&sample](unsigned bit) { return (sample.fields & bit) != 0; };
  using namespace leadline::base;  // NOLINT: the bits' names
  require(sample.fields != 0 && sample.quality > 0);
  require(!has(kNavVelocityBody) && !has(kNavVelocityWorld));
  require(!(has(kNavHeading) && has(kNavHeadingMagnetic)));
  require(has(kNavHeading) || has(kNavHeadingMagnetic) || sample.attitude.heading_bam32 == 0);
  require(has(kNavRollPitch) ||
          (sample.attitude.roll_bam32 == 0 && sample.attitude.pitch_bam32 == 0));
  require(within(static_cast<std::int32_t>(sample.attitude.pitch_bam32), -0x40000000, 0x40000000));
  require(has(kNavGeodetic) ? within(sample.latitude_e9deg, -90'000'000'000, 90'000'000'000) &&
                                  within(sample.longitude_e9deg, -180'000'000'000, 180'000'000'000)
                            : sample.latitude_e9deg == 0 && sample.longitude_e9deg == 0);
  require(has(kNavPressure) ? within(sample.pressure_pa, 1, 201'000'000) : sample.pressure_pa == 0);
  require(has(kNavDepth) ? within(sample.depth_um, -kMaxVertical_um, kMaxVertical_um)
                         : sample.depth_um == 0);
  require(has(kNavAltitude) ? within(sample.altitude_um, 1, kMaxRange_um)
                            : sample.altitude_um == 0);
  require(has(kNavUtc) ? within(sample.utc_us, 0, 86'401'000'000) : sample.utc_us == 0);
  for (const std::uint32_t sigma_urad : sample.sigma_attitude_urad) {
    require(sigma_urad <= 3'141'593);
  }
}

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
      check(sample);
    }
  }
  codec.restart();
  const auto& c = codec.counters();
  require(c.records == records);
  require(starts == c.records + c.ignored + c.no_data + c.bad_checksum + c.no_checksum +
                        c.bad_field + c.bad_byte + c.too_long + c.unfinished);
  return 0;
}
