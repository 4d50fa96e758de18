// Xsens MTi (MTData2 of the Xbus protocol): attitude, rates, temperature, pressure, sensor clock. One
// record a message, kAttitude where it holds an orientation.
//
//   0xFA, bus id, message id, length (0xFF: two bytes of length follow), data, sum; all behind 0xFA add up
//   to 0 modulo 256. Big-endian. MTData2 (0x36) is a list of {u16 id, u8 size, data}.
//
// The low bits of an id are the number format (single, 12.20, 16.32, double) and the world's axes (east-
// north-up, north-east-down, north-west-up). Orientation is that of the housing (x forward, y left, z
// up) in that world, whatever the world: the alignment of the sensor does not follow it. So a sensor lying
// level says roll 180 degrees in north-east-down. Users who turned the housing's axes on the
// device say so: `body_frd`. What leaves is always forward-right-down in north-east-down: in the default
// world heading = 90 - yaw, pitch = -pitch, roll = roll.
//
// | packet | becomes |
// |---|---|
// | 0x2010 quaternion (w x y z), 0x2020 matrix, 0x2030 Euler angles | attitude (the first of them) |
// | 0x8020 rate of turn | rates |
// | 0x1060 sample time fine (100 us) | t_device_us; starts anew every 119 hours |
// | 0x0810 temperature, 0x3010 pressure | temperature (of the housing), pressure (of the air in it: left
// |        unless `use_pressure`) |
// | 0xE020, 0xE010 status | bit 1 clear (orientation not valid): the attitude is left out |
//
// UNSURE: 16.32 is taken with its fraction in front of its whole part; whether the status bit is kept by
// VRU profiles (`check_status`).
//
// Facts: xsens_mti_ros_node (message layout), MTi family reference manual (axes, RotLocal and RotSensor).
#pragma once

#include <cstdint>

#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"

namespace leadline::hal {

struct XsensConfig {
  bool true_heading = false;  ///< declination is set on the device (or it has GNSS); else magnetic
  bool body_frd = false;      ///< the sensor's axes were turned to forward-right-down on the device
  bool check_status = true;  ///< leave out attitudes whose status says that the filter is not valid
  bool use_pressure = false;      ///< the pressure is that of the water
  std::int32_t byte_time_ns = 0;  ///< per byte on the line; 0: in the port's latency
};

/// Bytes to samples. One object per port; not reentrant. No heap, no clock.
class XsensCodec {
 public:
  static constexpr std::size_t kMaxFrame_bytes = 1024;

  explicit XsensCodec(const XsensConfig& config) : config_(config) {}

  /// Takes one byte; true when a record is there, further ones through next(). O(1) per byte, O(frame)
  /// at its end.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample);
  [[nodiscard]] bool next(base::NavSample& sample);
  /// The port was closed and opened again.
  void restart() { framer_.reset(counters_); }
  [[nodiscard]] const CodecCounters& counters() const { return counters_; }

 private:
  [[nodiscard]] bool take(const FrameBytes& frame, base::NavSample& sample);

  XsensConfig config_;
  Framer<kMaxFrame_bytes> framer_{kMaxGap_us};
  CodecCounters counters_{};

  static constexpr base::TimeUs kMaxGap_us = 200'000;
};

}  // namespace leadline::hal
