// What lost bytes cost a polled head: pings lost beside those of a clean line. The table of hal/README.md.
#include <array>
#include <cstdio>
#include <functional>
#include <memory>

#include "hal/heads/ping1d.hpp"
#include "hal/heads/ping360.hpp"
#include "tests/support/ping_line.hpp"

namespace {

using leadline::base::Ping;
using leadline::base::TimeUs;
using leadline::emu::EmulatedDevice;
using leadline::emu::EmulatedPing1d;
using leadline::emu::EmulatedPing1dConfig;
using leadline::emu::EmulatedPing360;
using leadline::emu::EmulatedPing360Config;
using leadline::emu::FaultConfig;
using leadline::hal::Ping1dCodec;
using leadline::hal::Ping1dConfig;
using leadline::hal::Ping360Codec;
using leadline::hal::Ping360Config;
using leadline::test::Line;

constexpr std::int32_t kByteTime_ns = 86'806;  // 115200 baud
constexpr TimeUs kCycle_us = 20'000;           // as vehicles step
constexpr TimeUs kFlight_us = 300'000'000;
constexpr std::array<std::uint32_t, 4> kLoss_ppm = {0, 100, 1000, 10'000};

FaultConfig losing(std::uint32_t ppm, std::uint64_t seed) {
  FaultConfig fault;
  fault.seed = seed;
  fault.drop_ppm = ppm;
  return fault;
}

/// Percent of the clean line's pings that do not arrive, for each loss.
template <class Codec, class Config>
std::array<double, 4> lost_percent(const char* name, const Config& config,
                                   const std::function<EmulatedDevice*()>& make_device) {
  std::array<double, 4> percent{};
  std::size_t clean = 0;
  std::printf("%-22s", name);
  for (std::size_t i = 0; i < kLoss_ppm.size(); ++i) {
    const std::unique_ptr<EmulatedDevice> device(make_device());
    Codec codec(config);
    Line<Codec> line(codec, *device, losing(kLoss_ppm[i], 1), losing(kLoss_ppm[i], 2), kCycle_us);
    const std::size_t count = line.count_until(kFlight_us);
    clean = i == 0 ? count : clean;
    percent[i] = 100.0 * (1.0 - static_cast<double>(count) / static_cast<double>(clean));
    std::printf("  %5u ppm %6zu (-%.1f %%)", kLoss_ppm[i], count, percent[i]);
  }
  std::printf("\n");
  return percent;
}

Ping1dConfig altimeter(bool profile) {
  Ping1dConfig config;
  config.max_range_um = 30'000'000;
  config.byte_time_ns = kByteTime_ns;
  config.profile = profile;
  return config;
}

EmulatedDevice* new_ping1d() {
  EmulatedPing1dConfig device;
  device.byte_time_ns = kByteTime_ns;
  return new EmulatedPing1d(device, leadline::test::sinking);
}

}  // namespace

TEST(ping1d_range) {
  const auto lost = lost_percent<Ping1dCodec>("ping1d range", altimeter(false), new_ping1d);
  assert_true(lost[1] < 1.0);
  assert_true(lost[2] < 8.0);
  assert_true(lost[3] < 60.0);
}

TEST(ping1d_profile) {
  const auto lost = lost_percent<Ping1dCodec>("ping1d profile", altimeter(true), new_ping1d);
  assert_true(lost[1] < 4.0);
  assert_true(lost[2] < 30.0);
}

TEST(ping360_polled) {
  Ping360Config config;
  config.max_range_um = 10'000'000;
  config.poll_interval_us = 100'000;
  config.max_samples = 600;
  config.byte_time_ns = kByteTime_ns;
  const auto lost = lost_percent<Ping360Codec>("ping360 600 samples", config, [] {
    EmulatedPing360Config device;
    device.byte_time_ns = kByteTime_ns;
    return new EmulatedPing360(device, leadline::test::wall);
  });
  assert_true(lost[1] < 12.0);
  assert_true(lost[2] < 65.0);
}
