// VectorNav VN-100, VN-110, VN-200, VN-300: the text $VNYMR and the binary output, mixed at will.
//
//   $VNYMR,yaw,pitch,roll,mag x,y,z,accel x,y,z,gyro x,y,z*XX CR LF
//       degrees, gauss, m/s2, rad/s; XX is an XOR of 8 bits, or a CRC of 16 in four digits
//   0xFA, group mask, u16 field mask per group, fields (little-endian), CRC of 16 bits (big-endian)
//
// Sensor axes are forward, right, down and the world is north-east-down: angles and rates are those of
// model/base/pose.hpp as they come. Yaw is of magnetic north unless the sensor knows better: `true_heading`.
//
// | record | from |
// |---|---|
// | attitude | YPR or quaternion (common or attitude group; YPR where both are), with rates and the sigmas of
// |          YprU where the frame has them |
// | rates    | angular rate without an attitude |
// | position | INS position and velocity (NED) of VN-200 and VN-300, fields 0 unless the INS status in the
// |          frame, if any, says that it tracks |
//
// A frame with attitude and position makes two records (next()). TimeStartup becomes t_device_us. Other
// text ($VNRRG, ...) is counted as ignored, $VNERR as a nack. `*XX` literally means that the sender
// checks nothing: taken with `accept_unchecked` only.
//
// Facts: the maker's programming library (lengths of fields; the CRC's polynomial 0x1021, start 0).
#pragma once

#include <cstdint>

#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"

namespace leadline::hal {

struct VectorNavConfig {
  bool true_heading = false;      ///< yaw is of true north (reference model or GNSS compass)
  bool accept_unchecked = false;  ///< take "*XX"
  bool every_report = false;  ///< $VNRRG makes a record (kOther, no fields): for decoding a file
  std::int32_t byte_time_ns = 0;  ///< per byte on the line; 0: in the port's latency
};

/// Bytes to samples. One object per port; not reentrant. No heap, no clock.
class VectorNavCodec {
 public:
  static constexpr std::size_t kMaxLine_bytes = 180;
  static constexpr std::size_t kMaxFrame_bytes = 512;

  explicit VectorNavCodec(const VectorNavConfig& config) : config_(config) {}

  /// Takes one byte; true when a record is there, further ones through next(). O(1) per byte of a
  /// binary frame, O(line) per byte of text.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample);
  [[nodiscard]] bool next(base::NavSample& sample);
  /// The port was closed and opened again.
  void restart();
  [[nodiscard]] const CodecCounters& counters() const { return counters_; }
  /// The frame of the last record, until the next byte: for whoever shows what navigation leaves.
  [[nodiscard]] FrameView frame() const { return framer_.last_frame(); }

 private:
  [[nodiscard]] bool take(const FrameBytes& frame, base::NavSample& sample);
  [[nodiscard]] bool take_text(const FrameBytes& frame, base::NavSample& sample);
  [[nodiscard]] bool take_binary(const FrameBytes& frame, base::NavSample& sample);
  [[nodiscard]] base::NavSample sample_of(const FrameBytes& frame, base::NavKind kind) const;
  [[nodiscard]] base::NavField heading_field() const {
    return config_.true_heading ? base::kNavHeading : base::kNavHeadingMagnetic;
  }

  VectorNavConfig config_;
  Framer<kMaxFrame_bytes> framer_{kMaxGap_us};
  CodecCounters counters_{};
  base::NavSample pending_{};  ///< the second record of a frame
  bool has_pending_ = false;

  static constexpr base::TimeUs kMaxGap_us = 200'000;
};

}  // namespace leadline::hal
