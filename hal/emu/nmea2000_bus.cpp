#include "hal/emu/nmea2000_bus.hpp"

#include <algorithm>
#include <cmath>

#include "hal/emu/wire_bytes.hpp"

namespace leadline::emu {

namespace {

constexpr double kRadians = 3.14159265358979323846 / 180.0;
constexpr std::uint8_t kSid = 7;

// Not llround(): newlib's (3.3, 32 bits) loses bits of values beyond 2^52.
std::int64_t units(double value, double unit) {
  return static_cast<std::int64_t>(std::round(value / unit));
}

std::uint64_t unsigned_units(double value, double unit) {
  return static_cast<std::uint64_t>(units(value, unit));
}

std::uint64_t course_units(double deg) {
  const double rest = std::fmod(deg, 360.0);
  return unsigned_units((rest < 0 ? rest + 360.0 : rest) * kRadians, 1e-4);
}

std::uint64_t days(const N2kTruth& truth) {
  return static_cast<std::uint64_t>(std::floor(truth.unix_s / 86400.0));
}

std::uint64_t time_of_day(const N2kTruth& truth) {
  return unsigned_units(std::fmod(truth.unix_s, 86400.0), 1e-4);
}

ByteWriter gnss_position(const N2kTruth& truth) {
  ByteWriter data(ByteOrder::kLittle);
  data.u8(kSid).u16(days(truth)).u32(time_of_day(truth));
  data.u64(unsigned_units(truth.latitude_deg, 1e-16));
  data.u64(unsigned_units(truth.longitude_deg, 1e-16));
  data.u64(0).u8(static_cast<std::uint64_t>(truth.gnss_method) << 4U).u8(0xFC);
  data.u8(12).i16(80).i16(140).u32(0).u8(0);
  return data;
}

Bytes payload(std::uint32_t pgn, const N2kTruth& truth) {
  const Motion& motion = truth.motion;
  ByteWriter data(ByteOrder::kLittle);
  switch (pgn) {
    case 126992:
      data.u8(kSid).u8(0xF0).u16(days(truth)).u32(time_of_day(truth));
      break;
    case 127250:
      data.u8(kSid).u16(course_units(motion.heading_deg)).u16(0x7FFF).u16(0x7FFF).u8(0xFC);
      break;
    case 127251:
      data.u8(kSid).u32(unsigned_units(motion.rate_rad_s[2], 3.125e-8)).u8(0xFF).u16(0xFFFF);
      break;
    case 127252:
      data.u8(kSid).i16(units(motion.heave_m, 0.01)).u8(0xFF).u32(0xFFFFFFFF);
      break;
    case 127257:
      data.u8(kSid).i16(units(std::remainder(motion.heading_deg, 360.0) * kRadians, 1e-4));
      data.i16(units(motion.pitch_deg * kRadians, 1e-4));
      data.i16(units(motion.roll_deg * kRadians, 1e-4)).u8(0xFF);
      break;
    case 128259:
      data.u8(kSid).u16(unsigned_units(truth.speed_through_water_m_s, 0.01));
      data.u16(0xFFFF).u8(0).u16(0xFFFF);
      break;
    case 128267:
      data.u8(kSid).u32(motion.altitude_m > 0 ? unsigned_units(motion.altitude_m, 0.01)
                                              : 0xFFFFFFFF);
      data.i16(0).u8(0xFF);
      break;
    case 129025:
      data.u32(unsigned_units(truth.latitude_deg, 1e-7));
      data.u32(unsigned_units(truth.longitude_deg, 1e-7));
      break;
    case 129026:
      data.u8(kSid).u8(0xFC).u16(course_units(truth.course_deg));
      data.u16(unsigned_units(truth.speed_over_ground_m_s, 0.01)).u16(0xFFFF);
      break;
    case 129029:
      return gnss_position(truth).bytes();
    case 130314:
      data.u8(kSid).u8(0).u8(1).u32(unsigned_units(truth.pressure_pa, 0.1)).u8(0xFF);
      break;
    default:
      break;
  }
  return data.bytes();
}

Bytes can_frame(std::uint32_t pgn, std::uint8_t source, const Bytes& data) {
  constexpr std::uint32_t kExtended = 0x80000000;
  constexpr std::uint32_t kPriority = 3;
  ByteWriter frame(ByteOrder::kLittle);
  frame.u32(kExtended | (kPriority << 26U) | (pgn << 8U) | source);
  frame.u8(data.size()).zeros(3).append(data).zeros(8 - data.size());
  return frame.bytes();
}

}  // namespace

Bytes n2k_message(std::uint32_t pgn, std::uint8_t source, const Bytes& data, bool fast,
                  unsigned sequence) {
  if (data.size() <= 8 && !fast) {
    return can_frame(pgn, source, data);
  }
  ByteWriter frames(ByteOrder::kLittle);
  std::size_t sent = 0;
  for (unsigned number = 0; number == 0 || sent < data.size(); ++number) {
    ByteWriter piece(ByteOrder::kLittle);
    piece.u8((sequence << 5U) | number);
    if (number == 0) {
      piece.u8(data.size());
    }
    const std::size_t count = std::min(8 - piece.bytes().size(), data.size() - sent);
    const auto from = data.begin() + static_cast<std::ptrdiff_t>(sent);
    piece.append(Bytes(from, from + static_cast<std::ptrdiff_t>(count)));
    while (piece.bytes().size() < 8) {
      piece.u8(0xFF);
    }
    sent += count;
    frames.append(can_frame(pgn, source, piece.bytes()));
  }
  return frames.bytes();
}

Bytes n2k_truth(std::uint32_t pgn, std::uint8_t source, const N2kTruth& truth, unsigned sequence) {
  const Bytes data = payload(pgn, truth);
  return data.empty() ? Bytes{} : n2k_message(pgn, source, data, pgn == 129029, sequence);
}

}  // namespace leadline::emu
