#include "proto/range_coder.hpp"

namespace leadline::proto {
namespace {

constexpr std::uint32_t kWholeRange = 0xFFFFFFFFU;
constexpr std::uint32_t kSmallRange = 1U << 24U;
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

/// The value in [low, low + range) with most zero bytes at its end, and of those the least; may pass
/// 2^32 (a carry).
std::uint64_t tail_of(std::uint32_t low, std::uint32_t range) {
  for (unsigned kept_bytes = 0; kept_bytes < 4; ++kept_bytes) {
    const std::uint64_t zeros = (std::uint64_t{1} << (32U - 8U * kept_bytes)) - 1U;
    const std::uint64_t value = (low + zeros) & ~zeros;
    if (value - low < range) {
      return value;
    }
  }
  return low;
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
    const std::uint32_t before = low_;
    low_ += share;
    range_ -= share;
    if (low_ < before) {
      carry();
    }
  }
  learn(model, bit);
  normalize();
}

void RangeEncoder::put_raw(std::uint32_t value, unsigned count) {
  range_ >>= count;
  const std::uint32_t before = low_;
  low_ += value * range_;
  if (low_ < before) {
    carry();
  }
  normalize();
}

void RangeEncoder::normalize() {
  while (range_ < kSmallRange) {
    emit(static_cast<std::uint8_t>(low_ >> 24U));
    low_ <<= 8U;
    range_ <<= 8U;
  }
}

void RangeEncoder::emit(std::uint8_t byte) {
  if (size_ == capacity_) {
    overflowed_ = true;
    return;
  }
  out_[size_++] = byte;
}

// Turns bytes FF into 00 on its way: each of them was paid for when it was written, so that a body costs
// O(bytes) in all.
void RangeEncoder::carry() {
  for (std::size_t i = size_; i > 0; --i) {
    ++out_[i - 1];
    if (out_[i - 1] != 0) {
      return;
    }
  }
}

std::size_t RangeEncoder::finish() {
  const std::uint64_t tail = tail_of(low_, range_);
  if (tail > 0xFFFFFFFFU) {
    carry();
  }
  for (unsigned shift = 32; shift > 0; shift -= 8) {
    const auto byte = static_cast<std::uint8_t>((tail >> (shift - 8U)) & 0xFFU);
    // Zeros are not written: the decoder reads them behind the end. Only they may lack room.
    if ((tail & ((std::uint64_t{1} << shift) - 1U)) == 0) {
      break;
    }
    emit(byte);
  }
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
  value = value < most ? value : most;  // more only in a body that no encoder wrote
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
  if (at_ < size_ || (size_ > 0 && body_[size_ - 1] == 0)) {
    return false;
  }
  const auto tail = static_cast<std::uint32_t>(tail_of(low_, range_) & 0xFFFFFFFFU);
  return code_ < range_ && low_ + code_ == tail;
}

}  // namespace leadline::proto
