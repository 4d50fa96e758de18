// Raw Snappy blocks: decompression into a buffer of the caller. Vehicle code.
#pragma once

#include <cstddef>
#include <cstdint>

namespace leadline::hal {

/// Decompresses one raw block (no framing format, no checksum) into `out`. False, with `size_bytes` 0, when
/// it is not a block or would not fit: every length and offset is checked against both buffers, and the
/// block must yield just as much as its preamble says. O(size + capacity).
/// Facts: google/snappy format_description.txt.
[[nodiscard]] bool snappy_uncompress(const std::uint8_t* data, std::size_t data_bytes,
                                     std::uint8_t* out, std::size_t capacity_bytes,
                                     std::size_t& size_bytes);

}  // namespace leadline::hal
