#include "hal/emu/xsens_sensor.hpp"

#include <array>
#include <cmath>
#include <vector>

#include "hal/checksums.hpp"
#include "hal/emu/wire_bytes.hpp"

namespace leadline::emu {

namespace {

constexpr double kRadian_deg = 180.0 / 3.14159265358979323846;

using Vector = std::array<double, 3>;
/// The housing's axes (forward, left, up) in the world that the sensor reports in.
using Axes = std::array<Vector, 3>;

/// A direction given as north, east, down, in the reported world.
Vector in_world(const Vector& ned, XsensWorld world) {
  switch (world) {
    case XsensWorld::kNed:
      return ned;
    case XsensWorld::kNwu:
      return {ned[0], -ned[1], -ned[2]};
    default:
      return {ned[1], ned[0], -ned[2]};
  }
}

Axes housing_axes(const Motion& motion, XsensWorld world) {
  const double ch = std::cos(motion.heading_deg / kRadian_deg);
  const double sh = std::sin(motion.heading_deg / kRadian_deg);
  const double cp = std::cos(motion.pitch_deg / kRadian_deg);
  const double sp = std::sin(motion.pitch_deg / kRadian_deg);
  const double cr = std::cos(motion.roll_deg / kRadian_deg);
  const double sr = std::sin(motion.roll_deg / kRadian_deg);
  // The bow; starboard, level and then rolled down; the keel completes them.
  const Vector bow{ch * cp, sh * cp, -sp};
  const Vector level_starboard{-sh, ch, 0};
  const Vector level_keel{ch * sp, sh * sp, cp};
  Vector port{};
  Vector up{};
  for (std::size_t i = 0; i < 3; ++i) {
    port[i] = -(cr * level_starboard[i] + sr * level_keel[i]);
    up[i] = -(cr * level_keel[i] - sr * level_starboard[i]);
  }
  return {in_world(bow, world), in_world(port, world), in_world(up, world)};
}

/// Number format and size of a packet's values.
void append_packet(ByteWriter& data, unsigned id, XsensNumber number,
                   const std::vector<double>& values) {
  constexpr std::array<unsigned, 4> kSizes{4, 4, 6, 8};
  data.u16(id | static_cast<unsigned>(number));
  data.u8(values.size() * kSizes[static_cast<std::size_t>(number)]);
  for (const double value : values) {
    const std::int64_t fixed32 = std::llround(value * 4294967296.0);
    switch (number) {
      case XsensNumber::kSingle:
        data.f32(value);
        break;
      case XsensNumber::kFixed20:
        data.u32(static_cast<std::uint64_t>(std::llround(value * 1048576.0)));
        break;
      case XsensNumber::kFixed32:
        data.u32(static_cast<std::uint64_t>(fixed32) & 0xFFFFFFFFU);
        data.u16(static_cast<std::uint64_t>(fixed32) >> 32U);
        break;
      case XsensNumber::kDouble:
        data.f64(value);
        break;
    }
  }
}

/// w, x, y, z of a matrix whose columns are the axes.
std::vector<double> quaternion_of(const Axes& axes) {
  const double xx = axes[0][0];
  const double yy = axes[1][1];
  const double zz = axes[2][2];
  const auto root = [](double v) { return 0.5 * std::sqrt(std::fmax(0.0, v)); };
  const auto sign = [](double size, double of) { return of < 0 ? -size : size; };
  const double w = root(1 + xx + yy + zz);
  if (w > 0.1) {
    return {w, (axes[1][2] - axes[2][1]) / (4 * w), (axes[2][0] - axes[0][2]) / (4 * w),
            (axes[0][1] - axes[1][0]) / (4 * w)};
  }
  // Half turns and nearly so: sizes from the diagonal, signs from the largest.
  const double x = root(1 + xx - yy - zz);
  const double y = root(1 - xx + yy - zz);
  const double z = root(1 - xx - yy + zz);
  if (x >= y && x >= z) {
    return {sign(w, axes[1][2] - axes[2][1]), x, sign(y, axes[0][1] + axes[1][0]),
            sign(z, axes[0][2] + axes[2][0])};
  }
  if (y >= z) {
    return {sign(w, axes[2][0] - axes[0][2]), sign(x, axes[0][1] + axes[1][0]), y,
            sign(z, axes[1][2] + axes[2][1])};
  }
  return {sign(w, axes[0][1] - axes[1][0]), sign(x, axes[0][2] + axes[2][0]),
          sign(y, axes[1][2] + axes[2][1]), z};
}

std::vector<double> euler_of(const Axes& axes) {
  return {std::atan2(axes[1][2], axes[2][2]) * kRadian_deg,
          -std::asin(std::fmin(1.0, std::fmax(-1.0, axes[0][2]))) * kRadian_deg,
          std::atan2(axes[0][1], axes[0][0]) * kRadian_deg};
}

void append_orientation(ByteWriter& data, const Axes& axes, XsensOrientation orientation,
                        unsigned world, XsensNumber number) {
  switch (orientation) {
    case XsensOrientation::kQuaternion:
      append_packet(data, 0x2010 | world, number, quaternion_of(axes));
      break;
    case XsensOrientation::kMatrix: {
      std::vector<double> columns;
      for (const Vector& axis : axes) {
        columns.insert(columns.end(), axis.begin(), axis.end());
      }
      append_packet(data, 0x2020 | world, number, columns);
      break;
    }
    case XsensOrientation::kEuler:
      append_packet(data, 0x2030 | world, number, euler_of(axes));
      break;
  }
}

}  // namespace

Bytes xsens_message(unsigned id, const Bytes& data) {
  ByteWriter body(ByteOrder::kBig);
  body.u8(0xFF).u8(id);
  if (data.size() < 0xFF) {
    body.u8(data.size());
  } else {
    body.u8(0xFF).u16(data.size());
  }
  body.append(data);
  const unsigned sum = hal::sum16(body.bytes().data(), body.bytes().size());
  body.u8(0x100U - (sum & 0xFFU));
  Bytes message{0xFA};
  message.insert(message.end(), body.bytes().begin(), body.bytes().end());
  return message;
}

Bytes xsens_mtdata2(const Motion& motion, XsensOrientation orientation, XsensWorld world,
                    XsensNumber number, bool filter_valid) {
  ByteWriter data(ByteOrder::kBig);
  data.u16(0x1020).u8(2).u16(77);
  data.u16(0x1060).u8(4).u32(static_cast<std::uint64_t>(std::llround(motion.time_s * 1e4)));
  append_orientation(data, housing_axes(motion, world), orientation, static_cast<unsigned>(world),
                     number);
  append_packet(data, 0x8020, number,
                {motion.rate_rad_s[0], -motion.rate_rad_s[1], -motion.rate_rad_s[2]});
  data.u16(0xE020).u8(4).u32(filter_valid ? 0x00000003 : 0x00000001);
  return xsens_message(0x36, data.bytes());
}

}  // namespace leadline::emu
