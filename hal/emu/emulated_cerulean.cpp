#include "hal/emu/emulated_cerulean.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace leadline::emu {

namespace {

PayloadWriter& f32(PayloadWriter& out, double value) {
  const auto narrow = static_cast<float>(value);
  std::uint32_t bits = 0;
  std::memcpy(&bits, &narrow, sizeof bits);
  return out.u32(bits);
}

PayloadWriter& u64(PayloadWriter& out, std::uint64_t value) {
  return out.u32(static_cast<std::uint32_t>(value)).u32(static_cast<std::uint32_t>(value >> 32U));
}

double read_f32(const Bytes& payload, std::size_t at) {
  const std::uint32_t bits = payload_u32(payload, at);
  float value = 0;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

unsigned parameters_id(CeruleanModel model) {
  switch (model) {
    case CeruleanModel::kSurveyor:
      return 3023;
    case CeruleanModel::kOmniscan3d:
      return 3024;
    case CeruleanModel::kOmniscan450:
      return 2197;
    case CeruleanModel::kS500:
      break;
  }
  return 1015;
}

}  // namespace

EmulatedCerulean::EmulatedCerulean(const EmulatedCeruleanConfig& config, Measure measure)
    : PingDeviceEmulator(config.identity, config.byte_time_ns, config.answer_delay_us),
      config_(config),
      measure_(std::move(measure)) {
  power_on(0);
}

void EmulatedCerulean::power_on(base::TimeUs now_us) {
  t_power_us_ = now_us;
  t_ping_us_ = kNever_us;
  pinging_ = false;
  utc_ms_ = 0;
  sound_speed_m_s_ = 1500;
}

bool EmulatedCerulean::handle(base::TimeUs now_us, unsigned id, const Bytes& payload) {
  if (id == 15 && payload.size() == 12) {
    utc_ms_ = payload_u32(payload, 0) + (std::uint64_t{payload_u32(payload, 4)} << 32U);
    t_utc_us_ = now_us;
    return true;
  }
  const bool multibeam =
      config_.model == CeruleanModel::kSurveyor || config_.model == CeruleanModel::kOmniscan3d;
  if (id == 1002 && payload.size() == 4 && !multibeam) {
    sound_speed_m_s_ = payload_u32(payload, 0) / 1000.0;
    ack(now_us, id);
    return true;
  }
  const std::size_t size = config_.model == CeruleanModel::kS500 ? 20 : 36;
  if (id != parameters_id(config_.model) || payload.size() != size) {
    return false;
  }
  set_parameters(now_us, id, payload);
  return true;
}

bool EmulatedCerulean::answer_request(base::TimeUs /*now_us*/, unsigned /*id*/) { return false; }

void EmulatedCerulean::set_parameters(base::TimeUs now_us, unsigned id, const Bytes& payload) {
  bool enable = false;
  if (config_.model == CeruleanModel::kS500) {
    report_ = payload_u16(payload, 14);
    enable = report_ != 0;
    start_m_ = payload_u32(payload, 0) / 1000.0;
    end_m_ = start_m_ + payload_u32(payload, 4) / 1000.0;
    interval_us_ = payload_u16(payload, 10) * std::int64_t{1000};
    bins_ = 1024;
    if (report_ != 0 && report_ != 1223 && report_ != 1308) {
      nack(now_us, id, "no such report");
      return;
    }
  } else if (config_.model == CeruleanModel::kOmniscan450) {
    enable = payload[32] != 0;
    start_m_ = payload_u32(payload, 0) / 1000.0;
    end_m_ = start_m_ + payload_u32(payload, 4) / 1000.0;
    interval_us_ = payload_u32(payload, 8) * std::int64_t{1000};
    bins_ = static_cast<int>(payload_u16(payload, 30));
  } else {
    const bool surveyor = config_.model == CeruleanModel::kSurveyor;
    enable = payload[19] != 0;
    start_m_ = surveyor ? payload_u32(payload, 0) / 1000.0 : read_f32(payload, 0);
    end_m_ = surveyor ? payload_u32(payload, 4) / 1000.0 : read_f32(payload, 4);
    sound_speed_m_s_ = read_f32(payload, 8);
    interval_us_ = payload_u16(payload, 14) * std::int64_t{1000};
    bins_ = static_cast<int>(payload_u16(payload, 28));
    yz_ = surveyor && payload[22] != 0;
    atof_ = payload[23] != 0;
    if (bins_ < 200 || bins_ > (surveyor ? 800 : 1000) || payload[18] != 0 || payload[21] != 0) {
      nack(now_us, id, "out of range");
      return;
    }
  }
  if (end_m_ <= start_m_) {
    end_m_ = config_.auto_end_m;
  }
  ack(now_us, id);
  if (!enable) {
    pinging_ = false;
    t_ping_us_ = kNever_us;
  } else if (!pinging_) {
    pinging_ = true;
    t_ping_us_ = now_us;
  }
}

void EmulatedCerulean::run(base::TimeUs now_us) {
  while (t_ping_us_ <= now_us) {
    ping();
  }
}

void EmulatedCerulean::ping() {
  const CeruleanShot shot{t_ping_us_, start_m_, end_m_, sound_speed_m_s_, bins_};
  const CeruleanEcho echo = measure_(shot);
  ++shots_;
  const auto listen_us = static_cast<std::int64_t>(2e6 * end_m_ / sound_speed_m_s_);
  const base::TimeUs t_us = t_ping_us_ + listen_us + config_.answer_delay_us;
  t_ping_us_ += std::max(interval_us_, listen_us + 1000);
  const bool multibeam =
      config_.model == CeruleanModel::kSurveyor || config_.model == CeruleanModel::kOmniscan3d;
  if (multibeam) {
    PayloadWriter attitude;
    for (const double part : echo.up) {
      f32(attitude, part);
    }
    attitude.u32(0).u32(0).u32(0);
    u64(attitude, utc_at(shot.t_transmit_us)).u32(up_ms(shot.t_transmit_us));
    if (config_.model == CeruleanModel::kOmniscan3d) {
      attitude.u8(0);  // channel
    }
    send(t_us, 504, attitude.payload());
    if (utc_ms_ == 0) {
      send(t_us, 14, {});
    }
    send_points(t_us, shot, echo);
    return;
  }
  send_profile(t_us, shot, echo);
}

void EmulatedCerulean::send_points(base::TimeUs t_us, const CeruleanShot& shot,
                                   const CeruleanEcho& echo) {
  const auto count = static_cast<unsigned>(echo.points.size());
  const auto number = static_cast<std::uint32_t>(shots_);
  if (config_.model == CeruleanModel::kOmniscan3d) {
    PayloadWriter end;
    f32(f32(end.u32(0), shot.start_m), shot.end_m);
    end.bytes(Bytes(80 - 12, 0));
    send(t_us, 3010, end.payload());
    PayloadWriter set;
    f32(set.u32(number), shot.sound_speed_m_s).u16(count).u16(0).u32(0);
    u64(set, utc_at(shot.t_transmit_us)).u32(up_ms(shot.t_transmit_us));
    set.u8(1).u8(0).u8(0).u8(0);
    f32(f32(f32(set, 30), 20), 10).bytes(Bytes(36, 0));
    for (const auto& point : echo.points) {
      f32(f32(f32(set, point.angle_rad), point.two_way_s), point.power);
      set.u8(static_cast<unsigned>(point.kind)).u8(0).u8(0).u8(0);
    }
    send(t_us, 3104, set.payload());
    return;
  }
  if (yz_) {
    PayloadWriter set;
    f32(set.u32(up_ms(shot.t_transmit_us)).u32(number), shot.sound_speed_m_s);
    for (const double part : echo.up) {
      f32(set, part);
    }
    set.bytes(Bytes(12 + 40, 0));
    f32(f32(f32(f32(f32(set, -1000), -1000), 0), shot.start_m), shot.end_m).u16(0).u16(count);
    for (const auto& point : echo.points) {
      const double range_m = point.two_way_s * shot.sound_speed_m_s / 2;
      f32(f32(set, range_m * std::sin(point.angle_rad)), -range_m * std::cos(point.angle_rad));
    }
    send(t_us, 3011, set.payload());
  }
  if (atof_) {
    PayloadWriter set;
    u64(set.u32(up_ms(shot.t_transmit_us)), utc_at(shot.t_transmit_us));
    f32(f32(set, 2 * shot.end_m / shot.sound_speed_m_s), shot.sound_speed_m_s);
    f32(set.u32(number).u32(240'000), 0.0001).u32(0).u16(count).u16(0);
    for (const auto& point : echo.points) {
      f32(f32(set, point.angle_rad), point.two_way_s).u32(0).u32(0);
    }
    send(t_us, 3012, set.payload());
  }
}

void EmulatedCerulean::send_profile(base::TimeUs t_us, const CeruleanShot& shot,
                                    const CeruleanEcho& echo) {
  const auto mm = [](double metres) {
    return static_cast<std::uint32_t>(std::lround(metres * 1e3));
  };
  const auto number = static_cast<std::uint32_t>(shots_);
  if (report_ == 1223) {
    PayloadWriter out;
    out.u32(mm(echo.distance_m)).u32(mm(echo.distance_m)).u16(0);
    out.u8(static_cast<unsigned>(echo.confidence_percent));
    out.u8(static_cast<unsigned>(echo.confidence_percent)).u32(up_ms(shot.t_transmit_us));
    send(t_us, 1223, out.payload());
    return;
  }
  const auto range = std::minmax_element(echo.power_db.begin(), echo.power_db.end());
  const double low = echo.power_db.empty() ? 0 : *range.first;
  const double high = echo.power_db.empty() ? 0 : *range.second;
  const auto count = static_cast<unsigned>(echo.power_db.size());
  PayloadWriter out;
  out.u32(number).u32(mm(shot.start_m)).u32(mm(shot.end_m - shot.start_m));
  if (config_.model == CeruleanModel::kS500) {
    out.u32(500'000).u32(500'000).u32(100'000).u32(up_ms(shot.t_transmit_us)).u32(0);
    f32(f32(f32(f32(out, 0.0001), 1), high), low);
    f32(f32(f32(out, echo.distance_m), echo.distance_m), 0);
    out.u8(static_cast<unsigned>(echo.confidence_percent)).u8(0).u8(0).u8(0).u16(count);
  } else {
    out.u32(up_ms(shot.t_transmit_us)).u32(450'000).u16(3).u16(count);
    out.u16(static_cast<unsigned>(std::lround(shot.sound_speed_m_s * 10))).u8(0).u8(0);
    f32(f32(f32(f32(f32(f32(out, 0.0001), 1), high), low), 0), 0);
  }
  for (const double power : echo.power_db) {
    const double part = high > low ? (power - low) / (high - low) : 0;
    out.u16(static_cast<unsigned>(std::lround(part * 65535)));
  }
  send(t_us, config_.model == CeruleanModel::kS500 ? 1308 : 2198, out.payload());
}

std::uint64_t EmulatedCerulean::utc_at(base::TimeUs t_us) const {
  return utc_ms_ == 0 ? 0
                      : static_cast<std::uint64_t>(static_cast<std::int64_t>(utc_ms_) +
                                                   (t_us - t_utc_us_) / 1000);
}

std::uint32_t EmulatedCerulean::up_ms(base::TimeUs t_us) const {
  return static_cast<std::uint32_t>((t_us - t_power_us_) / 1000);
}

}  // namespace leadline::emu
