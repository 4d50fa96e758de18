// NMEA 2000: attitude, heading, position, depth and speed from a CAN bus. The bytes are frames of
// hal/can_frame.hpp, as a CAN port delivers them.
//
//   identifier (29 bits): priority 28..26, page 24, format 23..16, specific 15..8, source 7..0
//   format >= 240: PGN = page, format, specific; below: specific is a destination, and the PGN ends in 0
//
// Values are little-endian integers. The three largest of each type say "not available", "out of range"
// and "reserved", and so does the most negative of a signed one (a heave of -327.68 m); such a value, or
// an angle beyond its circle, is left out of the record. A message without any that counts is a
// record whose `fields` are 0.
//
// | PGN | kind | becomes |
// |---|---|---|
// | 126992 system time | time | UTC |
// | 127250 heading | heading | true or magnetic as the message says, its deviation applied to a magnetic
// |        one; with `use_variation` and a variation in the message, true |
// | 127251 rate of turn | rates | rate about the down axis (kNavYawRate) |
// | 127252 heave | heave | down positive (`heave_up`: the bus says up) |
// | 127257 attitude | attitude | one record a message. Roll and pitch, both or none; yaw as a heading,
// |        magnetic unless `yaw_true`: the message does not say of which north (a Raymarine EV-1 sends
// |        what it calls magnetic in 127250) |
// | 128259 speed | velocity | forward speed through the water; its own ground speed has no direction
// |        and is left |
// | 128267 depth | altitude | below the transducer; the offset belongs to the lever arm |
// | 129025 position | position | latitude, longitude |
// | 129026 course and speed over ground | velocity | north and east, of a true course only |
// | 129029 GNSS position (fast packet) | position | latitude, longitude, UTC; quality from the method as in
// |        GGA; its altitude is left |
// | 130314 pressure | pressure | of `pressure_source`: on a vehicle a barometer's must not become depth |
//
// Times are the arrival of the message's first frame (a frame takes half a millisecond on the wire).
//
// Bytes lost between frames: frames have no checksum here (the bus had one), so a lost byte shows by
// what a frame cannot be and by the arrival time, which all bytes of a frame share. It costs its frame
// when the next one arrived at another time.
//
// Facts: canboat's analyzer (PGN tables).
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/attitude/fast_packet.hpp"
#include "hal/can_frame.hpp"
#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

inline constexpr std::uint32_t kPgnSystemTime = 126'992;
inline constexpr std::uint32_t kPgnHeading = 127'250;
inline constexpr std::uint32_t kPgnRateOfTurn = 127'251;
inline constexpr std::uint32_t kPgnHeave = 127'252;
inline constexpr std::uint32_t kPgnAttitude = 127'257;
inline constexpr std::uint32_t kPgnSpeed = 128'259;
inline constexpr std::uint32_t kPgnWaterDepth = 128'267;
inline constexpr std::uint32_t kPgnPositionRapid = 129'025;
inline constexpr std::uint32_t kPgnCourseSpeed = 129'026;
inline constexpr std::uint32_t kPgnGnssPosition = 129'029;
inline constexpr std::uint32_t kPgnActualPressure = 130'314;

inline constexpr std::uint8_t kAnyN2kSource = 255;
/// Values of 130314's source field.
inline constexpr std::uint8_t kN2kPressureAtmospheric = 0;
inline constexpr std::uint8_t kN2kPressureWater = 1;
inline constexpr std::uint8_t kAnyN2kPressure = 255;

/// Plain integers.
struct Nmea2000Config {
  std::uint8_t source = kAnyN2kSource;             ///< listen to this bus address only
  std::uint8_t pressure_source = kAnyN2kPressure;  ///< kN2kPressureWater on a vehicle
  bool use_variation = false;  ///< 127250: apply its own variation; false: the consumer's
  bool yaw_true = false;       ///< 127257: yaw is of true north, otherwise magnetic
  bool heave_up = true;        ///< 127252: positive is up (not stated in public)
};

/// PGN of a 29-bit identifier; flags are not looked at.
[[nodiscard]] constexpr std::uint32_t pgn_of(std::uint32_t can_id) {
  const std::uint32_t page_and_format = (can_id >> 16U) & 0x1FFU;
  const bool broadcast = (page_and_format & 0xFFU) >= 240;
  return (page_and_format << 8U) | (broadcast ? (can_id >> 8U) & 0xFFU : 0U);
}
/// Bus address of the sender.
[[nodiscard]] constexpr std::uint8_t n2k_source_of(std::uint32_t can_id) {
  return static_cast<std::uint8_t>(can_id);
}

/// Bytes of CAN frames to samples. One object per port; not reentrant. No heap, no clock. About 2 KiB.
///
/// Counters: `frames` are CAN frames. `ignored`: other PGNs, 11-bit identifiers, error and remote frames.
/// `unfinished`: fast packets that lost a frame. `no_data` are those of `records` that carry nothing.
class Nmea2000Codec {
 public:
  explicit Nmea2000Codec(const Nmea2000Config& config) : config_(config) {}

  /// Takes one byte; true when it completed a record. O(1).
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample);
  /// What else the last byte completed: frames behind a damaged one.
  [[nodiscard]] bool next(base::NavSample& sample);
  /// The port was closed and opened again: forgets what is half here.
  void restart();

  [[nodiscard]] const CodecCounters& counters() const { return counters_; }
  /// The frame of the last record, until the next byte: for whoever shows what navigation leaves.
  [[nodiscard]] FrameView frame() const { return framer_.last_frame(); }

 private:
  [[nodiscard]] bool take(const CanFrame& frame, base::TimeUs t_us, base::NavSample& sample);
  [[nodiscard]] bool take_message(std::uint32_t pgn, const std::uint8_t* data,
                                  std::size_t size_bytes, base::TimeUs t_us,
                                  base::NavSample& sample);

  Nmea2000Config config_;
  Framer<4 * kCanFrame_bytes> framer_{0};
  FastPackets fast_packets_;
  CodecCounters counters_{};
};

}  // namespace leadline::hal
