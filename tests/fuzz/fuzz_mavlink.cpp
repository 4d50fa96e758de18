// MAVLink frames, cut at will: every sample is sound, and each byte is in exactly one place of the books. An
// input that begins with an odd byte gets its frames' CRCs put right, so that the fields are reached.
#include <vector>

#include "hal/attitude/mavlink.hpp"
#include "hal/checksums.hpp"
#include "tests/support/nav_check.hpp"

namespace {

void seal(std::vector<std::uint8_t>& bytes) {
  using namespace leadline::hal;  // NOLINT: a fuzz target
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    MavlinkHeader header{};
    std::uint8_t extra = 0;
    if (!read_mavlink_header(&bytes[i], bytes.size() - i, header) ||
        i + header.frame_bytes > bytes.size() || !mavlink_crc_extra(header.id, extra)) {
      continue;
    }
    const std::size_t crc_at = i + header.payload_offset + header.payload_bytes;
    const std::uint16_t crc =
        crc16_mcrf4xx(&extra, 1, crc16_mcrf4xx(&bytes[i + 1], crc_at - i - 1));
    bytes[crc_at] = static_cast<std::uint8_t>(crc);
    bytes[crc_at + 1] = static_cast<std::uint8_t>(crc >> 8U);
    i += header.frame_bytes - 1U;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using leadline::test::require;
  if (size < 1) {
    return 0;
  }
  std::vector<std::uint8_t> bytes(data + 1, data + size);
  if ((data[0] & 1U) != 0) {
    seal(bytes);
  }
  leadline::hal::MavlinkConfig config;
  config.heading_true = (data[0] & 2U) != 0;
  leadline::hal::MavlinkCodec codec(config);
  std::uint32_t records = 0;
  leadline::base::NavSample sample{};
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    if (!codec.feed(bytes[i], static_cast<std::int64_t>(i), sample)) {
      continue;
    }
    do {
      ++records;
      leadline::test::require_sound(sample);
    } while (codec.next(sample));
  }
  codec.restart();
  const auto& counters = codec.counters();
  require(counters.records == records && records + counters.ignored <= counters.frames);
  require(counters.skipped_bytes <= bytes.size());
  return 0;
}
