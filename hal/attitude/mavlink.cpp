#include "hal/attitude/mavlink.hpp"

#include "hal/angles.hpp"
#include "hal/wire.hpp"
#include "model/base/fixed.hpp"

namespace leadline::hal {

namespace {

using Payload = std::array<std::uint8_t, kMaxMavlinkPayload_bytes>;

/// 2^32 / (2 pi), within 6e-10 of it.
constexpr std::int64_t kBam32PerRadian = 683'565'276;
constexpr std::int64_t kMaxAngle_urad = 6'300'000;  // a little over a turn
constexpr std::int64_t kMaxRate_urad_s = 100'000'000;
constexpr std::int64_t kMaxPressure_pa = 201'000'000;
constexpr std::int64_t kMaxSpeed_um_s = 100'000'000;

/// The single at `bytes` times `scale`, within +-limit. False for NaN and all else.
bool read_scaled(const std::uint8_t* bytes, std::int64_t scale, std::int64_t limit,
                 std::int64_t& value) {
  return f32_bits_to_integer(read_u32_le(bytes), scale, value) && value >= -limit && value <= limit;
}

/// Three singles in a row, all or none.
bool read_three(const std::uint8_t* bytes, std::int64_t scale, std::int64_t limit,
                std::int64_t (&values)[3]) {
  std::int64_t read[3]{};
  for (std::size_t i = 0; i < 3; ++i) {
    if (!read_scaled(bytes + 4 * i, scale, limit, read[i])) {
      return false;
    }
  }
  for (std::size_t i = 0; i < 3; ++i) {
    values[i] = read[i];
  }
  return true;
}

bool read_angle(const std::uint8_t* bytes, base::Bam32& angle_bam32) {
  std::int64_t angle_urad = 0;
  std::int64_t angle = 0;
  if (!read_scaled(bytes, 1'000'000, kMaxAngle_urad, angle_urad) ||
      !f32_bits_to_integer(read_u32_le(bytes), kBam32PerRadian, angle)) {
    return false;
  }
  angle_bam32 = static_cast<base::Bam32>(static_cast<std::uint64_t>(angle));
  return true;
}

std::int64_t boot_time_us(const Payload& payload) {
  return std::int64_t{read_u32_le(payload.data())} * 1000;
}

base::NavField heading_field(const MavlinkConfig& config) {
  return config.heading_true ? base::kNavHeading : base::kNavHeadingMagnetic;
}

void take_rates(const std::uint8_t* bytes, base::NavSample& sample) {
  if (read_three(bytes, 1'000'000, kMaxRate_urad_s, sample.rate_urad_s)) {
    sample.fields |= base::kNavRates;
  }
}

void take_attitude(const Payload& payload, const MavlinkConfig& config, base::NavSample& sample) {
  sample.t_device_us = boot_time_us(payload);
  base::Attitude attitude{};
  const bool levelled =
      read_angle(&payload[4], attitude.roll_bam32) && read_angle(&payload[8], attitude.pitch_bam32);
  if (levelled) {
    sample.attitude.roll_bam32 = attitude.roll_bam32;
    sample.attitude.pitch_bam32 = attitude.pitch_bam32;
    sample.fields |= base::kNavRollPitch;
  }
  if (read_angle(&payload[12], attitude.heading_bam32)) {
    sample.attitude.heading_bam32 = attitude.heading_bam32;
    sample.fields |= heading_field(config);
  }
  take_rates(&payload[16], sample);
}

void take_quaternion(const Payload& payload, const MavlinkConfig& config, base::NavSample& sample) {
  sample.t_device_us = boot_time_us(payload);
  constexpr std::int64_t kLimit_q30 = std::int64_t{2} * base::kOne_q30;
  std::array<std::int64_t, 4> parts_q30{};
  bool good = true;
  for (std::size_t i = 0; i < parts_q30.size(); ++i) {
    good = good && read_scaled(&payload[4 + 4 * i], base::kOne_q30, kLimit_q30, parts_q30[i]);
  }
  Rotation rotation{};
  if (good && rotation_of_quaternion(parts_q30, rotation)) {
    sample.attitude = attitude_of(rotation);
    sample.fields |= base::kNavRollPitch | heading_field(config);
  }
  take_rates(&payload[20], sample);
}

void take_pressure(const Payload& payload, base::NavSample& sample) {
  constexpr std::int64_t kPaPerHpa = 100;
  constexpr std::int64_t kColdest_cdegc = -5000;
  constexpr std::int64_t kHottest_cdegc = 15'000;
  sample.t_device_us = boot_time_us(payload);
  std::int64_t pressure_pa = 0;
  if (!read_scaled(&payload[4], kPaPerHpa, kMaxPressure_pa, pressure_pa) || pressure_pa <= 0) {
    return;  // a sensor that failed: its temperature is no better
  }
  sample.pressure_pa = pressure_pa;
  sample.fields = base::kNavPressure;
  const std::int64_t temperature_cdegc = as_i16(read_u16_le(&payload[12]));
  if (temperature_cdegc >= kColdest_cdegc && temperature_cdegc <= kHottest_cdegc) {
    sample.temperature_mdegc = static_cast<std::int32_t>(temperature_cdegc * 10);
    sample.fields |= base::kNavTemperature;
  }
}

void take_global_position(const Payload& payload, base::NavSample& sample) {
  constexpr std::int64_t kQuarter_e7deg = 900'000'000;
  sample.t_device_us = boot_time_us(payload);
  const std::int64_t latitude_e7deg = as_i32(read_u32_le(&payload[4]));
  const std::int64_t longitude_e7deg = as_i32(read_u32_le(&payload[8]));
  const bool none = latitude_e7deg == 0 && longitude_e7deg == 0;
  if (none || latitude_e7deg < -kQuarter_e7deg || latitude_e7deg > kQuarter_e7deg ||
      longitude_e7deg < -2 * kQuarter_e7deg || longitude_e7deg > 2 * kQuarter_e7deg) {
    return;
  }
  sample.latitude_e9deg = latitude_e7deg * 100;
  sample.longitude_e9deg = longitude_e7deg * 100;
  for (std::size_t i = 0; i < 3; ++i) {
    sample.velocity_um_s[i] = std::int64_t{as_i16(read_u16_le(&payload[20 + 2 * i]))} * 10'000;
  }
  sample.fields = base::kNavGeodetic | base::kNavVelocityWorld;
}

bool take_local(const std::uint8_t* bytes, base::NavSample& sample) {
  constexpr std::int64_t kUmPerMetre = 1'000'000;
  std::int64_t position_um[3]{};
  if (!read_three(bytes, kUmPerMetre, base::kMaxHorizontal_um, position_um) ||
      position_um[base::kDown] < -base::kMaxVertical_um ||
      position_um[base::kDown] > base::kMaxVertical_um) {
    return false;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    sample.position_um[i] = position_um[i];
  }
  sample.fields |= base::kNavPositionLocal;
  return true;
}

void take_local_position(const Payload& payload, base::NavSample& sample) {
  constexpr std::int64_t kUmPerMetre = 1'000'000;
  sample.t_device_us = boot_time_us(payload);
  (void)take_local(&payload[4], sample);
  if (read_three(&payload[16], kUmPerMetre, kMaxSpeed_um_s, sample.velocity_um_s)) {
    sample.fields |= base::kNavVelocityWorld;
  }
}

/// Root of a variance in m^2, in mm; 0 when it is none (NaN: not stated).
std::uint32_t sigma_mm(const std::uint8_t* bytes) {
  constexpr std::int64_t kMm2PerM2 = 1'000'000;
  constexpr std::int64_t kLargest_mm2 = std::int64_t{1} << 50U;
  std::int64_t variance_mm2 = 0;
  if (!read_scaled(bytes, kMm2PerM2, kLargest_mm2, variance_mm2) || variance_mm2 <= 0) {
    return 0;
  }
  return isqrt_u64(static_cast<std::uint64_t>(variance_mm2));
}

void take_vision(const Payload& payload, base::NavSample& sample) {
  // Upper triangle of a 6 x 6 matrix, by rows: x at 0, y at 6, z at 11.
  constexpr std::size_t kX = 32;
  constexpr std::size_t kY = kX + std::size_t{4} * 6;
  constexpr std::size_t kDown = kX + std::size_t{4} * 11;
  if (!take_local(&payload[8], sample)) {
    return;
  }
  sample.sigma_position_mm = base::max_of(sigma_mm(&payload[kX]), sigma_mm(&payload[kY]));
  sample.sigma_vertical_mm = sigma_mm(&payload[kDown]);
}

/// Frames of ODOMETRY that say which way is which.
constexpr std::uint8_t kLocalNed = 1;
constexpr std::uint8_t kBodyFrd = 12;

void take_odometry(const Payload& payload, base::NavSample& sample) {
  constexpr std::int64_t kUmPerMetre = 1'000'000;
  // Upper triangles of 6 x 6 matrices, by rows: x at 0, y at 6, z at 11.
  constexpr std::size_t kPose = 60;
  constexpr std::size_t kVelocity = 144;
  constexpr std::size_t kSecond = std::size_t{4} * 6;
  constexpr std::size_t kThird = std::size_t{4} * 11;
  const std::uint64_t time_us = read_u64_le(payload.data());
  sample.t_device_us = time_us < (std::uint64_t{1} << 62U) ? static_cast<std::int64_t>(time_us) : 0;
  const std::uint8_t frame = payload[228];
  const std::uint8_t child = payload[229];
  const auto quality = static_cast<std::int8_t>(payload[232]);  // -1 failed, 0 not stated, 1 .. 100
  if (quality < 0) {
    return;
  }
  if (quality > 0 && quality <= 100) {
    sample.quality = static_cast<std::uint8_t>(quality * 255 / 100);
  }
  if (frame == kLocalNed && take_local(&payload[8], sample)) {
    sample.sigma_position_mm =
        base::max_of(sigma_mm(&payload[kPose]), sigma_mm(&payload[kPose + kSecond]));
    sample.sigma_vertical_mm = sigma_mm(&payload[kPose + kThird]);
  }
  if ((child == kBodyFrd || child == kLocalNed) &&
      read_three(&payload[36], kUmPerMetre, kMaxSpeed_um_s, sample.velocity_um_s)) {
    sample.fields |= child == kBodyFrd ? base::kNavVelocityBody : base::kNavVelocityWorld;
    std::uint32_t sigma_mm_s = 0;
    for (const std::size_t at : {kVelocity, kVelocity + kSecond, kVelocity + kThird}) {
      sigma_mm_s = base::max_of(sigma_mm_s, sigma_mm(&payload[at]));
    }
    sample.sigma_velocity_um_s = base::min_of<std::uint32_t>(sigma_mm_s, 1'000'000) * 1000;
  }
}

void set_altitude(std::int64_t altitude_um, base::NavSample& sample) {
  if (altitude_um > 0 && altitude_um <= base::kMaxRange_um) {
    sample.altitude_um = altitude_um;
    sample.fields = base::kNavAltitude;
  }
}

void take_distance(const Payload& payload, base::NavSample& sample) {
  constexpr std::uint16_t kNone_cm = 0xFFFF;
  constexpr std::uint8_t kInvalidQuality = 1;  // 0: not stated; 100: best
  sample.t_device_us = boot_time_us(payload);
  const std::uint16_t min_cm = read_u16_le(&payload[4]);
  const std::uint16_t max_cm = read_u16_le(&payload[6]);
  const std::uint16_t distance_cm = read_u16_le(&payload[8]);
  const std::uint8_t quality = payload[38];
  if (distance_cm == kNone_cm || distance_cm < min_cm || (max_cm > 0 && distance_cm > max_cm) ||
      quality == kInvalidQuality) {
    return;
  }
  if (quality > 0 && quality <= 100) {
    sample.quality = static_cast<std::uint8_t>(quality * 255 / 100);
  }
  set_altitude(std::int64_t{distance_cm} * 10'000, sample);
}

void take_rangefinder(const Payload& payload, base::NavSample& sample) {
  std::int64_t distance_um = 0;
  if (read_scaled(payload.data(), 1'000'000, base::kMaxRange_um, distance_um)) {
    set_altitude(distance_um, sample);
  }
}

void take_system_time(const Payload& payload, base::NavSample& sample) {
  const std::uint64_t unix_us = read_u64_le(payload.data());
  sample.t_device_us = std::int64_t{read_u32_le(&payload[8])} * 1000;
  if (unix_us > 0 && unix_us < (std::uint64_t{1} << 62U)) {
    sample.utc_us = static_cast<std::int64_t>(unix_us);
    sample.fields = base::kNavUtc;
  }
}

struct Message {
  std::uint16_t id;
  base::NavKind kind;
  std::uint32_t take;
};

constexpr Message kMessages[]{
    {kMavSystemTime, base::NavKind::kTime, kTakeTime},
    {kMavScaledPressure, base::NavKind::kPressure, kTakePressure},
    {kMavAttitude, base::NavKind::kAttitude, kTakeAttitude},
    {kMavAttitudeQuaternion, base::NavKind::kAttitude, kTakeAttitudeQuaternion},
    {kMavLocalPositionNed, base::NavKind::kPosition, kTakeLocalPosition},
    {kMavGlobalPositionInt, base::NavKind::kPosition, kTakeGlobalPosition},
    {kMavVisionPositionEstimate, base::NavKind::kPosition, kTakeVision},
    {kMavDistanceSensor, base::NavKind::kAltitude, kTakeDistance},
    {kMavScaledPressure2, base::NavKind::kPressure, kTakePressure2},
    {kMavScaledPressure3, base::NavKind::kPressure, kTakePressure3},
    {kMavRangefinder, base::NavKind::kAltitude, kTakeDistance},
    {kMavOdometry, base::NavKind::kVelocity, kTakeOdometry},
};

const Message* find_message(std::uint32_t id) {
  for (const Message& message : kMessages) {
    if (message.id == id) {
      return &message;
    }
  }
  return nullptr;
}

void take_values(std::uint32_t id, const Payload& payload, const MavlinkConfig& config,
                 base::NavSample& sample) {
  switch (id) {
    case kMavSystemTime:
      return take_system_time(payload, sample);
    case kMavAttitude:
      return take_attitude(payload, config, sample);
    case kMavAttitudeQuaternion:
      return take_quaternion(payload, config, sample);
    case kMavLocalPositionNed:
      return take_local_position(payload, sample);
    case kMavGlobalPositionInt:
      return take_global_position(payload, sample);
    case kMavVisionPositionEstimate:
      return take_vision(payload, sample);
    case kMavDistanceSensor:
      return take_distance(payload, sample);
    case kMavOdometry:
      return take_odometry(payload, sample);
    case kMavRangefinder:
      return take_rangefinder(payload, sample);
    default:
      return take_pressure(payload, sample);
  }
}

constexpr std::size_t kOrientationAt = 12;
constexpr std::uint8_t kDownwards = 25;

}  // namespace

bool MavlinkCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample) {
  framer_.feed(byte, t_arrival_us, counters_);
  return next(sample);
}

bool MavlinkCodec::next(base::NavSample& sample) {
  return framer_.take_next(judge_mavlink, counters_,
                           [&](const FrameBytes& frame) { return take(frame, sample); });
}

bool MavlinkCodec::take(const FrameBytes& frame, base::NavSample& sample) {
  MavlinkHeader header{};
  if (!read_mavlink_header(frame.data, frame.size_bytes, header)) {
    return false;
  }
  const Message* message = find_message(header.id);
  if (message == nullptr || (message->take & config_.take) == 0) {
    ++counters_.ignored;
    return false;
  }
  if ((config_.system != 0 && header.system != config_.system) ||
      (config_.component != 0 && header.component != config_.component)) {
    ++counters_.wrong_device;
    return false;
  }
  Payload payload{};
  for (std::size_t i = 0; i < header.payload_bytes; ++i) {
    payload[i] = frame.data[header.payload_offset + i];
  }
  if (header.id == kMavDistanceSensor && payload[kOrientationAt] != kDownwards) {
    ++counters_.ignored;
    return false;
  }
  sample = {};
  sample.kind = message->kind;
  sample.quality = 255;
  const std::int64_t sent_ns = static_cast<std::int64_t>(frame.size_bytes) * config_.byte_time_ns;
  sample.t_us = frame.t_arrival_us - sent_ns / 1000;
  take_values(header.id, payload, config_, sample);
  ++counters_.records;
  counters_.no_data += sample.fields == 0 ? 1U : 0U;
  return true;
}

}  // namespace leadline::hal
