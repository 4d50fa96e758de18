// PD0 ensembles of Teledyne RDI's Doppler instruments (WorkHorse, Navigator, Explorer, Pathfinder,
// RiverPro, ...) and of others that speak it. Every intact ensemble makes exactly one record of kind
// kVelocity, and what its leaders know besides comes behind it through next().
//
//   0x7F 0x7F, u16 size without the checksum, u8, u8 n, u16 offset[n], n blocks that begin with their
//   u16 id, u16 sum of all bytes. Little-endian. Used are the fixed leader (0x0000), the variable leader
//   (0x0080) and bottom track (0x0600); water profiles and what other programs put in are left.
//
// | record | fields |
// |---|---|
// | velocity | of the vehicle: kNavVelocityBody, in earth coordinates kNavVelocityWorld; none where bottom
// |          track is absent or bad (-32768) |
// | altitude | mean of the four vertical ranges, or of an opposite pair; only where there is one |
// | attitude | roll, pitch, heading, UTC as the instrument's clock has it |
// | depth | only where the leader says that a depth sensor was used |
// | water | sound speed as set or computed, temperature |
//
// Frames. PD0 states the velocity of the bottom past the instrument (the other sign than PD4 and PD6), so
// the vehicle's is its negative; shown on the track of a real transect beside GNSS. Instrument axes are x to
// starboard, y forward (beam 3), z up, beams positive towards the transducer:
//
//   x = c (b1 - b2) / (2 sin a)   y = c (b4 - b3) / (2 sin a)   z = (b1 + b2 + b3 + b4) / (4 cos a)
//
// with the angle a and c = -1 for concave heads, both from the fixed leader; an instrument that looks up
// is rolled by 180 degrees. Beam 3's angle to the bow (EA) turns beam and instrument frames into the
// vehicle's. Ship coordinates are level where the instrument applied its tilts: they are turned back into
// the body's, with P = atan(tan(pitch) cos(roll)) as the instrument does it. One bad beam of four is made
// up (no error velocity) where the leader allows three-beam solutions.
//
// Pitch of the attitude record is the tilt sensor's, which is not quite the Euler angle:
// `euler_pitch` applies the formula above.
//
// Facts: rock-drivers/drivers-dvl_teledyne (layout); Teledyne RDI, ADCP Coordinate Transformation (2010).
#pragma once

#include <array>
#include <cstdint>

#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"

namespace leadline::hal {

enum class Pd0Frame : std::uint8_t { kBeam = 0, kInstrument = 1, kShip = 2, kEarth = 3 };

/// A velocity or range that the instrument did not get.
inline constexpr std::int16_t kPd0BadVelocity = -32768;

/// What the last ensemble said, as it stands on the wire.
struct Pd0Ensemble {
  std::uint32_t number;
  std::int64_t utc_us;  ///< since 1970; 0: no date
  std::uint16_t heading_cdeg;
  std::int16_t pitch_cdeg;
  std::int16_t roll_cdeg;
  std::uint16_t sound_speed_m_s;
  std::uint16_t depth_dm;
  std::int16_t temperature_cdegc;
  Pd0Frame frame;
  bool looks_up;
  bool convex;
  std::uint8_t beam_angle_deg;  ///< from the vertical; 0: not known
  std::int16_t alignment_cdeg;  ///< of beam 3, clockwise from the bow
  bool has_bottom_track;
  std::array<std::int16_t, 4> velocity_mm_s;  ///< of the bottom, in `frame`; kPd0BadVelocity: none
  std::array<std::uint32_t, 4> range_cm;      ///< vertical; 0: none
};

struct Pd0Config {
  bool true_heading = false;       ///< the compass is corrected (EB, gyro); otherwise magnetic
  bool velocity_of_bottom = true;  ///< false: the sender states the vehicle's velocity
  bool euler_pitch = false;        ///< attitude records carry the Euler angle
  std::int32_t byte_time_ns = 0;   ///< per byte on the line; 0: in the port's latency
};

/// Bytes to samples. One object per port; not reentrant. No heap, no clock; 41 kB.
class Pd0Codec {
 public:
  static constexpr std::size_t kMaxEnsemble_bytes = 8192;
  static constexpr std::size_t kMaxBlocks = 64;

  explicit Pd0Codec(const Pd0Config& config) : config_(config) {}

  /// Takes one byte; true when an ensemble is whole: `sample` is its velocity, the other records come
  /// through next(). O(1) per byte, O(ensemble) at its end.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample);
  [[nodiscard]] bool next(base::NavSample& sample);
  /// The port was closed and opened again.
  void restart();
  /// Of the last velocity record; zero before the first.
  [[nodiscard]] const Pd0Ensemble& ensemble() const { return ensemble_; }
  [[nodiscard]] const CodecCounters& counters() const { return counters_; }

 private:
  static constexpr std::size_t kMaxRecords = 4;  ///< behind the velocity

  void take(const FrameBytes& frame, base::NavSample& sample);
  void queue(const base::NavSample& sample);

  Pd0Config config_;
  Framer<kMaxEnsemble_bytes> framer_{kMaxGap_us};
  CodecCounters counters_{};
  Pd0Ensemble ensemble_{};
  std::array<base::NavSample, kMaxRecords> queued_{};
  std::size_t queued_count_ = 0;
  std::size_t queued_next_ = 0;

  static constexpr base::TimeUs kMaxGap_us = 500'000;
};

}  // namespace leadline::hal
