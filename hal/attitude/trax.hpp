// PNI TRAX, TRAX2, TCM and SeaTRAX: heading, pitch, roll. One record (kAttitude) a measurement.
//
//   u16 size of the whole frame, u8 frame id, payload, CRC of 16 bits (XMODEM). Big-endian, 38400 8N1.
//   GetDataResp (5): u8 n, n times {u8 component, value}
//
// There is no start byte: a size whose CRC fits is all that marks a frame, and the search goes on byte by
// byte where it does not.
//
// The device is asked (request()): after power-up its line carries junk, so the codec says "stop" and asks
// three times for the module's name; when an answer has come it sets the components and either starts
// continuous output (with its interval) or polls. Silence starts all over. A device that was set up
// by others needs no request() to be decoded.
//
// Heading is clockwise from north (magnetic unless the device knows the declination), pitch positive bow
// up, roll positive starboard down. The distortion flag, if sent and set, halves the quality and leaves the
// heading out unless `keep_distorted`.
//
// UNSURE: unit of the rates (rad/s), their signs (right-handed about forward, right, down). Quaternions (component
// 77) are read over: no public source says in which order its four numbers stand.
//
// Facts: public drivers of TRAX and TCM (traxd, viewer-trax2, io_ahrs).
#pragma once

#include <array>
#include <cstdint>

#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"

namespace leadline::hal {

struct TraxConfig {
  bool true_heading = false;     ///< the device adds the declination
  bool keep_distorted = false;   ///< heading counts even while the device sees magnetic distortion
  bool poll = false;             ///< ask for each measurement; false: continuous output
  bool with_rates = false;       ///< also ask for rates (not all models have them)
  bool with_distortion = false;  ///< also ask for the distortion flag
  std::int64_t interval_us = 50'000;    ///< between measurements
  std::int64_t timeout_us = 500'000;    ///< an answer takes no longer
  std::int64_t silence_us = 2'000'000;  ///< without a measurement: start again
  std::int32_t byte_time_ns = 0;        ///< per byte on the line; 0: in the port's latency
};

/// Bytes to samples and back. One object per port; not reentrant. No heap, no clock.
class TraxCodec {
 public:
  static constexpr std::size_t kMaxFrame_bytes = 255;
  /// Most bytes that request() gives out at once.
  static constexpr std::size_t kMaxRequest_bytes = 24;

  explicit TraxCodec(const TraxConfig& config) : config_(config) {}

  /// Takes one byte; true when a record is there, further ones through next(). O(1) per byte, O(frame)
  /// at its end.
  [[nodiscard]] bool feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample);
  [[nodiscard]] bool next(base::NavSample& sample);
  /// Bytes that the device is owed now; 0 when none, or when `capacity` is below kMaxRequest_bytes. O(1).
  [[nodiscard]] std::size_t request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity);
  /// The port was closed and opened again: the device is set up anew.
  void restart();
  [[nodiscard]] const CodecCounters& counters() const { return counters_; }

 private:
  /// What is sent next.
  enum class Step : std::uint8_t {
    kStop,        ///< ends what an earlier host began
    kHello,       ///< the module's name, kHellos times, then its answer is waited for
    kComponents,  ///< not answered
    kInterval,    ///< continuous: answered
    kStart,       ///< continuous: not answered
    kRunning,
  };
  static constexpr std::uint8_t kHellos = 3;

  [[nodiscard]] bool take(const FrameBytes& frame, base::NavSample& sample);
  [[nodiscard]] bool take_data(const FrameBytes& frame, base::NavSample& sample);
  [[nodiscard]] bool take_component(std::uint8_t id, const std::uint8_t* value,
                                    base::NavSample& sample) const;
  [[nodiscard]] bool waits_for_answer() const;
  [[nodiscard]] std::size_t send_step(base::TimeUs now_us, std::uint8_t* out);
  [[nodiscard]] std::size_t send_hello(base::TimeUs now_us, std::uint8_t* out);
  [[nodiscard]] std::size_t send_poll(base::TimeUs now_us, std::uint8_t* out);
  [[nodiscard]] std::size_t components(std::uint8_t* out) const;
  [[nodiscard]] std::size_t interval(std::uint8_t* out) const;
  void start_over(base::TimeUs now_us);
  /// The next step, not before `wait_us`.
  void go_on(Step next_step, base::TimeUs now_us, std::int64_t wait_us);

  TraxConfig config_;
  Framer<2 * kMaxFrame_bytes> framer_{kMaxGap_us};
  CodecCounters counters_{};
  Step step_ = Step::kStop;
  std::uint8_t hellos_ = 0;
  bool begun_ = false;             ///< request() has been called
  bool answered_ = false;          ///< what the step before asked for has come
  bool measured_ = false;          ///< a measurement came since request() last looked
  bool polled_ = false;            ///< a measurement is owed
  base::TimeUs t_request_us_ = 0;  ///< the last call of request()
  base::TimeUs t_due_us_ = 0;      ///< nothing is sent before
  base::TimeUs t_polled_us_ = 0;
  base::TimeUs t_alive_us_ = 0;  ///< last measurement, or start of the wait for the first

  static constexpr base::TimeUs kMaxGap_us = 200'000;
};

}  // namespace leadline::hal
