// What holds for every sample of every codec, for the fuzz targets: values within the ranges of the record,
// and nothing in it that its fields do not name. Stops the program where it does not hold.
#pragma once

#include <cstdint>
#include <cstdlib>

#include "model/base/nav_sample.hpp"
#include "model/base/units.hpp"

namespace leadline::test {

inline void require(bool condition) {
  if (!condition) {
    std::abort();
  }
}

inline bool within(std::int64_t value, std::int64_t limit) {
  return value >= -limit && value <= limit;
}

inline void require_vector(bool carried, const std::int64_t* values, std::int64_t limit) {
  for (int i = 0; i < 3; ++i) {
    require(carried ? within(values[i], limit) : values[i] == 0);
  }
}

inline void check_sample(const base::NavSample& sample) {
  using namespace base;  // NOLINT: the bits' names
  const auto has = [&sample](unsigned bits) { return (sample.fields & bits) != 0; };
  require(sample.quality > 0);
  require(!(has(kNavHeading) && has(kNavHeadingMagnetic)));
  require(has(kNavHeading | kNavHeadingMagnetic) || sample.attitude.heading_bam32 == 0);
  require(has(kNavRollPitch) ||
          (sample.attitude.roll_bam32 == 0 && sample.attitude.pitch_bam32 == 0));
  require(within(static_cast<std::int32_t>(sample.attitude.pitch_bam32), 0x40000000));
  require(has(kNavGeodetic) ? within(sample.latitude_e9deg, 90'000'000'000) &&
                                  within(sample.longitude_e9deg, 180'000'000'000)
                            : sample.latitude_e9deg == 0 && sample.longitude_e9deg == 0);
  require(has(kNavPressure) ? sample.pressure_pa >= 0 && sample.pressure_pa <= INT64_C(0xFFFFFFFF)
                            : sample.pressure_pa == 0);
  require(has(kNavDepth) ? within(sample.depth_um, kMaxVertical_um) : sample.depth_um == 0);
  require(has(kNavAltitude) ? sample.altitude_um > 0 && sample.altitude_um <= kMaxRange_um
                            : sample.altitude_um == 0);
  require_vector(has(kNavVelocityBody | kNavVelocityWorld | kNavVelocityWater),
                 sample.velocity_um_s, 1'000'000'000);
  require_vector(has(kNavRates), sample.rate_urad_s, 100'000'000);
  require_vector(has(kNavPositionLocal), sample.position_um, 100'000'000'000);
  require(has(kNavHeave) || sample.heave_um == 0);
  require(has(kNavUtc) || sample.utc_us == 0);
  require(has(kNavSoundSpeed) || sample.sound_speed_mm_s == 0);
  require(has(kNavTemperature) || sample.temperature_mdegc == 0);
}

/// Feeds everything; the books of the bytes and of the records are right at the end.
template <typename Codec>
void check_codec(Codec& codec, const std::uint8_t* data, std::size_t size) {
  std::uint32_t records = 0;
  std::int64_t t_us = 0;
  base::NavSample sample{};
  for (std::size_t i = 0; i < size; ++i) {
    // Every 251st byte comes after a silence.
    t_us += i % 251 == 250 ? 10'000'000 : 100;
    bool more = codec.feed(data[i], t_us, sample);
    for (; more; more = codec.next(sample)) {
      check_sample(sample);
      ++records;
    }
  }
  codec.restart();
  require(!codec.next(sample));
  require(codec.counters().records == records);
  require(codec.counters().skipped_bytes <= size);
}

}  // namespace leadline::test
