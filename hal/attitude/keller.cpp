#include "hal/attitude/keller.hpp"

#include "hal/checksums.hpp"
#include "hal/wire.hpp"
#include "model/base/fixed.hpp"

namespace leadline::hal {

namespace {

constexpr std::uint8_t kReadRegisters = 3;
constexpr std::uint8_t kRefused = 0x80;
constexpr std::uint8_t kStart = 48;
constexpr std::uint8_t kReadChannel = 73;
constexpr std::uint8_t kNotStarted = 32;
constexpr std::uint8_t kLastChannel = 5;
constexpr std::uint16_t kPressureRegister = 0x0002;
constexpr std::uint16_t kBlockRegister = 0x0100;
constexpr std::size_t kCrc_bytes = 2;
constexpr std::size_t kRefusal_bytes = 5;
constexpr std::size_t kModbusRequest_bytes = 8;
constexpr std::size_t kModbusOverhead_bytes = 5;
constexpr std::size_t kPressureBytes = 4;
constexpr std::size_t kBlockBytes = 8;

bool modbus_sealed(const std::uint8_t* bytes, std::size_t size_bytes) {
  return crc16_modbus(bytes, size_bytes - kCrc_bytes) == read_u16_le(bytes + size_bytes - 2);
}

bool keller_sealed(const std::uint8_t* bytes, std::size_t size_bytes) {
  return crc16_modbus(bytes, size_bytes - kCrc_bytes) == read_u16_be(bytes + size_bytes - 2);
}

using Sealed = bool (*)(const std::uint8_t*, std::size_t);

Judgement judge_size(const std::uint8_t* bytes, std::size_t available, std::size_t size_bytes,
                     Sealed sealed) {
  if (available < size_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  return sealed(bytes, size_bytes) ? Judgement{FrameVerdict::kFrame, size_bytes}
                                   : Judgement{FrameVerdict::kBadChecksum, 0};
}

/// A request says the high byte of its first register where an answer counts its bytes: 0 .. 2 against
/// 4 and more.
bool is_modbus_request(const std::uint8_t* bytes) {
  return bytes[1] == kReadRegisters && bytes[2] < kPressureBytes;
}

Judgement judge_modbus(const std::uint8_t* bytes, std::size_t available) {
  constexpr std::uint8_t kLastAddress = 250;
  constexpr std::uint8_t kLongestAnswer = 48;
  if (bytes[0] == 0 || bytes[0] > kLastAddress) {
    return {FrameVerdict::kNoStart, 0};
  }
  if (available < 3) {
    const bool known = available < 2 || (bytes[1] & ~kRefused) == kReadRegisters;
    return {known ? FrameVerdict::kMore : FrameVerdict::kNoStart, 0};
  }
  if (bytes[1] == (kReadRegisters | kRefused)) {
    return judge_size(bytes, available, kRefusal_bytes, modbus_sealed);
  }
  if (bytes[1] != kReadRegisters) {
    return {FrameVerdict::kNoStart, 0};
  }
  if (is_modbus_request(bytes)) {
    return judge_size(bytes, available, kModbusRequest_bytes, modbus_sealed);
  }
  if (bytes[2] % 2 != 0 || bytes[2] > kLongestAnswer) {
    return {FrameVerdict::kBadLength, 0};
  }
  return judge_size(bytes, available, kModbusOverhead_bytes + bytes[2], modbus_sealed);
}

/// A request for a channel names it (0 .. 5) where the answer has the first byte of a single: no pressure
/// or temperature but 0 begins with such a byte, and a 0 is a longer frame than its request.
Judgement judge_read_channel(const std::uint8_t* bytes, std::size_t available) {
  constexpr std::size_t kRequest_bytes = 5;
  constexpr std::size_t kAnswer_bytes = 9;
  if (available >= kRequest_bytes && bytes[2] <= kLastChannel &&
      keller_sealed(bytes, kRequest_bytes)) {
    return {FrameVerdict::kFrame, kRequest_bytes};
  }
  return judge_size(bytes, available, kAnswer_bytes, keller_sealed);
}

Judgement judge_start(const std::uint8_t* bytes, std::size_t available) {
  constexpr std::size_t kRequest_bytes = 4;
  constexpr std::size_t kAnswer_bytes = 10;
  if (available >= kRequest_bytes && keller_sealed(bytes, kRequest_bytes)) {
    return {FrameVerdict::kFrame, kRequest_bytes};
  }
  return judge_size(bytes, available, kAnswer_bytes, keller_sealed);
}

Judgement judge_keller_bus(const std::uint8_t* bytes, std::size_t available) {
  if (available < 2) {
    return {FrameVerdict::kMore, 0};
  }
  switch (bytes[1]) {
    case kStart:
      return judge_start(bytes, available);
    case kReadChannel:
      return judge_read_channel(bytes, available);
    case kStart | kRefused:
    case kReadChannel | kRefused:
      return judge_size(bytes, available, kRefusal_bytes, keller_sealed);
    default:
      return {FrameVerdict::kNoStart, 0};
  }
}

bool speaks_modbus(const std::uint8_t* bytes) { return (bytes[1] & ~kRefused) == kReadRegisters; }

Judgement judge_either(const std::uint8_t* bytes, std::size_t available) {
  return available >= 2 && speaks_modbus(bytes) ? judge_modbus(bytes, available)
                                                : judge_keller_bus(bytes, available);
}

}  // namespace

KellerCodec::KellerCodec(const KellerConfig& config) : config_(config) {
  constexpr std::int32_t kShortest_us = 10'000;
  constexpr std::int32_t kLongest_us = 60'000'000;
  config_.address = base::min_of<std::uint8_t>(config.address, 250);
  config_.poll_interval_us = base::clamp(config.poll_interval_us, kShortest_us, kLongest_us);
  config_.answer_timeout_us = base::clamp(config.answer_timeout_us, kShortest_us, kLongest_us);
  config_.byte_time_ns = base::clamp(config.byte_time_ns, 0, 100'000'000);
}

bool KellerCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample) {
  framer_.feed(byte, t_arrival_us, counters_);
  return next(sample);
}

bool KellerCodec::next(base::NavSample& sample) {
  const auto rules = config_.bus == KellerBus::kModbusRtu   ? judge_modbus
                     : config_.bus == KellerBus::kKellerBus ? judge_keller_bus
                                                            : judge_either;
  FrameBytes frame{};
  while (framer_.next(rules, counters_, frame)) {
    if (take(frame, sample)) {
      return true;
    }
  }
  return false;
}

void KellerCodec::restart() {
  framer_.reset(counters_);
  asked_ = false;
  started_ = false;
  channel_ = kPressureChannel;
  turned_ = false;
}

bool KellerCodec::take(const FrameBytes& frame, base::NavSample& sample) {
  if (config_.address != 0 && frame.data[0] != config_.address) {
    ++counters_.wrong_device;
    return false;
  }
  const bool taken =
      speaks_modbus(frame.data) ? take_modbus(frame, sample) : take_keller_bus(frame, sample);
  if (taken) {
    ++counters_.records;
    counters_.no_data += sample.fields == 0 ? 1U : 0U;
  }
  return taken;
}

void KellerCodec::begin(const FrameBytes& frame, base::NavSample& sample) const {
  const std::int64_t sent_ns = static_cast<std::int64_t>(frame.size_bytes) * config_.byte_time_ns;
  sample = {};
  sample.kind = base::NavKind::kPressure;
  sample.quality = 255;
  sample.t_us = frame.t_arrival_us - sent_ns / 1000;
}

bool KellerCodec::take_modbus(const FrameBytes& frame, base::NavSample& sample) {
  if (frame.data[1] == (kReadRegisters | kRefused)) {
    ++counters_.nacks;
    asked_ = false;
    return false;
  }
  const std::uint8_t count = frame.data[2];
  if (is_modbus_request(frame.data) || (count != kPressureBytes && count != kBlockBytes)) {
    ++counters_.ignored;
    return false;
  }
  asked_ = false;
  begin(frame, sample);
  take_pressure(frame.data + 3, sample);
  if (count == kBlockBytes) {
    take_temperature(frame.data + 3 + kPressureBytes, sample);
  }
  return true;
}

bool KellerCodec::take_keller_bus(const FrameBytes& frame, base::NavSample& sample) {
  constexpr std::size_t kStartAnswer_bytes = 10;
  constexpr std::size_t kReadAnswer_bytes = 9;
  constexpr std::size_t kStatusAt = 6;
  if ((frame.data[1] & kRefused) != 0) {
    ++counters_.nacks;
    asked_ = false;
    started_ = started_ && frame.data[2] != kNotStarted;
    return false;
  }
  if (frame.data[1] == kStart && frame.size_bytes == kStartAnswer_bytes) {
    asked_ = false;
    started_ = true;
  }
  const bool read = frame.data[1] == kReadChannel;
  if (read && frame.size_bytes != kReadAnswer_bytes) {
    channel_ = frame.data[2];  // a request heard: a recorded bus, or our own come back
  }
  const bool wanted = channel_ == kPressureChannel || channel_ == kTemperatureChannel;
  if (!read || frame.size_bytes != kReadAnswer_bytes || !wanted) {
    ++counters_.ignored;
    return false;
  }
  const bool temperature = channel_ == kTemperatureChannel;
  asked_ = false;
  begin(frame, sample);
  sample.kind = temperature ? base::NavKind::kWater : base::NavKind::kPressure;
  if (frame.data[kStatusAt] == 0 && temperature) {
    take_temperature(frame.data + 2, sample);
  } else if (frame.data[kStatusAt] == 0) {
    take_pressure(frame.data + 2, sample);
  }
  return true;
}

void KellerCodec::take_pressure(const std::uint8_t* bytes, base::NavSample& sample) const {
  constexpr std::int64_t kPaPerBar = 100'000;
  constexpr std::int64_t kLowest_pa = -101'325;
  constexpr std::int64_t kHighest_pa = 201'000'000;
  std::int64_t pressure_pa = 0;
  if (!f32_bits_to_integer(read_u32_be(bytes), kPaPerBar, pressure_pa) ||
      pressure_pa < kLowest_pa || pressure_pa > kHighest_pa) {
    return;
  }
  pressure_pa += config_.gauge_pressure ? config_.reference_pa : 0;
  if (pressure_pa > 0) {
    sample.pressure_pa = pressure_pa;
    sample.fields |= base::kNavPressure;
  }
}

void KellerCodec::take_temperature(const std::uint8_t* bytes, base::NavSample& sample) {
  constexpr std::int64_t kColdest_mdegc = -50'000;
  constexpr std::int64_t kHottest_mdegc = 150'000;
  std::int64_t temperature_mdegc = 0;
  if (f32_bits_to_integer(read_u32_be(bytes), 1000, temperature_mdegc) &&
      temperature_mdegc >= kColdest_mdegc && temperature_mdegc <= kHottest_mdegc) {
    sample.temperature_mdegc = static_cast<std::int32_t>(temperature_mdegc);
    sample.fields |= base::kNavTemperature;
  }
}

/// Times that go back restart the wait instead of stretching it.
bool KellerCodec::waiting(base::TimeUs now_us) {
  if (now_us < t_asked_us_) {
    t_asked_us_ = now_us;
  }
  const std::int64_t since_us = now_us - t_asked_us_;
  if (asked_ && since_us >= config_.answer_timeout_us) {
    ++counters_.timeouts;
    asked_ = false;
    return false;
  }
  return asked_ || since_us < config_.poll_interval_us;
}

std::size_t KellerCodec::request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity) {
  const bool listens = config_.address == 0 || config_.bus == KellerBus::kEither;
  if (listens || capacity < kMaxRequest_bytes || (polled_ && waiting(now_us))) {
    return 0;
  }
  polled_ = true;
  asked_ = true;
  t_asked_us_ = now_us;
  return config_.bus == KellerBus::kModbusRtu ? write_modbus(out) : write_keller_bus(out);
}

std::size_t KellerCodec::write_modbus(std::uint8_t* out) const {
  constexpr std::size_t kBody_bytes = 6;
  out[0] = config_.address;
  out[1] = kReadRegisters;
  write_u16_be(out + 2, config_.pressure_only ? kPressureRegister : kBlockRegister);
  write_u16_be(out + 4, config_.pressure_only ? kPressureBytes / 2 : kBlockBytes / 2);
  write_u16_le(out + kBody_bytes, crc16_modbus(out, kBody_bytes));
  return kModbusRequest_bytes;
}

std::size_t KellerCodec::write_keller_bus(std::uint8_t* out) {
  std::size_t size = 0;
  out[size++] = config_.address;
  out[size++] = started_ ? kReadChannel : kStart;
  if (started_) {
    const bool temperature = !config_.pressure_only && channel_ == kPressureChannel && turned_;
    channel_ = temperature ? kTemperatureChannel : kPressureChannel;
    turned_ = true;
    out[size++] = channel_;
  }
  write_u16_be(out + size, crc16_modbus(out, size));
  return size + kCrc_bytes;
}

}  // namespace leadline::hal
