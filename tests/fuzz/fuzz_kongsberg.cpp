// A Kongsberg head's datagrams, cut at will: beams and samples stay within their limits. The sum of an
// older datagram that arrives whole is put right first, so that what is in it gets looked at.
#include <cstdint>
#include <vector>

#include "hal/heads/kongsberg.hpp"
#include "hal/wire.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::base::NavSample;
using leadline::base::Ping;
using leadline::fuzz::require;
using leadline::hal::KongsbergCodec;

void put_sum_right(std::vector<std::uint8_t>& bytes) {
  if (bytes.size() < 12 || bytes[4] != 2) {
    return;
  }
  const std::size_t size = std::size_t{leadline::hal::read_u32_le(bytes.data())} + 4;
  if (size < 12 || size > bytes.size()) {
    return;
  }
  std::uint32_t sum = 0;
  for (std::size_t i = 5; i + 3 < size; ++i) {
    sum += bytes[i];
  }
  bytes[size - 3] = 3;
  leadline::hal::write_u16_le(bytes.data() + size - 2, static_cast<std::uint16_t>(sum));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) {
    return 0;
  }
  leadline::hal::KongsbergConfig config;
  config.device_clock = (data[0] & 1U) != 0;
  std::vector<std::uint8_t> bytes(data + 1, data + size);
  put_sum_right(bytes);
  KongsbergCodec codec(config);
  std::uint32_t records = 0;
  for (const std::uint8_t byte : bytes) {
    Ping ping{};
    for (bool more = codec.feed(byte, 0, ping); more; more = codec.next(ping)) {
      ++records;
      require(ping.range_um > 0 && ping.range_um <= leadline::base::kMaxRange_um);
      require(ping.t_receive_us >= ping.t_transmit_us);
      require(ping.sound_speed_mm_s >= 1'300'000 && ping.sound_speed_mm_s <= 1'700'000);
    }
    NavSample sample{};
    while (codec.take_sample(sample)) {
      require(sample.fields != 0);
      require(sample.latitude_e9deg >= -90'000'000'000 && sample.latitude_e9deg <= 90'000'000'000);
    }
    require(codec.profile_count() <= leadline::hal::kMaxKongsbergProfile);
  }
  require(codec.counters().records == records);
  require(codec.counters().skipped_bytes <= bytes.size());
  return 0;
}
