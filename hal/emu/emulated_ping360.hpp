// A Ping360 scanning sonar from the outside: turns, transmits, listens, answers; by request or by itself.
// From bluerobotics/ping-protocol src/definitions/ping360.json; motor times as observed by
// bluerobotics/ping-viewer.
#pragma once

#include <cstdint>
#include <functional>

#include "hal/emu/ping_device.hpp"

namespace leadline::emu {

/// One transmission, as the world is asked about it. Sample i covers the two-way times
/// i * sample_period_ns .. (i + 1) * sample_period_ns.
struct Ping360Shot {
  base::TimeUs t_transmit_us;
  int angle_grad;  ///< 0 .. 399, 200 is away from the cable
  std::int64_t sample_period_ns;
  int samples;
  int transmit_duration_us;
  int frequency_khz;
  int gain_setting;
};

struct EmulatedPing360Config {
  PingIdentity identity{2, 2, 1, {3, 3, 1}, {1, 0, 0}};
  std::int64_t byte_time_ns = 0;     ///< per byte on the line (115200 baud: 86806)
  std::int64_t answer_delay_us = 0;  ///< from a request, or the end of listening, to the first byte
  std::int64_t step_us = 6'000;      ///< motor, per gradian
  std::int64_t homing_us = 3'000'000;  ///< extra, when the motor was off
  std::int64_t idle_us = 30'000'000;   ///< without work the motor goes off
};

class EmulatedPing360 final : public PingDeviceEmulator {
 public:
  /// Intensities of a shot, up to `samples`; the rest is 0.
  using Measure = std::function<Bytes(const Ping360Shot&)>;

  /// `measure` is called once per transmission, in order of time.
  EmulatedPing360(const EmulatedPing360Config& config, Measure measure);

  [[nodiscard]] int angle_grad() const { return angle_grad_; }
  [[nodiscard]] bool scanning() const { return state_ != State::kIdle && automatic_; }
  [[nodiscard]] std::uint64_t shots() const { return shots_; }
  /// Requests that came while it was busy and were lost, as on the half-duplex line.
  [[nodiscard]] std::uint64_t missed() const { return missed_; }

 private:
  enum class State : std::uint8_t { kIdle, kTurning, kListening };
  struct Settings {
    unsigned gain;
    unsigned transmit_us;
    unsigned period_ticks;
    unsigned frequency_khz;
    unsigned samples;
  };

  bool handle(base::TimeUs now_us, unsigned id, const Bytes& payload) override;
  bool answer_request(base::TimeUs now_us, unsigned id) override;
  void run(base::TimeUs now_us) override;
  [[nodiscard]] base::TimeUs own_event_us() const override { return t_event_us_; }
  void power_on(base::TimeUs now_us) override;

  void transducer(base::TimeUs now_us, const Bytes& payload);
  void auto_transmit(base::TimeUs now_us, const Bytes& payload);
  void turn_to(base::TimeUs now_us, int angle_grad);
  void transmit();
  void answer();
  [[nodiscard]] int next_angle();
  [[nodiscard]] Bytes data_payload(const Bytes& data) const;

  EmulatedPing360Config config_;
  Measure measure_;
  State state_ = State::kIdle;
  bool automatic_ = false;
  bool transmits_ = false;
  bool motor_on_ = false;
  int angle_grad_ = 0;
  int start_grad_ = 0;
  int stop_grad_ = 0;
  int steps_grad_ = 1;
  int delay_ms_ = 0;
  int direction_ = 1;
  Settings settings_{};
  Bytes data_;
  base::TimeUs t_event_us_ = kNever_us;
  base::TimeUs t_work_us_ = 0;
  std::uint64_t shots_ = 0;
  std::uint64_t missed_ = 0;
};

}  // namespace leadline::emu
