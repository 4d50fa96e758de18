#include "firmware/pipeline/downlink.hpp"

#include "model/base/fixed.hpp"
#include "proto/cell.hpp"

namespace leadline::firmware {
namespace {

using base::max_of;
using base::min_of;

}  // namespace

void Downlink::configure(std::uint32_t rate_bytes_s, std::size_t mtu_bytes) {
  mtu_bytes_ = mtu_bytes;
  tokens_ub_ = INT64_MAX;
  set_rate(rate_bytes_s);
  size_bytes_ = 0;
  room_bytes_ = 0;
  hash_ = proto::kFnvOffset;
  total_bytes_ = 0;
  total_frames_ = 0;
}

void Downlink::set_rate(std::uint32_t rate_bytes_s) {
  rate_bytes_s_ = rate_bytes_s;
  // What leaves at once waits behind itself in the line: a second's worth at most, but some frame has to leave.
  longest_frame_bytes_ =
      max_of(kLeastBurst_bytes,
             min_of<std::size_t>(rate_bytes_s, max_of<std::size_t>(mtu_bytes_, rate_bytes_s / 8)));
  // And a little more, so that nothing is forfeited between two cycles.
  burst_bytes_ = longest_frame_bytes_ + rate_bytes_s / 16;
  tokens_ub_ = min_of(tokens_ub_, static_cast<std::int64_t>(burst_bytes_) * kByte_ub);
}

void Downlink::begin_cycle(base::TimeUs elapsed_us, std::uint32_t room_bytes) {
  size_bytes_ = 0;
  room_bytes_ = room_bytes;
  // The bucket is full long before an hour has passed: rate * elapsed stays below 2^32 * 2^32.
  constexpr base::TimeUs kLongest_us = 1'000'000'000;
  const std::int64_t full_ub = static_cast<std::int64_t>(burst_bytes_) * kByte_ub;
  const std::int64_t gain_ub =
      static_cast<std::int64_t>(rate_bytes_s_) * min_of(elapsed_us, kLongest_us);
  tokens_ub_ = min_of(tokens_ub_ + min_of(gain_ub, full_ub), full_ub);
}

std::size_t Downlink::free_bytes() const {
  const auto tokens = static_cast<std::size_t>(tokens_ub_ / kByte_ub);
  return min_of(min_of<std::size_t>(tokens, room_bytes_ - size_bytes_),
                kDownlinkCapacity_bytes - size_bytes_);
}

std::size_t Downlink::free_payload_bytes() const {
  return proto::max_payload_bytes(min_of(free_bytes(), mtu_bytes_));
}

bool Downlink::put(const std::uint8_t* payload, std::size_t payload_bytes) {
  // Written first and measured then: the bound of a payload may be longer than its frame.
  const base::Result<std::size_t> frame = proto::encode_frame(
      payload, payload_bytes, buffer_.data() + size_bytes_, kDownlinkCapacity_bytes - size_bytes_);
  if (!frame.ok() || frame.value() > min_of(free_bytes(), mtu_bytes_)) {
    return false;
  }
  for (std::size_t i = 0; i < frame.value(); ++i) {
    hash_ = (hash_ ^ buffer_[size_bytes_ + i]) * proto::kFnvPrime;
  }
  size_bytes_ += frame.value();
  tokens_ub_ -= static_cast<std::int64_t>(frame.value()) * kByte_ub;
  total_bytes_ += frame.value();
  ++total_frames_;
  return true;
}

}  // namespace leadline::firmware
