#include "proto/range_coder.hpp"

namespace leadline::proto {
namespace {

constexpr std::uint32_t kWholeRange = 0xFFFFFFFFU;
constexpr std::uint32_t kSmallRange = 1U << 24U;
constexpr std::uint64_t kCarry = std::uint64_t{1} << 32U;
constexpr unsigned kFastShift = 4;
constexpr unsigned kSlowShift = 7;
constexpr std::uint32_t kOne_q15 = 1U << 15U;

/// Part of `range` that stands for a 1: at least 2^9 * kLeastProbability_q15, less than range.
std::uint32_t one_share(std::uint32_t range, const BitModel& model) {
  const std::uint32_t one_q15 =
      (static_cast<std::uint32_t>(model.fast_q15) + static_cast<std::uint32_t>(model.slow_q15)) >>
      1U;
  return (range >> 15U) * one_q15;
}

std::uint16_t moved(std::uint16_t estimate_q15, bool bit, unsigned shift) {
  const std::uint32_t estimate = estimate_q15;
  const std::uint32_t next =
      bit ? estimate + ((kOne_q15 - kLeastProbability_q15 - estimate) >> shift)
          : estimate - ((estimate - kLeastProbability_q15) >> shift);
  return static_cast<std::uint16_t>(next);
}

void learn(BitModel& model, bool bit) {
  model.fast_q15 = moved(model.fast_q15, bit, kFastShift);
  model.slow_q15 = moved(model.slow_q15, bit, kSlowShift);
}

/// Where a body may end: the least multiple of 2^32 in [low, low + range), or else of 2^24. There is
/// one, for range is at least 2^24. It may be 2^32 itself, a carry.
std::uint64_t tail_of(std::uint32_t low, std::uint32_t range) {
  constexpr std::uint64_t kOneByte = (1U << 24U) - 1U;
  if (low == 0) {
    return 0;
  }
  const std::uint64_t end = std::uint64_t{low} + range;
  return end > kCarry ? kCarry : (low + kOneByte) & ~kOneByte;
}

}  // namespace

void RangeEncoder::start(std::uint8_t* out, std::size_t capacity_bytes) {
  *this = RangeEncoder{};
  out_ = out;
  capacity_ = capacity_bytes;
  range_ = kWholeRange;
}

void RangeEncoder::put(BitModel& model, bool bit) {
  const std::uint32_t share = one_share(range_, model);
  if (bit) {
    range_ = share;
  } else {
    low_ += share;
    range_ -= share;
  }
  learn(model, bit);
  normalize();
}

void RangeEncoder::put_raw(std::uint32_t value, unsigned count) {
  range_ >>= count;
  low_ += std::uint64_t{value} * range_;
  normalize();
}

void RangeEncoder::normalize() {
  while (range_ < kSmallRange) {
    shift_low();
    range_ <<= 8U;
  }
}

// The top byte of low moves out; it is held while a carry may still come.
void RangeEncoder::shift_low() {
  const auto low = static_cast<std::uint32_t>(low_ & 0xFFFFFFFFU);
  const std::uint32_t carry = low_ >= kCarry ? 1U : 0U;
  const bool all_ones = carry == 0 && low >= 0xFF000000U;
  if (all_ones && has_held_) {
    ++pending_;
  } else {
    if (has_held_) {
      emit(held_ + carry);
    }
    // Of bytes that are turned over at most as many are written as were put: O(1) on the average.
    for (; pending_ > 0; --pending_) {
      emit(0xFFU + carry);
    }
    held_ = static_cast<std::uint8_t>(low >> 24U);
    has_held_ = true;
  }
  low_ = std::uint64_t{low & 0x00FFFFFFU} << 8U;
}

void RangeEncoder::emit(std::uint32_t byte) {
  if (size_ < capacity_) {
    out_[size_] = static_cast<std::uint8_t>(byte & 0xFFU);
    ++size_;
  }
}

std::size_t RangeEncoder::finish() {
  const std::uint64_t carry = low_ & kCarry;
  low_ = carry + tail_of(static_cast<std::uint32_t>(low_ & 0xFFFFFFFFU), range_);
  shift_low();  // writes what was held, holds the byte of the tail
  shift_low();  // writes that
  while (size_ > 0 && out_[size_ - 1] == 0) {
    --size_;
  }
  return size_;
}

void RangeDecoder::start(const std::uint8_t* body, std::size_t size_bytes) {
  *this = RangeDecoder{};
  body_ = body;
  size_ = size_bytes;
  range_ = kWholeRange;
  for (int i = 0; i < 4; ++i) {
    code_ = (code_ << 8U) | next_byte();
  }
  outside_ = code_ >= range_;
}

std::uint32_t RangeDecoder::next_byte() {
  const std::uint32_t byte = at_ < size_ ? body_[at_] : 0U;
  ++at_;
  return byte;
}

bool RangeDecoder::get(BitModel& model) {
  const std::uint32_t share = one_share(range_, model);
  const bool bit = code_ < share;
  if (bit) {
    range_ = share;
  } else {
    low_ += share;
    code_ -= share;
    range_ -= share;
  }
  learn(model, bit);
  normalize();
  return bit;
}

std::uint32_t RangeDecoder::get_raw(unsigned count) {
  range_ >>= count;
  const std::uint32_t most = (1U << count) - 1U;
  std::uint32_t value = code_ / range_;
  if (value > most) {
    value = most;
    outside_ = true;
  }
  low_ += value * range_;
  code_ -= value * range_;
  normalize();
  return value;
}

void RangeDecoder::normalize() {
  while (range_ < kSmallRange) {
    low_ <<= 8U;
    range_ <<= 8U;
    code_ = (code_ << 8U) | next_byte();
  }
}

bool RangeDecoder::finished_exactly() const {
  if (outside_ || at_ < size_ || (size_ > 0 && body_[size_ - 1] == 0)) {
    return false;
  }
  const auto tail = static_cast<std::uint32_t>(tail_of(low_, range_) & 0xFFFFFFFFU);
  return low_ + code_ == tail;
}

}  // namespace leadline::proto
