#include "hal/heads/ping360.hpp"

#include <cstring>

#include "hal/wire.hpp"
#include "model/base/fixed.hpp"

namespace leadline::hal {

namespace {

constexpr std::uint16_t kDeviceData = 2300;
constexpr std::uint16_t kAutoDeviceData = 2301;
constexpr std::uint16_t kTransducer = 2601;
constexpr std::uint16_t kAutoTransmit = 2602;
constexpr std::uint16_t kMotorOff = 2903;

constexpr std::uint8_t kMode = 1;  // asked for; a real head answers with 0 as well
constexpr std::int64_t kMinPeriod_ticks = 80;
constexpr std::int64_t kMaxPeriod_ticks = 40'000;
constexpr std::int64_t kTicksPerUs = 40;  // 25 ns
constexpr std::int64_t kMinSamples = 200;
constexpr std::int64_t kMaxSamples = kMaxPingSamples;
constexpr std::int64_t kMinPulse_us = 5;
constexpr std::int64_t kMaxPulse_us = 500;
constexpr std::int32_t kMinFrequency_khz = 500;
constexpr std::int32_t kMaxFrequency_khz = 1000;

constexpr std::int64_t kCommandTimeout_us = 500'000;
// The motor sleeps after 30 s without work and homes itself when it is woken.
constexpr std::int64_t kIdle_us = 30'000'000;
constexpr std::int64_t kHomingTimeout_us = 4'500'000;
constexpr std::int64_t kScanTimeout_us = 4'000'000;
constexpr std::int64_t kMotor_us_grad = 6'000;  // 400 steps in 2.4 s
constexpr std::uint8_t kMaxInARow = PingSession::kMaxInARow;
constexpr std::size_t kDataFixed_bytes = kPingOverhead_bytes + 14;
constexpr std::int64_t kUsualByte_ns = 86'806;  // 115200 baud

constexpr std::int32_t turn_remainder(std::int32_t grad) {
  const std::int32_t rest = grad % kPing360Turn_grad;
  return rest < 0 ? rest + kPing360Turn_grad : rest;
}

constexpr base::Bam32 bam_of(std::int32_t grad) {
  const auto turned = static_cast<std::uint64_t>(turn_remainder(grad));
  return static_cast<base::Bam32>(((turned << 32U) + 200) / 400);
}

Ping360Config limited(Ping360Config config) {
  config.gain_setting = base::min_of<std::uint8_t>(config.gain_setting, 2);
  config.poll_interval_us = base::clamp(config.poll_interval_us, 0, 60'000'000);
  config.forward_grad = turn_remainder(config.forward_grad);
  config.scan_first_grad = turn_remainder(config.scan_first_grad);
  config.scan_last_grad = turn_remainder(config.scan_last_grad);
  config.scan_step_grad = base::clamp(config.scan_step_grad, 1, 10);
  config.frequency_khz = base::clamp(config.frequency_khz, kMinFrequency_khz, kMaxFrequency_khz);
  config.max_samples = base::clamp<std::int32_t>(config.max_samples, kMinSamples, kMaxSamples);
  config.min_range_um = base::clamp<std::int64_t>(config.min_range_um, 0, base::kMaxRange_um);
  config.max_range_um =
      base::clamp<std::int64_t>(config.max_range_um, config.min_range_um, base::kMaxRange_um);
  config.sound_speed_mm_s = base::clamp(config.sound_speed_mm_s, 1'300'000, 1'700'000);
  config.byte_time_ns = base::clamp(config.byte_time_ns, 0, 100'000'000);
  return config;
}

}  // namespace

Ping360Settings ping360_settings(std::int64_t range_um, std::int32_t sound_speed_mm_s,
                                 std::int32_t max_samples) {
  const std::int64_t range = base::clamp<std::int64_t>(range_um, 1, base::kMaxRange_um);
  const std::int64_t speed = base::clamp(sound_speed_mm_s, 1'300'000, 1'700'000);
  std::int64_t samples = base::clamp<std::int64_t>(max_samples, kMinSamples, kMaxSamples);
  // Two-way travel time in ticks of 25 ns: 2 R / c.
  const std::int64_t travel_ticks = range * 80'000 / speed;
  std::int64_t period = travel_ticks / samples;
  if (period < kMinPeriod_ticks) {
    period = kMinPeriod_ticks;
    samples = base::clamp(travel_ticks / period, kMinSamples, samples);
  }
  period = base::min_of(period, kMaxPeriod_ticks);

  std::int64_t pulse_us = (8 * range + speed / 2) / speed;
  pulse_us = base::max_of(pulse_us, (5 * period + 2 * kTicksPerUs - 1) / (2 * kTicksPerUs));
  pulse_us =
      base::clamp(pulse_us, kMinPulse_us, base::min_of(kMaxPulse_us, 64 * period / kTicksPerUs));
  return {static_cast<std::uint16_t>(pulse_us), static_cast<std::uint16_t>(period),
          static_cast<std::uint16_t>(samples)};
}

Ping360Codec::Ping360Codec(const Ping360Config& config)
    : PingHead(ping360_table(), PingDevice::kPing360, config.device_id),
      config_(limited(config)),
      settings_(
          ping360_settings(config_.max_range_um, config_.sound_speed_mm_s, config_.max_samples)),
      span_grad_(turn_remainder(config_.scan_last_grad - config_.scan_first_grad)) {
  if (span_grad_ + config_.scan_step_grad >= kPing360Turn_grad) {
    span_grad_ = kPing360Turn_grad;
  }
}

// --- What arrives ---

bool Ping360Codec::take(const PingFrame& frame, base::Ping& ping) {
  switch (frame.id) {
    case kDeviceData:
    case kAutoDeviceData:
      return take_data(frame, ping);
    case kPingAck:
      take_ack(frame);
      return false;
    case kPingNack:
      take_nack(frame);
      return false;
    case kPingProtocolVersion:
      if (step_ == Step::kVersion) {
        advance(Step::kDevice);
      }
      return false;
    case kPingDeviceInformation:
      take_device();
      return false;
    default:
      return false;
  }
}

// The checksum is weak: the frame must also be one that the head could have sent.
bool Ping360Codec::take_data(const PingFrame& frame, base::Ping& ping) {
  const std::uint8_t* payload = frame.payload;
  const std::size_t tail = frame.id == kDeviceData ? 10 : 16;
  const std::uint16_t samples = read_u16_le(payload + tail);
  const std::uint16_t data_count = read_u16_le(payload + tail + 2);
  const std::uint16_t period = read_u16_le(payload + 6);
  const std::uint16_t frequency_khz = read_u16_le(payload + 8);
  const bool plausible = payload[0] <= kMode && payload[1] <= 2 &&
                         read_u16_le(payload + 2) < kPing360Turn_grad &&
                         period >= kMinPeriod_ticks && period <= kMaxPeriod_ticks &&
                         frequency_khz >= kMinFrequency_khz && frequency_khz <= kMaxFrequency_khz &&
                         samples <= kMaxSamples && (data_count == 0 || data_count == samples);
  if (!plausible) {
    ++session_.counters().bad_values;
    return false;
  }
  answered(frame, samples);
  return data_count > 0 && take_profile(frame, tail + 4, ping);
}

bool Ping360Codec::take_profile(const PingFrame& frame, std::size_t data_offset, base::Ping& ping) {
  const std::uint8_t* payload = frame.payload;
  const auto count = static_cast<std::int64_t>(frame.payload_bytes - data_offset);
  const std::int64_t period = read_u16_le(payload + 6);
  // There and back: a bin is period * 25 ns * c / 2.
  const std::int64_t bin_um = (period * config_.sound_speed_mm_s + 40'000) / 80'000;
  const std::int64_t half_bin_um = (period * config_.sound_speed_mm_s + 80'000) / 160'000;
  const std::int64_t first = base::clamp<std::int64_t>(
      (config_.min_range_um - half_bin_um + bin_um - 1) / bin_um, 0, count);
  const std::int64_t last = base::clamp<std::int64_t>(
      (config_.max_range_um - half_bin_um + bin_um) / bin_um, first, count);
  if (first == last) {
    ++session_.counters().bad_values;  // settings of another range altogether
    return false;
  }
  for (std::int64_t i = first; i < last; ++i) {
    intensity_[static_cast<std::size_t>(i - first)] =
        payload[data_offset + static_cast<std::size_t>(i)];
  }

  const std::int64_t frame_bytes = frame.payload_bytes + std::int64_t{kPingOverhead_bytes};
  const std::int32_t turned = read_u16_le(payload + 2) - config_.forward_grad;
  ping = base::Ping{};
  ping.t_receive_us = frame.t_arrival_us - frame_bytes * config_.byte_time_ns / 1000;
  ping.t_transmit_us = ping.t_receive_us - count * period / kTicksPerUs;
  ping.azimuth_bam32 = bam_of(config_.clockwise ? turned : -turned);
  ping.mount = config_.mount;
  ping.kind = base::ReturnKind::kProfile;
  ping.quality = 255;
  ping.profile.intensity = intensity_.data();
  ping.profile.bin_um = static_cast<std::uint32_t>(bin_um);
  ping.profile.first_bin_um = half_bin_um + first * bin_um;
  ping.profile.bin_count = static_cast<std::uint16_t>(last - first);
  return true;
}

void Ping360Codec::answered(const PingFrame& frame, std::uint16_t samples) {
  t_heard_us_ = frame.t_arrival_us;
  has_angle_ = true;
  angle_grad_ = read_u16_le(frame.payload + 2);
  if (!running()) {
    return;
  }
  if (step_ == Step::kPoll) {
    // An answer to an older request leaves the younger one waiting.
    if (session_.waiting() && angle_grad_ == beam_grad()) {
      session_.answered(true);
      next_beam();
    }
    return;
  }
  session_.answered(true);
  session_.expect(frame.t_arrival_us, timeout_us(frame.t_arrival_us));  // the next comes by itself
  mismatches_ =
      holds(frame.payload, samples) ? std::uint8_t{0} : static_cast<std::uint8_t>(mismatches_ + 1);
  if (mismatches_ >= kMaxInARow) {
    ++session_.counters().refused_settings;
    mismatches_ = 0;
    session_.answered(true);
  }
}

bool Ping360Codec::holds(const std::uint8_t* payload, std::uint16_t samples) const {
  return payload[1] == config_.gain_setting &&
         read_u16_le(payload + 4) == settings_.transmit_duration_us &&
         read_u16_le(payload + 6) == settings_.sample_period_ticks &&
         read_u16_le(payload + 8) == config_.frequency_khz &&
         samples == settings_.number_of_samples;
}

void Ping360Codec::take_ack(const PingFrame& frame) {
  if (step_ == Step::kStop && read_u16_le(frame.payload) == kMotorOff) {
    advance(Step::kVersion);
  }
}

void Ping360Codec::take_nack(const PingFrame& frame) {
  // A refused beam is left to its time-out.
  if (step_ == Step::kStop && read_u16_le(frame.payload) == kMotorOff) {
    advance(Step::kVersion);
  } else if (step_ == Step::kVersion && PingSession::refuses(frame, kPingProtocolVersion)) {
    advance(Step::kDevice);
  } else if (step_ == Step::kDevice && PingSession::refuses(frame, kPingDeviceInformation)) {
    advance(Step::kPoll);
  }
}

void Ping360Codec::take_device() {
  // A wrong one is left unanswered: asked again after the time-out, in case somebody plugs in the right one.
  if (!session_.right_device() || step_ != Step::kDevice) {
    return;
  }
  const std::uint8_t(&firmware)[3] = session_.device().firmware;
  const std::int32_t version = (firmware[0] << 16) | (firmware[1] << 8) | firmware[2];
  const bool scans_itself = version > 0x030300;
  advance(config_.poll_interval_us == 0 && scans_itself ? Step::kAuto : Step::kPoll);
}

// --- What is asked ---

void Ping360Codec::advance(Step step) {
  step_ = step;
  mismatches_ = 0;
  session_.answered(true);
}

void Ping360Codec::begin_again() {
  ++session_.counters().restarts;
  has_angle_ = false;
  advance(Step::kStop);
}

void Ping360Codec::give_up() {
  if (step_ == Step::kAuto) {
    begin_again();
    return;
  }
  if (session_.silences() < kMaxInARow) {
    return;
  }
  if (step_ == Step::kStop) {
    advance(Step::kVersion);  // firmware that does not say when it has stopped
    return;
  }
  if (step_ == Step::kVersion) {
    advance(Step::kStop);  // nobody there: there is nothing to begin again
    return;
  }
  begin_again();
}

std::int32_t Ping360Codec::beam_grad() const {
  return turn_remainder(config_.scan_first_grad + offset_grad_);
}

void Ping360Codec::next_beam() {
  const std::int32_t step = config_.scan_step_grad;
  if (span_grad_ == kPing360Turn_grad) {
    offset_grad_ += step;
    offset_grad_ = offset_grad_ >= kPing360Turn_grad ? 0 : offset_grad_;
    return;
  }
  if (backwards_ && offset_grad_ < step) {
    backwards_ = false;
  } else if (!backwards_ && offset_grad_ + step > span_grad_) {
    backwards_ = true;
  }
  const std::int32_t next = offset_grad_ + (backwards_ ? -step : step);
  // A sector narrower than a step is one beam.
  offset_grad_ = next < 0 || next > span_grad_ ? 0 : next;
}

std::size_t Ping360Codec::request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity) {
  const PingAnswer answer = session_.watch(now_us);
  if (answer == PingAnswer::kSilent) {
    give_up();
  }
  if (answer != PingAnswer::kWaiting) {
    session_.poll_again(now_us);
  }
  const bool polls = step_ == Step::kPoll && config_.poll_interval_us > 0;
  if (session_.waiting() || capacity < kMaxRequest_bytes ||
      (polls && !session_.due(now_us, config_.poll_interval_us))) {
    return 0;
  }
  if (step_ == Step::kAuto) {
    session_.expect(now_us, timeout_us(now_us));
  } else {
    session_.asked(now_us, timeout_us(now_us));
  }
  if (polls) {
    session_.polled(config_.poll_interval_us);
  }
  return write_step(out, capacity);
}

std::int64_t Ping360Codec::timeout_us(base::TimeUs now_us) const {
  const std::int64_t listen_us =
      std::int64_t{settings_.number_of_samples} * settings_.sample_period_ticks / kTicksPerUs;
  if (step_ == Step::kAuto) {
    return kScanTimeout_us + listen_us;
  }
  if (step_ != Step::kPoll) {
    return kCommandTimeout_us;
  }
  const std::int64_t idle_us = now_us - t_heard_us_;
  if (!has_angle_ || idle_us < 0 || idle_us > kIdle_us) {
    return kHomingTimeout_us + listen_us;
  }
  const std::int32_t turn = turn_remainder(beam_grad() - angle_grad_);
  const std::int32_t shorter = base::min_of(turn, kPing360Turn_grad - turn);
  const std::int64_t answer_bytes = std::int64_t{kDataFixed_bytes} + settings_.number_of_samples;
  const std::int64_t byte_ns = config_.byte_time_ns > 0 ? config_.byte_time_ns : kUsualByte_ns;
  return PingSession::kMargin_us + listen_us + shorter * kMotor_us_grad +
         answer_bytes * byte_ns / 1000;
}

std::size_t Ping360Codec::write_step(std::uint8_t* out, std::size_t capacity) const {
  switch (step_) {
    case Step::kStop:
      return write_ping_frame(kMotorOff, 0, config_.device_id, nullptr, 0, out, capacity);
    case Step::kVersion:
      return session_.write_question(kPingProtocolVersion, out, capacity);
    case Step::kDevice:
      return session_.write_question(kPingDeviceInformation, out, capacity);
    case Step::kPoll:
      return write_beam(out, capacity);
    case Step::kAuto:
      return write_scan(out, capacity);
  }
  return 0;
}

std::size_t Ping360Codec::write_beam(std::uint8_t* out, std::size_t capacity) const {
  std::uint8_t payload[14] = {};
  payload[0] = kMode;
  payload[1] = config_.gain_setting;
  write_u16_le(payload + 2, static_cast<std::uint16_t>(beam_grad()));
  write_u16_le(payload + 4, settings_.transmit_duration_us);
  write_u16_le(payload + 6, settings_.sample_period_ticks);
  write_u16_le(payload + 8, static_cast<std::uint16_t>(config_.frequency_khz));
  write_u16_le(payload + 10, settings_.number_of_samples);
  payload[12] = 1;  // transmit
  return write_ping_frame(kTransducer, 0, config_.device_id, payload, sizeof payload, out,
                          capacity);
}

std::size_t Ping360Codec::write_scan(std::uint8_t* out, std::size_t capacity) const {
  std::uint8_t payload[16] = {};
  payload[0] = kMode;
  payload[1] = config_.gain_setting;
  write_u16_le(payload + 2, settings_.transmit_duration_us);
  write_u16_le(payload + 4, settings_.sample_period_ticks);
  write_u16_le(payload + 6, static_cast<std::uint16_t>(config_.frequency_khz));
  write_u16_le(payload + 8, settings_.number_of_samples);
  write_u16_le(payload + 10, static_cast<std::uint16_t>(config_.scan_first_grad));
  write_u16_le(payload + 12, static_cast<std::uint16_t>(config_.scan_last_grad));
  payload[14] = static_cast<std::uint8_t>(config_.scan_step_grad);
  payload[15] = 0;  // no delay between pings
  return write_ping_frame(kAutoTransmit, 0, config_.device_id, payload, sizeof payload, out,
                          capacity);
}

}  // namespace leadline::hal
