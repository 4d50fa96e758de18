// TSS1: the 27 bytes of motion sensors (TSS, Kongsberg MRU, SBG, Norwegian Subsea, NovAtel, ...): roll,
// pitch, heave, no heading, no checksum. One record (kAttitude) a line.
//
//   ':' XX AAAA ' ' M HHHH Q M RRRR ' ' M PPPP CR LF
//
// XX and AAAA are accelerations in hex (left), M is a space or '-', HHHH heave in centimetres (up
// positive), RRRR roll (port side up positive), PPPP pitch (bow up positive), both in hundredths of a
// degree. Q is U, G, H or F (unaided, aided by speed, heading, both), in lower case while the sensor
// settles: then the record has no heave and its quality is kUnsettledQuality.
//
// Columns are fixed (copies on the web have lost a space) and, for want of a checksum, every one is
// checked: a line that lost a byte is dropped. A digit changed to another digit is beyond the protocol.
//
// Roll of TSS1 is not the Euler angle: it is how far the athwartships axis is off level, so
// sin(roll_tss) = sin(roll) cos(pitch). It becomes the Euler angle of model/base/pose.hpp here, unless
// the sensor is set to send that (`euler_roll`).
//
// Facts: docs.novatel.com TSS1; Norwegian Subsea TSS1; CalCOFI EK80 help on TSS1.
#pragma once

#include <cstdint>

#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"

namespace leadline::hal {

struct Tss1Config {
  bool euler_roll = false;        ///< the sensor sends the Euler angle
  std::int32_t byte_time_ns = 0;  ///< per byte on the line; 0: in the port's latency
};

/// Bytes to samples. One object per port; not reentrant. No heap, no clock.
class Tss1Codec {
 public:
  static constexpr std::size_t kLine_bytes = 27;
  static constexpr std::uint8_t kUnsettledQuality = 64;

  explicit Tss1Codec(const Tss1Config& config) : config_(config) {}

  /// Takes one byte; true when a record is there, further ones through next(). O(1) per byte, O(line)
  /// at its end.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample);
  [[nodiscard]] bool next(base::NavSample& sample);
  /// The port was closed and opened again.
  void restart() { framer_.reset(counters_); }
  [[nodiscard]] const CodecCounters& counters() const { return counters_; }
  /// The frame of the last record, until the next byte: for whoever shows what navigation leaves.
  [[nodiscard]] FrameView frame() const { return framer_.last_frame(); }

 private:
  [[nodiscard]] bool take(const FrameBytes& frame, base::NavSample& sample);

  Tss1Config config_;
  Framer<2 * kLine_bytes> framer_{kMaxGap_us};
  CodecCounters counters_{};

  static constexpr base::TimeUs kMaxGap_us = 200'000;
};

}  // namespace leadline::hal
