#include "hal/attitude/trax.hpp"

#include "hal/angles.hpp"
#include "hal/checksums.hpp"
#include "hal/wire.hpp"

namespace leadline::hal {

namespace {

constexpr std::int64_t kE9 = 1'000'000'000;
constexpr std::size_t kLeast_bytes = 5;
constexpr std::int64_t kMaxRate_urad_s = 100'000'000;
constexpr std::int64_t kPause_us = 20'000;  // behind what is not answered

enum FrameId : std::uint8_t {
  kGetModInfo = 1,
  kGetModInfoResp = 2,
  kSetDataComponents = 3,
  kGetData = 4,
  kGetDataResp = 5,
  kStartContinuous = 21,
  kStopContinuous = 22,
  kSetAcqParams = 24,
  kSetAcqParamsDone = 26,
};

enum Component : std::uint8_t {
  kHeading = 5,
  kTemperature = 7,
  kDistortion = 8,
  kPitch = 24,
  kRoll = 25,
  kRateX = 74,
  kRateZ = 76,
};

/// Bytes of a component's value; 0: unknown.
std::size_t value_bytes(std::uint8_t id) {
  switch (id) {
    case kDistortion:
    case 9:   // calibration status
    case 79:  // heading status
      return 1;
    case 77:  // quaternion
      return 16;
    default:
      break;
  }
  const bool single = id == kHeading || id == kTemperature || (id >= 21 && id <= 29) ||
                      (id >= kRateX && id <= kRateZ);
  return single ? 4 : 0;
}

Judgement judge(const std::uint8_t* bytes, std::size_t available) {
  if (bytes[0] != 0) {
    return {FrameVerdict::kNoStart, 0};
  }
  if (available < 3) {
    return {FrameVerdict::kMore, 0};
  }
  const std::size_t size = bytes[1];
  if (size < kLeast_bytes || bytes[2] == 0) {
    return {FrameVerdict::kNoStart, 0};
  }
  if (available < size) {
    return {FrameVerdict::kMore, 0};
  }
  return crc16_xmodem(bytes, size) == 0 ? Judgement{FrameVerdict::kFrame, size}
                                        : Judgement{FrameVerdict::kBadChecksum, 0};
}

/// Writes size and CRC around `payload_bytes` that stand at out + 3.
std::size_t seal(std::uint8_t* out, FrameId id, std::size_t payload_bytes) {
  const std::size_t size = payload_bytes + kLeast_bytes;
  write_u16_be(out, static_cast<std::uint16_t>(size));
  out[2] = id;
  write_u16_be(out + size - 2, crc16_xmodem(out, size - 2));
  return size;
}

/// An IEEE single of `value_us` in seconds, rounded down; 0 .. 2^31 us.
std::uint32_t seconds_f32(std::int64_t value_us) {
  if (value_us <= 0) {
    return 0;
  }
  // mantissa = value * 2^shift / 1e6 with 24 bits
  std::int32_t shift = 0;
  std::int64_t mantissa = value_us;
  while (mantissa < (std::int64_t{1} << 43U)) {
    mantissa *= 2;
    ++shift;
  }
  mantissa /= 1'000'000;
  while (mantissa >= (std::int64_t{1} << 24U)) {
    mantissa >>= 1U;
    --shift;
  }
  const auto exponent = static_cast<std::uint32_t>(127 + 23 - shift);
  return (exponent << 23U) | (static_cast<std::uint32_t>(mantissa) & 0x7FFFFFU);
}

bool angle_at(const std::uint8_t* value, std::int64_t low_deg, std::int64_t high_deg,
              base::Bam32& angle_bam32) {
  std::int64_t angle_e9deg = 0;
  if (!f32_bits_to_integer(read_u32_be(value), kE9, angle_e9deg) || angle_e9deg < low_deg * kE9 ||
      angle_e9deg > high_deg * kE9) {
    return false;
  }
  angle_bam32 = bam_of_e9deg(angle_e9deg);
  return true;
}

}  // namespace

bool TraxCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample) {
  framer_.feed(byte, t_arrival_us, counters_);
  return next(sample);
}

bool TraxCodec::next(base::NavSample& sample) {
  const bool made = framer_.take_next(judge, counters_,
                                      [&](const FrameBytes& frame) { return take(frame, sample); });
  counters_.records += made ? 1U : 0U;
  return made;
}

void TraxCodec::restart() {
  framer_.reset(counters_);
  begun_ = false;
}

bool TraxCodec::take(const FrameBytes& frame, base::NavSample& sample) {
  const std::uint8_t id = frame.data[2];
  if (id == kGetDataResp) {
    return take_data(frame, sample);
  }
  answered_ = answered_ || (step_ == Step::kHello && id == kGetModInfoResp) ||
              (step_ == Step::kStart && id == kSetAcqParamsDone);
  ++counters_.ignored;
  return false;
}

bool TraxCodec::take_component(std::uint8_t id, const std::uint8_t* value,
                               base::NavSample& sample) const {
  switch (id) {
    case kHeading:
      sample.fields |= config_.true_heading ? base::kNavHeading : base::kNavHeadingMagnetic;
      return angle_at(value, -180, 360, sample.attitude.heading_bam32);
    case kPitch:
      return angle_at(value, -90, 90, sample.attitude.pitch_bam32);
    case kRoll:
      return angle_at(value, -180, 180, sample.attitude.roll_bam32);
    case kDistortion:
      sample.quality = value[0] != 0 ? 127 : sample.quality;
      return true;
    default:
      break;
  }
  if (id < kRateX || id > kRateZ) {
    return true;
  }
  std::int64_t rate_urad_s = 0;
  const bool good = f32_bits_to_integer(read_u32_be(value), 1'000'000, rate_urad_s) &&
                    rate_urad_s >= -kMaxRate_urad_s && rate_urad_s <= kMaxRate_urad_s;
  sample.rate_urad_s[id - kRateX] = good ? rate_urad_s : 0;
  return good;
}

bool TraxCodec::take_data(const FrameBytes& frame, base::NavSample& sample) {
  base::NavSample taken{};
  taken.quality = 255;
  const std::size_t end = frame.size_bytes - 2;
  std::size_t at = 4;
  std::uint32_t found = 0;  // bits: pitch, roll, rates
  bool good = end > 3;
  const std::size_t count = good ? frame.data[3] : 0;
  for (std::size_t i = 0; good && i < count; ++i) {
    const std::size_t size = at < end ? value_bytes(frame.data[at]) : 0;
    const std::uint8_t id = frame.data[at < end ? at : 0];
    good = size > 0 && at + 1 + size <= end && take_component(id, frame.data + at + 1, taken);
    found |= id == kPitch ? 1U : 0U;
    found |= id == kRoll ? 2U : 0U;
    found |= id >= kRateX && id <= kRateZ ? 4U << (id - kRateX) : 0U;
    at += 1 + size;
  }
  polled_ = false;
  if (!good || at != end) {
    ++counters_.bad_values;
    return false;
  }

  // An attitude with half of it missing is none.
  if ((found & 3U) == 3U) {
    taken.fields |= base::kNavRollPitch;
  } else {
    taken.attitude.roll_bam32 = 0;
    taken.attitude.pitch_bam32 = 0;
  }
  if ((found & 0x1CU) == 0x1CU) {
    taken.fields |= base::kNavRates;
  } else {
    taken.rate_urad_s[0] = taken.rate_urad_s[1] = taken.rate_urad_s[2] = 0;
  }
  if (taken.quality < 255 && !config_.keep_distorted) {
    taken.fields &=
        static_cast<std::uint16_t>(~unsigned{base::kNavHeading | base::kNavHeadingMagnetic});
    taken.attitude.heading_bam32 = 0;
  }
  // A device that lost its settings answers, but with nothing in it: that does not keep it alive.
  measured_ = measured_ || taken.fields != 0;
  counters_.no_data += taken.fields == 0 ? 1U : 0U;
  taken.kind = base::NavKind::kAttitude;
  taken.t_us = sent_us(frame, config_.byte_time_ns);
  sample = taken;
  return true;
}

void TraxCodec::go_on(Step next_step, base::TimeUs now_us, std::int64_t wait_us) {
  step_ = next_step;
  t_due_us_ = now_us + wait_us;
}

void TraxCodec::start_over(base::TimeUs now_us) {
  counters_.restarts += begun_ ? 1U : 0U;
  begun_ = true;
  answered_ = false;
  measured_ = false;
  polled_ = false;
  go_on(Step::kStop, now_us, 0);
}

bool TraxCodec::waits_for_answer() const {
  return (step_ == Step::kHello && hellos_ == kHellos) || step_ == Step::kStart;
}

std::size_t TraxCodec::components(std::uint8_t* out) const {
  std::size_t count = 0;
  const auto add = [out, &count](std::uint8_t id) {
    out[4 + count] = id;
    ++count;
  };
  add(kHeading);
  add(kPitch);
  add(kRoll);
  if (config_.with_distortion) {
    add(kDistortion);
  }
  for (std::uint8_t id = kRateX; config_.with_rates && id <= kRateZ; ++id) {
    add(id);
  }
  out[3] = static_cast<std::uint8_t>(count);
  return seal(out, kSetDataComponents, count + 1);
}

std::size_t TraxCodec::interval(std::uint8_t* out) const {
  out[3] = 0;  // continuous
  out[4] = 0;  // the filters keep what they have
  write_u32_be(out + 5, 0);
  write_u32_be(out + 9, seconds_f32(config_.interval_us));
  return seal(out, kSetAcqParams, 10);
}

std::size_t TraxCodec::request(base::TimeUs now_us, std::uint8_t* out, std::size_t capacity) {
  if (capacity < kMaxRequest_bytes) {
    return 0;
  }
  if (!begun_) {
    start_over(now_us);
  } else if (now_us < t_request_us_) {
    // The clock went back: waits begin anew instead of growing.
    t_due_us_ = now_us;
    t_polled_us_ = now_us;
    t_alive_us_ = now_us;
  }
  t_request_us_ = now_us;
  if (measured_) {
    measured_ = false;
    t_alive_us_ = now_us;
  }
  if (step_ == Step::kRunning && now_us - t_alive_us_ > config_.silence_us) {
    start_over(now_us);
  }
  const bool due = now_us >= t_due_us_ || (answered_ && waits_for_answer());
  return due ? send_step(now_us, out) : 0;
}

std::size_t TraxCodec::send_step(base::TimeUs now_us, std::uint8_t* out) {
  switch (step_) {
    case Step::kStop:
      hellos_ = 0;
      go_on(Step::kHello, now_us, kPause_us);
      return seal(out, kStopContinuous, 0);
    case Step::kHello:
      return send_hello(now_us, out);
    case Step::kComponents:
      t_alive_us_ = now_us;
      go_on(config_.poll ? Step::kRunning : Step::kInterval, now_us, kPause_us);
      return components(out);
    case Step::kInterval:
      answered_ = false;
      go_on(Step::kStart, now_us, config_.timeout_us);
      return interval(out);
    case Step::kStart:
      if (!answered_) {
        ++counters_.timeouts;
        start_over(now_us);
        return 0;
      }
      t_alive_us_ = now_us;
      go_on(Step::kRunning, now_us, 0);
      return seal(out, kStartContinuous, 0);
    case Step::kRunning:
      return config_.poll ? send_poll(now_us, out) : 0;
  }
  return 0;
}

std::size_t TraxCodec::send_hello(base::TimeUs now_us, std::uint8_t* out) {
  // All of them, whatever comes: the junk of power-up may eat the first, and with it the next.
  if (hellos_ < kHellos) {
    ++hellos_;
    answered_ = false;
    go_on(Step::kHello, now_us, hellos_ < kHellos ? kPause_us : config_.timeout_us);
    return seal(out, kGetModInfo, 0);
  }
  if (answered_) {
    go_on(Step::kComponents, now_us, 0);
  } else {
    ++counters_.timeouts;
    start_over(now_us);
  }
  return 0;
}

std::size_t TraxCodec::send_poll(base::TimeUs now_us, std::uint8_t* out) {
  if (polled_ && now_us - t_polled_us_ < config_.timeout_us) {
    return 0;
  }
  counters_.timeouts += polled_ ? 1U : 0U;
  polled_ = true;
  t_polled_us_ = now_us;
  go_on(Step::kRunning, now_us, config_.interval_us);
  return seal(out, kGetData, 0);
}

}  // namespace leadline::hal
