// R2Sonic 2020/2022/2024/2026 survey multibeam: bathymetry packets ("BTH0"), listened to over UDP or
// taken from a recording. The head's controller sets it up; here nothing is sent.
//
// Packet, big-endian: "BTH0", total size u32, stream id u32, then sections {name u16, size u16, ...}, each
// padded to four bytes. Used: H0 (clock, ping number, sound speed at the head), R0 (two-way times), A0
// (equi-angular) or A2 (equi-distant) beam angles, I1 (intensities), Q0 (flags); the rest is stepped over.
//
// Direction. A beam's angle is counted across the track from straight below, starboard positive:
//   v_FRD = (0, sin angle, cos angle)                                  (hal/heads/beam_angles.hpp)
// Roll has not been applied to it. The projector's steering and the mount's tilt of H0 are not applied
// (0 wherever a head is mounted level; a tilted one is the mount's boresight).
//
// Range. range_um = sound speed of H0 * two-way time / 2, along a straight line: with a profile of the
// water estimator/refraction.hpp bends it, from `sound_speed_mm_s`, which goes along with each ping.
//
// Time. H0 stamps the transmission, seconds since 1970 (UTC when the head gets PPS and ZDA). With
// `device_clock` that is t_transmit, shifted by `clock_offset_us`; without, it is the arrival of the
// packet's first byte less the longest two-way time in it. t_receive is the beam's own echo.
//
// There is no checksum. A packet counts as intact when its sections add up to its size, H0 comes first
// with its own size, the sections hold as many points as H0 says, and no second packet begins inside.
//
// Facts: R2Sonic's own decoder (bathymetry packets), CIDCO MBES-lib. UNSURE: whether the sum of A2's steps
// includes the beam's own; the format note and the recording at hand say yes (its beams lie symmetric),
// one public decoder says no (`a2_inclusive`).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/codec.hpp"
#include "model/base/ping.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

inline constexpr std::size_t kMaxR2SonicBeams = 1024;
/// Longest packet taken: 1024 points in all sections, gates for each of them too.
inline constexpr std::size_t kMaxR2SonicPacket_bytes = 16'384;

/// Bits of R2SonicBeam::flags, as on the wire.
enum R2SonicFlag : std::uint8_t {
  kR2SonicBrightness = 1U << 0U,  ///< passed the brightness test
  kR2SonicColinear = 1U << 1U,    ///< passed the colinearity test
  kR2SonicMagnitude = 1U << 2U,   ///< bottom found by magnitude
  kR2SonicPhase = 1U << 3U,       ///< bottom found by phase
};

struct R2SonicConfig {
  std::uint16_t mount = 0;           ///< copied into every ping
  bool device_clock = true;          ///< times from the packet instead of its arrival
  bool a2_inclusive = true;          ///< A2: the beam's own step counts
  std::int64_t clock_offset_us = 0;  ///< added to the device's clock
  /// Packets with a sound speed outside are rejected. Inclusive.
  std::int32_t min_sound_speed_mm_s = 1'300'000;
  std::int32_t max_sound_speed_mm_s = 1'700'000;
};

/// What the last record leaves out of base::Ping.
struct R2SonicBeam {
  std::uint32_t ping_number;
  std::uint16_t beam;       ///< 0 .. N-1, from port to starboard
  std::uint16_t intensity;  ///< raw; times the scale of I1 micropascal; 0 without I1
  std::int64_t two_way_ns;
  std::int32_t angle_bam32;  ///< starboard positive
  std::uint8_t flags;        ///< R2SonicFlag; 0 without Q0
};

/// Bytes to pings, one per beam that found the bottom. quality: 255 when both tests were passed, 170 with
/// one, 85 with none; without Q0 255. Beams without a time, or with Q0 without a detection, make no record
/// and count as no_data. One object per port; not reentrant; copyable. O(1) per byte plus O(packet).
/// About 84 KiB.
class R2SonicCodec {
 public:
  explicit R2SonicCodec(const R2SonicConfig& config);

  /// Takes one byte. True: it completed a packet and `ping` is its first beam; the others follow from
  /// next(), until false. Beams not fetched before the next feed() are lost.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping);
  [[nodiscard]] bool next(base::Ping& ping);

  /// The port was closed and opened again.
  void restart();

  [[nodiscard]] const CodecCounters& counters() const { return counters_; }
  /// About the record that was delivered last.
  [[nodiscard]] const R2SonicBeam& beam() const { return beam_; }

 private:
  /// Where the sections lie in the packet; 0: not there.
  struct Sections {
    std::uint16_t ranges;
    std::uint16_t angles;
    std::uint16_t intensities;
    std::uint16_t flags;
    bool equidistant;
  };

  [[nodiscard]] bool next_packet(base::Ping& ping);
  [[nodiscard]] bool open(const FrameBytes& frame);
  [[nodiscard]] bool find_sections(const FrameBytes& frame);
  [[nodiscard]] bool read_header(const FrameBytes& frame);
  [[nodiscard]] bool read_scales();
  [[nodiscard]] bool take_beam(std::size_t index, base::Ping& ping);
  [[nodiscard]] std::int64_t two_way_ns(std::size_t index) const;
  [[nodiscard]] std::int64_t angle_bam32(std::size_t index);
  [[nodiscard]] std::uint8_t flags_of(std::size_t index) const;

  R2SonicConfig config_;
  Framer<kMaxR2SonicPacket_bytes> framer_;
  CodecCounters counters_{};
  R2SonicBeam beam_{};

  // The packet being handed out, copied here: the codec may be copied while it is open.
  std::array<std::uint8_t, kMaxR2SonicPacket_bytes> packet_{};
  Sections sections_{};
  std::size_t beam_count_ = 0;
  std::size_t next_beam_ = 0;  ///< beam_count_: none
  base::TimeUs t_transmit_us_ = 0;
  base::TimeUs t_device_us_ = 0;
  std::int32_t sound_speed_mm_s_ = 0;
  std::int64_t angle_first_bam_ = 0;   ///< Q12
  std::int64_t angle_factor_bam_ = 0;  ///< A0: last - first, Q12; A2: of one step, Q20
  std::uint32_t step_sum_ = 0;
  std::uint32_t ping_number_ = 0;
  std::uint8_t tail_bytes_ = 0;  ///< end of the last packet that looks like the start of another
};

}  // namespace leadline::hal
