// The square root of base/fixed.hpp where a loop wants it inline: the same bits.
#pragma once

#include <array>
#include <cstdint>

#include "model/base/fixed.hpp"

namespace leadline::base {

/// Starting values: root of the middle of [i, i + 1) 2^24, for i in 64 .. 255.
extern const std::array<std::uint16_t, 256> kRootTable;

[[nodiscard]] inline std::uint32_t sqrt_u32_inline(std::uint32_t value) {
  if (value == 0) {
    return 0;
  }
  const int shift = leading_zeros(value) & ~1;  // even, so that the root shifts by half of it
  const std::uint32_t x = value << static_cast<unsigned>(shift);
  return root_step(x, kRootTable[x >> 24U]) >> static_cast<unsigned>(shift / 2);
}

[[nodiscard]] inline std::uint32_t sqrt_u64_inline(std::uint64_t value) {
  const auto high = static_cast<std::uint32_t>(value >> 32U);
  if (high == 0) {
    return sqrt_u32_inline(static_cast<std::uint32_t>(value));
  }
  // Brings the value below 2^32, by an even number of bits: its first or second bit is then set.
  const auto shift = static_cast<unsigned>((33 - leading_zeros(high)) & ~1);
  const auto x = static_cast<std::uint32_t>(value >> shift);
  return root_step(x, kRootTable[x >> 24U]) << (shift / 2U);
}

}  // namespace leadline::base
