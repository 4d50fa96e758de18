// A Ping1D altimeter from the outside: settings, free-running pings, distance and profile on request or
// as a stream. From bluerobotics/ping-protocol src/definitions/ping1d.json.
#pragma once

#include <cstdint>
#include <functional>

#include "hal/emu/ping_device.hpp"

namespace leadline::emu {

/// One transmission, as the world is asked about it.
struct Ping1dShot {
  base::TimeUs t_transmit_us;
  std::int64_t listen_from_ns;  ///< two-way time of the scan's start
  std::int64_t listen_to_ns;    ///< and of its end
  int samples;                  ///< equal parts of it, for the profile
};

/// What comes back. The device makes a distance of it with the sound speed that it is set to.
struct Ping1dEcho {
  std::int64_t two_way_ns = 0;  ///< 0: nothing
  int confidence_percent = 0;
  Bytes intensity;  ///< up to `samples`; the rest is 0
};

struct EmulatedPing1dConfig {
  PingIdentity identity{1, 1, 1, {3, 29, 0}, {1, 0, 0}};
  std::int64_t byte_time_ns = 0;     ///< per byte on the line (115200 baud: 86806)
  std::int64_t answer_delay_us = 0;  ///< from a request, or the end of a ping, to the first byte
  int samples = 200;
  /// The protocol says "most recent measurement" (false). True: a request for one waits for the next.
  bool answers_with_next = false;
};

class EmulatedPing1d final : public PingDeviceEmulator {
 public:
  using Measure = std::function<Ping1dEcho(const Ping1dShot&)>;

  /// `measure` is called once per ping, in order of time, when the ping is transmitted or later.
  EmulatedPing1d(const EmulatedPing1dConfig& config, Measure measure);

  [[nodiscard]] std::uint32_t ping_number() const { return latest_.number; }
  [[nodiscard]] bool mode_auto() const { return mode_auto_; }
  [[nodiscard]] std::uint32_t scan_start_mm() const { return scan_start_mm_; }
  [[nodiscard]] std::uint32_t scan_length_mm() const { return scan_length_mm_; }
  [[nodiscard]] std::uint32_t sound_speed_mm_s() const { return sound_speed_mm_s_; }
  [[nodiscard]] unsigned ping_interval_ms() const { return ping_interval_ms_; }
  [[nodiscard]] unsigned gain_setting() const { return gain_; }

 private:
  struct Measurement {
    std::uint32_t number;
    std::uint32_t distance_mm;
    std::uint32_t scan_start_mm;
    std::uint32_t scan_length_mm;
    unsigned confidence_percent;
    unsigned gain;
    Bytes intensity;
  };

  bool handle(base::TimeUs now_us, unsigned id, const Bytes& payload) override;
  bool answer_request(base::TimeUs now_us, unsigned id) override;
  void run(base::TimeUs now_us) override;
  [[nodiscard]] base::TimeUs own_event_us() const override;
  void power_on(base::TimeUs now_us) override;

  bool set(base::TimeUs now_us, unsigned id, const Bytes& payload);
  void begin_ping();
  void end_ping();
  void send_measurement(base::TimeUs t_us, unsigned id);

  EmulatedPing1dConfig config_;
  Measure measure_;
  bool mode_auto_ = true;
  bool enabled_ = true;
  bool streaming_ = false;
  std::uint32_t scan_start_mm_ = 0;
  std::uint32_t scan_length_mm_ = 0;
  std::uint32_t sound_speed_mm_s_ = 0;
  unsigned ping_interval_ms_ = 0;
  unsigned gain_ = 0;
  base::TimeUs t_next_ping_us_ = 0;
  base::TimeUs t_ping_end_us_ = kNever_us;  ///< of the ping under way
  Measurement under_way_{};
  Measurement latest_{};
  std::vector<unsigned> waiting_;  ///< ids asked for, answered by the next measurement
};

}  // namespace leadline::emu
