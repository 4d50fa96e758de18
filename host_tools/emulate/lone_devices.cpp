#include "host_tools/emulate/lone_devices.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "hal/emu/emulated_cerulean.hpp"
#include "hal/emu/emulated_deltat.hpp"
#include "hal/emu/emulated_imagenex.hpp"
#include "hal/emu/emulated_ping1d.hpp"
#include "hal/emu/emulated_ping360.hpp"
#include "hal/emu/emulated_r2sonic.hpp"
#include "hal/emu/emulated_tritech.hpp"
#include "hal/emu/emulated_wl3d.hpp"
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
#include "host_tools/sim/exact_math.hpp"

namespace leadline::host {
namespace {

using emu::Bytes;
using emu::EmulatedDevice;
using firmware::Driver;
using Device = std::unique_ptr<EmulatedDevice>;

constexpr std::uint8_t kNoise = 4;
constexpr std::uint8_t kEcho = 220;
constexpr int kConfidence_percent = 95;
constexpr double kQuiet_db = 30.0;
constexpr double kLoud_db = 90.0;
constexpr double kAny_m = 1e6;
constexpr base::TimeUs kSecond_us = 1'000'000;
// 2026-11-22: what sensors with a calendar believe.
constexpr std::int64_t kUnix_s = 1'795'305'600;

// ---- What heads hear ----------------------------------------------------------------------------

/// Of a fan below: positive to starboard.
Vec3 across(double angle_rad) {
  const exact::SinCos angle = exact::sin_cos(angle_rad);
  return {0.0, angle.sin, angle.cos};
}

/// Of the 3-D camera that looks down with its top to the bow.
Vec3 camera(double yaw_deg, double pitch_deg) {
  const exact::SinCos yaw = exact::sin_cos(yaw_deg * exact::kRadPerDeg);
  const exact::SinCos pitch = exact::sin_cos(pitch_deg * exact::kRadPerDeg);
  return {pitch.sin, pitch.cos * yaw.sin, pitch.cos * yaw.cos};
}

/// Where an echo from `range_m` falls in `count` bins of `bin_m` from `first_m` on; count: nowhere.
std::size_t echo_bin(double range_m, double first_m, double bin_m, std::size_t count) {
  const double bin = std::floor((range_m - first_m) / bin_m);
  const bool inside = range_m > 0.0 && bin >= 0.0 && bin < static_cast<double>(count);
  return inside ? static_cast<std::size_t>(bin) : count;
}

Bytes intensities(double range_m, double first_m, double bin_m, int count) {
  Bytes bins(static_cast<std::size_t>(std::max(count, 0)), kNoise);
  const std::size_t echo = echo_bin(range_m, first_m, bin_m, bins.size());
  if (echo < bins.size()) {
    bins[echo] = kEcho;
  }
  return bins;
}

Device make_ping1d(std::size_t /*variant*/, const DeviceScene& scene) {
  const auto measure = [scene](const emu::Ping1dShot& shot) {
    const double to_m = 0.5e-9 * scene.sound_speed_m_s;
    const double first_m = static_cast<double>(shot.listen_from_ns) * to_m;
    const double last_m = static_cast<double>(shot.listen_to_ns) * to_m;
    const double range = scene.range_m(shot.t_transmit_us, across(0.0), last_m);
    emu::Ping1dEcho echo;
    if (range > 0.0 && range >= first_m) {
      echo.two_way_ns = std::llround(range / to_m);
      echo.confidence_percent = kConfidence_percent;
    }
    const double bin_m = (last_m - first_m) / std::max(shot.samples, 1);
    echo.intensity = intensities(range, first_m, bin_m, shot.samples);
    return echo;
  };
  return std::make_unique<emu::EmulatedPing1d>(emu::EmulatedPing1dConfig{}, measure);
}

Device make_ping360(std::size_t /*variant*/, const DeviceScene& scene) {
  constexpr int kAhead_grad = 200;
  constexpr double kRadPerGrad = exact::kPi / 200.0;
  const auto measure = [scene](const emu::Ping360Shot& shot) {
    const double bin_m =
        0.5e-9 * scene.sound_speed_m_s * static_cast<double>(shot.sample_period_ns);
    const Vec3 beam = across((shot.angle_grad - kAhead_grad) * kRadPerGrad);
    return intensities(scene.range_m(shot.t_transmit_us, beam, kAny_m), 0.0, bin_m, shot.samples);
  };
  return std::make_unique<emu::EmulatedPing360>(emu::EmulatedPing360Config{}, measure);
}

/// `to_starboard`: 1 where the head counts angles to starboard, -1 to port.
emu::CeruleanEcho cerulean_echo(const DeviceScene& scene, const emu::CeruleanShot& shot,
                                double to_starboard) {
  constexpr double kStep_rad = 0.02;
  constexpr int kPoints_each_side = 35;
  emu::CeruleanEcho echo;
  for (int i = -kPoints_each_side; i <= kPoints_each_side; ++i) {
    const double range =
        scene.range_m(shot.t_transmit_us, across(to_starboard * i * kStep_rad), shot.end_m);
    if (range > 0.0) {
      echo.points.push_back({i * kStep_rad, 2.0 * range / scene.sound_speed_m_s, 25.0, 1});
    }
  }
  const double bin_m = (shot.end_m - shot.start_m) / std::max(shot.bins, 1);
  echo.power_db.assign(static_cast<std::size_t>(std::max(shot.bins, 0)), kQuiet_db);
  echo.distance_m = scene.range_m(shot.t_transmit_us, across(0.0), shot.end_m);
  echo.confidence_percent = echo.distance_m > 0.0 ? kConfidence_percent : 0;
  const std::size_t bin = echo_bin(echo.distance_m, shot.start_m, bin_m, echo.power_db.size());
  if (bin < echo.power_db.size()) {
    echo.power_db[bin] = kLoud_db;
  }
  const emu::Motion motion = scene.motion(shot.t_transmit_us);
  const exact::SinCos roll = exact::sin_cos(motion.roll_deg * exact::kRadPerDeg);
  const exact::SinCos pitch = exact::sin_cos(motion.pitch_deg * exact::kRadPerDeg);
  echo.up = {pitch.sin, roll.sin * pitch.cos, roll.cos * pitch.cos};
  return echo;
}

Device make_cerulean(std::size_t variant, const DeviceScene& scene) {
  emu::EmulatedCeruleanConfig config;
  config.model = static_cast<emu::CeruleanModel>(variant - 1);
  config.auto_end_m = 2.0 * scene.bottom_m;
  // The makers' documents say so of the one, and draw the other.
  const double sense = config.model == emu::CeruleanModel::kOmniscan3d ? 1.0 : -1.0;
  return std::make_unique<emu::EmulatedCerulean>(
      config,
      [scene, sense](const emu::CeruleanShot& shot) { return cerulean_echo(scene, shot, sense); });
}

Device make_imagenex(std::size_t variant, const DeviceScene& scene) {
  emu::EmulatedImagenexConfig config;
  config.head = static_cast<emu::ImagenexHead>(variant - 1);
  const auto measure = [scene](const emu::ImagenexShot& shot) {
    emu::ImagenexEcho echo;
    echo.found_m =
        scene.range_m(shot.t_transmit_us, across(shot.angle_deg * exact::kRadPerDeg), shot.range_m);
    echo.intensity =
        intensities(echo.found_m, 0.0, shot.range_m / std::max(shot.points, 1), shot.points);
    const emu::Motion motion = scene.motion(shot.t_transmit_us);
    echo.roll_deg = motion.roll_deg;
    echo.pitch_deg = motion.pitch_deg;
    return echo;
  };
  return std::make_unique<emu::EmulatedImagenex>(config, measure);
}

Device make_deltat(std::size_t /*variant*/, const DeviceScene& scene) {
  emu::EmulatedDeltatConfig config;
  config.range_m = std::ceil(2.5 * scene.bottom_m);
  const auto measure = [scene](const emu::DeltatShot& shot) {
    emu::DeltatEcho echo;
    for (int i = 0; i < shot.beams; ++i) {
      const double angle_deg = shot.start_deg + i * shot.increment_deg;
      echo.range_m.push_back(
          scene.range_m(shot.t_transmit_us, across(angle_deg * exact::kRadPerDeg), shot.range_m));
    }
    const emu::Motion motion = scene.motion(shot.t_transmit_us);
    echo.roll_deg = motion.roll_deg;
    echo.pitch_deg = motion.pitch_deg;
    echo.heading_deg = motion.heading_deg;
    return echo;
  };
  return std::make_unique<emu::EmulatedDeltat>(config, measure);
}

Device make_tritech(std::size_t variant, const DeviceScene& scene) {
  emu::EmulatedTritechConfig config;
  config.profiler = variant == 2;
  const auto range = [scene](const emu::SeanetShot& shot) {
    return scene.range_m(shot.t_us, across(shot.right_deg * exact::kRadPerDeg), shot.range_m);
  };
  return std::make_unique<emu::EmulatedTritech>(
      config,
      [scene, range](const emu::SeanetShot& shot) {
        return intensities(range(shot), 0.0, 0.5 * shot.bin_s * scene.sound_speed_m_s, shot.bins);
      },
      [scene, range](const emu::SeanetShot& shot) {
        return 2.0 * range(shot) / scene.sound_speed_m_s;
      });
}

template <typename Count>
Count share_of(Count all, const DeviceScene& scene) {
  constexpr double kLeast = 2.0;
  return static_cast<Count>(std::max(static_cast<double>(all) * scene.beams_share, kLeast));
}

Device make_r2sonic(std::size_t /*variant*/, const DeviceScene& scene) {
  emu::EmulatedR2SonicSettings settings;
  settings.sound_speed_m_s = static_cast<float>(scene.sound_speed_m_s);
  settings.clock_offset_us = kUnix_s * kSecond_us;
  settings.beams = share_of(settings.beams, scene);
  settings.two_way_s = [scene](base::TimeUs t_us, double angle_rad) {
    return 2.0 * scene.range_m(t_us, across(angle_rad), kAny_m) / scene.sound_speed_m_s;
  };
  return std::make_unique<emu::EmulatedR2Sonic>(settings);
}

Device make_wl3d(std::size_t /*variant*/, const DeviceScene& scene) {
  emu::EmulatedWl3dConfig config;
  config.sound_speed_m_s = scene.sound_speed_m_s;
  config.range_m = std::max(config.range_m, 2.0 * scene.bottom_m);
  config.width = share_of(config.width, scene);
  config.height = share_of(config.height, scene);
  return std::make_unique<emu::EmulatedWl3d>(
      config, [scene, longest_m = config.range_m](const emu::Wl3dShot& shot) {
        return scene.range_m(shot.t_us, camera(shot.yaw_deg, shot.pitch_deg), longest_m);
      });
}

// ---- Sensors ------------------------------------------------------------------------------------

using Message = std::function<Bytes(base::TimeUs)>;

emu::TalkerRow row(std::int64_t interval_us, Message message) {
  return {std::move(message), interval_us, interval_us};
}

Device talker(std::vector<emu::TalkerRow> rows) {
  return std::make_unique<emu::Talker>(emu::TalkerConfig{}, std::move(rows));
}

/// A sensor that says its motion in one kind of message.
template <class Writer>
Device talker_of_motion(const DeviceScene& scene, std::int64_t interval_us, Writer write) {
  return talker(
      {row(interval_us, [scene, write](base::TimeUs t_us) { return write(scene.motion(t_us)); })});
}

Device make_nmea(std::size_t /*variant*/, const DeviceScene& scene) {
  emu::NmeaTalkerConfig config;
  config.schedule = {{emu::NmeaKind::kPashr, 100'000, 100'000},
                     {emu::NmeaKind::kHdt, 100'000, 100'000},
                     {emu::NmeaKind::kPrvatPressure, 200'000, 200'000},
                     {emu::NmeaKind::kDpt, 500'000, 500'000},
                     {emu::NmeaKind::kGga, kSecond_us, kSecond_us}};
  const auto measure = [scene](base::TimeUs t_us) {
    const emu::Motion motion = scene.motion(t_us);
    emu::NmeaTruth truth;
    truth.roll_deg = motion.roll_deg;
    truth.pitch_deg = motion.pitch_deg;
    truth.heading_deg = motion.heading_deg;
    truth.magnetic_heading_deg = motion.heading_deg;
    truth.latitude_deg = scene.latitude_at(t_us);
    truth.longitude_deg = scene.longitude_at(t_us);
    truth.pressure_pa = scene.pressure_pa();
    truth.depth_m = scene.depth_m;
    truth.altitude_m = scene.bottom_m;
    truth.time_of_day_s = motion.time_s;
    return truth;
  };
  return std::make_unique<emu::NmeaTalker>(config, measure);
}

Device make_tss1(std::size_t /*variant*/, const DeviceScene& scene) {
  return talker_of_motion(scene, 50'000, [](const emu::Motion& m) { return emu::tss1_line(m); });
}

Device make_vectornav(std::size_t /*variant*/, const DeviceScene& scene) {
  return talker_of_motion(scene, 50'000,
                          [](const emu::Motion& m) { return emu::vectornav_common(m); });
}

Device make_xsens(std::size_t /*variant*/, const DeviceScene& scene) {
  return talker_of_motion(scene, 20'000, [](const emu::Motion& m) {
    return emu::xsens_mtdata2(m, emu::XsensOrientation::kQuaternion);
  });
}

Device make_trax(std::size_t /*variant*/, const DeviceScene& scene) {
  return std::make_unique<emu::EmulatedTrax>(
      emu::TraxSensorConfig{}, [scene](base::TimeUs t_us) { return scene.motion(t_us); });
}

Device make_wldvl(std::size_t /*variant*/, const DeviceScene& scene) {
  const auto motion = [scene](base::TimeUs t_us) { return scene.motion(t_us); };
  return talker(
      {row(200'000, [motion](base::TimeUs t_us) { return emu::wldvl_velocity(motion(t_us)); }),
       row(200'000, [motion](base::TimeUs t_us) { return emu::wldvl_position(motion(t_us)); })});
}

Device make_pd0(std::size_t /*variant*/, const DeviceScene& scene) {
  emu::Pd0Setup setup;
  setup.depth_sensor = true;
  return talker({row(500'000, [scene, setup, number = 0U](base::TimeUs t_us) mutable {
    return emu::pd0_ensemble(scene.motion(t_us), setup, ++number);
  })});
}

Device make_keller(std::size_t /*variant*/, const DeviceScene& scene) {
  constexpr double kPascalPerBar = 1e5;
  return std::make_unique<emu::KellerSensor>(emu::KellerSensorConfig{}, [scene](base::TimeUs t_us) {
    return emu::KellerTruth{scene.pressure_pa() / kPascalPerBar,
                            scene.motion(t_us).temperature_degc};
  });
}

Device make_nmea2000(std::size_t /*variant*/, const DeviceScene& scene) {
  constexpr std::uint8_t kSource = 35;
  const auto message = [scene](std::uint32_t pgn) {
    return [scene, pgn, number = 0U](base::TimeUs t_us) mutable {
      emu::N2kTruth truth;
      truth.motion = scene.motion(t_us);
      truth.latitude_deg = scene.latitude_at(t_us);
      truth.longitude_deg = scene.longitude_at(t_us);
      truth.pressure_pa = scene.pressure_pa();
      truth.speed_through_water_m_s = scene.speed_m_s;
      truth.speed_over_ground_m_s = scene.speed_m_s;
      truth.course_deg = scene.attitude.heading_deg;
      truth.unix_s = static_cast<double>(kUnix_s) + truth.motion.time_s;
      return emu::n2k_truth(pgn, kSource, truth, number++ % 8U);
    };
  };
  return talker({row(100'000, message(127250)), row(100'000, message(127251)),
                 row(100'000, message(127257)), row(500'000, message(128259)),
                 row(500'000, message(128267)), row(200'000, message(129025)),
                 row(500'000, message(129026)), row(kSecond_us, message(129029)),
                 row(500'000, message(130314))});
}

Device make_mavlink(std::size_t /*variant*/, const DeviceScene& scene) {
  constexpr std::uint32_t kScaledPressure2 = 137;
  // All messages of an autopilot count in one sequence.
  const auto sequence = std::make_shared<std::uint8_t>(std::uint8_t{0});
  const auto peer = [sequence] {
    emu::MavlinkPeer self;
    self.sequence = (*sequence)++;
    return self;
  };
  return talker(
      {row(100'000, [=](base::TimeUs t) { return emu::mavlink_attitude(peer(), scene.motion(t)); }),
       row(200'000,
           [=](base::TimeUs t) {
             return emu::mavlink_pressure(peer(), kScaledPressure2, scene.motion(t),
                                          scene.pressure_pa() / 100.0);
           }),
       row(200'000, [=](base::TimeUs t) { return emu::mavlink_distance(peer(), scene.motion(t)); }),
       row(200'000, [=](base::TimeUs t) {
         emu::Motion motion = scene.motion(t);
         const Vec3 velocity = scene.velocity_m_s();  // this message has it in the world
         motion.velocity_m_s = {velocity.x, velocity.y, velocity.z};
         return emu::mavlink_local_position(peer(), motion);
       })});
}

// ---- All of them --------------------------------------------------------------------------------

struct Entry {
  Driver driver;
  Device (*make)(std::size_t variant, const DeviceScene& scene);
};

constexpr std::array<Entry, 18> kEntries{{
    {Driver::kPing1d, &make_ping1d},
    {Driver::kPing360, &make_ping360},
    {Driver::kCerulean, &make_cerulean},
    {Driver::kImagenex, &make_imagenex},
    {Driver::kDeltat83p, &make_deltat},
    {Driver::kTritech, &make_tritech},
    {Driver::kR2sonic, &make_r2sonic},
    {Driver::kWl3d, &make_wl3d},
    {Driver::kNmea, &make_nmea},
    {Driver::kTss1, &make_tss1},
    {Driver::kVectornav, &make_vectornav},
    {Driver::kXsens, &make_xsens},
    {Driver::kTrax, &make_trax},
    {Driver::kWldvl, &make_wldvl},
    {Driver::kPd0, &make_pd0},
    {Driver::kKeller, &make_keller},
    {Driver::kNmea2000, &make_nmea2000},
    {Driver::kMavlink, &make_mavlink},
}};

const Entry* find_entry(Driver driver) {
  const auto* const found = std::find_if(kEntries.begin(), kEntries.end(),
                                         [&](const Entry& each) { return each.driver == driver; });
  return found == kEntries.end() ? nullptr : found;
}

}  // namespace

Device make_lone_device(Driver driver, std::size_t variant, const DeviceScene& scene) {
  const Entry* const entry = find_entry(driver);
  return entry != nullptr ? entry->make(variant, scene) : nullptr;
}

bool has_lone_device(Driver driver) { return find_entry(driver) != nullptr; }

std::string lone_device_names() {
  std::string names;
  for (const Entry& each : kEntries) {
    names += (names.empty() ? "" : " ") + std::string(firmware::driver_name(each.driver));
  }
  return names;
}

}  // namespace leadline::host
