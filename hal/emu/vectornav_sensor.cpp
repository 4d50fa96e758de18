#include "hal/emu/vectornav_sensor.hpp"

#include <cmath>
#include <cstdio>

#include "hal/checksums.hpp"
#include "hal/emu/wire_bytes.hpp"

namespace leadline::emu {

namespace {

double half_radians(double degrees) { return degrees * 3.14159265358979323846 / 360.0; }

/// -180 .. 180.
double wrapped(double degrees) { return std::remainder(degrees, 360.0); }

std::uint64_t nanoseconds(const Motion& motion) {
  return static_cast<std::uint64_t>(std::llround(motion.time_s * 1e9));
}

void append_rates(ByteWriter& fields, const Motion& motion) {
  for (const double rate : motion.rate_rad_s) {
    fields.f32(rate);
  }
}

}  // namespace

Bytes vectornav_text(const std::string& body, VectorNavSeal seal) {
  const Bytes bytes(body.begin(), body.end());
  char tail[12];
  if (seal == VectorNavSeal::kXor) {
    std::snprintf(tail, sizeof tail, "*%02X\r\n", hal::xor8(bytes.data(), bytes.size()));
  } else if (seal == VectorNavSeal::kCrc) {
    std::snprintf(tail, sizeof tail, "*%04X\r\n", hal::crc16_xmodem(bytes.data(), bytes.size()));
  } else {
    std::snprintf(tail, sizeof tail, "*XX\r\n");
  }
  const std::string line = "$" + body + tail;
  return {line.begin(), line.end()};
}

Bytes vectornav_ymr(const Motion& motion, VectorNavSeal seal) {
  char body[200];
  std::snprintf(body, sizeof body,
                "VNYMR,%+08.3f,%+08.3f,%+08.3f,+00.2000,+00.0000,+00.4000,+00.000,+00.000,-09.810,"
                "%+010.6f,%+010.6f,%+010.6f",
                wrapped(motion.heading_deg), motion.pitch_deg, motion.roll_deg,
                motion.rate_rad_s[0], motion.rate_rad_s[1], motion.rate_rad_s[2]);
  return vectornav_text(body, seal);
}

Bytes vectornav_binary(const Bytes& header, const Bytes& fields) {
  ByteWriter body(ByteOrder::kBig);
  body.append(header).append(fields);
  const std::uint16_t crc = hal::crc16_xmodem(body.bytes().data(), body.bytes().size());
  body.u16(crc);
  Bytes frame{0xFA};
  frame.insert(frame.end(), body.bytes().begin(), body.bytes().end());
  return frame;
}

Bytes vectornav_common(const Motion& motion) {
  ByteWriter fields(ByteOrder::kLittle);
  fields.u64(nanoseconds(motion));
  fields.f32(wrapped(motion.heading_deg)).f32(motion.pitch_deg).f32(motion.roll_deg);
  append_rates(fields, motion);
  return vectornav_binary({0x01, 0x29, 0x00}, fields.bytes());
}

Bytes vectornav_quaternion(const Motion& motion) {
  // Heading about down, then pitch about the new right, then roll about the new forward.
  const double ch = std::cos(half_radians(motion.heading_deg));
  const double sh = std::sin(half_radians(motion.heading_deg));
  const double cp = std::cos(half_radians(motion.pitch_deg));
  const double sp = std::sin(half_radians(motion.pitch_deg));
  const double cr = std::cos(half_radians(motion.roll_deg));
  const double sr = std::sin(half_radians(motion.roll_deg));
  ByteWriter fields(ByteOrder::kLittle);
  fields.u64(nanoseconds(motion));
  fields.f32(ch * cp * sr - sh * sp * cr);
  fields.f32(ch * sp * cr + sh * cp * sr);
  fields.f32(sh * cp * cr - ch * sp * sr);
  fields.f32(ch * cp * cr + sh * sp * sr);
  append_rates(fields, motion);
  return vectornav_binary({0x01, 0x31, 0x00}, fields.bytes());
}

}  // namespace leadline::emu
