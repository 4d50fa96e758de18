// Every emulated device at ten times its usual rate, on three vehicles, lines that lose bytes and break at
// random: in the end everything that came in is accounted for, to the byte and to the record, and memory is what
// it was. 20 s of the vehicles' time; LEADLINE_SENSOR_SOAK_S=600: as long as that takes on the clock at the wall
// (toolchain/soak.sh --sensors). Kongsberg heads have no emulator.
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "firmware/pipeline/host_report.hpp"
#include "hal/emu/emulated_cerulean.hpp"
#include "hal/emu/emulated_deltat.hpp"
#include "hal/emu/emulated_imagenex.hpp"
#include "hal/emu/emulated_ping1d.hpp"
#include "hal/emu/emulated_ping360.hpp"
#include "hal/emu/emulated_r2sonic.hpp"
#include "hal/emu/emulated_tritech.hpp"
#include "hal/emu/emulated_wl3d.hpp"
#include "hal/emu/faulty_stream.hpp"
#include "hal/emu/keller_sensor.hpp"
#include "hal/emu/mavlink_autopilot.hpp"
#include "hal/emu/nmea2000_bus.hpp"
#include "hal/emu/nmea_talker.hpp"
#include "hal/emu/pd0_dvl.hpp"
#include "hal/emu/talker.hpp"
#include "hal/emu/trax_sensor.hpp"
#include "hal/emu/tss1_sensor.hpp"
#include "hal/emu/vectornav_sensor.hpp"
#include "hal/emu/wl_dvl.hpp"
#include "hal/emu/xsens_sensor.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using namespace leadline::emu;  // NOLINT: all of its devices
using leadline::base::TimeUs;
using leadline::firmware::CycleOutput;
using leadline::firmware::Driver;
using leadline::firmware::HostReport;
using leadline::firmware::Vehicle;
using leadline::firmware::VehicleConfig;
using leadline::test::configure_rig;
using leadline::test::drain;
using leadline::test::Random;
using leadline::test::RecordedChunk;
using leadline::test::RecordedCycle;
using leadline::test::rig_config;
using leadline::test::run_cycle;

constexpr TimeUs kCycle_us = 20'000;
constexpr double kRange_m = 15;
constexpr double kTwoWay_s = 2 * kRange_m / 1500;
constexpr double kPi = 3.14159265358979323846;

double seconds(TimeUs t_us) { return static_cast<double>(t_us) * 1e-6; }

Motion motion_at(TimeUs t_us) {
  const double t = seconds(t_us);
  Motion motion;
  motion.roll_deg = 4.0 * std::sin(2.0 * kPi * t / 5.0);
  motion.pitch_deg = 2.0 * std::sin(2.0 * kPi * t / 7.0);
  motion.heading_deg = 10.0;
  motion.depth_m = 2.0;
  motion.altitude_m = kRange_m;
  motion.time_s = 100.0 + t;
  return motion;
}

using Device = std::unique_ptr<EmulatedDevice>;

struct Port {
  Driver driver;
  int variant_plus_1;
  Device device;
};

/// A sensor that sends `message` `hz` times a second.
Port talks(Driver driver, double hz, std::function<Bytes(const Motion&)> message) {
  TalkerRow row{[message = std::move(message)](TimeUs t) { return message(motion_at(t)); },
                static_cast<std::int64_t>(1e6 / hz), 1'000};
  return {driver, 0, std::make_unique<Talker>(TalkerConfig{}, std::vector<TalkerRow>{row})};
}

Bytes lit(int size) {
  Bytes bytes(static_cast<std::size_t>(size), 3);
  for (std::size_t i = bytes.size() / 2; i < bytes.size() / 2 + 3 && i < bytes.size(); ++i) {
    bytes[i] = 120;
  }
  return bytes;
}

/// Attitude at 200 Hz, fixes at 50 Hz, pressure at 100 Hz.
Port navigation() {
  NmeaTalkerConfig config;
  config.schedule = {{NmeaKind::kPashr, 5'000, 300},
                     {NmeaKind::kGga, 20'000, 1'100},
                     {NmeaKind::kPrvatPressure, 10'000, 1'700}};
  return {Driver::kNmea, 0, std::make_unique<NmeaTalker>(config, [](TimeUs t_us) {
            const Motion motion = motion_at(t_us);
            NmeaTruth truth;
            truth.roll_deg = motion.roll_deg;
            truth.pitch_deg = motion.pitch_deg;
            truth.heading_deg = motion.heading_deg;
            truth.latitude_deg = 47.5;
            truth.longitude_deg = 9.25;
            truth.pressure_pa = 101325.0 + 1029.0 * 9.80665 * motion.depth_m;
            truth.time_of_day_s = 36000.0 + seconds(t_us);
            return truth;
          })};
}

Port altimeter() {
  return {Driver::kPing1d, 0,
          std::make_unique<EmulatedPing1d>(EmulatedPing1dConfig{}, [](const Ping1dShot& shot) {
            Ping1dEcho echo;
            echo.two_way_ns = static_cast<std::int64_t>(kTwoWay_s * 1e9);
            echo.confidence_percent = 95;
            echo.intensity = lit(shot.samples);
            return echo;
          })};
}

std::vector<Port> asked_heads() {
  std::vector<Port> ports;
  ports.push_back(altimeter());
  ports.push_back(navigation());
  ports.push_back(
      {Driver::kPing360, 0,
       std::make_unique<EmulatedPing360>(
           EmulatedPing360Config{}, [](const Ping360Shot& shot) { return lit(shot.samples); })});
  ports.push_back(
      {Driver::kCerulean, 2,
       std::make_unique<EmulatedCerulean>(EmulatedCeruleanConfig{}, [](const CeruleanShot&) {
         CeruleanEcho echo;
         for (int i = -20; i <= 20; ++i) {
           echo.points.push_back({0.02 * i, kTwoWay_s, 50.0, 1});
         }
         return echo;
       })});
  ports.push_back(
      {Driver::kImagenex, 2,
       std::make_unique<EmulatedImagenex>(EmulatedImagenexConfig{}, [](const ImagenexShot& shot) {
         ImagenexEcho echo;
         echo.intensity = lit(shot.points);
         echo.found_m = kRange_m;
         return echo;
       })});
  ports.push_back(
      {Driver::kTritech, 2,
       std::make_unique<EmulatedTritech>(
           EmulatedTritechConfig{}, [](const SeanetShot& shot) { return lit(shot.bins); },
           [](const SeanetShot&) { return kTwoWay_s; })});
  ports.push_back(
      {Driver::kTrax, 0, std::make_unique<EmulatedTrax>(TraxSensorConfig{}, motion_at)});
  ports.push_back(
      {Driver::kKeller, 0, std::make_unique<KellerSensor>(KellerSensorConfig{}, [](TimeUs) {
         return KellerTruth{1.2, 12};
       })});
  return ports;
}

std::vector<Port> multibeams() {
  std::vector<Port> ports;
  EmulatedDeltatConfig deltat;
  deltat.interval_us = 10'000;
  ports.push_back(
      {Driver::kDeltat83p, 0, std::make_unique<EmulatedDeltat>(deltat, [](const DeltatShot& shot) {
         DeltatEcho echo;
         echo.range_m.assign(static_cast<std::size_t>(shot.beams), kRange_m);
         return echo;
       })});
  ports.push_back(navigation());
  EmulatedR2SonicSettings r2sonic;
  r2sonic.period_us = 5'000;
  r2sonic.two_way_s = [](TimeUs, double) { return kTwoWay_s; };
  ports.push_back({Driver::kR2sonic, 0, std::make_unique<EmulatedR2Sonic>(r2sonic)});
  EmulatedWl3dConfig wl3d;
  wl3d.interval_us = 20'000;
  wl3d.width = 64;
  wl3d.height = 16;
  ports.push_back({Driver::kWl3d, 0,
                   std::make_unique<EmulatedWl3d>(wl3d, [](const Wl3dShot&) { return 10.0; })});
  ports.push_back(talks(Driver::kVectornav, 400, vectornav_common));
  ports.push_back(talks(Driver::kXsens, 1000, [](const Motion& motion) {
    return xsens_mtdata2(motion, XsensOrientation::kQuaternion);
  }));
  ports.push_back(
      talks(Driver::kTss1, 250, [](const Motion& motion) { return tss1_line(motion); }));
  ports.push_back(
      talks(Driver::kPd0, 50, [](const Motion& motion) { return pd0_ensemble(motion, {}); }));
  return ports;
}

std::vector<Port> buses() {
  std::vector<Port> ports;
  ports.push_back(altimeter());
  ports.push_back(navigation());
  ports.push_back(
      talks(Driver::kWldvl, 150, [](const Motion& motion) { return wldvl_velocity(motion); }));
  ports.push_back(talks(Driver::kMavlink, 500, [](const Motion& motion) {
    return mavlink_attitude(MavlinkPeer{}, motion);
  }));
  ports.push_back(talks(Driver::kNmea2000, 100, [](const Motion& motion) {
    N2kTruth truth;
    truth.motion = motion;
    return n2k_truth(127'257, 7, truth);
  }));
  return ports;
}

/// One vehicle and what is at its ports.
class Ship {
 public:
  Ship(Vehicle& vehicle, std::vector<Port> ports, std::uint64_t seed)
      : vehicle_(vehicle), ports_(std::move(ports)), random_(seed) {
    VehicleConfig config = rig_config();
    config.cycle_voxel_budget = 100'000;
    config.port_count = static_cast<std::uint16_t>(ports_.size());
    for (std::size_t i = 0; i < ports_.size(); ++i) {
      auto& port = config.ports[i];
      port.driver = ports_[i].driver;
      port.variant_plus_1 = ports_[i].variant_plus_1;
      port.mount = is_head(port.driver) ? 0 : leadline::firmware::kNoMount;
      port.min_range_um = 500'000;
      port.max_range_um = 40'000'000;
      port.ping_interval_us = 10'000;
      port.scan_last_grad = 399;
      port.scan_step_grad = 2;
      FaultConfig fault;
      fault.seed = seed + i;
      fault.drop_ppm = 20;
      fault.corrupt_ppm = 20;
      fault.repeat_ppm = 20;
      fault.disconnect_at_byte = next_break();
      lines_.emplace_back(fault);
      plugged_us_.push_back(0);
    }
    report_.port_count = static_cast<std::uint8_t>(ports_.size());
    configure_rig(vehicle_, config);
  }

  void cycle(TimeUs t_us) {
    RecordedCycle cycle{t_us, 100'000, {}};
    bool changed = false;
    for (std::size_t i = 0; i < ports_.size(); ++i) {
      Bytes sent;
      ports_[i].device->advance(t_us, sent);
      changed = plug(i, t_us) || changed;
      Bytes arrived;
      lines_[i].pass(t_us, sent, arrived);
      given_[i] += arrived.size();
      // A chunk holds 65535 bytes.
      for (std::size_t at = 0; at < arrived.size(); at += 4096) {
        const auto first = arrived.begin() + static_cast<std::ptrdiff_t>(at);
        const auto size =
            static_cast<std::ptrdiff_t>(std::min<std::size_t>(4096, arrived.size() - at));
        cycle.chunks.push_back({static_cast<std::uint8_t>(i), t_us, {first, first + size}});
      }
    }
    if (changed) {
      std::vector<std::uint8_t> bytes(leadline::firmware::kMaxHostReport_bytes);
      bytes.resize(encode_host_report(report_, bytes.data(), bytes.size()));
      cycle.chunks.insert(cycle.chunks.begin(),
                          {leadline::firmware::kHostPort, t_us, std::move(bytes)});
    }
    const CycleOutput output = run_cycle(vehicle_, cycle);
    for (std::size_t i = 0; i < ports_.size(); ++i) {
      const auto& request = output.device_requests[i];
      if (request.size_bytes != 0 && lines_[i].connected()) {
        ports_[i].device->take(t_us, request.data, request.size_bytes);
      }
    }
  }

  /// In = fused + shed + rejected, exactly.
  void check(TimeUs t_us) {
    assert_true(drain(vehicle_, t_us, 20'000));
    const auto& counters = vehicle_.counters();
    std::uint64_t given = 0;
    std::uint64_t taken = counters.bytes_over_limit;
    std::uint64_t records = 0;
    std::uint64_t rejected = 0;
    for (std::size_t i = 0; i < ports_.size(); ++i) {
      given += given_[i];
      taken += counters.ports[i].bytes;
      records += counters.ports[i].records;
      rejected += counters.ports[i].rejected;
      std::printf("  %-10s %10llu bytes %9llu records %6llu rejected %4llu breaks\n",
                  driver_name(ports_[i].driver),
                  static_cast<unsigned long long>(counters.ports[i].bytes),
                  static_cast<unsigned long long>(counters.ports[i].records),
                  static_cast<unsigned long long>(counters.ports[i].rejected),
                  static_cast<unsigned long long>(lines_[i].counters().disconnects));
      assert_true(counters.ports[i].records > 0);
    }
    std::uint64_t lost = 0;
    for (const std::uint64_t count : counters.pings_lost) {
      lost += count;
    }
    std::uint64_t in_model = 0;
    for (const std::uint64_t count : vehicle_.model().counters().pings) {
      in_model += count;
    }
    std::printf(
        "  pings in %llu = mapped %llu + lost %llu (shed %llu); samples %llu; frames rejected "
        "%llu; bytes over the limit %llu\n",
        static_cast<unsigned long long>(counters.pings_in),
        static_cast<unsigned long long>(counters.pings_mapped),
        static_cast<unsigned long long>(lost),
        static_cast<unsigned long long>(counters.pings_lost[0]),
        static_cast<unsigned long long>(counters.nav_samples),
        static_cast<unsigned long long>(rejected),
        static_cast<unsigned long long>(counters.bytes_over_limit));
    assert_int_equal(given, taken);
    assert_int_equal(records, counters.pings_in + counters.nav_samples);
    assert_int_equal(counters.pings_pending, 0);
    assert_int_equal(counters.pings_in, counters.pings_mapped + lost);
    assert_int_equal(counters.pings_mapped, in_model);
    assert_true(counters.pings_mapped > 100);
  }

 private:
  std::uint64_t next_break() { return static_cast<std::uint64_t>(random_.between(5'000, 100'000)); }

  // Lines that broke are plugged in again a while later. True: something changed.
  bool plug(std::size_t i, TimeUs t_us) {
    if (lines_[i].connected()) {
      plugged_us_[i] = t_us;
      const bool changed = report_.port_open[i] == 0;
      report_.port_open[i] = 1;
      return changed;
    }
    if (t_us - plugged_us_[i] < random_.between(200'000, 3'000'000)) {
      const bool changed = report_.port_open[i] == 1;
      report_.port_open[i] = 0;
      return changed;
    }
    lines_[i].reconnect(lines_[i].counters().bytes_in + next_break());
    report_.port_open[i] = 1;
    ++report_.opens[i];
    plugged_us_[i] = t_us;
    return true;
  }

  Vehicle& vehicle_;
  std::vector<Port> ports_;
  Random random_;
  std::vector<FaultyStream> lines_;
  std::vector<TimeUs> plugged_us_;
  std::uint64_t given_[leadline::firmware::kMaxPorts] = {};
  HostReport report_{};
};

long resident_kib() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("VmRSS:", 0) == 0) {
      return std::strtol(line.c_str() + 6, nullptr, 10);
    }
  }
  return 0;
}

long descriptors() {
  long count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    static_cast<void>(entry);
    ++count;
  }
  return count;
}

Vehicle vehicles[3];

TEST(all_sensors_at_ten_times_their_rate) {
  const char* const wanted = std::getenv("LEADLINE_SENSOR_SOAK_S");
  const double wall_s = wanted != nullptr ? std::strtod(wanted, nullptr) : 0.0;
  std::vector<std::unique_ptr<Ship>> ships;
  ships.push_back(std::make_unique<Ship>(vehicles[0], asked_heads(), 1));
  ships.push_back(std::make_unique<Ship>(vehicles[1], multibeams(), 2));
  ships.push_back(std::make_unique<Ship>(vehicles[2], buses(), 3));
  const auto start = std::chrono::steady_clock::now();
  const auto elapsed_s = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  };
  long warm_kib = 0;
  long warm_descriptors = 0;
  TimeUs t_us = 0;
  TimeUs next_report_us = 60'000'000;
  while (t_us < 20'000'000 || elapsed_s() < wall_s) {
    t_us += kCycle_us;
    for (auto& ship : ships) {
      ship->cycle(t_us);
    }
    if (t_us == 10'000'000) {
      warm_kib = resident_kib();
      warm_descriptors = descriptors();
    }
    if (t_us >= next_report_us) {
      next_report_us += 60'000'000;
      std::printf("reached %.0f s of the vehicles' time after %.0f s, %ld KiB, %ld descriptors\n",
                  seconds(t_us), elapsed_s(), resident_kib(), descriptors());
      std::fflush(stdout);
    }
  }
  std::printf("%.0f s of the vehicles' time; memory %ld -> %ld KiB, descriptors %ld -> %ld\n",
              seconds(t_us), warm_kib, resident_kib(), warm_descriptors, descriptors());
  assert_int_equal(descriptors(), warm_descriptors);
  // The tiles of the map that are first written later are pages that are first touched later.
  assert_true(resident_kib() - warm_kib < 4096 + warm_kib / 20);
  for (auto& ship : ships) {
    ship->check(t_us);
  }
}

}  // namespace
