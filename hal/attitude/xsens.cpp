#include "hal/attitude/xsens.hpp"

#include <array>

#include "hal/angles.hpp"
#include "hal/checksums.hpp"
#include "hal/wire.hpp"

namespace leadline::hal {

namespace {

constexpr std::int64_t kE9 = 1'000'000'000;
constexpr std::uint8_t kPreamble = 0xFA;
constexpr std::uint8_t kExtended = 0xFF;
constexpr std::uint8_t kMtData2 = 0x36;
constexpr std::uint8_t kError = 0x42;
constexpr std::size_t kExtendedHeader_bytes = 6;
constexpr std::int64_t kMaxRate_urad_s = 100'000'000;
constexpr std::uint32_t kStatusFilterValid = 2;

// Packet ids without their format bits.
constexpr std::uint16_t kTemperature = 0x0810;
constexpr std::uint16_t kSampleTimeFine = 0x1060;
constexpr std::uint16_t kQuaternion = 0x2010;
constexpr std::uint16_t kMatrix = 0x2020;
constexpr std::uint16_t kEuler = 0x2030;
constexpr std::uint16_t kPressure = 0x3010;
constexpr std::uint16_t kRate = 0x8020;
constexpr std::uint16_t kStatusByte = 0xE010;
constexpr std::uint16_t kStatusWord = 0xE020;

enum class World : std::uint8_t { kEnu, kNed, kNwu, kUnknown };

/// One packet of a message.
struct Packet {
  std::uint16_t id;  ///< without the format bits
  std::uint8_t format;
  std::uint8_t size_bytes;
  const std::uint8_t* data;
};

constexpr std::array<std::uint8_t, 4> kNumberBytes{4, 4, 6, 8};

World world_of(const Packet& packet) {
  switch (packet.format & 0x0CU) {
    case 0x00:
      return World::kEnu;
    case 0x04:
      return World::kNed;
    case 0x08:
      return World::kNwu;
    default:
      return World::kUnknown;
  }
}

Judgement judge(const std::uint8_t* bytes, std::size_t available) {
  if (bytes[0] != kPreamble) {
    return {FrameVerdict::kNoStart, 0};
  }
  // Every device is 0xFF (the master) or 1 .. 32 behind it; requests and answers look alike.
  if (available >= 2 && bytes[1] != 0xFF && (bytes[1] == 0 || bytes[1] > 32)) {
    return {FrameVerdict::kNoStart, 0};
  }
  if (available < 4) {
    return {FrameVerdict::kMore, 0};
  }
  std::size_t size = std::size_t{bytes[3]} + 5;
  if (bytes[3] == kExtended) {
    if (available < kExtendedHeader_bytes) {
      return {FrameVerdict::kMore, 0};
    }
    size = std::size_t{read_u16_be(bytes + 4)} + kExtendedHeader_bytes + 1;
  }
  if (size > XsensCodec::kMaxFrame_bytes) {
    return {FrameVerdict::kBadLength, 0};
  }
  if (available < size) {
    return {FrameVerdict::kMore, 0};
  }
  const bool good = (sum16(bytes + 1, size - 1) & 0xFFU) == 0;
  return good ? Judgement{FrameVerdict::kFrame, size} : Judgement{FrameVerdict::kBadChecksum, 0};
}

/// Number `index` of a packet, times `scale` (<= 2^30); false for what is no number.
bool number_at(const Packet& packet, std::size_t index, std::int64_t scale, std::int64_t& value) {
  const std::uint8_t* bytes = packet.data + index * kNumberBytes[packet.format & 3U];
  switch (packet.format & 3U) {
    case 0:
      return f32_bits_to_integer(read_u32_be(bytes), scale, value);
    case 1:  // 12.20
      value = divide_rounded(as_i32(read_u32_be(bytes)) * scale, std::int64_t{1} << 20U);
      return true;
    case 2: {  // 16.32, the fraction in front
      const std::int64_t whole = as_i16(read_u16_be(bytes + 4));
      const std::int64_t part = read_u32_be(bytes);
      value = whole * scale + divide_rounded(part * scale, std::int64_t{1} << 32U);
      return true;
    }
    default:
      return f64_bits_to_integer(read_u64_be(bytes), scale, value);
  }
}

bool numbers(const Packet& packet, std::size_t count, std::int64_t scale, std::int64_t limit,
             std::int64_t* values) {
  if (packet.size_bytes != count * kNumberBytes[packet.format & 3U]) {
    return false;
  }
  for (std::size_t i = 0; i < count; ++i) {
    if (!number_at(packet, i, scale, values[i]) || values[i] < -limit || values[i] > limit) {
      return false;
    }
  }
  return true;
}

bool rotation_of_euler(const Packet& packet, Rotation& rotation) {
  std::array<std::int64_t, 3> angles_e9deg{};
  if (!numbers(packet, 3, kE9, 360 * kE9, angles_e9deg.data())) {
    return false;
  }
  rotation = rotation_of({bam_of_e9deg(angles_e9deg[0]), bam_of_e9deg(angles_e9deg[1]),
                          bam_of_e9deg(angles_e9deg[2])});
  return true;
}

/// Sent column by column.
bool rotation_of_matrix(const Packet& packet, Rotation& rotation) {
  std::array<std::int64_t, 9> cosines_q30{};
  if (!numbers(packet, 9, base::kOne_q30, std::int64_t{base::kOne_q30} * 101 / 100,
               cosines_q30.data())) {
    return false;
  }
  for (std::size_t i = 0; i < 9; ++i) {
    rotation[i % 3][i / 3] = static_cast<std::int32_t>(cosines_q30[i]);
  }
  // The bow's axis has length one, or it is no rotation.
  std::int64_t square_q30 = 0;
  for (std::size_t row = 0; row < 3; ++row) {
    square_q30 += (std::int64_t{rotation[row][0]} * rotation[row][0]) >> 30;
  }
  const std::int64_t off = square_q30 - base::kOne_q30;
  return off <= kQuaternionSlack_q30 && off >= -kQuaternionSlack_q30;
}

bool rotation_of_packet(const Packet& packet, Rotation& rotation) {
  if (packet.id == kEuler) {
    return rotation_of_euler(packet, rotation);
  }
  if (packet.id == kMatrix) {
    return rotation_of_matrix(packet, rotation);
  }
  std::array<std::int64_t, 4> wxyz_q30{};
  return numbers(packet, 4, base::kOne_q30, std::int64_t{2} * base::kOne_q30, wxyz_q30.data()) &&
         rotation_of_quaternion(wxyz_q30, rotation);
}

/// Turns the axes of the body (right and down instead of left and up, or back).
Rotation with_other_body(Rotation rotation) {
  for (auto& row : rotation) {
    row[1] = -row[1];
    row[2] = -row[2];
  }
  return rotation;
}

/// To forward-right-down in north-east-down, from any world.
Rotation ned_of(const Rotation& rotation, World world, bool body_frd) {
  const Rotation housing = body_frd ? with_other_body(rotation) : rotation;
  switch (world) {
    case World::kNed:
      return with_other_body(housing);
    case World::kNwu:
      return ned_of_nwu(housing);
    case World::kEnu:
    case World::kUnknown:
      break;
  }
  return ned_of_enu(housing);
}

/// What the packets of one message say.
struct Reading {
  Rotation rotation{};
  bool oriented = false;
  bool invalid = false;  ///< the status says so
  base::NavSample sample{};
};

bool take_orientation(const Packet& packet, bool body_frd, Reading& reading) {
  if (reading.oriented) {
    return true;
  }
  const World world = world_of(packet);
  if (world == World::kUnknown || !rotation_of_packet(packet, reading.rotation)) {
    return false;
  }
  reading.rotation = ned_of(reading.rotation, world, body_frd);
  reading.oriented = true;
  return true;
}

bool take_rates(const Packet& packet, bool body_frd, Reading& reading) {
  std::int64_t* rates = reading.sample.rate_urad_s;
  if (!numbers(packet, 3, 1'000'000, kMaxRate_urad_s, rates)) {
    return false;
  }
  if (!body_frd) {
    rates[1] = -rates[1];
    rates[2] = -rates[2];
  }
  reading.sample.fields |= base::kNavRates;
  return true;
}

bool take_temperature(const Packet& packet, Reading& reading) {
  std::int64_t temperature_mdegc = 0;
  if (!numbers(packet, 1, 1'000, 200'000, &temperature_mdegc)) {
    return false;
  }
  reading.sample.temperature_mdegc = static_cast<std::int32_t>(temperature_mdegc);
  reading.sample.fields |= base::kNavTemperature;
  return true;
}

/// False: a packet whose size or values its kind cannot have.
bool take_packet(const Packet& packet, const XsensConfig& config, Reading& reading) {
  switch (packet.id) {
    case kQuaternion:
    case kMatrix:
    case kEuler:
      return take_orientation(packet, config.body_frd, reading);
    case kRate:
      return take_rates(packet, config.body_frd, reading);
    case kTemperature:
      return take_temperature(packet, reading);
    case kSampleTimeFine:
      if (packet.size_bytes == 4) {
        reading.sample.t_device_us = std::int64_t{read_u32_be(packet.data)} * 100;
      }
      return packet.size_bytes == 4;
    case kPressure:
      if (packet.size_bytes == 4 && config.use_pressure) {
        reading.sample.pressure_pa = read_u32_be(packet.data);
        reading.sample.fields |= base::kNavPressure;
      }
      return packet.size_bytes == 4;
    case kStatusWord:
      reading.invalid = packet.size_bytes == 4 && (packet.data[3] & kStatusFilterValid) == 0;
      return packet.size_bytes == 4;
    case kStatusByte:
      reading.invalid = packet.size_bytes == 1 && (packet.data[0] & kStatusFilterValid) == 0;
      return packet.size_bytes == 1;
    default:
      return true;  // none of ours
  }
}

base::NavKind kind_of(const Reading& reading) {
  if (reading.oriented) {
    return base::NavKind::kAttitude;
  }
  if ((reading.sample.fields & base::kNavRates) != 0) {
    return base::NavKind::kRates;
  }
  return (reading.sample.fields & base::kNavPressure) != 0 ? base::NavKind::kPressure
                                                           : base::NavKind::kOther;
}

}  // namespace

bool XsensCodec::feed(std::uint8_t byte, base::TimeUs t_arrival_us, base::NavSample& sample) {
  framer_.feed(byte, t_arrival_us, counters_);
  return next(sample);
}

bool XsensCodec::next(base::NavSample& sample) {
  const bool made = framer_.take_next(judge, counters_,
                                      [&](const FrameBytes& frame) { return take(frame, sample); });
  counters_.records += made ? 1U : 0U;
  return made;
}

bool XsensCodec::take(const FrameBytes& frame, base::NavSample& sample) {
  if (frame.data[2] != kMtData2) {
    ++(frame.data[2] == kError ? counters_.nacks : counters_.ignored);
    return false;
  }
  Reading reading;
  std::size_t at = frame.data[3] == kExtended ? kExtendedHeader_bytes : 4;
  const std::size_t end = frame.size_bytes - 1;
  bool good = true;
  while (good && at < end) {
    const std::size_t left = end - at;
    if (left < 3 || left - 3 < frame.data[at + 2]) {
      good = false;
      break;
    }
    const std::uint16_t id = read_u16_be(frame.data + at);
    const Packet packet{static_cast<std::uint16_t>(id & 0xFFF0U),
                        static_cast<std::uint8_t>(id & 0x0FU), frame.data[at + 2],
                        frame.data + at + 3};
    good = take_packet(packet, config_, reading);
    at += std::size_t{3} + packet.size_bytes;
  }
  if (!good) {
    ++counters_.bad_values;
    return false;
  }

  const bool usable = reading.oriented && !(config_.check_status && reading.invalid);
  if (!reading.oriented && reading.sample.fields == 0) {
    ++counters_.ignored;
    return false;
  }
  sample = reading.sample;
  sample.t_us = sent_us(frame, config_.byte_time_ns);
  sample.quality = 255;
  sample.kind = kind_of(reading);
  if (usable) {
    sample.attitude = attitude_of(reading.rotation);
    sample.fields = static_cast<std::uint16_t>(
        sample.fields | base::kNavRollPitch |
        (config_.true_heading ? base::kNavHeading : base::kNavHeadingMagnetic));
  }
  counters_.no_data += reading.oriented && !usable ? 1U : 0U;
  return true;
}

}  // namespace leadline::hal
