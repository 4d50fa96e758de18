// The codec at the end of a port, whatever it is: bytes to records, and the bytes that the device is owed.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "firmware/pipeline/config.hpp"
#include "firmware/pipeline/driver_codecs.hpp"
#include "firmware/pipeline/drivers.hpp"
#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/ping.hpp"

namespace leadline::firmware {

/// What feed() or next() delivered.
enum class RecordKind : std::uint8_t { kNone = 0, kPing = 1, kSample = 2 };

struct DeviceRecord {
  base::Ping ping;
  base::NavSample sample;
};

/// The calls of one codec class: feed, next, request, restart, counters. Static, one for each driver; `codec`
/// is the object that `make` or `make_default` constructed.
struct DeviceCodec {
  Driver driver;
  void* (*make)(void* storage, const PortConfig& port, const DeviceSetup& setup);
  void* (*make_default)(void* storage);
  RecordKind (*feed)(void* codec, std::uint8_t byte, base::TimeUs t_arrival_us,
                     DeviceRecord& record);
  RecordKind (*next)(void* codec, DeviceRecord& record);
  std::size_t (*request)(void* codec, base::TimeUs now_us, std::uint8_t* out, std::size_t capacity);
  void (*restart)(void* codec);
  hal::CodecCounters (*counters)(const void* codec);
};

/// Null for kNone and for drivers that this build does not carry. O(drivers).
[[nodiscard]] const DeviceCodec* device_codec(Driver driver);

/// One codec at a time, in storage of its own that the largest fits into. No heap. Does not move. About
/// kCodecStorage_bytes.
class DevicePort {
 public:
  DevicePort() = default;
  DevicePort(const DevicePort&) = delete;
  DevicePort& operator=(const DevicePort&) = delete;

  /// Adopts the port's driver and starts it anew. A driver that this build lacks leaves the port as kNone
  /// does: deaf and dumb. O(codec).
  void configure(const PortConfig& config, const DeviceSetup& setup);
  /// For bytes from a file: the driver with its codec's default configuration. False: as above.
  [[nodiscard]] bool configure_decoding(Driver driver);

  [[nodiscard]] Driver driver() const { return codec_ == nullptr ? Driver::kNone : codec_->driver; }
  /// As the codecs' own (hal/README.md). `t_arrival_us`: latency already taken off.
  [[nodiscard]] RecordKind feed(std::uint8_t byte, base::TimeUs t_arrival_us, DeviceRecord& record);
  /// What else the last byte completed.
  [[nodiscard]] RecordKind next(DeviceRecord& record);
  [[nodiscard]] std::size_t request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity);
  /// The port was closed and opened again: half a frame is forgotten, a conversation begins anew.
  void restart();
  [[nodiscard]] hal::CodecCounters counters() const;
  /// Frames that the codec dropped, for any reason, and records that it refused.
  [[nodiscard]] std::uint32_t rejected() const { return hal::rejected(counters()); }

 private:
  alignas(kCodecStorage_alignment) std::array<std::uint8_t, kCodecStorage_bytes> storage_{};
  const DeviceCodec* codec_ = nullptr;
  void* object_ = nullptr;  ///< in storage_
};

}  // namespace leadline::firmware
