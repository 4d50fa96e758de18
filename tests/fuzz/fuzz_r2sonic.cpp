// An R2Sonic head's bytes, cut at will: every beam is within its limits and every byte accounted for.
#include <cstdint>

#include "hal/heads/r2sonic.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::base::Ping;
using leadline::fuzz::require;
using leadline::hal::R2SonicCodec;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) {
    return 0;
  }
  leadline::hal::R2SonicConfig config;
  config.device_clock = (data[0] & 1U) != 0;
  config.a2_inclusive = (data[0] & 2U) != 0;
  R2SonicCodec codec(config);
  std::uint32_t records = 0;
  std::int64_t t_us = 0;
  for (std::size_t i = 1; i < size; ++i) {
    t_us += data[i] == 0xFE ? 3'000'000 : 10;
    Ping ping{};
    bool more = codec.feed(data[i], t_us, ping);
    while (more) {
      ++records;
      require(ping.kind == leadline::base::ReturnKind::kRange);
      require(ping.range_um > 0 && ping.range_um <= leadline::base::kMaxRange_um);
      require(ping.t_receive_us >= ping.t_transmit_us);
      require(ping.elevation_bam32 <= leadline::base::kBam32HalfTurn);
      require(ping.sound_speed_mm_s >= 1'300'000 && ping.sound_speed_mm_s <= 1'700'000);
      more = codec.next(ping);
    }
  }
  require(codec.counters().records == records);
  // Bytes that two packets share count twice, at most three a packet.
  require(codec.counters().skipped_bytes <= size + 3 * codec.counters().frames);
  return 0;
}
