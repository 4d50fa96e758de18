#include "hal/emu/trax_sensor.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "hal/checksums.hpp"
#include "hal/emu/wire_bytes.hpp"

namespace leadline::emu {

namespace {

double turn(double deg) {
  const double rest = std::fmod(deg, 360.0);
  return rest < 0 ? rest + 360.0 : rest;
}

void append_component(ByteWriter& payload, unsigned id, const Motion& motion, bool distorted) {
  payload.u8(id);
  switch (id) {
    case 5:
      payload.f32(turn(motion.heading_deg));
      break;
    case 7:
      payload.f32(motion.temperature_degc);
      break;
    case 8:
      payload.u8(distorted ? 1 : 0);
      break;
    case 24:
      payload.f32(motion.pitch_deg);
      break;
    case 25:
      payload.f32(motion.roll_deg);
      break;
    case 74:
    case 75:
    case 76:
      payload.f32(motion.rate_rad_s[id - 74]);
      break;
    default:
      break;
  }
}

double seconds_of(const Bytes& payload) {
  std::uint32_t bits = 0;
  for (std::size_t i = 6; i < 10; ++i) {
    bits = (bits << 8U) | payload[i];
  }
  float seconds = 0;
  std::memcpy(&seconds, &bits, sizeof seconds);
  return static_cast<double>(seconds);
}

}  // namespace

Bytes trax_frame(unsigned id, const Bytes& payload) {
  ByteWriter frame(ByteOrder::kBig);
  frame.u16(payload.size() + 5).u8(id).append(payload);
  frame.u16(hal::crc16_xmodem(frame.bytes().data(), frame.bytes().size()));
  return frame.bytes();
}

Bytes trax_data(const Motion& motion, const std::vector<unsigned>& components, bool distorted) {
  ByteWriter payload(ByteOrder::kBig);
  payload.u8(components.size());
  for (const unsigned id : components) {
    append_component(payload, id, motion, distorted);
  }
  return trax_frame(5, payload.bytes());
}

EmulatedTrax::EmulatedTrax(const TraxSensorConfig& config, Measure measure)
    : config_(config), measure_(std::move(measure)), line_(config.byte_time_ns) {}

void EmulatedTrax::take(base::TimeUs now_us, const std::uint8_t* data, std::size_t size_bytes) {
  if (now_us < t_up_us_) {
    return;
  }
  inbox_.insert(inbox_.end(), data, data + size_bytes);
  std::size_t at = 0;
  while (inbox_.size() - at >= 5) {
    const std::size_t size = inbox_[at] * 256U + inbox_[at + 1];
    if (size < 5 || size > 64) {
      ++at;
      continue;
    }
    if (inbox_.size() - at < size) {
      break;
    }
    if (hal::crc16_xmodem(inbox_.data() + at, size) != 0) {
      ++at;
      continue;
    }
    const auto start = inbox_.begin() + static_cast<std::ptrdiff_t>(at);
    handle(now_us, inbox_[at + 2], Bytes(start + 3, start + static_cast<std::ptrdiff_t>(size) - 2));
    at += size;
  }
  inbox_.erase(inbox_.begin(), inbox_.begin() + static_cast<std::ptrdiff_t>(at));
}

void EmulatedTrax::handle(base::TimeUs now_us, unsigned id, const Bytes& payload) {
  ++requests_;
  const base::TimeUs t_answer_us = now_us + config_.answer_delay_us;
  switch (id) {
    case 1:
      line_.send(t_answer_us, trax_frame(2, {'T', 'R', 'A', 'X', '0', '1', '0', '0'}));
      break;
    case 3:
      components_.assign(payload.begin() + 1, payload.end());
      break;
    case 4:
      line_.send(t_answer_us, trax_data(measure_(now_us), components_));
      break;
    case 21:
      t_next_us_ = now_us;
      break;
    case 22:
      t_next_us_ = kNever_us;
      break;
    case 24:
      interval_us_ = std::llround(seconds_of(payload) * 1e6);
      line_.send(t_answer_us, trax_frame(26, {}));
      break;
    default:
      break;
  }
}

void EmulatedTrax::advance(base::TimeUs now_us, Bytes& out) {
  while (t_next_us_ <= now_us) {
    line_.send(t_next_us_, trax_data(measure_(t_next_us_), components_));
    t_next_us_ += std::max<std::int64_t>(interval_us_, 1'000);
  }
  Bytes unheard;
  line_.take_until(now_us, silent_ ? unheard : out);
}

base::TimeUs EmulatedTrax::next_event_us() const { return std::min(line_.next_us(), t_next_us_); }

void EmulatedTrax::reboot(base::TimeUs now_us) {
  line_.clear();
  inbox_.clear();
  components_.clear();
  interval_us_ = 0;
  t_next_us_ = kNever_us;
  t_up_us_ = now_us + config_.boot_us;
  line_.send(t_up_us_, {0x00, 0xFF, 0x13, 0x00, 0x20});
}

}  // namespace leadline::emu
