#include "hal/emu/ping_device.hpp"

#include <algorithm>

#include "hal/heads/ping_protocol.hpp"

namespace leadline::emu {

namespace {

constexpr unsigned kAck = 1;
constexpr unsigned kNack = 2;
constexpr unsigned kDeviceInformation = 4;
constexpr unsigned kProtocolVersion = 5;
constexpr unsigned kGeneralRequest = 6;
constexpr std::size_t kHeader_bytes = 8;
constexpr std::size_t kChecksum_bytes = 2;
// No request is longer; what claims to be is noise.
constexpr std::size_t kLongestRequest_bytes = 64;
constexpr unsigned kBroadcast = 255;

}  // namespace

PayloadWriter& PayloadWriter::u8(unsigned value) {
  payload_.push_back(static_cast<std::uint8_t>(value & 0xFFU));
  return *this;
}
PayloadWriter& PayloadWriter::u16(unsigned value) { return u8(value).u8(value >> 8U); }
PayloadWriter& PayloadWriter::u32(std::uint32_t value) { return u16(value).u16(value >> 16U); }
PayloadWriter& PayloadWriter::bytes(const Bytes& more) {
  payload_.insert(payload_.end(), more.begin(), more.end());
  return *this;
}

std::uint32_t payload_u16(const Bytes& payload, std::size_t at) {
  return payload.at(at) + 256U * payload.at(at + 1);
}
std::uint32_t payload_u32(const Bytes& payload, std::size_t at) {
  return payload_u16(payload, at) + 65536U * payload_u16(payload, at + 2);
}

Bytes ping_frame(unsigned id, unsigned source, unsigned destination, const Bytes& payload) {
  PayloadWriter frame;
  frame.u8('B').u8('R').u16(static_cast<unsigned>(payload.size())).u16(id);
  frame.u8(source).u8(destination).bytes(payload);
  frame.u16(hal::ping_checksum(frame.payload().data(), frame.payload().size()));
  return frame.payload();
}

void PingDeviceEmulator::take(base::TimeUs now_us, const std::uint8_t* data,
                              std::size_t size_bytes) {
  run(now_us);
  if (now_us < t_up_us_) {
    return;  // booting: nobody listens
  }
  inbox_.insert(inbox_.end(), data, data + size_bytes);
  std::size_t used = take_frame(now_us);
  while (used > 0) {
    // A reset command has emptied the inbox.
    used = std::min(used, inbox_.size());
    inbox_.erase(inbox_.begin(), inbox_.begin() + static_cast<std::ptrdiff_t>(used));
    used = take_frame(now_us);
  }
}

// Bytes at the front that are done with; 0: more must come first.
std::size_t PingDeviceEmulator::take_frame(base::TimeUs now_us) {
  const auto start = std::find(inbox_.begin(), inbox_.end(), std::uint8_t{'B'});
  if (start != inbox_.begin()) {
    return static_cast<std::size_t>(start - inbox_.begin());
  }
  if (inbox_.size() < kHeader_bytes) {
    return 0;
  }
  const std::size_t payload_bytes = payload_u16(inbox_, 2);
  if (inbox_[1] != 'R' || payload_bytes > kLongestRequest_bytes) {
    return 1;
  }
  const std::size_t checked_bytes = kHeader_bytes + payload_bytes;
  if (inbox_.size() < checked_bytes + kChecksum_bytes) {
    return 0;
  }
  if (hal::ping_checksum(inbox_.data(), checked_bytes) != payload_u16(inbox_, checked_bytes)) {
    ++bad_requests_;
    return 1;
  }
  const unsigned destination = inbox_[7];
  if (destination == 0 || destination == kBroadcast || destination == identity_.device_id) {
    const Bytes payload(inbox_.begin() + kHeader_bytes,
                        inbox_.begin() + static_cast<std::ptrdiff_t>(checked_bytes));
    ++requests_;
    handle_frame(now_us, payload_u16(inbox_, 4), payload);
  }
  return checked_bytes + kChecksum_bytes;
}

void PingDeviceEmulator::handle_frame(base::TimeUs now_us, unsigned id, const Bytes& payload) {
  const bool general = id == kGeneralRequest;
  if (!general && handle(now_us, id, payload)) {
    return;
  }
  if (payload.size() != (general ? 2U : 0U)) {
    nack(now_us, id, "no such command");
    return;
  }
  // By general_request, or as old hosts ask: the wanted message itself, empty.
  const unsigned wanted = general ? payload_u16(payload, 0) : id;
  const base::TimeUs t_us = now_us + answer_delay_us_;
  if (wanted == kProtocolVersion) {
    const auto& v = identity_.protocol;
    send(t_us, kProtocolVersion, PayloadWriter().u8(v[0]).u8(v[1]).u8(v[2]).u8(0).payload());
  } else if (wanted == kDeviceInformation) {
    const auto& v = identity_.firmware;
    PayloadWriter info;
    info.u8(identity_.device_type).u8(identity_.revision).u8(v[0]).u8(v[1]).u8(v[2]).u8(0);
    send(t_us, kDeviceInformation, info.payload());
  } else if (!answer_request(now_us, wanted)) {
    nack(now_us, wanted, "no such message");
  }
}

void PingDeviceEmulator::advance(base::TimeUs now_us, Bytes& out) {
  run(now_us);
  if (!silent_) {
    line_.take_until(now_us, out);
    return;
  }
  Bytes unheard;
  line_.take_until(now_us, unheard);
}

base::TimeUs PingDeviceEmulator::next_event_us() const {
  return std::min(line_.next_us(), own_event_us());
}

void PingDeviceEmulator::reboot(base::TimeUs now_us, std::int64_t boot_us) {
  run(now_us);
  line_.clear();
  inbox_.clear();
  t_up_us_ = now_us + boot_us;
  power_on(t_up_us_);
}

void PingDeviceEmulator::send(base::TimeUs t_us, unsigned id, const Bytes& payload) {
  line_.send(t_us, ping_frame(id, identity_.device_id, 0, payload));
}

void PingDeviceEmulator::ack(base::TimeUs now_us, unsigned id) {
  send(now_us + answer_delay_us_, kAck, PayloadWriter().u16(id).payload());
}

void PingDeviceEmulator::nack(base::TimeUs now_us, unsigned id, const std::string& reason) {
  const Bytes text(reason.begin(), reason.end());
  send(now_us + answer_delay_us_, kNack, PayloadWriter().u16(id).bytes(text).payload());
}

}  // namespace leadline::emu
