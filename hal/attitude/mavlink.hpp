// MAVLink 1 and 2 from an autopilot (ArduSub): attitude, pressure, position, altitude.
//
// | message | kind | becomes |
// |---|---|---|
// | SYSTEM_TIME | time | UTC |
// | SCALED_PRESSURE, 2, 3 | pressure | absolute pressure, temperature. On ArduSub the first is the barometer
// |         inside of the hull and the second the one in the water (kTakeArduSub) |
// | ATTITUDE | attitude | roll, pitch, heading, rates |
// | ATTITUDE_QUATERNION | attitude | the same from the quaternion (w first, body FRD in NED) |
// | GLOBAL_POSITION_INT | position | latitude, longitude, velocity NED. 0, 0 is no position. Its altitude
// |         comes from the same pressure sensor and its heading is that of ATTITUDE: both are left |
// | LOCAL_POSITION_NED | position | position and velocity NED from an origin of the autopilot's |
// | VISION_POSITION_ESTIMATE | position | position NED from an origin of the camera's, sigmas from the
// |         covariance; its yaw is about that frame's axis, of which nobody knows the north, and is left |
// | ODOMETRY | velocity | velocity of the body (child frame BODY_FRD) or of the world (LOCAL_NED) with its
// |         sigma; position NED from an origin of the sender's where the frame is LOCAL_NED. Its attitude and
// |         rates are those of ATTITUDE, or about a frame without a north, and are left |
// | DISTANCE_SENSOR (downwards), RANGEFINDER | altitude | distance within the sensor's own limits |
//
// What is NaN or out of range is left out of the record; a message without anything left is a record
// whose `fields` are 0. An ATTITUDE without good roll and pitch may still carry a heading, or rates.
//
// Trailing zeros that version 2 cuts off are zeros again. `t_device_us` is the autopilot's time since boot.
//
// Facts: mavlink message definitions (common, ardupilotmega).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/attitude/mavlink_frame.hpp"
#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

/// Bits of MavlinkConfig::take.
enum MavlinkTake : std::uint32_t {
  kTakeAttitude = 1U << 0U,
  kTakeAttitudeQuaternion = 1U << 1U,
  kTakePressure = 1U << 2U,
  kTakePressure2 = 1U << 3U,
  kTakePressure3 = 1U << 4U,
  kTakeGlobalPosition = 1U << 5U,
  kTakeLocalPosition = 1U << 6U,
  kTakeVision = 1U << 7U,
  kTakeDistance = 1U << 8U,
  kTakeTime = 1U << 9U,
  kTakeOdometry = 1U << 10U,
  kTakeEverything = (1U << 11U) - 1U,
  /// What a vehicle may navigate by.
  kTakeArduSub = kTakeEverything & ~(kTakePressure | kTakePressure3),
};

/// Plain integers.
struct MavlinkConfig {
  std::uint32_t take = kTakeEverything;
  std::uint8_t system = 0;        ///< listen to this system only; 0: any
  std::uint8_t component = 0;     ///< listen to this component only; 0: any
  bool heading_true = true;       ///< yaw is of true north, otherwise magnetic
  std::int32_t byte_time_ns = 0;  ///< per byte on the line (115200 baud: 86806); 0: in the latency
};

/// Bytes to samples. One object per port; not reentrant. No heap, no clock. About 2 KiB.
///
/// Counters: `ignored` are intact frames of other kinds, `wrong_device` those of other systems;
/// `no_data` are those of `records` that carry nothing.
class MavlinkCodec {
 public:
  explicit MavlinkCodec(const MavlinkConfig& config) : config_(config) {}

  /// Takes one byte; true when it completed a record. O(1), O(frame) at a frame's end.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample);
  /// What else the last byte completed: frames behind a damaged one.
  [[nodiscard]] bool next(base::NavSample& sample);
  /// The port was closed and opened again: forgets half a frame.
  void restart() { framer_.reset(counters_); }

  [[nodiscard]] const CodecCounters& counters() const { return counters_; }

 private:
  /// A pause inside of a frame that no autopilot makes.
  static constexpr base::TimeUs kMaxGap_us = 500'000;

  [[nodiscard]] bool take(const FrameBytes& frame, base::NavSample& sample);

  MavlinkConfig config_;
  Framer<2 * kMaxMavlinkFrame_bytes> framer_{kMaxGap_us};
  CodecCounters counters_{};
};

}  // namespace leadline::hal
