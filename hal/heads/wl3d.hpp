// Water Linked Sonar 3D-15: range images of its Range Image Protocol, by UDP (224.0.0.96:4747) or from a file
// of such packets (.sonar).
//
// Packet: "RIP2" (or "RIP1"), u32 length of all of it, payload, u32 CRC-32 (zlib) of all before it. The
// payload is a protobuf Packet whose Any holds the message, in RIP2 as a raw Snappy block. Of its messages
// RangeImage is read; the grey image, IMU batches and undocumented ones are intact frames and ignored.
// The sonar sends by itself; switching it on and its range are its web interface's business.
//
// Records: one per pixel that has a distance, kRange; pixels of 0 ("no data") give none: they do not say
// that the water is free. The image has rows of `width` pixels:
//   yaw   = (column / (width - 1) - 1/2) * fov_horizontal
//   pitch = (row / (height - 1) - 1/2) * fov_vertical
// taken as azimuth to the right and elevation upwards in the mount's frame (forward, right, down). UNSURE:
// the maker's helper gives x, y, z without naming the axes; options turn each over.
// Range = pixel * scale, made with the message's speed of sound.
//
// Time. t_transmit = arrival - two-way time of the configured range; t_receive = t_transmit + two-way time
// of the pixel. The header's own time (unset until the sonar has NTP) is left to others.
//
// Facts: waterlinked/wlsonar (protocol, .proto, helpers), waterlinked/docs docs/sonar-3d.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/codec.hpp"
#include "model/base/ping.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

inline constexpr std::size_t kMaxWl3dPixels = std::size_t{256} * 64;
/// An image of nothing but three-byte pixels, and its other fields.
inline constexpr std::size_t kMaxWl3dMessage_bytes = 3 * kMaxWl3dPixels + 512;
/// Longest packet: a message that could not be compressed.
inline constexpr std::size_t kMaxWl3dPacket_bytes = kMaxWl3dMessage_bytes + 512;

struct Wl3dConfig {
  std::uint16_t mount = 0;
  bool columns_to_the_right = true;
  bool rows_upwards = true;
};

/// Bytes to pings. One object per port; not reentrant. No heap, no clock. O(1) per byte, O(bytes) per
/// packet, O(1) per record but for the empty pixels in between. About 300 KiB.
class Wl3dCodec {
 public:
  explicit Wl3dCodec(const Wl3dConfig& config);

  /// The further pixels of an image come from next(), which may be left undrained without losing any.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping);
  [[nodiscard]] bool next(base::Ping& ping);
  void restart();

  [[nodiscard]] std::uint32_t sequence_id() const { return image_.sequence_id; }
  [[nodiscard]] const CodecCounters& counters() const { return counters_; }

 private:
  /// What all pixels of an image share. Offsets into message_, so that the codec can be copied.
  struct Image {
    base::TimeUs t_transmit_us = 0;
    std::uint64_t width = 0;
    std::uint64_t height = 0;
    std::int64_t fov_horizontal_bam = 0;
    std::int64_t fov_vertical_bam = 0;
    std::int64_t scale_q38m = 0;  ///< metres a count, in units of 2^-38
    std::int64_t range_um = 0;
    std::int32_t sound_speed_mm_s = 0;
    std::uint32_t sequence_id = 0;
    std::size_t pixels_at = 0;
    std::size_t pixels_end = 0;
    std::uint64_t pixel = 0;  ///< number of the next one
  };

  void take(const FrameBytes& frame);
  [[nodiscard]] bool take_image(const std::uint8_t* data, std::size_t size_bytes);
  [[nodiscard]] bool take_field(std::uint32_t number, std::uint64_t value, bool is_float);
  [[nodiscard]] bool pixels_plausible() const;
  [[nodiscard]] bool deliver(base::Ping& ping);
  [[nodiscard]] std::int64_t range_um_of(std::uint64_t counts) const;

  Wl3dConfig config_;
  CodecCounters counters_{};
  Framer<kMaxWl3dPacket_bytes> framer_;
  std::array<std::uint8_t, kMaxWl3dMessage_bytes> message_{};
  Image image_;
};

}  // namespace leadline::hal
