// Kongsberg EM survey multibeams: raw ranges and angles, attitude, position and sound speed profile, from the
// older datagrams (".all") and the newer ones (".kmall"), as files hold them: each datagram with its
// length in front. Listened to; nothing is sent. Little-endian.
//
//   .all    length u32, STX 02, type u8, model u16, date u32 (yyyymmdd), time u32 (ms of the day), counter
//           u16, serial u16, ..., ETX 03, sum u16 of the bytes between STX and ETX
//           'N' raw range and angle 78, 'A' attitude, 'P' position, 'U' sound speed profile
//   .kmall  length u32, "#xyz", version u8, system u8, sounder u16, seconds u32, nanoseconds u32, ...,
//           length u32 again
//           #MRZ, #SKM, #SPO, #SVP; sizes inside are the datagram's own, so longer future ones are read too
//
// Direction. A beam is the angle from the receiver's array, port positive, and the tilt of the
// transmitter's sector, forward positive, both about arrays that lie level in the mount:
//   v_FRD = (sin tilt, -sin angle, sqrt(1 - sin^2 tilt - sin^2 angle))
// Angles of installation (and the two receivers of a dual head) are the mounts' boresights: pings of the
// second receiver carry mount + 1. Rotation keeps the beam's along axis fore and aft.
//
// Range and time. range_um = sound speed at the head * two-way time / 2. t_transmit is the datagram's clock
// plus the sector's delay, t_receive the beam's own echo; without `device_clock` the arrival of the
// datagram's first byte less the longest two-way time.
//
// Samples. take_sample() gives those of the last datagram, one for each reading (#SKM and 'A' hold about a
// hundred): drain it after every feed() and next(). Roll is positive starboard down, pitch bow up; heave is
// positive down on the wire too (in both .all recordings the transducer's depth less the heave is constant).
//
// Not used: 'X' and 'D' (soundings that were reduced already), water column, seabed image. #MRZ that came in
// parts over UDP (numOfDgms > 1) is counted as ignored. Facts: Kongsberg's descriptions of both formats;
// layout and signs checked on four recordings (EM2045, EM2040 dual, two EM2040 of the newer kind).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/ping.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

inline constexpr std::size_t kMaxKongsbergBeams = 1024;
inline constexpr std::size_t kMaxKongsbergReadings = 512;
inline constexpr std::size_t kMaxKongsbergProfile = 512;
/// Longest datagram taken.
inline constexpr std::size_t kMaxKongsbergDatagram_bytes = 81'920;

struct KongsbergConfig {
  std::uint16_t mount = 0;           ///< of the first receiver; the second has one more
  bool device_clock = true;          ///< times from the datagrams instead of their arrival
  std::int64_t clock_offset_us = 0;  ///< added to the device's clock (microseconds since 1970)
  /// ".all": serial number whose pings are those of the second receiver; 0: there is one only.
  std::uint16_t second_serial = 0;
  /// Pings with a sound speed outside are rejected. Inclusive.
  std::int32_t min_sound_speed_mm_s = 1'300'000;
  std::int32_t max_sound_speed_mm_s = 1'700'000;
};

/// What the last ping leaves out of base::Ping.
struct KongsbergBeam {
  std::uint32_t ping_number;
  std::uint16_t serial;  ///< of the head (.all); sounder id (.kmall)
  std::uint16_t beam;    ///< index in the datagram
  std::int64_t two_way_ns;
};

struct KongsbergSpeed {
  std::int64_t depth_um;
  std::int32_t speed_mm_s;
};

/// Bytes to pings (kRange, one per beam with a valid detection; 255 by phase, 170 by amplitude) and samples.
/// Beams without one count as no_data. One object per port; not reentrant; copyable. No heap, no clock;
/// about 460 KiB: for Linux, not for a microcontroller. O(1) per byte plus O(datagram).
class KongsbergCodec {
 public:
  explicit KongsbergCodec(const KongsbergConfig& config);

  /// As R2SonicCodec::feed() and next().
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping);
  [[nodiscard]] bool next(base::Ping& ping);
  /// The next sample of the datagrams fed so far. Samples not taken before the next feed() are lost.
  [[nodiscard]] bool take_sample(base::NavSample& sample);

  void restart();

  [[nodiscard]] const CodecCounters& counters() const { return counters_; }
  [[nodiscard]] const KongsbergBeam& beam() const { return about_; }
  /// The profile that the head works with, depths as sent; thinned to kMaxKongsbergProfile points.
  [[nodiscard]] const KongsbergSpeed* profile() const { return profile_.data(); }
  [[nodiscard]] std::size_t profile_count() const { return profile_count_; }

 private:
  struct Beam {
    std::int64_t two_way_ns;
    std::int32_t delay_us;
    std::int32_t sin_forward_q30;
    std::int32_t sin_starboard_q30;
    std::uint16_t index;
    std::uint8_t quality;
  };
  struct Reading {
    base::TimeUs t_us;
    base::Attitude attitude;
    std::int64_t heave_um;
  };

  [[nodiscard]] bool take_beam(base::Ping& ping);
  [[nodiscard]] bool next_datagram(base::Ping& ping);
  void open(const FrameBytes& frame);
  void open_all(const FrameBytes& frame);
  void open_kmall(const FrameBytes& frame);
  [[nodiscard]] bool take_raw78(const FrameBytes& frame);
  [[nodiscard]] bool take_attitude(const FrameBytes& frame);
  [[nodiscard]] bool take_position(const FrameBytes& frame);
  [[nodiscard]] bool take_profile(const FrameBytes& frame);
  [[nodiscard]] bool take_mrz(const FrameBytes& frame);
  [[nodiscard]] bool take_mrz_beams(const FrameBytes& frame, std::size_t sectors_at,
                                    std::size_t sectors, std::size_t sector_bytes);
  [[nodiscard]] bool take_skm(const FrameBytes& frame);
  [[nodiscard]] bool take_spo(const FrameBytes& frame);
  [[nodiscard]] bool take_svp(const FrameBytes& frame);
  void add_beam(const Beam& beam);
  [[nodiscard]] bool set_sound_speed(std::int64_t speed_mm_s);
  void set_place(std::int64_t latitude_e9deg, std::int64_t longitude_e9deg, std::int64_t sigma_mm);
  void start_ping(const FrameBytes& frame, base::TimeUs t_device_us);
  [[nodiscard]] base::TimeUs sample_time(const FrameBytes& frame, base::TimeUs t_device_us) const;

  KongsbergConfig config_;
  Framer<kMaxKongsbergDatagram_bytes> framer_;
  CodecCounters counters_{};
  KongsbergBeam about_{};

  std::array<Beam, kMaxKongsbergBeams> beams_{};
  std::size_t beam_count_ = 0;
  std::size_t next_beam_ = 0;
  base::TimeUs t_transmit_us_ = 0;
  base::TimeUs t_device_us_ = 0;
  std::int32_t sound_speed_mm_s_ = 0;
  std::uint16_t mount_ = 0;

  std::array<Reading, kMaxKongsbergReadings> readings_{};
  std::size_t reading_count_ = 0;
  std::size_t next_reading_ = 0;
  base::NavSample place_{};
  bool has_place_ = false;

  std::array<KongsbergSpeed, kMaxKongsbergProfile> profile_{};
  std::size_t profile_count_ = 0;
};

}  // namespace leadline::hal
