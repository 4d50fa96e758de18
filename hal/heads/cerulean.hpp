// Cerulean Sonar's heads: Surveyor 240-16 and Omniscan 3D (multibeam, points), Omniscan 450 (side scan,
// intensities), S500 (echo sounder). Ping protocol over TCP, UDP or a serial line. A .svlog recording is the
// same bytes. One codec reads all of them: their measurements have different message ids.
//
// Points (Surveyor atof_point_data 3012, yz_point_data 3011; Omniscan os3d_point_set 3104). One record per
// point, kRange, in a fan that looks down (beam_angles.hpp). A point is an angle and a two-way time:
// range = time * c / 2 with the c of the message, which also made the angles and goes into
// sound_speed_mm_s. A Surveyor may send both of its messages: yz points are read until the first atof
// message, and never twice the same ping number. Signs: y of yz points is positive to port (stated); the
// makers' example turns atof angles into y by the sine, so they are taken as positive to port too
// (UNSURE, option); those of the Omniscan 3D are positive to starboard (stated). Omniscan points carry a
// kind: water column points are left out; firmware known today calls every point unclassified, hence
// kBottom alone is no default. Quality of an Omniscan point is its power against the three thresholds of
// the message: 255, 170, 85 or, below the lowest, 40; other points have 255.
//
// Intensities (Omniscan 450 os_mono_profile 2198, S500 profile6 1308): kProfile. The wire has decibels, in
// 65535 equal parts between min_pwr_db and max_pwr_db; the record has the amplitude 10^(dB/20), 65535 at
// full_scale_mdb (0: at the message's own max_pwr_db, so that no bin saturates). S500 ranges (distance2
// 1223, and profile6 when `profile` is false) are made with a sound speed that the device is set to.
//
// Attitude (attitude_report 504: "up" in axes forward, port, up): samples of kind kAttitude with roll
// (starboard down positive) and pitch (bow up positive), of the head, not of the vehicle. Both documents
// agree on the vector and only call opposite senses of pitch positive; `bow_up_is_positive_x` false is for
// a head that proves otherwise. Water temperature (118): kWater. Its pressure is not used: the protocol
// does not say whether it is absolute.
//
// Time. Device stamps are milliseconds since power-up and, once it was told, of UTC; they go into the
// samples' t_device_us and utc_us. Taken for granted: the head listens to the end of its range, then
// answers at once:
//   t_transmit = arrival of the last byte - listening time,
// which is listening_sec of 3012, the range of the last end_ping_info (3010) for 3104, the range of a
// profile; for yz points and distance2 the longest two-way time itself. t_receive = t_transmit + two-way
// time (kRange), end of listening (kProfile).
//
// Conversation. Switched on by its ping parameters, repeated after silence_us without a measurement;
// utc_request is answered from set_utc_offset(), and left unanswered until that was called; stop() switches
// it off, again every second while measurements still come.
//
// Facts: bluerobotics/ping-protocol src/definitions/{surveyor240,omniscan3d,omniscan450,s500}.json.
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

/// Which head is asked. kListen: none, nothing is ever sent.
enum class CeruleanHead : std::uint8_t {
  kListen = 0,
  kSurveyor = 1,
  kOmniscan3d = 2,
  kOmniscan450 = 3,
  kS500 = 4,
};

/// Which points of an Omniscan 3D become records.
enum class CeruleanPoints : std::uint8_t { kAll = 0, kNoWaterColumn = 1, kBottom = 2 };

inline constexpr std::size_t kMaxCeruleanPoints = 1024;  ///< of one message
inline constexpr std::size_t kMaxCeruleanBins = 6000;    ///< of one profile: the S500's limit
/// Longest payload that is looked at: an Omniscan 3D point set.
inline constexpr std::size_t kMaxCeruleanPayload_bytes = 80 + 16 * kMaxCeruleanPoints;

struct CeruleanConfig {
  CeruleanHead head = CeruleanHead::kListen;
  std::uint16_t mount = 0;  ///< of channel 0; further channels of a head have the numbers behind it
  std::uint8_t device_id = 0;  ///< listen to this source only; 0: any
  bool profile = true;         ///< S500: intensities; false: the device's own range
  bool atof_positive_to_port = true;
  bool bow_up_is_positive_x = true;
  CeruleanPoints points = CeruleanPoints::kNoWaterColumn;
  /// S500: a range below this confidence is no return. Percent, 0 .. 100.
  std::uint8_t min_confidence_percent = 0;
  std::int16_t gain_index = -1;         ///< -1: automatic
  std::int32_t ping_interval_ms = 100;  ///< 1 .. 32767
  std::int32_t silence_us = 3'000'000;  ///< without measurements: start again
  std::int64_t min_range_um = 0;        ///< start of the range asked for
  std::int64_t max_range_um = 0;        ///< its end; 0: the head follows the bottom (S500: as well)
  std::int32_t range_steps = 400;  ///< Surveyor 200 .. 800, Omniscan 3D .. 1000; bins of the 450
  std::int32_t full_scale_mdb =
      0;  ///< power of amplitude 65535, millidecibel; 0: each profile's own
  std::int32_t sound_speed_mm_s = 1'500'000;  ///< told to the head, 1'300'000 .. 1'700'000
  /// Direction of the single beam of an S500 or Omniscan 450, mount's frame; down unless told otherwise.
  base::Bam32 azimuth_bam32 = 0;
  base::Bam32 elevation_bam32 = base::kBam32QuarterTurn;
};

/// Bytes to pings and samples, and the requests that keep the head going. One object per port; not
/// reentrant. No heap, no clock. O(1) per byte, O(points) or O(bins) per message. About 115 KiB.
class CeruleanCodec {
 public:
  static constexpr std::size_t kMaxRequest_bytes = 48;  ///< a smaller buffer gets nothing

  /// Values outside their range are limited to it.
  explicit CeruleanCodec(const CeruleanConfig& config);

  /// Takes one byte; true when there is a record. The others of the same message come from next(), which
  /// may be left undrained without losing any.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::Ping& ping);
  [[nodiscard]] bool next(base::Ping& ping);
  /// See nav_queue.hpp.
  [[nodiscard]] bool take_sample(base::NavSample& sample) { return samples_.take(sample); }

  /// Bytes that the head is owed now: 0, or one whole request. To be called every cycle.
  [[nodiscard]] std::size_t request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity);
  /// UTC since 1970 less vehicle time, and what it is good for. From then on utc_request is answered.
  void set_utc_offset(std::int64_t offset_us, std::uint32_t accuracy_ms);
  /// Switches the head off for good (until restart()).
  void stop();

  /// The port was closed and opened again: forgets half a frame and starts over.
  void restart();

  [[nodiscard]] bool running() const { return step_ == Step::kRun; }
  [[nodiscard]] const CodecCounters& counters() const { return counters_; }

 private:
  enum class Step : std::uint8_t { kStart, kSpeed, kRun, kStop };
  struct Point {
    base::Bam32 to_starboard_bam32;
    std::uint32_t two_way_ns;
    std::uint32_t range_um;
    std::uint8_t quality;
  };
  /// What all points of a message share.
  struct Set {
    base::TimeUs t_arrival_us = 0;
    std::int64_t listening_us = 0;
    std::int32_t sound_speed_mm_s = 0;
    std::uint16_t mount = 0;
    std::uint16_t count = 0;
    std::uint16_t next = 0;
  };
  struct Profile {
    const std::uint8_t* results;
    std::int64_t count;
    std::int64_t start_mm;
    std::int64_t length_mm;
    std::int64_t min_mdb;
    std::int64_t max_mdb;
    std::int32_t sound_speed_mm_s;
    std::uint16_t channel;
  };

  [[nodiscard]] bool take(const FrameBytes& frame, base::Ping& ping);
  [[nodiscard]] bool take_measurement(const FrameBytes& frame, std::uint16_t id, base::Ping& ping);
  [[nodiscard]] bool take_other(const FrameBytes& frame, std::uint16_t id);
  [[nodiscard]] bool take_atof(const FrameBytes& frame);
  [[nodiscard]] bool take_os3d(const FrameBytes& frame);
  [[nodiscard]] bool take_yz(const FrameBytes& frame);
  [[nodiscard]] bool add_point(std::int64_t to_starboard_bam, std::int64_t two_way_ns,
                               std::int64_t longest_ns, std::uint8_t quality);
  [[nodiscard]] bool begin_set(const FrameBytes& frame, std::uint32_t speed_bits);
  [[nodiscard]] bool take_distance2(const FrameBytes& frame, base::Ping& ping);
  [[nodiscard]] bool take_profile6(const FrameBytes& frame, base::Ping& ping);
  [[nodiscard]] bool take_mono_profile(const FrameBytes& frame, base::Ping& ping);
  [[nodiscard]] bool take_profile(const FrameBytes& frame, const Profile& profile,
                                  base::Ping& ping);
  void set_range(std::int64_t range_um, std::uint8_t confidence_percent, base::Ping& ping) const;
  [[nodiscard]] bool take_attitude(const FrameBytes& frame);
  [[nodiscard]] bool take_water(const FrameBytes& frame);
  [[nodiscard]] bool take_end_ping(const FrameBytes& frame);
  [[nodiscard]] base::Ping single_beam(const FrameBytes& frame, std::int32_t sound_speed_mm_s,
                                       std::int64_t farthest_um) const;
  [[nodiscard]] bool deliver_point(base::Ping& ping);
  [[nodiscard]] std::size_t write_parameters(bool enable, std::uint8_t* out,
                                             std::size_t capacity) const;
  [[nodiscard]] std::size_t write_utc(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity);

  CeruleanConfig config_;
  CodecCounters counters_{};
  Framer<kMaxCeruleanPayload_bytes + 10> framer_;
  NavQueue samples_;
  Set set_;
  std::array<Point, kMaxCeruleanPoints> points_{};
  std::array<std::uint16_t, kMaxCeruleanBins> intensity_{};
  Step step_ = Step::kStart;
  base::TimeUs t_sent_us_ = 0;
  bool waiting_ = false;  ///< parameters were sent at t_sent_us_ and nothing came since
  bool heard_ = false;    ///< a measurement came since the last request()
  base::TimeUs t_heard_us_ = 0;
  bool utc_asked_ = false;
  bool knows_utc_ = false;
  std::int64_t utc_offset_us_ = 0;
  std::uint32_t utc_accuracy_ms_ = 0;
  bool has_atof_ = false;
  bool has_yz_ = false;
  std::uint32_t yz_ping_ = 0;      ///< number of the last yz message that was used
  std::int64_t end_range_um_ = 0;  ///< of the last end_ping_info
};

}  // namespace leadline::hal
