#include "hal/heads/ping1d.hpp"

#include <cstring>

#include "hal/wire.hpp"
#include "model/base/fixed.hpp"

namespace leadline::hal {

namespace {

constexpr std::uint16_t kSetRange = 1001;
constexpr std::uint16_t kSetSpeedOfSound = 1002;
constexpr std::uint16_t kSetModeAuto = 1003;
constexpr std::uint16_t kSetPingInterval = 1004;
constexpr std::uint16_t kSetGain = 1005;
constexpr std::uint16_t kSetPingEnable = 1006;
constexpr std::uint16_t kSpeedOfSound = 1203;
constexpr std::uint16_t kRange = 1204;
constexpr std::uint16_t kModeAuto = 1205;
constexpr std::uint16_t kPingInterval = 1206;
constexpr std::uint16_t kGain = 1207;
constexpr std::uint16_t kPingEnable = 1215;
constexpr std::uint16_t kDistanceSimple = 1211;
constexpr std::uint16_t kDistance = 1212;
constexpr std::uint16_t kProfile = 1300;
constexpr std::uint16_t kContinuousStart = 1400;
constexpr std::uint16_t kContinuousStop = 1401;

constexpr std::size_t kFixed_bytes = 24;  // distance, and what profile has in front of its samples
constexpr std::int64_t kMinScan_mm = 1000;
constexpr std::int64_t kMaxScan_mm = base::kMaxRange_um / 1000;
constexpr std::int64_t kMaxBin_mm = 3'000'000;  // fits 32 bits in micrometres, scaled
constexpr std::int64_t kMinInterval_ms = 20;    // the device's 50 Hz
constexpr std::int64_t kTimeout_us = 500'000;   // of a setting, and of a device that runs free
constexpr std::int64_t kUsualSamples = 200;
constexpr std::int64_t kUsualByte_ns = 86'806;  // 115200 baud
constexpr std::uint8_t kMaxGain = 6;
constexpr std::uint8_t kMaxTries = 3;
constexpr std::uint8_t kMaxInARow = PingSession::kMaxInARow;

// There and back, at the device's sound speed.
constexpr base::TimeUs travel_us(std::int64_t device_um) {
  constexpr std::int64_t kUmPerUs = kPing1dSoundSpeed_mm_s / 2000;
  return (device_um + kUmPerUs / 2) / kUmPerUs;
}

Ping1dConfig limited(Ping1dConfig config) {
  config.min_confidence_percent = base::min_of<std::uint8_t>(config.min_confidence_percent, 100);
  config.gain_setting = base::min_of(config.gain_setting, kMaxGain);
  config.poll_interval_us = base::clamp(config.poll_interval_us, 0, 60'000'000);
  config.min_range_um = base::clamp<std::int64_t>(config.min_range_um, 0, base::kMaxRange_um);
  config.max_range_um =
      base::clamp<std::int64_t>(config.max_range_um, config.min_range_um, base::kMaxRange_um);
  config.sound_speed_mm_s = base::clamp(config.sound_speed_mm_s, 1'300'000, 1'700'000);
  config.byte_time_ns = base::clamp(config.byte_time_ns, 0, 100'000'000);
  return config;
}

}  // namespace

Ping1dCodec::Ping1dCodec(const Ping1dConfig& config)
    : PingHead(ping1d_table(), PingDevice::kPing1d, config.device_id), config_(limited(config)) {}

// --- What arrives ---

bool Ping1dCodec::take(const PingFrame& frame, base::Ping& ping) {
  switch (frame.id) {
    case kDistance:
    case kProfile:
      return take_measurement(frame, ping);
    case kDistanceSimple:
      return config_.every_range && take_simple(frame, ping);
    case kPingProtocolVersion:
      if (step_ == Step::kVersion) {
        advance();
      }
      return false;
    case kPingDeviceInformation:
      take_device();
      return false;
    case kPingNack:
      take_nack(frame);
      return false;
    default:
      take_setting(frame);
      return false;
  }
}

// The checksum is weak: a measurement must also be one that the device could have made.
bool Ping1dCodec::plausible(const PingFrame& frame) const {
  const std::uint8_t* payload = frame.payload;
  const std::int64_t scan_start_mm = read_u32_le(payload + 12);
  const std::int64_t scan_length_mm = read_u32_le(payload + 16);
  if (read_u16_le(payload + 4) > 100 || read_u32_le(payload + 20) > kMaxGain ||
      scan_start_mm > kMaxScan_mm || scan_length_mm > kMaxScan_mm) {
    return false;
  }
  if (!wants_bins(frame)) {
    return true;
  }
  const std::int64_t samples = read_u16_le(payload + kFixed_bytes);
  return samples > 0 && scan_length_mm > 0 && scan_length_mm <= samples * kMaxBin_mm;
}

bool Ping1dCodec::wants_bins(const PingFrame& frame) const {
  return config_.profile && frame.id == kProfile;
}

bool Ping1dCodec::take_measurement(const PingFrame& frame, base::Ping& ping) {
  if (!plausible(frame)) {
    ++session_.counters().bad_values;
    return false;
  }
  measured(frame);
  const bool repeated = has_last_ && std::memcmp(last_.data(), frame.payload, kFixed_bytes) == 0;
  std::memcpy(last_.data(), frame.payload, kFixed_bytes);
  has_last_ = true;
  if (repeated && config_.drop_repeats) {
    ++session_.counters().repeats;
    return false;
  }

  const std::int64_t frame_bytes = frame.payload_bytes + std::int64_t{kPingOverhead_bytes};
  const std::int64_t scan_end_mm =
      std::int64_t{read_u32_le(frame.payload + 12)} + std::int64_t{read_u32_le(frame.payload + 16)};
  begin_ping(frame.t_arrival_us - frame_bytes * config_.byte_time_ns / 1000, scan_end_mm, ping);
  if (wants_bins(frame)) {
    take_profile(frame.payload, ping);
  } else {
    take_range(read_u32_le(frame.payload), read_u16_le(frame.payload + 4), ping);
  }
  return true;
}

void Ping1dCodec::begin_ping(base::TimeUs t_sent_us, std::int64_t scan_end_mm,
                             base::Ping& ping) const {
  ping = base::Ping{};
  ping.t_receive_us = t_sent_us;
  ping.t_transmit_us = t_sent_us - travel_us(scan_end_mm * 1000);
  ping.azimuth_bam32 = config_.azimuth_bam32;
  ping.elevation_bam32 = config_.elevation_bam32;
  ping.mount = config_.mount;
  ping.quality = 255;
}

// Sent when its echo was heard, for all that it says.
bool Ping1dCodec::take_simple(const PingFrame& frame, base::Ping& ping) {
  const std::uint32_t distance_mm = read_u32_le(frame.payload);
  if (frame.payload[4] > 100 || distance_mm > kMaxScan_mm) {
    ++session_.counters().bad_values;
    return false;
  }
  begin_ping(frame.t_arrival_us, distance_mm, ping);
  take_range(distance_mm, frame.payload[4], ping);
  return true;
}

void Ping1dCodec::take_range(std::uint32_t distance_mm, std::uint32_t confidence_percent,
                             base::Ping& ping) const {
  const std::uint32_t least_percent =
      config_.every_range ? 0U : base::max_of<std::uint32_t>(config_.min_confidence_percent, 1);
  const std::int64_t device_um = std::int64_t{distance_mm} * 1000;
  const std::int64_t range_um = scaled_um(device_um);
  ping.kind = base::ReturnKind::kNoReturn;
  if (range_um == 0 || confidence_percent < least_percent || range_um > config_.max_range_um) {
    return;
  }
  if (range_um < config_.min_range_um) {
    ping.quality = 0;
    return;
  }
  ping.kind = base::ReturnKind::kRange;
  ping.quality = static_cast<std::uint8_t>((confidence_percent * 255 + 50) / 100);
  ping.range_um = range_um;
  ping.t_receive_us = ping.t_transmit_us + travel_us(device_um);
}

void Ping1dCodec::take_profile(const std::uint8_t* payload, base::Ping& ping) {
  const std::uint16_t samples = read_u16_le(payload + kFixed_bytes);
  for (std::size_t i = 0; i < samples; ++i) {
    intensity_[i] = payload[kFixed_bytes + 2 + i];
  }
  const std::int64_t start_um = scaled_um(std::int64_t{read_u32_le(payload + 12)} * 1000);
  const std::int64_t length_um = scaled_um(std::int64_t{read_u32_le(payload + 16)} * 1000);
  ping.kind = base::ReturnKind::kProfile;
  ping.profile.intensity = intensity_.data();
  ping.profile.bin_count = samples;
  ping.profile.bin_um = static_cast<std::uint32_t>((length_um + samples / 2) / samples);
  ping.profile.first_bin_um = start_um + (length_um + samples) / (2 * std::int64_t{samples});
}

void Ping1dCodec::measured(const PingFrame& frame) {
  if (step_ != Step::kRun) {
    return;
  }
  session_.answered(true);
  if (config_.poll_interval_us == 0) {
    session_.expect(frame.t_arrival_us, timeout_us());  // the next one comes by itself
  }
  // A device that lost its settings shows it by counting from the start, or by its scan.
  if (has_last_ && read_u32_le(frame.payload + 8) < read_u32_le(last_.data() + 8)) {
    begin_again();
    return;
  }
  const bool same = read_u32_le(frame.payload + 12) == scan_start_mm() &&
                    read_u32_le(frame.payload + 16) == scan_length_mm();
  mismatches_ = same || !range_held_ ? std::uint8_t{0} : static_cast<std::uint8_t>(mismatches_ + 1);
  if (mismatches_ >= kMaxInARow) {
    begin_again();
  }
}

void Ping1dCodec::take_device() {
  // A wrong one is left unanswered: asked again after the time-out, in case somebody plugs in the right one.
  if (session_.right_device() && step_ == Step::kDevice) {
    advance();
  }
}

void Ping1dCodec::take_nack(const PingFrame& frame) {
  // Settings show by their read-back.
  const bool refused_question =
      (step_ == Step::kVersion && PingSession::refuses(frame, kPingProtocolVersion)) ||
      (step_ == Step::kDevice && PingSession::refuses(frame, kPingDeviceInformation));
  if (refused_question) {
    advance();
  }
}

void Ping1dCodec::take_setting(const PingFrame& frame) {
  if (step_ < Step::kManual || step_ > Step::kStart) {
    return;
  }
  const Setting wanted = setting();
  if (frame.id != wanted.read_id) {
    return;
  }
  if (std::memcmp(frame.payload, wanted.value, wanted.read_bytes) == 0) {
    range_held_ = range_held_ || step_ == Step::kRange;
    advance();
    return;
  }
  ++tries_;
  session_.answered(true);
  if (tries_ >= kMaxTries) {
    ++session_.counters().refused_settings;
    advance();
  }
}

// --- What is asked ---

void Ping1dCodec::advance() {
  step_ = static_cast<Step>(static_cast<std::uint8_t>(step_) + 1);
  tries_ = 0;
  mismatches_ = 0;
  session_.answered(true);
}

void Ping1dCodec::begin_again() {
  ++session_.counters().restarts;
  step_ = Step::kVersion;
  tries_ = 0;
  mismatches_ = 0;
  has_last_ = false;
  range_held_ = false;
  session_.answered(true);
}

void Ping1dCodec::give_up() {
  if (step_ == Step::kVersion) {
    session_.forget_silences();  // nobody there: there is nothing to begin again
  } else if (session_.silences() >= PingSession::kMaxInARow) {
    begin_again();
  }
}

std::size_t Ping1dCodec::request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity) {
  const PingAnswer answer = session_.watch(now_us);
  if (answer == PingAnswer::kSilent) {
    give_up();
  }
  if (answer != PingAnswer::kWaiting) {
    session_.poll_again(now_us);
  }
  const bool polls = step_ == Step::kRun && config_.poll_interval_us > 0;
  if (session_.waiting() || capacity < kMaxRequest_bytes ||
      (polls && !session_.due(now_us, config_.poll_interval_us))) {
    return 0;
  }
  if (step_ == Step::kRun && !polls) {
    session_.expect(now_us, timeout_us());
  } else {
    session_.asked(now_us, timeout_us());
  }
  if (polls) {
    session_.polled(config_.poll_interval_us);
  }
  return write_step(out, capacity);
}

std::int64_t Ping1dCodec::timeout_us() const {
  // Two pings: the one under way and the one that was asked for.
  const std::int64_t listening_us = 2 * travel_us(config_.max_range_um);
  if (step_ != Step::kRun || config_.poll_interval_us == 0) {
    return kTimeout_us + config_.poll_interval_us + listening_us;
  }
  const std::int64_t answer_bytes =
      std::int64_t{kPingOverhead_bytes + kFixed_bytes} + (config_.profile ? 2 + kUsualSamples : 0);
  const std::int64_t byte_ns = config_.byte_time_ns > 0 ? config_.byte_time_ns : kUsualByte_ns;
  return PingSession::kMargin_us + config_.poll_interval_us + listening_us +
         answer_bytes * byte_ns / 1000;
}

std::uint32_t Ping1dCodec::scan_start_mm() const {
  return static_cast<std::uint32_t>(config_.min_range_um * kPing1dSoundSpeed_mm_s /
                                    config_.sound_speed_mm_s / 1000);
}

std::uint32_t Ping1dCodec::scan_length_mm() const {
  const std::int64_t end_um =
      config_.max_range_um * kPing1dSoundSpeed_mm_s / config_.sound_speed_mm_s;
  const std::int64_t end_mm = (end_um + 999) / 1000;
  return static_cast<std::uint32_t>(
      base::clamp(end_mm - std::int64_t{scan_start_mm()}, kMinScan_mm, kMaxScan_mm));
}

Ping1dCodec::Setting Ping1dCodec::setting() const {
  switch (step_) {
    case Step::kManual:
      return {kSetModeAuto, kModeAuto, 1, 1, {}};
    case Step::kRange: {
      Setting range{kSetRange, kRange, 8, 8, {}};
      write_u32_le(range.value, scan_start_mm());
      write_u32_le(range.value + 4, scan_length_mm());
      return range;
    }
    case Step::kSoundSpeed: {
      Setting speed{kSetSpeedOfSound, kSpeedOfSound, 4, 4, {}};
      write_u32_le(speed.value, kPing1dSoundSpeed_mm_s);
      return speed;
    }
    case Step::kInterval: {
      Setting interval{kSetPingInterval, kPingInterval, 2, 2, {}};
      write_u16_le(interval.value, static_cast<std::uint16_t>(base::clamp<std::int64_t>(
                                       config_.poll_interval_us / 1000, kMinInterval_ms, 0xFFFF)));
      return interval;
    }
    case Step::kGain:
      return {kSetGain, kGain, 1, 4, {config_.gain_setting}};
    case Step::kStart:
      return {kSetPingEnable, kPingEnable, 1, 1, {1}};
    case Step::kVersion:
    case Step::kDevice:
    case Step::kRun:
      break;
  }
  return {};
}

std::size_t Ping1dCodec::write_step(std::uint8_t* out, std::size_t capacity) const {
  const std::uint8_t device_id = config_.device_id;
  std::uint8_t payload[2];
  write_u16_le(payload, kProfile);
  std::size_t size = 0;
  switch (step_) {
    case Step::kVersion:
      // An earlier host may have left it streaming.
      size =
          write_ping_frame(kContinuousStop, 0, device_id, payload, sizeof payload, out, capacity);
      return size + session_.write_question(kPingProtocolVersion, out + size, capacity - size);
    case Step::kDevice:
      return session_.write_question(kPingDeviceInformation, out, capacity);
    case Step::kRun:
      if (config_.poll_interval_us == 0) {
        return write_ping_frame(kContinuousStart, 0, device_id, payload, sizeof payload, out,
                                capacity);
      }
      return session_.write_question(config_.profile ? kProfile : kDistance, out, capacity);
    case Step::kManual:
    case Step::kRange:
    case Step::kSoundSpeed:
    case Step::kInterval:
    case Step::kGain:
    case Step::kStart:
      break;
  }
  const Setting wanted = setting();
  size =
      write_ping_frame(wanted.set_id, 0, device_id, wanted.value, wanted.set_bytes, out, capacity);
  return size + session_.write_question(wanted.read_id, out + size, capacity - size);
}

std::int64_t Ping1dCodec::scaled_um(std::int64_t device_um) const {
  return (device_um * config_.sound_speed_mm_s + kPing1dSoundSpeed_mm_s / 2) /
         kPing1dSoundSpeed_mm_s;
}

}  // namespace leadline::hal
