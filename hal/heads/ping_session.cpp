#include "hal/heads/ping_session.hpp"

#include <cstring>

#include "hal/wire.hpp"
#include "model/base/fixed.hpp"

namespace leadline::hal {

namespace {

// How much more patient each failure in a row makes it.
constexpr std::int64_t kSilencePatience_us = 250'000;
constexpr std::int64_t kMaxQuiet_us = 500'000;
constexpr std::uint8_t kDamagesPerStep = 4;
// Bytes that keep coming put the end of the wait off, up to here.
constexpr std::int64_t kLongestAnswer_us = 2'000'000;

// Frames that may have been the answer. Another device's are not.
std::uint32_t damaged_frames(const CodecCounters& counters) {
  return rejected(counters) - counters.wrong_device;
}

}  // namespace

void PingSession::feed(std::uint8_t byte, base::TimeUs t_arrival_us) {
  parser_.feed(byte, t_arrival_us);
  t_byte_us_ = t_arrival_us;
  heard_ = true;
}

bool PingSession::next(PingFrame& frame) {
  while (parser_.next(frame)) {
    if (device_id_ != 0 && frame.source != device_id_) {
      ++counters().wrong_device;
      continue;
    }
    if (frame.id == kPingProtocolVersion) {
      std::memcpy(info_.protocol, frame.payload, sizeof info_.protocol);
    }
    if (frame.id == kPingDeviceInformation) {
      info_.device_type = frame.payload[0];
      info_.device_revision = frame.payload[1];
      std::memcpy(info_.firmware, frame.payload + 2, sizeof info_.firmware);
      counters().wrong_device += right_device() ? 0U : 1U;
    }
    counters().nacks += frame.id == kPingNack ? 1U : 0U;
    return true;
  }
  return false;
}

void PingSession::restart() {
  parser_.reset();
  answered(true);
}

bool PingSession::right_device() const {
  return info_.device_type == static_cast<std::uint8_t>(kind_) ||
         info_.device_type == static_cast<std::uint8_t>(PingDevice::kUnknown);
}

void PingSession::begin_wait(base::TimeUs now_us, std::int64_t timeout_us, bool asked) {
  t_asked_us_ = now_us;
  timeout_us_ = timeout_us;
  waiting_ = true;
  asked_ = asked;
  heard_ = false;
  damaged_before_ = damaged_frames(counters());
}

void PingSession::asked(base::TimeUs now_us, std::int64_t timeout_us) {
  begin_wait(now_us, timeout_us + silences_ * kSilencePatience_us, true);
}

void PingSession::expect(base::TimeUs now_us, std::int64_t timeout_us) {
  begin_wait(now_us, timeout_us, false);
}

void PingSession::answered(bool in_full) {
  waiting_ = false;
  if (in_full) {
    silences_ = 0;
    damages_ = 0;
  }
}

PingAnswer PingSession::watch(base::TimeUs now_us) {
  if (!waiting_) {
    return PingAnswer::kWaiting;
  }
  t_asked_us_ = base::min_of(t_asked_us_, now_us);
  t_byte_us_ = base::min_of(t_byte_us_, now_us);
  const bool half = asked_ && heard_ && parser_.buffered_bytes() > 0;
  const bool damaged = half || (asked_ && damaged_frames(counters()) != damaged_before_);
  const std::int64_t patience_us =
      base::min_of<std::int64_t>(kQuiet_us * (1 + damages_ / kDamagesPerStep), kMaxQuiet_us);
  const bool quiet = now_us - t_byte_us_ >= patience_us;
  const std::int64_t waited_us = now_us - t_asked_us_;
  if (damaged && quiet) {
    parser_.pause();
    waiting_ = false;
    damages_ = static_cast<std::uint8_t>(base::min_of<int>(damages_ + 1, 255));
    ++counters().timeouts;
    return PingAnswer::kDamaged;
  }
  if (waited_us < timeout_us_ || (half && waited_us < kLongestAnswer_us)) {
    return PingAnswer::kWaiting;
  }
  parser_.pause();
  waiting_ = false;
  silences_ = static_cast<std::uint8_t>(base::min_of<int>(silences_ + 1, kMaxInARow));
  ++counters().timeouts;
  return PingAnswer::kSilent;
}

bool PingSession::due(base::TimeUs now_us, std::int64_t interval_us) {
  const std::int64_t wait_us = next_poll_us_ - now_us;
  if (wait_us > interval_us || wait_us <= -interval_us) {
    next_poll_us_ = now_us;  // late by a whole poll, or time went back: no burst, no silence
  }
  return now_us >= next_poll_us_;
}

std::size_t PingSession::write_question(std::uint16_t id, std::uint8_t* out,
                                        std::size_t capacity) const {
  std::uint8_t payload[2];
  write_u16_le(payload, id);
  return write_ping_frame(kPingGeneralRequest, 0, device_id_, payload, sizeof payload, out,
                          capacity);
}

bool PingSession::refuses(const PingFrame& nack, std::uint16_t question) {
  const std::uint16_t id = read_u16_le(nack.payload);
  return id == question || id == kPingGeneralRequest;
}

}  // namespace leadline::hal
