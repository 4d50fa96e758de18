// Cerulean Sonar's heads from the outside: switched on by their ping parameters, they ping at the interval
// asked for and send what they heard; they ask for the time until somebody tells it.
// From bluerobotics/ping-protocol src/definitions/{surveyor240,omniscan3d,omniscan450,s500}.json.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "hal/emu/ping_device.hpp"

namespace leadline::emu {

enum class CeruleanModel : std::uint8_t { kSurveyor, kOmniscan3d, kOmniscan450, kS500 };

/// One transmission, as the world is asked about it.
struct CeruleanShot {
  base::TimeUs t_transmit_us;
  double start_m;
  double end_m;
  double sound_speed_m_s;  ///< that the host has set
  int bins;                ///< of a profile
};

/// What a head heard. Points for the multibeams, decibels for the others.
struct CeruleanEcho {
  struct Point {
    double angle_rad;  ///< in the head's own sense
    double two_way_s;
    double power;
    int kind;  ///< 0 unclassified, 1 bottom, 2 water column
  };
  std::vector<Point> points;
  std::vector<double> power_db;
  double distance_m = 0;
  int confidence_percent = 0;
  std::array<double, 3> up{0, 0, 1};  ///< forward, port, up axes
};

struct EmulatedCeruleanConfig {
  CeruleanModel model = CeruleanModel::kSurveyor;
  PingIdentity identity{1, 0, 1, {1, 0, 0}, {1, 0, 0}};
  std::int64_t byte_time_ns = 0;
  std::int64_t answer_delay_us = 0;  ///< from the end of listening to the first byte
  double auto_end_m = 20;            ///< end of the range when the head chooses
};

class EmulatedCerulean final : public PingDeviceEmulator {
 public:
  using Measure = std::function<CeruleanEcho(const CeruleanShot&)>;

  EmulatedCerulean(const EmulatedCeruleanConfig& config, Measure measure);

  [[nodiscard]] bool pinging() const { return pinging_; }
  [[nodiscard]] std::uint64_t shots() const { return shots_; }
  [[nodiscard]] std::uint64_t utc_ms() const { return utc_ms_; }  ///< as told; 0: never

 private:
  bool handle(base::TimeUs now_us, unsigned id, const Bytes& payload) override;
  bool answer_request(base::TimeUs now_us, unsigned id) override;
  void run(base::TimeUs now_us) override;
  [[nodiscard]] base::TimeUs own_event_us() const override { return t_ping_us_; }
  void power_on(base::TimeUs now_us) override;

  void set_parameters(base::TimeUs now_us, unsigned id, const Bytes& payload);
  void ping();
  void send_points(base::TimeUs t_us, const CeruleanShot& shot, const CeruleanEcho& echo);
  void send_profile(base::TimeUs t_us, const CeruleanShot& shot, const CeruleanEcho& echo);
  [[nodiscard]] std::uint64_t utc_at(base::TimeUs t_us) const;
  [[nodiscard]] std::uint32_t up_ms(base::TimeUs t_us) const;

  EmulatedCeruleanConfig config_;
  Measure measure_;
  base::TimeUs t_power_us_ = 0;
  base::TimeUs t_ping_us_ = kNever_us;
  std::int64_t interval_us_ = 100'000;
  double start_m_ = 0;
  double end_m_ = 0;
  double sound_speed_m_s_ = 1500;
  int bins_ = 0;
  unsigned report_ = 0;
  bool yz_ = false;
  bool atof_ = false;
  bool pinging_ = false;
  std::uint64_t utc_ms_ = 0;
  base::TimeUs t_utc_us_ = 0;
  std::uint64_t shots_ = 0;
};

}  // namespace leadline::emu
