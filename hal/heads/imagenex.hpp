// Imagenex heads with the 27-byte switch command: 852 echo sounder and scanning, 881A, 831L.
//
// A switch command (0xFE 0x44 .. 0xFD) asks for one measurement and carries every setting; a scanning head
// turns one step with each. The reply is "IMX" (252 points), "IGX" (500) or "IPX" (none), a header of 12
// bytes (831L: 32, and 250 points), the points, 0xFC. There is no checksum: a reply must have its letters,
// its length, its terminator, the count of points that its letters say, 7-bit groups without an eighth
// bit, and a range and a position that its model has.
//
// Direction. Scanning heads turn in the plane of the mount's forward and right axes as a Ping360 does:
// position 0 deg looks along forward, angles grow to the right (`clockwise`, UNSURE: an option). The echo
// sounder looks along azimuth/elevation of the configuration, down unless told otherwise.
//
// Records: kProfile from IMX and IGX; kRange or kNoReturn from IPX, and from all replies when `profile` is
// false (then the head is asked for IPX). A profile range of 0 is "nothing found": kNoReturn. A range
// below min_range_um is no proof of free water: kNoReturn with quality 0. The heads calculate with
// 1500 m/s. Units of the profile range: 852 and 831L centimetres; 881A 2 mm below 5 m, otherwise 10 mm.
//
// Status. The 852 says by bit 6 that the switches were accepted, by bit 7 that characters were lost: both
// are counted (refused_settings) and the reply is used. Bits of the 831L: sources conflict, not read.
//
// The 831L measures roll and pitch (0.025 deg): samples of kind kAttitude, when its bits say new and
// without error. Their signs are UNSURE: an option turns each.
//
// Time. t_transmit = arrival of the last byte - transmission of the reply - two-way time of the range.
//
// Facts: "852 echo sounder serial interface specification" v1.04 (CIDCO-dev/Imagenex852); LSTS/dune
// Imagenex881A, Imagenex852; quattrinili/imagenex831l.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/codec.hpp"
#include "hal/heads/exchange.hpp"
#include "hal/heads/nav_queue.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/ping.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

/// kAuto reads only: head ids 0x11 .. 0x15 are an 852 echo sounder, long headers an 831L, and others an
/// 881A (the 852 scanning head has the same id 0x10: tell it by kScanner852).
enum class ImagenexModel : std::uint8_t {
  kAuto = 0,
  kSounder852 = 1,
  kScanner852 = 2,
  k881a = 3,
  k831l = 4,
};

inline constexpr std::size_t kMaxImagenexPoints = 500;
inline constexpr std::size_t kImagenexSwitch_bytes = 27;
inline constexpr std::int32_t kImagenexSoundSpeed_mm_s = 1'500'000;

struct ImagenexConfig {
  ImagenexModel model = ImagenexModel::kAuto;
  std::uint16_t mount = 0;
  std::uint8_t head_id = 0;  ///< 0: the model's usual one, and any is heard
  bool profile = true;       ///< intensities; false: ranges of the head's own detector
  bool many_points = true;   ///< ask for 500 points, not 252 (831L: always 250)
  bool clockwise = true;
  bool roll_positive = true;
  bool pitch_positive = true;
  std::uint8_t gain_db = 14;               ///< 0 .. 40
  std::uint8_t pulse_us = 100;             ///< 852, 831L; the 881A's follows its range
  std::int32_t poll_interval_us = 0;       ///< 0: the next as soon as one is answered
  std::int32_t forward_cdeg = 0;           ///< head angle of the mount's forward axis, centidegrees
  std::int32_t train_deg = 0;              ///< middle of the sector
  std::int32_t sector_deg = 360;           ///< 0 .. 360 (831L: 120)
  std::int32_t step_ddeg = 3;              ///< tenths of a degree: 3 .. 24 (852: 30 or 60)
  std::int64_t min_range_um = 500'000;     ///< also told to the head
  std::int64_t max_range_um = 10'000'000;  ///< the head gets the next range that it has
  std::int32_t byte_time_ns = 0;  ///< per byte on the line (115200 baud: 86806); 0: in the latency
  base::Bam32 azimuth_bam32 = 0;
  base::Bam32 elevation_bam32 = base::kBam32QuarterTurn;
};

/// Bytes to pings, and the switch commands that ask for them. One object per port; not reentrant. No heap,
/// no clock. O(1) per byte, O(points) per reply. About 5 KiB.
class ImagenexCodec {
 public:
  static constexpr std::size_t kMaxRequest_bytes = kImagenexSwitch_bytes;

  /// Values outside their range are limited to it.
  explicit ImagenexCodec(const ImagenexConfig& config);

  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping);
  [[nodiscard]] bool next(base::Ping& ping);
  /// See nav_queue.hpp.
  [[nodiscard]] bool take_sample(base::NavSample& sample) { return samples_.take(sample); }

  /// A switch command when one is due: nothing is sent while a reply is, and a reply that does not come
  /// is counted and asked for again. Nothing for kAuto.
  [[nodiscard]] std::size_t request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity);
  /// The port was closed and opened again.
  void restart();

  [[nodiscard]] const CodecCounters& counters() const { return counters_; }

 private:
  [[nodiscard]] bool take(const FrameBytes& frame, base::Ping& ping);
  void take_attitude(const FrameBytes& frame);
  void set_direction(ImagenexModel model, const std::uint8_t* bytes, base::Ping& ping) const;
  void set_profile(const std::uint8_t* points, std::int64_t count, std::int64_t range_mm,
                   base::Ping& ping);
  void set_range(std::int64_t found_um, base::Ping& ping) const;
  [[nodiscard]] std::uint8_t range_code() const;
  void write_switch(std::uint8_t* out) const;

  ImagenexConfig config_;
  CodecCounters counters_{};
  Framer<12 + kMaxImagenexPoints + 1> framer_;
  PingExchange exchange_;
  base::TimeUs next_poll_us_ = 0;
  NavQueue samples_;
  std::array<std::uint16_t, kMaxImagenexPoints> intensity_{};
};

}  // namespace leadline::hal
