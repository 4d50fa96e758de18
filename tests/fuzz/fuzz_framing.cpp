// Bytes of a link, cut at will: the decoder never reads or writes outside its buffer, whatever it
// delivers carries its CRC, its counters account for every byte, and the cut does not matter.
#include <cstdint>
#include <cstring>
#include <vector>

#include "proto/framing.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::fuzz::require;
using leadline::proto::encode_frame;
using leadline::proto::FrameDecoder;
using leadline::proto::FrameView;

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) {
    return 0;
  }
  // The first byte chooses the receiver's buffer; on the heap, so that ASan knows its exact end.
  const std::size_t buffer_bytes = std::size_t{4} + data[0];
  std::vector<std::uint8_t> buffer(buffer_bytes);
  std::vector<std::uint8_t> other_buffer(buffer_bytes);
  FrameDecoder by_byte(buffer.data(), buffer.size());
  FrameDecoder by_block(other_buffer.data(), other_buffer.size());

  const std::uint8_t* link = data + 1;
  const std::size_t link_bytes = size - 1;
  std::size_t block_at = 0;
  for (std::size_t i = 0; i < link_bytes; ++i) {
    FrameView frame{};
    if (!by_byte.feed(link[i], frame)) {
      continue;
    }
    require(frame.payload_bytes + leadline::proto::kCrc_bytes <= buffer_bytes);

    std::size_t used = 0;
    FrameView same{};
    require(by_block.feed(link + block_at, link_bytes - block_at, used, same));
    block_at += used;
    require(block_at == i + 1);
    require(same.payload_bytes == frame.payload_bytes);
    require(frame.payload_bytes == 0 ||
            std::memcmp(same.payload, frame.payload, frame.payload_bytes) == 0);

    // What was delivered, encoded again, is delivered again.
    std::vector<std::uint8_t> again(leadline::proto::frame_bound_bytes(frame.payload_bytes));
    const auto encoded =
        encode_frame(frame.payload, frame.payload_bytes, again.data(), again.size());
    require(encoded.ok());
    std::vector<std::uint8_t> third_buffer(buffer_bytes);
    FrameDecoder third(third_buffer.data(), third_buffer.size());
    FrameView echoed{};
    require(third.feed(again.data(), encoded.value(), used, echoed));
    require(echoed.payload_bytes == frame.payload_bytes);
  }
  const auto& counters = by_byte.counters();
  const std::uint64_t frames = std::uint64_t{counters.frames} + counters.bad_crc +
                               counters.bad_code + counters.too_short + counters.too_long;
  require(frames <= link_bytes && counters.dropped_bytes <= link_bytes);
  return 0;
}
