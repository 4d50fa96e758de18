// What every fuzz target of a sonar head checks: the rules of hal/codec.hpp and model/base/ping.hpp.
#pragma once

#include <cstddef>
#include <cstdint>

#include "hal/codec.hpp"
#include "model/base/nav_sample.hpp"
#include "model/base/ping.hpp"
#include "tests/support/fuzz_require.hpp"

namespace leadline::fuzz {

inline std::uint32_t g_sum = 0;  // read, so that a bad span is seen

inline void check_ping(const base::Ping& ping, std::size_t max_bins) {
  require(ping.t_transmit_us <= ping.t_receive_us);
  require(ping.sound_speed_mm_s == 0 ||
          (ping.sound_speed_mm_s >= 1'300'000 && ping.sound_speed_mm_s <= 1'700'000));
  if (ping.kind == base::ReturnKind::kRange) {
    require(ping.range_um > 0 && ping.range_um <= base::kMaxRange_um);
    return;
  }
  require(ping.range_um == 0);
  if (ping.kind == base::ReturnKind::kNoReturn) {
    return;
  }
  require(ping.profile.bin_count > 0 && ping.profile.bin_count <= max_bins);
  require(ping.profile.bin_um > 0 && ping.profile.first_bin_um >= 0);
  for (std::size_t i = 0; i < ping.profile.bin_count; ++i) {
    g_sum += ping.profile.intensity[i];
  }
}

template <typename Codec>
void drain_samples(Codec& codec) {
  base::NavSample sample{};
  while (codec.take_sample(sample)) {
    require((sample.fields & base::kNavRollPitch) != 0 || sample.attitude.roll_bam32 == 0);
  }
}

/// Feeds the bytes, 0xFE after a pause. What comes out goes to `check`; `after` is called behind each byte. Returns how many
/// records there were.
template <typename Codec, typename Check, typename After>
std::uint32_t feed_head(Codec& codec, const std::uint8_t* data, std::size_t size,
                        const Check& check, const After& after) {
  std::int64_t t_us = 0;
  std::uint32_t records = 0;
  for (std::size_t i = 0; i < size; ++i) {
    t_us += data[i] == 0xFE ? 700'000 : 100;
    base::Ping ping{};
    bool more = codec.feed(data[i], t_us, ping);
    while (more) {
      ++records;
      check(ping);
      more = codec.next(ping);
    }
    after(t_us);
  }
  return records;
}

/// Asks for requests in between when the codec has any.
template <typename Codec, bool kAsks = true, bool kSamples = true>
void drive_head(Codec& codec, const std::uint8_t* data, std::size_t size, std::size_t max_bins) {
  const std::uint32_t records = feed_head(
      codec, data, size, [&](const base::Ping& ping) { check_ping(ping, max_bins); },
      [&]([[maybe_unused]] std::int64_t t_us) {
        if constexpr (kSamples) {
          drain_samples(codec);
        }
        if constexpr (kAsks) {
          std::uint8_t out[Codec::kMaxRequest_bytes];
          require(codec.request(t_us, out, sizeof out) <= sizeof out);
        }
      });
  const hal::CodecCounters& counters = codec.counters();
  require(counters.records == records);
  require(counters.skipped_bytes <= size);
}

/// A head of the Ping protocol, which never asks while an answer is due; its frames are 10 bytes and more.
template <typename Codec, typename Check>
void drive_ping_head(Codec& codec, const std::uint8_t* data, std::size_t size, const Check& check) {
  const std::uint32_t records = feed_head(codec, data, size, check, [&](std::int64_t t_us) {
    std::uint8_t out[Codec::kMaxRequest_bytes];
    require(codec.request(t_us, out, sizeof out) <= sizeof out);
    require(codec.request(t_us, out, sizeof out) == 0);
  });
  const auto counters = codec.counters();
  require(counters.records == records);
  require(counters.skipped_bytes + counters.frames * 10 <= size);
}

}  // namespace leadline::fuzz
