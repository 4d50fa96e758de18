#include "hal/emu/emulated_ping360.hpp"

#include <algorithm>
#include <tuple>
#include <utility>

namespace leadline::emu {

namespace {

constexpr int kTurn_grad = 400;
constexpr std::int64_t kTick_ns = 25;

bool within(unsigned value, unsigned low, unsigned high) { return value >= low && value <= high; }

}  // namespace

EmulatedPing360::EmulatedPing360(const EmulatedPing360Config& config, Measure measure)
    : PingDeviceEmulator(config.identity, config.byte_time_ns, config.answer_delay_us),
      config_(config),
      measure_(std::move(measure)) {
  power_on(0);
}

void EmulatedPing360::power_on(base::TimeUs now_us) {
  state_ = State::kIdle;
  automatic_ = false;
  motor_on_ = false;
  angle_grad_ = 0;
  settings_ = Settings{0, 32, 80, 740, 1024};
  data_.clear();
  t_event_us_ = kNever_us;
  t_work_us_ = now_us;
}

bool EmulatedPing360::handle(base::TimeUs now_us, unsigned id, const Bytes& payload) {
  if (id == 2903 && payload.empty()) {
    state_ = State::kIdle;
    automatic_ = false;
    motor_on_ = false;
    t_event_us_ = kNever_us;
    ack(now_us, id);
    return true;
  }
  if ((id == 2601 && payload.size() == 14) || (id == 2602 && payload.size() == 16)) {
    if (state_ != State::kIdle && !automatic_) {
      ++missed_;
      return true;
    }
    if (id == 2601) {
      transducer(now_us, payload);
    } else {
      auto_transmit(now_us, payload);
    }
    return true;
  }
  if (id == 2600 && payload.size() == 2) {
    reboot(now_us, 1'000'000);
    return true;
  }
  return false;
}

bool EmulatedPing360::answer_request(base::TimeUs now_us, unsigned id) {
  if (id != 2300) {
    return false;
  }
  send(now_us + config_.answer_delay_us, 2300, data_payload({}));
  return true;
}

void EmulatedPing360::transducer(base::TimeUs now_us, const Bytes& payload) {
  const Settings wanted{payload[1], payload_u16(payload, 4), payload_u16(payload, 6),
                        payload_u16(payload, 8), payload_u16(payload, 10)};
  const unsigned angle = payload_u16(payload, 2);
  if (payload[0] != 1 || wanted.gain > 2 || angle >= kTurn_grad ||
      !within(wanted.transmit_us, 1, 1000) || !within(wanted.period_ticks, 80, 40'000) ||
      !within(wanted.frequency_khz, 500, 1000) || !within(wanted.samples, 200, 1200)) {
    nack(now_us, 2601, "out of range");
    return;
  }
  settings_ = wanted;
  automatic_ = false;
  transmits_ = payload[12] == 1;
  turn_to(now_us, static_cast<int>(angle));
}

void EmulatedPing360::auto_transmit(base::TimeUs now_us, const Bytes& payload) {
  const Settings wanted{payload[1], payload_u16(payload, 2), payload_u16(payload, 4),
                        payload_u16(payload, 6), payload_u16(payload, 8)};
  const unsigned start = payload_u16(payload, 10);
  const unsigned stop = payload_u16(payload, 12);
  const auto& firmware = config_.identity.firmware;
  const bool knows = std::make_tuple(firmware[0], firmware[1], firmware[2]) >
                     std::make_tuple(std::uint8_t{3}, std::uint8_t{3}, std::uint8_t{0});
  if (!knows || payload[0] != 1 || wanted.gain > 2 || start >= kTurn_grad || stop >= kTurn_grad ||
      !within(wanted.transmit_us, 1, 1000) || !within(wanted.period_ticks, 80, 40'000) ||
      !within(wanted.frequency_khz, 500, 1000) || !within(wanted.samples, 200, 1200) ||
      !within(payload[14], 1, 10) || payload[15] > 100) {
    nack(now_us, 2602, "out of range");
    return;
  }
  settings_ = wanted;
  automatic_ = true;
  transmits_ = true;
  start_grad_ = static_cast<int>(start);
  stop_grad_ = static_cast<int>(stop);
  steps_grad_ = payload[14];
  delay_ms_ = payload[15];
  direction_ = 1;
  turn_to(now_us, start_grad_);
}

void EmulatedPing360::turn_to(base::TimeUs now_us, int angle_grad) {
  if (now_us - t_work_us_ > config_.idle_us) {
    motor_on_ = false;
  }
  const int forth = (angle_grad - angle_grad_ + kTurn_grad) % kTurn_grad;
  const std::int64_t steps = std::min(forth, kTurn_grad - forth);
  t_event_us_ = now_us + steps * config_.step_us + (motor_on_ ? 0 : config_.homing_us);
  motor_on_ = true;
  angle_grad_ = angle_grad;
  state_ = State::kTurning;
}

void EmulatedPing360::run(base::TimeUs now_us) {
  while (t_event_us_ <= now_us) {
    if (state_ == State::kTurning) {
      transmit();
    } else {
      answer();
    }
  }
}

void EmulatedPing360::transmit() {
  state_ = State::kListening;
  data_.clear();
  if (!transmits_) {
    return;
  }
  const Ping360Shot shot{t_event_us_,
                         angle_grad_,
                         settings_.period_ticks * kTick_ns,
                         static_cast<int>(settings_.samples),
                         static_cast<int>(settings_.transmit_us),
                         static_cast<int>(settings_.frequency_khz),
                         static_cast<int>(settings_.gain)};
  data_ = measure_(shot);
  data_.resize(settings_.samples, 0);
  ++shots_;
  t_event_us_ += shot.samples * shot.sample_period_ns / 1000;
}

void EmulatedPing360::answer() {
  const base::TimeUs t_us = t_event_us_;
  t_work_us_ = t_us;
  state_ = State::kIdle;
  t_event_us_ = kNever_us;
  send(t_us + config_.answer_delay_us, automatic_ ? 2301 : 2300, data_payload(data_));
  if (automatic_) {
    // The line is half-duplex: the head turns on when the frame has left.
    const std::int64_t frame_us = (30 + settings_.samples) * config_.byte_time_ns / 1000;
    turn_to(t_us + config_.answer_delay_us + frame_us + delay_ms_ * std::int64_t{1000},
            next_angle());
  }
}

// A full turn goes round, a sector to and fro.
int EmulatedPing360::next_angle() {
  const int span = (stop_grad_ - start_grad_ + kTurn_grad) % kTurn_grad;
  int offset = (angle_grad_ - start_grad_ + kTurn_grad) % kTurn_grad;
  if (span + steps_grad_ >= kTurn_grad) {
    offset += steps_grad_;
    offset = offset >= kTurn_grad ? 0 : offset;
  } else {
    if (offset + direction_ * steps_grad_ > span || offset + direction_ * steps_grad_ < 0) {
      direction_ = -direction_;
    }
    offset = std::clamp(offset + direction_ * steps_grad_, 0, span);
  }
  return (start_grad_ + offset) % kTurn_grad;
}

Bytes EmulatedPing360::data_payload(const Bytes& data) const {
  PayloadWriter out;
  out.u8(1).u8(settings_.gain).u16(static_cast<unsigned>(angle_grad_)).u16(settings_.transmit_us);
  out.u16(settings_.period_ticks).u16(settings_.frequency_khz);
  if (automatic_) {
    out.u16(static_cast<unsigned>(start_grad_)).u16(static_cast<unsigned>(stop_grad_));
    out.u8(static_cast<unsigned>(steps_grad_)).u8(static_cast<unsigned>(delay_ms_));
  }
  out.u16(settings_.samples).u16(static_cast<unsigned>(data.size())).bytes(data);
  return out.payload();
}

}  // namespace leadline::emu
