// All devices of the emulated vehicle, each at its own port, and the world that they measure. Time and
// bytes are passed in and out: who flies the fleet carries them through ptys, datagrams or memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "hal/emu/emulated_device.hpp"
#include "hal/emu/faulty_stream.hpp"
#include "hal/emu/nmea_talker.hpp"
#include "hal/emu/ping_device.hpp"
#include "host_tools/emulate/instruments.hpp"
#include "host_tools/emulate/mission.hpp"
#include "host_tools/emulate/port_devices.hpp"
#include "host_tools/emulate/trajectory.hpp"

namespace leadline::host {

/// Serial lines of all devices.
inline constexpr std::uint32_t kFleetBaud = 115'200;
inline constexpr std::int64_t kFleetByteTime_ns = 86'806;
/// From the instant of a measurement to the first byte about it.
inline constexpr std::int64_t kAttitudeLatency_us = 8'000;
inline constexpr std::int64_t kFixLatency_us = 60'000;
inline constexpr std::int64_t kPressureLatency_us = 20'000;

/// What the world did to the pings. Never decremented.
struct FleetCounters {
  std::uint64_t pings = 0;
  std::uint64_t echoes = 0;  ///< of these, heard from the ground
  std::uint64_t outliers = 0;
  std::uint64_t dropouts = 0;
};

/// Names of the ports in their order: the heads, then attitude, fix, pressure; or navigation, where they share a
/// line.
[[nodiscard]] std::vector<std::string> fleet_ports(const Mission& mission);

class Fleet : public PortDevices {
 public:
  /// Builds the ground and flies the trajectory once. Throws HostError (see build_ground) and
  /// kUsage for a plan that cannot be flown.
  explicit Fleet(const Mission& mission);

  [[nodiscard]] const Mission& mission() const { return mission_; }
  [[nodiscard]] const Terrain& ground() const { return ground_; }
  [[nodiscard]] const Trajectory& trajectory() const { return trajectory_; }
  [[nodiscard]] const std::vector<std::string>& port_names() const { return names_; }
  [[nodiscard]] const FleetCounters& counters() const { return counters_; }
  [[nodiscard]] const TouchedMask& touched() const { return touched_; }
  /// What was done to the bytes of all ports together.
  [[nodiscard]] emu::FaultCounters faults() const;

  /// The vehicle sets out here; before, the devices run and it waits.
  [[nodiscard]] base::TimeUs t_start_us() const { return t_start_us_; }
  /// The survey is over and the heads go off.
  [[nodiscard]] base::TimeUs t_survey_end_us() const;
  [[nodiscard]] std::size_t port_count() const override { return names_.size(); }
  [[nodiscard]] base::TimeUs t_end_us() const override;
  [[nodiscard]] base::TimeUs next_us(base::TimeUs now_us) const override;
  void advance(base::TimeUs now_us, std::vector<emu::Bytes>* bytes) override;
  void take(std::size_t port, base::TimeUs now_us, const std::uint8_t* data,
            std::size_t size_bytes) override;

 private:
  struct Line {
    std::unique_ptr<emu::EmulatedDevice> device;
    emu::PingDeviceEmulator* head = nullptr;  ///< the same, where it is a sonar head
    emu::FaultyStream faults;
    std::size_t port = 0;
    bool by_sentence = false;  ///< shares the port: sentences go out whole
    emu::Bytes begun;          ///< of the next sentence
  };

  void add_line(std::unique_ptr<emu::EmulatedDevice> device, emu::PingDeviceEmulator* head);
  void add_altimeter(std::size_t number);
  void add_scanner(std::size_t number);
  void add_navigation();
  Heard ping(std::size_t number, base::TimeUs t_us, double azimuth_deg);

  Mission mission_;
  Terrain ground_;
  Trajectory trajectory_;
  TouchedMask touched_;
  std::vector<std::unique_ptr<Sounder>> sounders_;
  NavigationSensors sensors_;
  base::TimeUs t_start_us_;
  std::vector<std::string> names_;
  std::vector<Line> lines_;
  FleetCounters counters_;
};

}  // namespace leadline::host
