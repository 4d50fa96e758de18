// CRC-32C (Castagnoli), the one checksum of the product: tables, model files, link frames, log records.
#pragma once

#include <cstddef>
#include <cstdint>

namespace leadline::base {

/// CRC-32C of `size_bytes` at `data`: polynomial 0x1EDC6F41 reflected, initial and final XOR
/// 0xFFFFFFFF (RFC 3720 appendix B.4; check value of "123456789" is 0xE3069283). To continue over a
/// second block pass the first block's result as `crc`. O(size), no state, reentrant.
[[nodiscard]] std::uint32_t crc32c(const void* data, std::size_t size_bytes, std::uint32_t crc = 0);

}  // namespace leadline::base
