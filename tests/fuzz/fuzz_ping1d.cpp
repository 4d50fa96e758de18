// A Ping1D's bytes, cut at will, with requests in between: whatever the codec delivers is a ping that the
// model may take, its counters account for every byte, and it never asks while an answer is due.
#include <cstdint>

#include "hal/heads/ping1d.hpp"
#include "tests/support/fuzz_heads.hpp"

namespace {

using leadline::base::Ping;
using leadline::base::ReturnKind;
using leadline::fuzz::require;
using leadline::hal::Ping1dCodec;
using leadline::hal::Ping1dConfig;

void check(const Ping& ping, const Ping1dConfig& config) {
  require(ping.t_transmit_us <= ping.t_receive_us);
  if (ping.kind == ReturnKind::kProfile) {
    require(config.profile && ping.profile.bin_count > 0 && ping.profile.bin_um > 0);
    require(ping.profile.first_bin_um > 0 || ping.profile.bin_um == 1);
    for (std::size_t i = 0; i < ping.profile.bin_count; ++i) {
      require(ping.profile.intensity[i] <= 255);
      leadline::fuzz::g_sum += ping.profile.intensity[i];
    }
    return;
  }
  require(ping.kind == ReturnKind::kRange || ping.range_um == 0);
  if (ping.kind == ReturnKind::kRange) {
    require(ping.range_um >= config.min_range_um && ping.range_um <= config.max_range_um);
    require(ping.range_um > 0 && ping.quality > 0);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) {
    return 0;
  }
  Ping1dConfig config;
  config.profile = (data[0] & 1U) != 0;
  config.drop_repeats = (data[0] & 2U) != 0;
  config.poll_interval_us = (data[0] & 4U) != 0 ? 0 : 100'000;
  config.sound_speed_mm_s = 1'400'000 + 1000 * data[1];
  config.byte_time_ns = (data[0] & 8U) != 0 ? 86'806 : 0;
  Ping1dCodec codec(config);
  leadline::fuzz::drive_ping_head(codec, data + 2, size - 2,
                                  [&](const Ping& ping) { check(ping, config); });
  const auto counters = codec.counters();
  require(counters.records + counters.repeats + counters.bad_values <= counters.frames);
  return 0;
}
