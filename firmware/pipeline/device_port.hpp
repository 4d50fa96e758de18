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

/// The calls of one codec class: feed, next, request, restart, counters, frame. Static, one for each driver; `codec`
/// is the object that `make` or `make_default` constructed.
struct DeviceCodec {
  Driver driver;
  std::size_t size_bytes;  ///< of the object
  void* (*make)(void* storage, const PortConfig& port, const DeviceSetup& setup);
  void* (*make_default)(void* storage);
  RecordKind (*feed)(void* codec, std::uint8_t byte, base::TimeUs t_arrival_us,
                     DeviceRecord& record);
  RecordKind (*next)(void* codec, DeviceRecord& record);
  std::size_t (*request)(void* codec, base::TimeUs now_us, std::uint8_t* out, std::size_t capacity);
  void (*restart)(void* codec);
  hal::CodecCounters (*counters)(const void* codec);
  hal::FrameView (*frame)(const void* codec);
};

/// Null for kNone and for drivers that this build does not carry. O(drivers).
[[nodiscard]] const DeviceCodec* device_codec(Driver driver);

/// Room that the codecs of several ports share: each takes what its own needs, so that a vehicle without a survey
/// multibeam does not pay for one at every port. Not thread-safe; no heap.
class CodecArena {
 public:
  /// `bytes`: aligned to kCodecStorage_alignment; not owned, outlives the codecs.
  CodecArena(std::uint8_t* bytes, std::size_t capacity_bytes)
      : bytes_(bytes), capacity_bytes_(capacity_bytes) {}

  /// All codecs in it are gone.
  void clear() { used_bytes_ = 0; }
  /// Null: no room. Aligned to kCodecStorage_alignment. O(1).
  [[nodiscard]] void* take(std::size_t size_bytes);
  /// What take() uses up for an object of `size_bytes`.
  [[nodiscard]] static constexpr std::size_t rounded(std::size_t size_bytes) {
    return (size_bytes + kCodecStorage_alignment - 1) / kCodecStorage_alignment *
           kCodecStorage_alignment;
  }

 private:
  std::uint8_t* bytes_;
  std::size_t capacity_bytes_;
  std::size_t used_bytes_ = 0;
};

/// A codec in an arena. No heap. Does not move.
class PortCodec {
 public:
  PortCodec() = default;
  PortCodec(const PortCodec&) = delete;
  PortCodec& operator=(const PortCodec&) = delete;

  /// Adopts the port's driver and starts it anew. A driver that this build lacks, or that the arena has no room
  /// for, leaves the port as kNone does: deaf and dumb. O(codec).
  void configure(const PortConfig& config, const DeviceSetup& setup, CodecArena& arena);
  /// For bytes from a file: the driver with its codec's default configuration. False: as above.
  [[nodiscard]] bool configure_decoding(Driver driver, CodecArena& arena);

  [[nodiscard]] Driver driver() const { return codec_ == nullptr ? Driver::kNone : codec_->driver; }
  /// As the codecs' own (hal/README.md). `t_arrival_us`: latency already taken off.
  [[nodiscard]] RecordKind feed(std::uint8_t byte, base::TimeUs t_arrival_us, DeviceRecord& record);
  /// What else the last byte completed.
  [[nodiscard]] RecordKind next(DeviceRecord& record);
  [[nodiscard]] std::size_t request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity);
  /// The port was closed and opened again: half a frame is forgotten, a conversation begins anew.
  void restart();
  [[nodiscard]] hal::CodecCounters counters() const;
  /// The frame that the last record was made of, until the next byte; none where the codec does not keep it, or the
  /// record came out of a queue.
  [[nodiscard]] hal::FrameView frame() const;
  /// Frames that the codec dropped, for any reason, and records that it refused.
  [[nodiscard]] std::uint32_t rejected() const { return hal::rejected(counters()); }

 private:
  [[nodiscard]] void* room_for(Driver driver, CodecArena& arena);

  const DeviceCodec* codec_ = nullptr;
  void* object_ = nullptr;  ///< in the arena
};

/// One codec at a time, in storage of its own that the largest fits into: for those who do not know beforehand
/// which. About kCodecStorage_bytes.
class DevicePort : public PortCodec {
 public:
  void configure(const PortConfig& config, const DeviceSetup& setup) {
    arena_.clear();
    PortCodec::configure(config, setup, arena_);
  }
  [[nodiscard]] bool configure_decoding(Driver driver) {
    arena_.clear();
    return PortCodec::configure_decoding(driver, arena_);
  }

 private:
  alignas(kCodecStorage_alignment)
      std::array<std::uint8_t, CodecArena::rounded(kCodecStorage_bytes)> storage_{};
  CodecArena arena_{storage_.data(), storage_.size()};
};

}  // namespace leadline::firmware
