// Ping360 scanning sonar (Blue Robotics), Ping protocol over a serial line or UDP.
//
// Direction. The head turns its beam in one plane, in 400 steps (gradians). Here that is the plane of
// the mount's forward and right axes: angle `forward_grad` (200, the side away from the cable) looks
// along the mount's forward axis, and angles grow from forward to right (`clockwise`, seen from above),
//   azimuth = +-(angle - forward_grad) / 400 turn,  elevation = 0.
// The mount's boresight turns that plane: with boresight pitch -90 deg the head is a vertical profiler
// across the track, angle 200 straight down, 300 to starboard, 100 to port. The beam is a fan, wide
// along the head's axis: that is the `along` axis of the beam's localization table.
// UNSURE: the sense of rotation is not stated by the protocol; hence the option.
//
// Range. Every frame says how it was measured, and only that is believed (settings of before may still
// be under way after a change). Sample i is centred (i + 1/2) sample periods of 25 ns ticks behind the
// transmission; lengths use the configured sound speed. Bins whose centre is nearer than min_range_um
// (ring-down) or farther than max_range_um are left out of the record.
//
// Time. Taken for granted: the head turns, transmits, listens for number_of_samples periods, and answers
// at once. Hence
//   t_transmit = arrival of the last byte - transmission of the frame - samples * period
//   t_receive  = end of listening, until a detector knows better.
//
// Facts: bluerobotics/ping-protocol src/definitions/ping360.json; limits and the pulse rule as the
// makers advise (bluerobotics/ping-viewer src/sensor/ping360).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/heads/ping_protocol.hpp"
#include "hal/heads/ping_session.hpp"
#include "model/base/ping.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

inline constexpr std::int32_t kPing360Turn_grad = 400;

/// Plain integers; zero-initialized is not a configuration, take the defaults.
struct Ping360Config {
  std::uint16_t mount = 0;        ///< copied into every ping
  std::uint8_t device_id = 0;     ///< listen to this source only; 0: any
  std::uint8_t gain_setting = 1;  ///< 0 low, 1 normal, 2 high
  bool clockwise = true;          ///< angles grow from the mount's forward to its right axis
  /// 0: the head scans by itself (auto_transmit; firmware above 3.3.0, else polled without a pause).
  std::int32_t poll_interval_us = 0;
  std::int32_t forward_grad = 200;
  /// First and last angle of the sector, taken modulo 400, in the direction of growing angles, so that
  /// 350 .. 50 passes 0. Polled, a sector is swept to and fro, a full turn round and round.
  std::int32_t scan_first_grad = 0;
  std::int32_t scan_last_grad = 399;
  std::int32_t scan_step_grad = 1;   ///< 1 .. 10
  std::int32_t frequency_khz = 750;  ///< 500 .. 1000, useful 650 .. 850
  std::int32_t max_samples = 1200;   ///< 200 .. 1200; fewer make shorter frames on slow lines
  std::int64_t min_range_um = 750'000;
  std::int64_t max_range_um = 50'000'000;
  std::int32_t sound_speed_mm_s = 1'500'000;  ///< of the water, 1'300'000 .. 1'700'000
  std::int32_t byte_time_ns = 0;  ///< per byte on the line (115200 baud: 86806); 0: in the latency
};

/// What a range asks of the head.
struct Ping360Settings {
  std::uint16_t transmit_duration_us;  ///< 5 .. 500
  std::uint16_t sample_period_ticks;   ///< of 25 ns, 80 .. 40000
  std::uint16_t number_of_samples;     ///< 200 .. 1200
};

/// Settings for listening out to `range_um` (limited to what the head can do) with up to
/// `max_samples`: the most samples at the shortest period that reaches there, less what rounding to
/// whole ticks takes off (below 1/80). The pulse grows with the range (8 s/km over c), is at least 2.5
/// sample periods and at most 64. O(1).
[[nodiscard]] Ping360Settings ping360_settings(std::int64_t range_um, std::int32_t sound_speed_mm_s,
                                               std::int32_t max_samples);

/// Bytes to pings (kProfile, quality 255, intensities widened to 16 bits as they are), and the requests
/// that keep the head scanning. One object per port; not reentrant. No heap, no clock. About 9 KiB.
class Ping360Codec : public PingHead<Ping360Codec> {
 public:
  /// Values outside their range are limited to it.
  explicit Ping360Codec(const Ping360Config& config);

  /// Bytes that the head is owed now: 0, or one whole request. To be called every cycle. Start-up: motor
  /// off (ends a scan that an earlier host left running), protocol version, device information; then
  /// one request per beam, or one for the whole scan. Silence (five requests, or four seconds of a
  /// scan) starts over; five frames in a row with other settings ask for the scan again.
  [[nodiscard]] std::size_t request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity);

  [[nodiscard]] bool running() const { return step_ == Step::kPoll || step_ == Step::kAuto; }
  [[nodiscard]] const Ping360Settings& settings() const { return settings_; }

 private:
  friend PingHead<Ping360Codec>;
  enum class Step : std::uint8_t { kStop, kVersion, kDevice, kPoll, kAuto };

  [[nodiscard]] bool take(const PingFrame& frame, base::Ping& ping);
  [[nodiscard]] bool take_data(const PingFrame& frame, base::Ping& ping);
  [[nodiscard]] bool take_profile(const PingFrame& frame, std::size_t data_offset,
                                  base::Ping& ping);
  void answered(const PingFrame& frame, std::uint16_t samples);
  [[nodiscard]] bool holds(const std::uint8_t* payload, std::uint16_t samples) const;
  void take_device();
  void take_ack(const PingFrame& frame);
  void take_nack(const PingFrame& frame);
  void advance(Step step);
  void begin_again();
  void give_up();
  void next_beam();
  [[nodiscard]] std::int32_t beam_grad() const;
  [[nodiscard]] std::int64_t timeout_us(base::TimeUs now_us) const;
  [[nodiscard]] std::size_t write_step(std::uint8_t* out, std::size_t capacity) const;
  [[nodiscard]] std::size_t write_beam(std::uint8_t* out, std::size_t capacity) const;
  [[nodiscard]] std::size_t write_scan(std::uint8_t* out, std::size_t capacity) const;

  Ping360Config config_;
  Ping360Settings settings_;
  std::int32_t span_grad_ = 0;  ///< of the sector; 400: full turn
  Step step_ = Step::kStop;
  std::uint8_t mismatches_ = 0;   ///< frames in a row with other settings
  std::int32_t offset_grad_ = 0;  ///< of the next beam from the sector's first
  bool backwards_ = false;
  bool has_angle_ = false;  ///< where the head stands is known
  std::int32_t angle_grad_ = 0;
  base::TimeUs t_heard_us_ = 0;  ///< last data
  std::array<std::uint16_t, kMaxPingSamples> intensity_{};
};

}  // namespace leadline::hal
