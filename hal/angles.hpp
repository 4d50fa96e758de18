// Angles of sensors to binary angles and back, rotations, without floating point. Vehicle code.
//
// A rotation is a matrix of direction cosines in Q30 whose columns are the body's axes (forward, right,
// down) in the world (north, east, down): v_world = R v_body. Its Euler angles are those of
// model/base/pose.hpp: R = Rz(heading) Ry(pitch) Rx(roll).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/base/fixed.hpp"
#include "model/base/pose.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

/// Quotient to the nearest integer, halves away from zero. `divisor` > 0; |value| + divisor / 2 fits.
[[nodiscard]] constexpr std::int64_t divide_rounded(std::int64_t value, std::int64_t divisor) {
  return (value + (value < 0 ? -(divisor / 2) : divisor / 2)) / divisor;
}

/// Degrees * 1e9 to a binary angle, within half a unit; |degrees| <= 8000.
[[nodiscard]] constexpr base::Bam32 bam_of_e9deg(std::int64_t angle_e9deg) {
  // 2^32 / 360e9 = 2^20 / (9 * 5^10)
  return static_cast<base::Bam32>(static_cast<std::uint64_t>(
      divide_rounded(angle_e9deg * (std::int64_t{1} << 20U), 87'890'625)));
}

/// Degrees * 1e9 to microradians; |degrees| <= 180e9 / 1e9.
[[nodiscard]] constexpr std::int64_t urad_of_e9deg(std::int64_t angle_e9deg) {
  // pi / 180 * 1e6 microradians a degree
  return divide_rounded(angle_e9deg * 17'453'293, 1'000'000'000'000);
}

/// floor(sqrt(value)), exact. 32 steps.
[[nodiscard]] constexpr std::uint32_t isqrt_u64(std::uint64_t value) {
  std::uint64_t root = 0;
  std::uint64_t rest = value;
  for (int bit = 62; bit >= 0; bit -= 2) {
    const std::uint64_t trial = root + (std::uint64_t{1} << bit);
    root >>= 1U;
    if (rest >= trial) {
      rest -= trial;
      root += std::uint64_t{1} << bit;
    }
  }
  return static_cast<std::uint32_t>(root);
}

/// atan(2^-i) in units of 2^-40 turn.
inline constexpr std::array<std::int64_t, 36> kCordic_bam40{
    137'438'953'472,
    81'134'951'838,
    42'869'480'287,
    21'761'217'566,
    10'922'836'750,
    5'466'743'129,
    2'734'038'620,
    1'367'102'738,
    683'561'799,
    341'782'203,
    170'891'265,
    85'445'653,
    42'722'829,
    21'361'415,
    10'680'707,
    5'340'354,
    2'670'177,
    1'335'088,
    667'544,
    333'772,
    166'886,
    83'443,
    41'722,
    20'861,
    10'430,
    5'215,
    2'608,
    1'304,
    652,
    326,
    163,
    81,
    41,
    20,
    10,
    5,
};

/// Direction of (x, y) from the x axis towards the y axis (CORDIC, error below 2 units); 0 for the
/// origin. Any values but the most negative.
[[nodiscard]] constexpr base::Bam32 atan2_bam32(std::int64_t y, std::int64_t x) {
  const auto size = [](std::int64_t v) { return static_cast<std::uint64_t>(v < 0 ? -v : v); };
  const int free_bits = base::leading_zeros64(size(x) | size(y));
  if (free_bits == 64) {
    return 0;
  }
  // 2^60 at most: the steps lengthen the vector 1.65 times and it may be 1.41 of its larger side.
  if (free_bits >= 4) {
    x *= std::int64_t{1} << (free_bits - 4);
    y *= std::int64_t{1} << (free_bits - 4);
  } else {
    x /= 16;
    y /= 16;
  }
  std::int64_t angle_bam40 = 0;
  if (x < 0) {
    x = -x;
    y = -y;
    angle_bam40 = std::int64_t{1} << 39U;
  }
  for (std::size_t i = 0; i < kCordic_bam40.size(); ++i) {
    const std::int64_t dx = x >> i;
    const std::int64_t dy = y >> i;
    const bool above = y > 0;
    x += above ? dy : -dy;
    y += above ? -dx : dx;
    angle_bam40 += above ? kCordic_bam40[i] : -kCordic_bam40[i];
  }
  return static_cast<base::Bam32>(static_cast<std::uint64_t>((angle_bam40 + 128) >> 8U));
}

/// Angle in [-90, 90] deg whose sine this is; outside of [-1, 1] the nearer end.
[[nodiscard]] constexpr base::Bam32 asin_bam32(std::int64_t sine_q30) {
  const std::int64_t one = base::kOne_q30;
  const std::int64_t sine = base::clamp(sine_q30, -one, one);
  // Q31: one bit more of the cosine.
  const std::uint32_t cosine_q31 =
      isqrt_u64(static_cast<std::uint64_t>(one * one - sine * sine) * 4);
  return atan2_bam32(sine * 2, cosine_q31);
}

using Rotation = std::array<std::array<std::int32_t, 3>, 3>;  ///< [row][column], Q30

/// The matrix of an attitude; each element within 1.5e-6 of the exact one.
[[nodiscard]] inline Rotation rotation_of(const base::Attitude& attitude) {
  const std::int64_t sr = base::sin_q30(attitude.roll_bam32);
  const std::int64_t cr = base::cos_q30(attitude.roll_bam32);
  const std::int64_t sp = base::sin_q30(attitude.pitch_bam32);
  const std::int64_t cp = base::cos_q30(attitude.pitch_bam32);
  const std::int64_t sh = base::sin_q30(attitude.heading_bam32);
  const std::int64_t ch = base::cos_q30(attitude.heading_bam32);
  const auto q30 = [](std::int64_t q60) { return static_cast<std::int32_t>(q60 >> 30); };
  const std::int64_t sp_sr = q30(sp * sr);
  const std::int64_t sp_cr = q30(sp * cr);
  return {{{q30(ch * cp), q30(ch * sp_sr - sh * cr), q30(ch * sp_cr + sh * sr)},
           {q30(sh * cp), q30(sh * sp_sr + ch * cr), q30(sh * sp_cr - ch * sr)},
           {static_cast<std::int32_t>(-sp), q30(cp * sr), q30(cp * cr)}}};
}

/// The attitude of a matrix: its Euler angles, pitch within +-90 deg.
[[nodiscard]] constexpr base::Attitude attitude_of(const Rotation& r) {
  const std::int64_t y = r[2][1];
  const std::int64_t z = r[2][2];
  const std::uint32_t across = isqrt_u64(static_cast<std::uint64_t>(y * y + z * z));
  return {atan2_bam32(y, z), atan2_bam32(-static_cast<std::int64_t>(r[2][0]), across),
          atan2_bam32(r[1][0], r[0][0])};
}

using Vector3 = std::array<std::int64_t, 3>;

/// R v, |v| of each axis below 2^31.
[[nodiscard]] constexpr Vector3 rotated(const Rotation& r, const Vector3& v) {
  Vector3 out{};
  for (std::size_t row = 0; row < 3; ++row) {
    // Each product below 2^61.
    const std::int64_t sum = r[row][0] * v[0] + r[row][1] * v[1] + r[row][2] * v[2];
    out[row] = (sum + (std::int64_t{1} << 29U)) >> 30;
  }
  return out;
}

/// R^T v: the way back.
[[nodiscard]] constexpr Vector3 rotated_back(const Rotation& r, const Vector3& v) {
  Vector3 out{};
  for (std::size_t column = 0; column < 3; ++column) {
    const std::int64_t sum = r[0][column] * v[0] + r[1][column] * v[1] + r[2][column] * v[2];
    out[column] = (sum + (std::int64_t{1} << 29U)) >> 30;
  }
  return out;
}

/// How far the square of a quaternion's length may be from 1, in Q30: 2 percent. What is farther off is
/// no attitude.
inline constexpr std::int64_t kQuaternionSlack_q30 = base::kOne_q30 / 50;

/// The matrix of a quaternion (w, x, y, z in Q30) that turns body axes into the world's: v_world = q v q*
/// (Hamilton). Not necessarily of length one: normalized by its square. False when its length is not
/// within 1 percent of one.
[[nodiscard]] constexpr bool rotation_of_quaternion(const std::array<std::int64_t, 4>& q_q30,
                                                    Rotation& rotation) {
  const std::int64_t limit = std::int64_t{base::kOne_q30} * 11 / 10;
  for (const std::int64_t part : q_q30) {
    if (part < -limit || part > limit) {
      return false;
    }
  }
  const auto product = [&q_q30](std::size_t a, std::size_t b) {
    return (q_q30[a] * q_q30[b] + (std::int64_t{1} << 29U)) >> 30;
  };
  const std::int64_t ww = product(0, 0);
  const std::int64_t xx = product(1, 1);
  const std::int64_t yy = product(2, 2);
  const std::int64_t zz = product(3, 3);
  const std::int64_t square = ww + xx + yy + zz;
  const std::int64_t off = square - base::kOne_q30;
  if (off > kQuaternionSlack_q30 || off < -kQuaternionSlack_q30) {
    return false;
  }
  const auto unit = [square](std::int64_t value_q30) {
    const std::int64_t scaled = divide_rounded(value_q30 * base::kOne_q30, square);
    return static_cast<std::int32_t>(scaled);
  };
  const std::int64_t wx = product(0, 1);
  const std::int64_t wy = product(0, 2);
  const std::int64_t wz = product(0, 3);
  const std::int64_t xy = product(1, 2);
  const std::int64_t xz = product(1, 3);
  const std::int64_t yz = product(2, 3);
  rotation = {{{unit(ww + xx - yy - zz), unit(2 * (xy - wz)), unit(2 * (xz + wy))},
               {unit(2 * (xy + wz)), unit(ww - xx + yy - zz), unit(2 * (yz - wx))},
               {unit(2 * (xz - wy)), unit(2 * (yz + wx)), unit(ww - xx - yy + zz)}}};
  return true;
}

/// A matrix of body axes forward-left-up in a world of east-north-up, as one of forward-right-down in
/// north-east-down.
[[nodiscard]] constexpr Rotation ned_of_enu(const Rotation& r) {
  return {
      {{r[1][0], -r[1][1], -r[1][2]}, {r[0][0], -r[0][1], -r[0][2]}, {-r[2][0], r[2][1], r[2][2]}}};
}

/// The same from a world of north-west-up.
[[nodiscard]] constexpr Rotation ned_of_nwu(const Rotation& r) {
  return {
      {{r[0][0], -r[0][1], -r[0][2]}, {-r[1][0], r[1][1], r[1][2]}, {-r[2][0], r[2][1], r[2][2]}}};
}

}  // namespace leadline::hal
