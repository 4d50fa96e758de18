// A Ping360's bytes, cut at will, with requests in between: every profile is whole and within the range
// asked for, the counters account for every byte, and it never asks while an answer is due.
#include <cstdint>

#include "hal/heads/ping360.hpp"
#include "tests/support/fuzz_heads.hpp"

namespace {

using leadline::base::Ping;
using leadline::base::ReturnKind;
using leadline::fuzz::require;
using leadline::hal::Ping360Codec;
using leadline::hal::Ping360Config;

void check(const Ping& ping, const Ping360Config& config) {
  require(ping.kind == ReturnKind::kProfile && ping.elevation_bam32 == 0);
  require(ping.t_transmit_us < ping.t_receive_us);
  require(ping.profile.bin_count > 0 && ping.profile.bin_count <= 1200 && ping.profile.bin_um > 0);
  const std::int64_t last_um =
      ping.profile.first_bin_um +
      (std::int64_t{ping.profile.bin_count} - 1) * static_cast<std::int64_t>(ping.profile.bin_um);
  require(ping.profile.first_bin_um >= config.min_range_um && last_um <= config.max_range_um);
  for (std::size_t i = 0; i < ping.profile.bin_count; ++i) {
    require(ping.profile.intensity[i] <= 255);
    leadline::fuzz::g_sum += ping.profile.intensity[i];
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 4) {
    return 0;
  }
  Ping360Config config;
  config.poll_interval_us = (data[0] & 1U) != 0 ? 0 : 50'000;
  config.clockwise = (data[0] & 2U) != 0;
  config.scan_first_grad = data[1] * 3 - 200;
  config.scan_last_grad = data[2] * 3 - 200;
  config.scan_step_grad = data[3];
  config.min_range_um = (data[0] & 4U) != 0 ? 750'000 : 0;
  config.max_range_um = (data[0] & 8U) != 0 ? 2'000'000 : 100'000'000;
  Ping360Codec codec(config);
  leadline::fuzz::drive_ping_head(codec, data + 4, size - 4,
                                  [&](const Ping& ping) { check(ping, config); });
  const auto counters = codec.counters();
  require(counters.records + counters.bad_values <= counters.frames);
  return 0;
}
