#include "hal/emu/emulated_ping1d.hpp"

#include <algorithm>
#include <utility>

namespace leadline::emu {

namespace {

constexpr unsigned kDistanceSimple = 1211;
constexpr unsigned kDistance = 1212;
constexpr unsigned kProfile = 1300;
constexpr unsigned kPulse_us = 100;
constexpr std::uint32_t kMinScan_mm = 1000;
constexpr std::uint32_t kMaxScan_mm = 200'000;
constexpr unsigned kMinInterval_ms = 20;

/// Two-way time over a length, the sound speed in mm/s.
std::int64_t two_way_ns(std::int64_t length_mm, std::int64_t speed_mm_s) {
  return 2 * length_mm * 1'000'000'000 / speed_mm_s;
}

}  // namespace

EmulatedPing1d::EmulatedPing1d(const EmulatedPing1dConfig& config, Measure measure)
    : PingDeviceEmulator(config.identity, config.byte_time_ns, config.answer_delay_us),
      config_(config),
      measure_(std::move(measure)) {
  power_on(0);
}

void EmulatedPing1d::power_on(base::TimeUs now_us) {
  mode_auto_ = true;
  enabled_ = true;
  streaming_ = false;
  scan_start_mm_ = 0;
  scan_length_mm_ = 30'000;
  sound_speed_mm_s_ = 1'500'000;
  ping_interval_ms_ = 250;
  gain_ = 1;
  t_next_ping_us_ = now_us;
  t_ping_end_us_ = kNever_us;
  under_way_ = Measurement{};
  latest_ = Measurement{};
  waiting_.clear();
}

base::TimeUs EmulatedPing1d::own_event_us() const {
  if (t_ping_end_us_ != kNever_us) {
    return t_ping_end_us_;
  }
  return enabled_ ? t_next_ping_us_ : kNever_us;
}

void EmulatedPing1d::run(base::TimeUs now_us) {
  while (own_event_us() <= now_us) {
    if (t_ping_end_us_ != kNever_us) {
      end_ping();
    } else {
      begin_ping();
    }
  }
}

void EmulatedPing1d::begin_ping() {
  const std::int64_t from_ns = two_way_ns(scan_start_mm_, sound_speed_mm_s_);
  const std::int64_t to_ns =
      two_way_ns(std::int64_t{scan_start_mm_} + scan_length_mm_, sound_speed_mm_s_);
  const base::TimeUs t_us = t_next_ping_us_;
  const Ping1dEcho echo = measure_({t_us, from_ns, to_ns, config_.samples});
  const bool heard = echo.two_way_ns > 0;
  under_way_.number = latest_.number + 1;
  under_way_.distance_mm =
      heard ? static_cast<std::uint32_t>((echo.two_way_ns * sound_speed_mm_s_ + 1'000'000'000) /
                                         2'000'000'000)
            : 0;
  under_way_.confidence_percent = heard ? static_cast<unsigned>(echo.confidence_percent) : 0;
  under_way_.scan_start_mm = scan_start_mm_;
  under_way_.scan_length_mm = scan_length_mm_;
  under_way_.gain = gain_;
  under_way_.intensity = echo.intensity;
  under_way_.intensity.resize(static_cast<std::size_t>(config_.samples), 0);
  t_ping_end_us_ = t_us + (to_ns + 999) / 1000;
  t_next_ping_us_ = std::max(t_us + base::TimeUs{ping_interval_ms_} * 1000, t_ping_end_us_);
}

void EmulatedPing1d::end_ping() {
  const base::TimeUs t_us = t_ping_end_us_ + config_.answer_delay_us;
  latest_ = under_way_;
  t_ping_end_us_ = kNever_us;
  if (streaming_) {
    send_measurement(t_us, kProfile);
  }
  for (const unsigned id : waiting_) {
    send_measurement(t_us, id);
  }
  waiting_.clear();
}

void EmulatedPing1d::send_measurement(base::TimeUs t_us, unsigned id) {
  PayloadWriter out;
  out.u32(latest_.distance_mm);
  if (id == kDistanceSimple) {
    send(t_us, id, out.u8(latest_.confidence_percent).payload());
    return;
  }
  out.u16(latest_.confidence_percent).u16(kPulse_us).u32(latest_.number);
  out.u32(latest_.scan_start_mm).u32(latest_.scan_length_mm).u32(latest_.gain);
  if (id == kProfile) {
    out.u16(static_cast<unsigned>(latest_.intensity.size())).bytes(latest_.intensity);
  }
  send(t_us, id, out.payload());
}

bool EmulatedPing1d::answer_request(base::TimeUs now_us, unsigned id) {
  const base::TimeUs t_us = now_us + config_.answer_delay_us;
  PayloadWriter out;
  switch (id) {
    case kDistanceSimple:
    case kDistance:
    case kProfile:
      if (config_.answers_with_next || latest_.number == 0) {
        waiting_.push_back(id);
      } else {
        send_measurement(t_us, id);
      }
      return true;
    case 1203:
      out.u32(sound_speed_mm_s_);
      break;
    case 1204:
      out.u32(scan_start_mm_).u32(scan_length_mm_);
      break;
    case 1205:
      out.u8(mode_auto_ ? 1 : 0);
      break;
    case 1206:
      out.u16(ping_interval_ms_);
      break;
    case 1207:
      out.u32(gain_);
      break;
    case 1208:
      out.u16(kPulse_us);
      break;
    case 1215:
      out.u8(enabled_ ? 1 : 0);
      break;
    default:
      return false;
  }
  send(t_us, id, out.payload());
  return true;
}

bool EmulatedPing1d::handle(base::TimeUs now_us, unsigned id, const Bytes& payload) {
  if ((id == 1400 || id == 1401) && payload.size() == 2) {
    if (payload_u16(payload, 0) != kProfile) {
      nack(now_us, id, "only profiles");
      return true;
    }
    streaming_ = id == 1400;
    ack(now_us, id);
    return true;
  }
  if (id < 1001 || id > 1006 || payload.empty()) {
    return false;
  }
  if (set(now_us, id, payload)) {
    ack(now_us, id);
  } else {
    nack(now_us, id, "out of range");
  }
  return true;
}

bool EmulatedPing1d::set(base::TimeUs now_us, unsigned id, const Bytes& payload) {
  static constexpr std::size_t kLength_bytes[] = {8, 4, 1, 2, 1, 1};
  if (payload.size() != kLength_bytes[id - 1001]) {
    return false;
  }
  switch (id) {
    case 1001: {
      const std::uint32_t start_mm = payload_u32(payload, 0);
      const std::uint32_t length_mm = payload_u32(payload, 4);
      if (mode_auto_ || length_mm < kMinScan_mm || length_mm > kMaxScan_mm ||
          start_mm > kMaxScan_mm) {
        return false;
      }
      scan_start_mm_ = start_mm;
      scan_length_mm_ = length_mm;
      return true;
    }
    case 1002: {
      const std::uint32_t speed_mm_s = payload_u32(payload, 0);
      if (speed_mm_s == 0) {
        return false;
      }
      sound_speed_mm_s_ = speed_mm_s;
      return true;
    }
    case 1003:
      mode_auto_ = payload[0] != 0;
      return payload[0] <= 1;
    case 1004:
      ping_interval_ms_ = std::max(payload_u16(payload, 0), kMinInterval_ms);
      return true;
    case 1005:
      if (mode_auto_ || payload[0] > 6) {
        return false;
      }
      gain_ = payload[0];
      return true;
    default:
      if (!enabled_ && payload[0] != 0) {
        t_next_ping_us_ = std::max(t_next_ping_us_, now_us);
      }
      enabled_ = payload[0] != 0;
      return true;
  }
}

}  // namespace leadline::emu
