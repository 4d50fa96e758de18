// Rotations in double precision, to hold those in integers against.
#pragma once

#include <algorithm>
#include <cmath>

#include "model/base/angle.hpp"
#include "tests/support/test.hpp"

namespace leadline::test {

constexpr double kRadPerBam = 2.0 * 3.14159265358979323846 / 4294967296.0;
constexpr double kOne = 1073741824.0;

struct Matrix {
  double m[3][3];
};

inline Matrix exact_rotation(const base::Attitude& attitude) {
  const double r = attitude.roll_bam32 * kRadPerBam;
  const double p = attitude.pitch_bam32 * kRadPerBam;
  const double h = attitude.heading_bam32 * kRadPerBam;
  const double sr = std::sin(r), cr = std::cos(r), sp = std::sin(p), cp = std::cos(p),
               sh = std::sin(h), ch = std::cos(h);
  return Matrix{{{ch * cp, ch * sp * sr - sh * cr, ch * sp * cr + sh * sr},
                 {sh * cp, sh * sp * sr + ch * cr, sh * sp * cr - ch * sr},
                 {-sp, cp * sr, cp * cr}}};
}

inline double worst_entry(const base::Rotation& a, const Matrix& b) {
  double largest = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      largest = std::max(largest, std::fabs(a[i][j] / kOne - b.m[i][j]));
    }
  }
  return largest;
}

inline base::Attitude any_attitude(Random& random) {
  const auto angle = [&random] { return static_cast<base::Bam32>(random.next()); };
  base::Attitude attitude{angle(), angle(), angle()};
  // A third of them at or near the poles.
  if (random.between(0, 2) == 0) {
    attitude.pitch_bam32 = (random.between(0, 1) == 0 ? 0x40000000U : 0xC0000000U) +
                           static_cast<base::Bam32>(random.between(-2000, 2000));
  }
  return attitude;
}

}  // namespace leadline::test
