// A binary range coder: 32-bit integers, adaptive 15-bit probabilities, a body without length field or
// padding. Bit by bit in proto/SPEC.md, "Range coder".
//
// Encoder and decoder do the same arithmetic on the same models; one symbol is O(1). Nothing is read or
// written outside the spans given.
#pragma once

#include <cstddef>
#include <cstdint>

namespace leadline::proto {

/// Probability that the next bit of this kind is 1: the mean of two estimates that follow what was
/// coded at two speeds. Q15, each within [kLeastProbability_q15, 32768 - kLeastProbability_q15].
struct BitModel {
  std::uint16_t fast_q15;
  std::uint16_t slow_q15;
};
inline constexpr std::uint32_t kLeastProbability_q15 = 64;

/// Bytes that are written stay as they are: a copy of the object is a state to come back to.
class RangeEncoder {
 public:
  /// Starts a body at `out`. Beyond `capacity_bytes` nothing is written: see needed_bytes().
  void start(std::uint8_t* out, std::size_t capacity_bytes);
  void put(BitModel& model, bool bit);
  /// `count` equally likely bits, 0 .. 16, most significant first; value < 2^count.
  void put_raw(std::uint32_t value, unsigned count);

  /// What finish() would need at most. As soon as it is over the capacity, the body is lost.
  [[nodiscard]] std::size_t needed_bytes() const {
    return size_ + (has_held_ ? 1U : 0U) + pending_ + kTail_bytes;
  }
  /// Writes the tail and returns the size of the body, which has no zero byte at its end. The coder is
  /// done then.
  [[nodiscard]] std::size_t finish();

 private:
  static constexpr std::size_t kTail_bytes = 1;

  void normalize();
  void shift_low();
  void emit(std::uint32_t byte);

  std::uint8_t* out_ = nullptr;
  std::size_t capacity_ = 0;
  std::size_t size_ = 0;
  std::uint64_t low_ = 0;  ///< 33 bits: the top one is a carry
  std::uint32_t range_ = 0;
  std::uint32_t pending_ = 0;  ///< bytes FF behind held_, which a carry would turn to 00
  std::uint8_t held_ = 0;      ///< last byte that a carry can still change
  bool has_held_ = false;
};

class RangeDecoder {
 public:
  void start(const std::uint8_t* body, std::size_t size_bytes);
  [[nodiscard]] bool get(BitModel& model);
  [[nodiscard]] std::uint32_t get_raw(unsigned count);

  /// After the last symbol: whether the body is, byte for byte, the one that an encoder of these
  /// symbols would have written. False for any that is cut, longer or changed in its tail.
  [[nodiscard]] bool finished_exactly() const;

 private:
  void normalize();
  [[nodiscard]] std::uint32_t next_byte();

  const std::uint8_t* body_ = nullptr;
  std::size_t size_ = 0;
  std::size_t at_ = 0;  ///< bytes taken, zeros behind the end included
  std::uint32_t low_ = 0;
  std::uint32_t range_ = 0;
  std::uint32_t code_ = 0;  ///< value of the body less low_
  bool outside_ = false;    ///< the body lies where no encoder gets to
};

}  // namespace leadline::proto
