// Angles of sensors to binary angles, without floating point; rotations are model/base/angle.hpp's. Vehicle
// code.
#pragma once

#include <cstdint>

#include "model/base/angle.hpp"
#include "model/base/units.hpp"

namespace leadline::hal {

using base::asin_bam32;
using base::atan2_bam32;
using base::attitude_of;
using base::divide_rounded;
using base::isqrt_u64;
using base::kQuaternionSlack_q30;
using base::ned_of_enu;
using base::ned_of_nwu;
using base::rotated;
using base::rotated_back;
using base::Rotation;
using base::rotation_of;
using base::rotation_of_quaternion;
using base::Vector3;

/// Degrees * 1e9 to a binary angle, within half a unit; |degrees| <= 8000.
[[nodiscard]] constexpr base::Bam32 bam_of_e9deg(std::int64_t angle_e9deg) {
  // 2^32 / 360e9 = 2^20 / (9 * 5^10)
  return static_cast<base::Bam32>(static_cast<std::uint64_t>(
      base::divide_rounded(angle_e9deg * (std::int64_t{1} << 20U), 87'890'625)));
}

/// Degrees * 1e9 to microradians; |degrees| <= 180e9 / 1e9.
[[nodiscard]] constexpr std::int64_t urad_of_e9deg(std::int64_t angle_e9deg) {
  // pi / 180 * 1e6 microradians a degree
  return base::divide_rounded(angle_e9deg * 17'453'293, 1'000'000'000'000);
}

}  // namespace leadline::hal
