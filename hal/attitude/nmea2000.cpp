#include "hal/attitude/nmea2000.hpp"

#include "hal/angles.hpp"
#include "hal/wire.hpp"
#include "model/base/fixed.hpp"

namespace leadline::hal {

namespace {

/// 2^32 / (2 pi * 1e4), in Q16: 1e-4 rad to binary angles, error below 2e-7 of a unit.
constexpr std::int64_t kBamPerE4rad_q16 = 4'479'813'390;
constexpr std::int64_t kHalfTurn_e4rad = 31'416;
constexpr std::int64_t kMaxPressure_pa = 201'000'000;

constexpr base::Bam32 bam_of_e4rad(std::int64_t angle_e4rad) {
  return static_cast<base::Bam32>(
      static_cast<std::uint64_t>(divide_rounded(angle_e4rad * kBamPerE4rad_q16, 65'536)));
}

bool read_u16(const std::uint8_t* bytes, std::int64_t& value) {
  const std::uint16_t raw = read_u16_le(bytes);
  value = raw;
  return raw < 0xFFFDU;
}
bool read_u32(const std::uint8_t* bytes, std::int64_t& value) {
  const std::uint32_t raw = read_u32_le(bytes);
  value = raw;
  return raw < 0xFFFFFFFDU;
}
bool read_i16(const std::uint8_t* bytes, std::int64_t& value) {
  const std::uint16_t raw = read_u16_le(bytes);
  value = as_i16(raw);
  return raw < 0x7FFDU || raw > 0x8000U;
}
bool read_i32(const std::uint8_t* bytes, std::int64_t& value) {
  const std::uint32_t raw = read_u32_le(bytes);
  value = as_i32(raw);
  return raw < 0x7FFFFFFDU || raw > 0x80000000U;
}
bool read_i64(const std::uint8_t* bytes, std::int64_t& value) {
  const std::uint64_t raw = read_u64_le(bytes);
  value = as_i64(raw);
  return raw < 0x7FFFFFFFFFFFFFFDU || raw > 0x8000000000000000U;
}

bool read_angle(const std::uint8_t* bytes, std::int64_t limit_e4rad, std::int64_t& angle_e4rad) {
  return read_i16(bytes, angle_e4rad) && angle_e4rad >= -limit_e4rad && angle_e4rad <= limit_e4rad;
}

void take_system_time(const std::uint8_t* data, std::size_t days_at, base::NavSample& sample) {
  constexpr std::int64_t kDay_us = 86'400'000'000;
  constexpr std::int64_t kLongestDay_e4s = 864'010'000;  // a leap second
  std::int64_t days = 0;
  std::int64_t time_e4s = 0;
  if (read_u16(data + days_at, days) && read_u32(data + days_at + 2, time_e4s) &&
      time_e4s < kLongestDay_e4s) {
    sample.utc_us = days * kDay_us + time_e4s * 100;
    sample.fields |= base::kNavUtc;
  }
}

void take_heading(const std::uint8_t* data, const Nmea2000Config& config, base::NavSample& sample) {
  std::int64_t heading_e4rad = 0;
  const std::uint32_t reference = data[7] & 3U;  // 0 true, 1 magnetic, else not known
  if (!read_u16(data + 1, heading_e4rad) || heading_e4rad > 2 * kHalfTurn_e4rad || reference > 1) {
    return;
  }
  bool is_true = reference == 0;
  std::int64_t correction_e4rad = 0;
  if (!is_true && read_angle(data + 3, kHalfTurn_e4rad, correction_e4rad)) {
    heading_e4rad += correction_e4rad;
  }
  if (!is_true && config.use_variation && read_angle(data + 5, kHalfTurn_e4rad, correction_e4rad)) {
    heading_e4rad += correction_e4rad;
    is_true = true;
  }
  sample.fields = is_true ? base::kNavHeading : base::kNavHeadingMagnetic;
  sample.attitude.heading_bam32 = bam_of_e4rad(heading_e4rad);
}

void take_rate_of_turn(const std::uint8_t* data, base::NavSample& sample) {
  std::int64_t rate = 0;  // 3.125e-8 rad/s
  if (read_i32(data + 1, rate)) {
    sample.rate_urad_s[2] = divide_rounded(rate, 32);
    sample.fields = base::kNavYawRate;
  }
}

void take_heave(const std::uint8_t* data, const Nmea2000Config& config, base::NavSample& sample) {
  std::int64_t heave_cm = 0;
  if (read_i16(data + 1, heave_cm)) {
    sample.heave_um = (config.heave_up ? -heave_cm : heave_cm) * 10'000;
    sample.fields = base::kNavHeave;
  }
}

void take_attitude(const std::uint8_t* data, const Nmea2000Config& config,
                   base::NavSample& sample) {
  std::int64_t yaw_e4rad = 0;
  std::int64_t pitch_e4rad = 0;
  std::int64_t roll_e4rad = 0;
  if (read_angle(data + 3, kHalfTurn_e4rad / 2, pitch_e4rad) &&
      read_angle(data + 5, kHalfTurn_e4rad, roll_e4rad)) {
    sample.attitude.pitch_bam32 = bam_of_e4rad(pitch_e4rad);
    sample.attitude.roll_bam32 = bam_of_e4rad(roll_e4rad);
    sample.fields |= base::kNavRollPitch;
  }
  // Some send 0 .. 2 pi as far as the type goes: any turn that it can hold is a heading.
  if (read_i16(data + 1, yaw_e4rad)) {
    sample.attitude.heading_bam32 = bam_of_e4rad(yaw_e4rad);
    sample.fields |= config.yaw_true ? base::kNavHeading : base::kNavHeadingMagnetic;
  }
}

void take_speed(const std::uint8_t* data, base::NavSample& sample) {
  std::int64_t water_cm_s = 0;
  if (read_u16(data + 1, water_cm_s)) {
    sample.velocity_um_s[0] = water_cm_s * 10'000;
    sample.fields = base::kNavVelocityWater;
  }
}

void take_water_depth(const std::uint8_t* data, base::NavSample& sample) {
  std::int64_t depth_cm = 0;
  if (read_u32(data + 1, depth_cm) && depth_cm > 0 && depth_cm <= base::kMaxRange_um / 10'000) {
    sample.altitude_um = depth_cm * 10'000;
    sample.fields = base::kNavAltitude;
  }
}

void take_geodetic(std::int64_t latitude_e9deg, std::int64_t longitude_e9deg,
                   base::NavSample& sample) {
  constexpr std::int64_t kQuarter_e9deg = 90'000'000'000;
  if (latitude_e9deg < -kQuarter_e9deg || latitude_e9deg > kQuarter_e9deg ||
      longitude_e9deg < -2 * kQuarter_e9deg || longitude_e9deg > 2 * kQuarter_e9deg) {
    return;
  }
  sample.latitude_e9deg = latitude_e9deg;
  sample.longitude_e9deg = longitude_e9deg;
  sample.fields |= base::kNavGeodetic;
}

void take_position(const std::uint8_t* data, base::NavSample& sample) {
  std::int64_t latitude_e7deg = 0;
  std::int64_t longitude_e7deg = 0;
  if (read_i32(data, latitude_e7deg) && read_i32(data + 4, longitude_e7deg)) {
    take_geodetic(latitude_e7deg * 100, longitude_e7deg * 100, sample);
  }
}

void take_course_speed(const std::uint8_t* data, base::NavSample& sample) {
  std::int64_t course_e4rad = 0;
  std::int64_t speed_cm_s = 0;
  if ((data[1] & 3U) != 0 || !read_u16(data + 2, course_e4rad) ||
      course_e4rad > 2 * kHalfTurn_e4rad || !read_u16(data + 4, speed_cm_s)) {
    return;
  }
  const base::Bam32 course_bam32 = bam_of_e4rad(course_e4rad);
  sample.velocity_um_s[base::kNorth] =
      base::mul_shift(speed_cm_s * 10'000, base::cos_q30(course_bam32), 30);
  sample.velocity_um_s[base::kEast] =
      base::mul_shift(speed_cm_s * 10'000, base::sin_q30(course_bam32), 30);
  sample.fields = base::kNavVelocityWorld;
}

/// As NMEA 0183's GGA; 0: no fix that anybody should use.
std::uint8_t quality_of_method(std::uint32_t method) {
  // none, plain, differential, precise, RTK, RTK float, dead reckoning; 7 manual, 8 simulated
  constexpr std::uint8_t kQuality[]{0, 160, 192, 192, 255, 224, 64};
  return method < sizeof kQuality ? kQuality[method] : std::uint8_t{0};
}

void take_gnss_position(const std::uint8_t* data, base::NavSample& sample) {
  constexpr std::int64_t kE16PerE9 = 10'000'000;
  std::int64_t latitude_e16deg = 0;
  std::int64_t longitude_e16deg = 0;
  const std::uint8_t quality = quality_of_method(data[31] >> 4U);
  if (quality > 0 && read_i64(data + 7, latitude_e16deg) && read_i64(data + 15, longitude_e16deg)) {
    take_geodetic(divide_rounded(latitude_e16deg, kE16PerE9),
                  divide_rounded(longitude_e16deg, kE16PerE9), sample);
  }
  if ((sample.fields & base::kNavGeodetic) != 0) {
    sample.quality = quality;
    take_system_time(data, 1, sample);
  }
}

void take_pressure(const std::uint8_t* data, base::NavSample& sample) {
  std::int64_t pressure_dpa = 0;
  if (!read_i32(data + 3, pressure_dpa)) {
    return;
  }
  const std::int64_t pressure_pa = divide_rounded(pressure_dpa, 10);
  if (pressure_pa > 0 && pressure_pa <= kMaxPressure_pa) {
    sample.pressure_pa = pressure_pa;
    sample.fields = base::kNavPressure;
  }
}

struct Message {
  std::uint32_t pgn;
  base::NavKind kind;
  std::uint8_t min_bytes;
  bool fast;
};

constexpr Message kMessages[]{
    {kPgnSystemTime, base::NavKind::kTime, 8, false},
    {kPgnHeading, base::NavKind::kHeading, 8, false},
    {kPgnRateOfTurn, base::NavKind::kRates, 5, false},
    {kPgnHeave, base::NavKind::kHeave, 3, false},
    {kPgnAttitude, base::NavKind::kAttitude, 7, false},
    {kPgnSpeed, base::NavKind::kVelocity, 3, false},
    {kPgnWaterDepth, base::NavKind::kAltitude, 5, false},
    {kPgnPositionRapid, base::NavKind::kPosition, 8, false},
    {kPgnCourseSpeed, base::NavKind::kVelocity, 6, false},
    {kPgnGnssPosition, base::NavKind::kPosition, 32, true},
    {kPgnActualPressure, base::NavKind::kPressure, 7, false},
};

const Message* find_message(std::uint32_t pgn) {
  for (const Message& message : kMessages) {
    if (message.pgn == pgn) {
      return &message;
    }
  }
  return nullptr;
}

void take_values(std::uint32_t pgn, const std::uint8_t* data, const Nmea2000Config& config,
                 base::NavSample& sample) {
  switch (pgn) {
    case kPgnSystemTime:
      return take_system_time(data, 2, sample);
    case kPgnHeading:
      return take_heading(data, config, sample);
    case kPgnRateOfTurn:
      return take_rate_of_turn(data, sample);
    case kPgnHeave:
      return take_heave(data, config, sample);
    case kPgnAttitude:
      return take_attitude(data, config, sample);
    case kPgnSpeed:
      return take_speed(data, sample);
    case kPgnWaterDepth:
      return take_water_depth(data, sample);
    case kPgnPositionRapid:
      return take_position(data, sample);
    case kPgnCourseSpeed:
      return take_course_speed(data, sample);
    case kPgnGnssPosition:
      return take_gnss_position(data, sample);
    default:
      return take_pressure(data, sample);
  }
}

/// Whether the bytes can be a frame: the reserved ones and those behind the data are 0, and no identifier
/// is longer than its kind.
Judgement judge(const std::uint8_t* bytes, std::size_t available) {
  if (available < kCanFrame_bytes) {
    return {FrameVerdict::kMore, 0};
  }
  CanFrame frame{};
  if (!read_can_frame(bytes, frame)) {
    return {FrameVerdict::kNoStart, 0};
  }
  std::uint32_t excess = 0;
  for (std::size_t i = frame.length_bytes; i < kMaxCanData_bytes; ++i) {
    excess |= frame.data[i];
  }
  constexpr std::uint32_t kLongBits = 0x1FFFF800U;
  const bool short_id = (frame.id & (kCanExtended | kCanError)) == 0;
  if (excess != 0 || (short_id && (frame.id & kLongBits) != 0)) {
    return {FrameVerdict::kNoStart, 0};
  }
  return {FrameVerdict::kFrame, kCanFrame_bytes};
}

}  // namespace

bool Nmea2000Codec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample) {
  framer_.feed(byte, t_arrival_us, counters_);
  return next(sample);
}

bool Nmea2000Codec::next(base::NavSample& sample) {
  FrameBytes bytes{};
  while (framer_.next(judge, counters_, bytes)) {
    CanFrame frame{};
    if (read_can_frame(bytes.data, frame) && take(frame, bytes.t_arrival_us, sample)) {
      return true;
    }
  }
  return false;
}

void Nmea2000Codec::restart() {
  framer_.reset(counters_);
  counters_.unfinished += fast_packets_.reset();
}

bool Nmea2000Codec::take(const CanFrame& frame, base::TimeUs t_us, base::NavSample& sample) {
  const bool data_frame = (frame.id & (kCanExtended | kCanRemote | kCanError)) == kCanExtended;
  const std::uint32_t pgn = pgn_of(frame.id);
  const Message* message = data_frame ? find_message(pgn) : nullptr;
  if (message == nullptr) {
    ++counters_.ignored;
    return false;
  }
  const std::uint8_t source = n2k_source_of(frame.id);
  if (config_.source != kAnyN2kSource && source != config_.source) {
    ++counters_.wrong_device;
    return false;
  }
  if (!message->fast) {
    return take_message(pgn, frame.data.data(), frame.length_bytes, t_us, sample);
  }
  FastPacket packet{};
  const std::uint32_t key = (pgn << 8U) | source;
  if (!fast_packets_.take(key, frame, t_us, packet, counters_.unfinished)) {
    return false;
  }
  return take_message(pgn, packet.data, packet.size_bytes, packet.t_first_us, sample);
}

bool Nmea2000Codec::take_message(std::uint32_t pgn, const std::uint8_t* data,
                                 std::size_t size_bytes, base::TimeUs t_us,
                                 base::NavSample& sample) {
  const Message* message = find_message(pgn);
  if (size_bytes < message->min_bytes) {
    ++counters_.bad_length;
    return false;
  }
  const bool other_pressure = pgn == kPgnActualPressure &&
                              config_.pressure_source != kAnyN2kPressure &&
                              data[2] != config_.pressure_source;
  if (other_pressure) {
    ++counters_.ignored;
    return false;
  }
  sample = {};
  sample.t_us = t_us;
  sample.kind = message->kind;
  sample.quality = 255;
  take_values(pgn, data, config_, sample);
  ++counters_.records;
  counters_.no_data += sample.fields == 0 ? 1U : 0U;
  return true;
}

}  // namespace leadline::hal
