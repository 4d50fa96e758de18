#include "hal/emu/emulated_deltat.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

namespace leadline::emu {

namespace {

void put_u16(Bytes& out, std::size_t at, std::int64_t value) {
  out.at(at) = static_cast<std::uint8_t>((value >> 8) & 0xFF);
  out.at(at + 1) = static_cast<std::uint8_t>(value & 0xFF);
}

void put_text(Bytes& out, std::size_t at, const std::string& text) {
  std::copy(text.begin(), text.end(), out.begin() + static_cast<std::ptrdiff_t>(at));
}

}  // namespace

EmulatedDeltat::EmulatedDeltat(const EmulatedDeltatConfig& config, Measure measure)
    : FreeRunningHead(config.interval_us), config_(config), measure_(std::move(measure)) {}

void EmulatedDeltat::ping(base::TimeUs t_ping_us) {
  const double increment_deg = config_.beams > 1 ? config_.sector_deg / config_.beams : 0;
  const double start_deg = -increment_deg * (config_.beams - 1) / 2;
  const DeltatEcho echo =
      measure_({t_ping_us, config_.beams, start_deg, increment_deg, config_.range_m});
  ++shots_;
  const auto beams = static_cast<std::size_t>(config_.beams);
  const bool intensities = !echo.intensity.empty();
  Bytes out(256 + beams * (intensities ? 4U : 2U), 0);
  put_text(out, 0, "83P");
  out[3] = 10;
  put_u16(out, 4, static_cast<long>(out.size()));
  char time[16];
  const long long ms = t_ping_us / 1000;
  std::snprintf(time, sizeof time, "%02d:%02d:%02d", static_cast<int>(ms / 3'600'000 % 24),
                static_cast<int>(ms / 60'000 % 60), static_cast<int>(ms / 1000 % 60));
  put_text(out, 8, config_.date);
  put_text(out, 20, time);
  std::snprintf(time, sizeof time, ".%02d", static_cast<int>(ms / 10 % 100));
  put_text(out, 29, time);
  std::snprintf(time, sizeof time, ".%03d", static_cast<int>(ms % 1000));
  put_text(out, 112, time);
  put_text(out, 33, echo.latitude);
  put_text(out, 47, echo.longitude);
  if (echo.has_attitude) {
    put_u16(out, 64, 0x8000 | (std::lround(echo.pitch_deg * 10) + 900));
    put_u16(out, 66, 0x8000 | (std::lround(echo.roll_deg * 10) + 900));
    put_u16(out, 68, 0x8000 | std::lround(echo.heading_deg * 10));
  }
  put_u16(out, 70, config_.beams);
  put_u16(out, 72, 500);
  put_u16(out, 74, std::lround(config_.sector_deg));
  put_u16(out, 76, std::lround((start_deg + 180) * 100));
  out[78] = static_cast<std::uint8_t>(std::lround(increment_deg * 100));
  put_u16(out, 79, std::lround(config_.range_m));
  put_u16(out, 81, 260);
  put_u16(out, 83, 0x8000 | 14'800);
  const long resolution_mm = std::max(1L, std::lround(config_.range_m * 1000 / 500));
  put_u16(out, 85, resolution_mm);
  put_u16(out, 89, 180);
  put_u16(out, 91, config_.interval_us / 1000);
  put_u16(out, 93, static_cast<long>(shots_ >> 16U));
  put_u16(out, 95, static_cast<long>(shots_ & 0xFFFFU));
  out[117] = intensities ? 1 : 0;
  put_u16(out, 120, config_.data_latency_us / 100);
  for (std::size_t i = 0; i < beams; ++i) {
    const double range = i < echo.range_m.size() ? echo.range_m[i] : 0;
    put_u16(out, 256 + 2 * i, std::lround(range * 1000 / static_cast<double>(resolution_mm)));
    if (intensities) {
      put_u16(out, 256 + 2 * (beams + i), static_cast<long>(echo.intensity.at(i)));
    }
  }
  const std::int64_t wait_us = config_.data_latency_us > 0
                                   ? config_.data_latency_us
                                   : static_cast<std::int64_t>(2e6 * config_.range_m / 1500);
  send(t_ping_us + wait_us, out);
}

}  // namespace leadline::emu
