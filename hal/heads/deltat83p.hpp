// Imagenex DeltaT multibeam (837B): "83P" profile packets, as sent over UDP and as written to .83P files.
//
// A packet is a header of 256 bytes, one u16 range per beam and, if byte 117 says so, one u16 intensity
// per beam; big-endian but for two floats. It is listened to: nothing is asked. There is no checksum; a
// packet must have the length that its beams need, its version, its date and time as text, and settings
// that a DeltaT has.
//
// Records: one per beam in a fan that looks down (beam_angles.hpp); beam i is at start + i * increment,
// positive to starboard (UNSURE: an option). Range = counts * resolution, which the packet makes with
// 1500 m/s whatever its sound speed field says (maker's format of 16 March 2010). 0 counts: kNoReturn.
// Quality 255: the scale of the intensities is not documented.
// Flag bit 0 (byte 123) says that the beams are already corrected for roll: option_flags() shows it, for
// whoever would correct them again. The tilt angle (byte 89) is the mount's business.
//
// Samples: kAttitude from the head's own sensor, fields by their valid bits, signs options (UNSURE:
// nothing says which way is positive; heading is magnetic unless told otherwise); kPosition when the
// header carries the ship's position. External sensors (bytes 128 ..) are the vehicle's own: not read.
//
// Time. t_transmit = arrival - (data latency - ping latency) where the packet has both (not in files), else
// arrival - two-way time of the range. The header's date and time go into t_device_us.
//
// Facts: maker's description as printed in MB-System mbsys_image83p.h; LSTS/dune Imagenex837B;
// rolker/imagenex_deltat (its little-endian floats are not needed here).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/codec.hpp"
#include "hal/heads/nav_queue.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/ping.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

inline constexpr std::size_t kMaxDeltatBeams = 480;
inline constexpr std::size_t kDeltatHeader_bytes = 256;
inline constexpr std::int32_t kDeltatSoundSpeed_mm_s = 1'500'000;

struct Deltat83pConfig {
  std::uint16_t mount = 0;
  bool positive_to_starboard = true;
  bool roll_positive = true;   ///< as sent: starboard down positive
  bool pitch_positive = true;  ///< as sent: bow up positive
  bool heading_is_true = false;
};

/// Bytes to pings and samples. One object per port; not reentrant. No heap, no clock. O(1) per byte,
/// O(beams) per packet. About 14 KiB.
class Deltat83pCodec {
 public:
  explicit Deltat83pCodec(const Deltat83pConfig& config);

  /// The further beams of a packet come from next(), which may be left undrained without losing any.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping);
  [[nodiscard]] bool next(base::Ping& ping);
  /// See nav_queue.hpp.
  [[nodiscard]] bool take_sample(base::NavSample& sample) { return samples_.take(sample); }
  void restart();

  /// Byte 123 of the last packet.
  [[nodiscard]] std::uint8_t option_flags() const { return option_flags_; }
  [[nodiscard]] const CodecCounters& counters() const { return counters_; }

 private:
  [[nodiscard]] bool deliver(base::Ping& ping);
  void take(const FrameBytes& frame);
  void take_attitude(const std::uint8_t* header, base::TimeUs t_us);
  void take_position(const std::uint8_t* header, base::TimeUs t_us);

  Deltat83pConfig config_;
  CodecCounters counters_{};
  Framer<kDeltatHeader_bytes + 4 * kMaxDeltatBeams> framer_;
  NavQueue samples_;
  std::array<std::uint16_t, kMaxDeltatBeams> counts_{};
  base::TimeUs t_transmit_us_ = 0;
  std::int64_t listening_us_ = 0;
  std::int32_t start_cdeg_ = 0;
  std::int32_t increment_cdeg_ = 0;
  std::int32_t resolution_mm_ = 0;
  std::uint16_t beam_count_ = 0;
  std::uint16_t next_beam_ = 0;
  std::uint8_t option_flags_ = 0;
};

}  // namespace leadline::hal
