// Ping1D / Ping2 altimeter (Blue Robotics), Ping protocol over a serial line or UDP.
//
// Direction. One beam; the configuration says where it looks in the mount's frame, by default along
// the mount's down axis: an altimeter on an unrotated mount looks straight down.
//
// Distance. The device counts time and multiplies by its own sound speed. The codec sets that to
// kPing1dSoundSpeed_mm_s once and for ever and scales every length by the configured speed over it, so
// that a log can be replayed with a better one.
//
// Time. Taken for granted: the device transmits, listens until an echo from scan_start + scan_length
// could have come back, and answers at once. Hence
//   t_transmit = arrival of the last byte - transmission of the frame - 2 (scan_start + scan_length) / c
//   t_receive  = t_transmit + 2 distance / c   (kRange), end of listening (otherwise)
// with the device's c, and the transmission from byte_time_ns. That holds where the device runs free
// (poll_interval_us 0: every profile is sent when it is measured). Polled, it answers with its most
// recent measurement, which may be as old as its ping interval (the codec sets it to the poll
// interval): belongs into the port's latency, half of it as the mean.
//
// Facts: bluerobotics/ping-protocol src/definitions/{common,ping1d}.json.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "hal/heads/ping_protocol.hpp"
#include "hal/heads/ping_session.hpp"
#include "model/base/ping.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

inline constexpr std::int32_t kPing1dSoundSpeed_mm_s = 1'500'000;

/// Plain integers; zero-initialized is not a configuration, take the defaults.
struct Ping1dConfig {
  std::uint16_t mount = 0;     ///< copied into every ping
  std::uint8_t device_id = 0;  ///< listen to this source only; 0: any
  bool profile = false;        ///< true: kProfile records; false: the device's own range
  /// A range below this confidence, or of none at all, is no return. Percent, 0 .. 100.
  std::uint8_t min_confidence_percent = 0;
  std::uint8_t gain_setting = 3;  ///< 0 .. 6; fixed, since automatic mode would also move the range
  /// Drop answers that carry the measurement of the answer before (same number, same values). False
  /// for decoding a file.
  bool drop_repeats = true;
  /// For decoding a file: ranges of no confidence are ranges (of quality 0), and distance_simple, which says neither
  /// number nor scan, is taken as well.
  bool every_range = false;
  std::int32_t poll_interval_us = 100'000;  ///< 0: the device runs free and sends profiles
  std::int64_t min_range_um = 500'000;      ///< ranges below are no return, quality 0
  std::int64_t max_range_um = 50'000'000;   ///< ranges above are no return
  std::int32_t sound_speed_mm_s = kPing1dSoundSpeed_mm_s;  ///< of the water, 1'300'000 .. 1'700'000
  std::int32_t byte_time_ns = 0;  ///< per byte on the line (115200 baud: 86806); 0: in the latency
  base::Bam32 azimuth_bam32 = 0;
  base::Bam32 elevation_bam32 = base::kBam32QuarterTurn;
};

/// Bytes to pings, and the requests that keep the device talking. One object per port; not reentrant.
/// No heap, no clock. About 9 KiB.
///
/// Records:
/// * kRange: 0 < range, within [min_range_um, max_range_um], confidence > 0; quality = confidence
///   scaled to 255
/// * kNoReturn: otherwise. Quality 255, but 0 where something answered from nearer than min_range_um:
///   that is no proof of free water
/// * kProfile: intensities of a profile message, widened to 16 bits, as they are; quality 255; bins
///   are equal parts of the scan; t_receive_us is the end of listening, until a detector knows better
class Ping1dCodec : public PingHead<Ping1dCodec> {
 public:
  /// Values outside their range are limited to it.
  explicit Ping1dCodec(const Ping1dConfig& config);

  /// Bytes that the device is owed now: 0, or one whole request. To be called every cycle. Nothing is
  /// sent while an answer is due (a damaged one is asked for again at once). Start-up: protocol version, device information, then the settings,
  /// each read back; from then on the poll. Settings that do not hold after three tries are counted and
  /// left. Five requests without an answer, a measurement number that goes back, and five measurements
  /// over another scan than the one that held start over.
  [[nodiscard]] std::size_t request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity);

  /// True once the settings are through and measurements are asked for.
  [[nodiscard]] bool running() const { return step_ == Step::kRun; }

 private:
  friend PingHead<Ping1dCodec>;
  /// In the order of the start-up.
  enum class Step : std::uint8_t {
    kVersion,
    kDevice,
    kManual,
    kRange,
    kSoundSpeed,
    kInterval,
    kGain,
    kStart,
    kRun
  };
  /// A setting and its read-back.
  struct Setting {
    std::uint16_t set_id;
    std::uint16_t read_id;
    std::uint8_t set_bytes;
    std::uint8_t read_bytes;
    std::uint8_t value[8];  ///< little-endian; the first set_bytes, read_bytes of it
  };

  [[nodiscard]] Setting setting() const;
  [[nodiscard]] bool take(const PingFrame& frame, base::Ping& ping);
  [[nodiscard]] bool take_measurement(const PingFrame& frame, base::Ping& ping);
  [[nodiscard]] bool plausible(const PingFrame& frame) const;
  [[nodiscard]] bool wants_bins(const PingFrame& frame) const;
  void begin_ping(base::TimeUs t_sent_us, std::int64_t scan_end_mm, base::Ping& ping) const;
  [[nodiscard]] bool take_simple(const PingFrame& frame, base::Ping& ping);
  void take_range(std::uint32_t distance_mm, std::uint32_t confidence_percent,
                  base::Ping& ping) const;
  void take_profile(const std::uint8_t* payload, base::Ping& ping);
  void take_setting(const PingFrame& frame);
  void take_device();
  void take_nack(const PingFrame& frame);
  void measured(const PingFrame& frame);
  void advance();
  void begin_again();
  void give_up();
  [[nodiscard]] std::int64_t timeout_us() const;
  [[nodiscard]] std::uint32_t scan_start_mm() const;
  [[nodiscard]] std::uint32_t scan_length_mm() const;
  [[nodiscard]] std::size_t write_step(std::uint8_t* out, std::size_t capacity) const;
  [[nodiscard]] std::int64_t scaled_um(std::int64_t device_um) const;

  Ping1dConfig config_;
  Step step_ = Step::kVersion;
  std::uint8_t tries_ = 0;       ///< of the setting under way
  std::uint8_t mismatches_ = 0;  ///< measurements in a row with another scan than the one that held
  bool range_held_ = false;      ///< the scan read back as set
  bool has_last_ = false;
  std::array<std::uint8_t, 24> last_{};  ///< fixed part of the last measurement
  std::array<std::uint16_t, kMaxPingSamples> intensity_{};
};

}  // namespace leadline::hal
