// The codec at the end of a port, whatever it is: bytes to records, and the bytes that the device is owed.
#pragma once

#include <cstddef>
#include <cstdint>

#include "firmware/pipeline/config.hpp"
#include "hal/attitude/nmea.hpp"
#include "hal/heads/ping1d.hpp"
#include "hal/heads/ping360.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/ping.hpp"

namespace leadline::firmware {

/// What feed() or next() delivered.
enum class RecordKind : std::uint8_t { kNone = 0, kPing = 1, kSample = 2 };

struct DeviceRecord {
  base::Ping ping;
  base::NavSample sample;
};

/// One of every codec, of which the configured one works: static storage knows no choice. About 20 KiB.
class DevicePort {
 public:
  DevicePort() = default;

  /// Adopts the port's driver and starts it anew. O(1).
  void configure(const PortConfig& config, std::int32_t sound_speed_mm_s);
  [[nodiscard]] Driver driver() const { return driver_; }
  /// As the codecs' own (hal/README.md). `t_arrival_us`: latency already taken off.
  [[nodiscard]] RecordKind feed(std::uint8_t byte, base::TimeUs t_arrival_us, DeviceRecord& record);
  /// What else the last byte completed.
  [[nodiscard]] RecordKind next(DeviceRecord& record);
  [[nodiscard]] std::size_t request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity);
  /// Frames that the codec dropped, for any reason, and records that it refused.
  [[nodiscard]] std::uint32_t rejected() const;

 private:
  Driver driver_ = Driver::kNone;
  hal::Ping1dCodec ping1d_{hal::Ping1dConfig{}};
  hal::Ping360Codec ping360_{hal::Ping360Config{}};
  hal::NmeaCodec nmea_{hal::NmeaConfig{}};
};

}  // namespace leadline::firmware
