#include "host_tools/emulate/fleet.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "hal/emu/emulated_ping1d.hpp"
#include "hal/emu/emulated_ping360.hpp"
#include "host_tools/exit_codes.hpp"

namespace leadline::host {
namespace {

// Bytes that arrive within this are one chunk, stamped at its end: about what a kernel does.
constexpr base::TimeUs kChunk_us = 2'000;

constexpr int kConfidence_percent = 96;
constexpr int kOutlierConfidence_percent = 61;
// The fault streams' seeds, apart from every stream of the mission's random numbers.
constexpr std::uint64_t kFaultSeed = 0xFA17000000000000U;

Trajectory fly(const Terrain& ground, const MotionPlan& plan) {
  try {
    return Trajectory(ground, plan);
  } catch (const std::invalid_argument& error) {
    throw HostError(ExitCode::kUsage, error.what());
  }
}

std::uint32_t ppm(double share) { return static_cast<std::uint32_t>(std::lround(share * 1e6)); }

std::int64_t interval_us(double rate_hz) {
  return static_cast<std::int64_t>(std::llround(1e6 / rate_hz));
}

}  // namespace

std::vector<std::string> fleet_ports(const Mission& mission) {
  std::vector<std::string> names;
  for (const HeadSpec& head : mission.heads) {
    names.push_back(head.name);
  }
  if (mission.one_nmea_line) {
    names.emplace_back("navigation");
  } else {
    names.insert(names.end(), {"attitude", "fix", "pressure"});
  }
  return names;
}

Fleet::Fleet(const Mission& mission)
    : mission_(mission),
      ground_(build_ground(mission_)),
      trajectory_(fly(ground_, mission_.motion)),
      touched_(ground_.north_count() * ground_.east_count(), 0),
      sensors_(trajectory_, mission_),
      t_start_us_(std::llround(mission_.start_s * 1e6)),
      names_(fleet_ports(mission_)) {
  for (std::size_t k = 0; k < mission_.heads.size(); ++k) {
    sounders_.push_back(std::make_unique<Sounder>(ground_, trajectory_, mission_, k));
    if (mission_.heads[k].kind == HeadKind::kPing1d) {
      add_altimeter(k);
    } else {
      add_scanner(k);
    }
  }
  add_navigation();
}

void Fleet::add_line(std::unique_ptr<emu::EmulatedDevice> device, emu::PingDeviceEmulator* head) {
  emu::FaultConfig faults;
  faults.seed = (mission_.seed ^ kFaultSeed) + lines_.size();
  faults.drop_ppm = ppm(mission_.faults.lost_byte);
  faults.corrupt_ppm = ppm(mission_.faults.flipped_bit);
  faults.repeat_ppm = ppm(mission_.faults.repeated_byte);
  const bool shares = mission_.one_nmea_line && head == nullptr;
  const std::size_t port = shares ? mission_.heads.size() : lines_.size();
  lines_.push_back({std::move(device), head, emu::FaultyStream(faults), port, shares, {}});
}

Heard Fleet::ping(std::size_t number, base::TimeUs t_us, double azimuth_deg) {
  // Before the start and after the end the vehicle is in the water, but off the survey: its pings are
  // heard, what they touch does not count.
  const base::TimeUs survey_us = t_us - t_start_us_;
  const bool counts = survey_us >= 0 && t_us < t_survey_end_us();
  const Heard heard = sounders_[number]->ping(survey_us, azimuth_deg, counts ? &touched_ : nullptr);
  counters_.pings += 1;
  counters_.echoes += heard.range_m && !heard.outlier ? 1U : 0U;
  counters_.outliers += heard.outlier ? 1U : 0U;
  counters_.dropouts += heard.dropout ? 1U : 0U;
  return heard;
}

void Fleet::add_altimeter(std::size_t number) {
  emu::EmulatedPing1dConfig config;
  config.byte_time_ns = kFleetByteTime_ns;
  config.identity.device_id = static_cast<std::uint8_t>(number + 1);
  const auto measure = [this, number](const emu::Ping1dShot& shot) {
    const Heard heard = ping(number, shot.t_transmit_us, 0.0);
    emu::Ping1dEcho echo;
    if (heard.range_m) {
      echo.two_way_ns = std::llround(2e9 * *heard.range_m / mission_.sound_speed_m_s);
      echo.confidence_percent = heard.outlier ? kOutlierConfidence_percent : kConfidence_percent;
    }
    if (echo.two_way_ns < shot.listen_from_ns || echo.two_way_ns > shot.listen_to_ns) {
      echo.two_way_ns = 0;
      echo.confidence_percent = 0;
    }
    if (mission_.profile && shot.samples > 0) {
      const double to_m = 0.5e-9 * mission_.sound_speed_m_s;
      echo.intensity.resize(static_cast<std::size_t>(shot.samples));
      sounders_[number]->profile(
          static_cast<double>(shot.listen_from_ns) * to_m,
          static_cast<double>(shot.listen_to_ns - shot.listen_from_ns) * to_m, &echo.intensity);
    }
    return echo;
  };
  auto device = std::make_unique<emu::EmulatedPing1d>(config, measure);
  emu::PingDeviceEmulator* const head = device.get();
  add_line(std::move(device), head);
}

void Fleet::add_scanner(std::size_t number) {
  emu::EmulatedPing360Config config;
  config.byte_time_ns = kFleetByteTime_ns;
  config.identity.device_id = static_cast<std::uint8_t>(number + 1);
  const auto measure = [this, number](const emu::Ping360Shot& shot) {
    (void)ping(number, shot.t_transmit_us, (shot.angle_grad - 200) * 0.9);
    emu::Bytes intensity(static_cast<std::size_t>(shot.samples));
    const double length_m = 0.5e-9 * mission_.sound_speed_m_s *
                            static_cast<double>(shot.sample_period_ns) * shot.samples;
    sounders_[number]->profile(0.0, length_m, &intensity);
    return intensity;
  };
  auto device = std::make_unique<emu::EmulatedPing360>(config, measure);
  emu::PingDeviceEmulator* const head = device.get();
  add_line(std::move(device), head);
}

void Fleet::add_navigation() {
  const NavigationSpec& spec = mission_.navigation;
  const auto talker = [this](emu::NmeaKind kind, double rate_hz, std::int64_t latency_us,
                             emu::NmeaTalker::Measure measure) {
    emu::NmeaTalkerConfig config;
    config.latency_us = mission_.one_nmea_line ? kAttitudeLatency_us : latency_us;
    config.byte_time_ns = kFleetByteTime_ns;
    if (rate_hz > 0.0) {
      // Not all at once: each starts in a phase of its own.
      const auto phase_us = static_cast<base::TimeUs>(1'700 * (lines_.size() + 1));
      config.schedule = {{kind, interval_us(rate_hz), phase_us}};
    }
    add_line(std::make_unique<emu::NmeaTalker>(config, std::move(measure)), nullptr);
  };
  talker(emu::NmeaKind::kPashr, spec.attitude_rate_hz, kAttitudeLatency_us,
         [this, &spec](base::TimeUs t_us) {
           const Attitude attitude = sensors_.attitude(t_us - t_start_us_);
           emu::NmeaTruth truth;
           truth.roll_deg = attitude.roll_deg;
           truth.pitch_deg = attitude.pitch_deg;
           truth.heading_deg = attitude.heading_deg;
           truth.sigma_roll_deg = spec.sigma_attitude_deg;
           truth.sigma_pitch_deg = spec.sigma_attitude_deg;
           truth.sigma_heading_deg = spec.sigma_heading_deg;
           truth.time_of_day_s = static_cast<double>(t_us) * 1e-6;
           return truth;
         });
  talker(emu::NmeaKind::kGga, spec.fix_rate_hz, kFixLatency_us, [this](base::TimeUs t_us) {
    const FixReading fix = sensors_.fix(t_us - t_start_us_);
    emu::NmeaTruth truth;
    truth.latitude_deg = fix.latitude_deg;
    truth.longitude_deg = fix.longitude_deg;
    truth.time_of_day_s = static_cast<double>(t_us) * 1e-6;
    return truth;
  });
  talker(emu::NmeaKind::kPrvatPressure, spec.pressure_rate_hz, kPressureLatency_us,
         [this](base::TimeUs t_us) {
           emu::NmeaTruth truth;
           truth.pressure_pa = sensors_.pressure_pa(t_us - t_start_us_);
           return truth;
         });
}

base::TimeUs Fleet::t_survey_end_us() const { return t_start_us_ + trajectory_.duration_us(); }

base::TimeUs Fleet::t_end_us() const {
  return t_survey_end_us() + std::llround(mission_.settle_s * 1e6);
}

base::TimeUs Fleet::next_us(base::TimeUs now_us) const { return now_us + kChunk_us; }

void Fleet::advance(base::TimeUs now_us, std::vector<emu::Bytes>* bytes) {
  const bool over = now_us >= t_survey_end_us();
  for (Line& line : lines_) {
    if (line.head != nullptr && over) {
      line.head->set_silent(true);
    }
    emu::Bytes sent;
    line.device->advance(now_us, sent);
    emu::Bytes& out = (*bytes)[line.port];
    if (!line.by_sentence) {
      line.faults.pass(now_us, sent, out);
      continue;
    }
    line.faults.pass(now_us, sent, line.begun);
    const auto end = std::find(line.begun.rbegin(), line.begun.rend(), '\n').base();
    out.insert(out.end(), line.begun.begin(), end);
    line.begun.erase(line.begun.begin(), end);
  }
}

void Fleet::take(std::size_t port, base::TimeUs now_us, const std::uint8_t* data,
                 std::size_t size_bytes) {
  lines_[port].device->take(now_us, data, size_bytes);
}

emu::FaultCounters Fleet::faults() const {
  emu::FaultCounters sum{};
  for (const Line& line : lines_) {
    const emu::FaultCounters& one = line.faults.counters();
    sum.bytes_in += one.bytes_in;
    sum.bytes_out += one.bytes_out;
    sum.dropped += one.dropped;
    sum.corrupted += one.corrupted;
    sum.repeated += one.repeated;
  }
  return sum;
}

}  // namespace leadline::host
