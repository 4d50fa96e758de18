// Beams that tests of the table generator describe, and their patterns by the textbook.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "host_tools/table/generator.hpp"
#include "host_tools/table/table_io.hpp"
#include "host_tools/table/table_math.hpp"
#include "tests/support/test.hpp"

namespace leadline::test {

inline constexpr double kPi = 3.14159265358979323846;
inline constexpr double kRad = kPi / 180.0;

inline host::BeamDescription cone(double half_angle_deg, double sigma_pointing_deg = 0.0) {
  host::BeamDescription beam;
  beam.half_angle_deg = half_angle_deg;
  beam.sigma_pointing_deg = sigma_pointing_deg;
  return beam;
}

inline host::BeamDescription piston(double diameter_mm, double frequency_hz,
                                    double sigma_pointing_deg = 0.0) {
  host::BeamDescription beam;
  beam.kind = model::BeamKind::kPiston;
  beam.piston_diameter_mm = diameter_mm;
  beam.frequency_hz = frequency_hz;
  beam.sigma_pointing_deg = sigma_pointing_deg;
  return beam;
}

inline host::BeamDescription rectangle(double along_mm, double across_mm, double frequency_hz,
                                       double sigma_pointing_deg = 0.0) {
  host::BeamDescription beam;
  beam.kind = model::BeamKind::kRectangle;
  beam.aperture_along_mm = along_mm;
  beam.aperture_across_mm = across_mm;
  beam.frequency_hz = frequency_hz;
  beam.sigma_pointing_deg = sigma_pointing_deg;
  return beam;
}

inline host::BeamDescription measured() {
  host::BeamDescription beam;
  beam.kind = model::BeamKind::kMeasured;
  beam.rows =
      host::parse_pattern("one_way\n0 -1\n2, -4.0\n4 -12\n6 -30 # null\n8 -18\n10 -40\n", "p.txt");
  beam.sigma_pointing_deg = 0.5;
  return beam;
}

inline host::BeamDescription capped(host::BeamDescription beam, double max_half_angle_deg) {
  beam.max_half_angle_deg = max_half_angle_deg;
  return beam;
}

/// Descriptions that between them take every way through the generator.
inline std::vector<host::BeamDescription> all_kinds() {
  return {cone(3.0, 1.0),
          cone(12.5, 1.0),
          cone(0.05, 2.0),
          cone(90.0, 45.0),
          piston(100.0, 200e3, 0.3),
          piston(20.0, 115e3, 0.3),
          piston(1.0, 100.0, 0.3),
          capped(piston(100.0, 200e3, 0.3), 3.0),
          rectangle(300.0, 30.0, 200e3, 0.5),
          rectangle(300.0, 4.0, 200e3, 0.5),
          measured()};
}

/// host::generate_table(), once per description.
inline const model::LocalizationTable& table_of(const host::BeamDescription& beam) {
  static std::vector<std::pair<host::BeamDescription, model::LocalizationTable>> made;
  const auto same = [&](const host::BeamDescription& other) {
    const bool rows =
        std::equal(beam.rows.begin(), beam.rows.end(), other.rows.begin(), other.rows.end(),
                   [](const host::PatternRow& a, const host::PatternRow& b) {
                     return a.off_axis_deg == b.off_axis_deg && a.two_way_db == b.two_way_db;
                   });
    return rows && beam.kind == other.kind && beam.half_angle_deg == other.half_angle_deg &&
           beam.piston_diameter_mm == other.piston_diameter_mm &&
           beam.aperture_along_mm == other.aperture_along_mm &&
           beam.aperture_across_mm == other.aperture_across_mm &&
           beam.frequency_hz == other.frequency_hz &&
           beam.max_half_angle_deg == other.max_half_angle_deg &&
           beam.sigma_pointing_deg == other.sigma_pointing_deg &&
           beam.detection_fraction == other.detection_fraction;
  };
  for (const auto& [description, table] : made) {
    if (same(description)) {
      return table;
    }
  }
  made.reserve(256);  // references stay valid
  assert_true(made.size() < made.capacity());
  made.emplace_back(beam, host::generate_table(beam).table);
  return made.back().second;
}

/// The two-way pattern from the textbook, with libm; the cut is applied by the caller.
inline double plain_two_way(const host::BeamDescription& beam, double along, double across) {
  const double sine = std::min(1.0, std::hypot(along, across));
  const double per_mm = beam.frequency_hz / beam.sound_speed_mm_s;
  const auto sinc4 = [](double x) { return x == 0.0 ? 1.0 : std::pow(std::sin(x) / x, 4); };
  switch (beam.kind) {
    case model::BeamKind::kCone: {
      // In long double: the differences of a narrow cone's cosines are small.
      const long double edge = std::cos(static_cast<long double>(beam.half_angle_deg) * kRad);
      const long double cosine = std::sqrt(1.0L - static_cast<long double>(sine) * sine);
      return static_cast<double>(std::max(0.0L, (cosine - edge) / (1.0L - edge)));
    }
    case model::BeamKind::kPiston: {
      const double u = kPi * beam.piston_diameter_mm * per_mm * sine;
      return u < 1e-6 ? 1.0 : std::pow(2.0 * std::cyl_bessel_j(1.0, u) / u, 4);
    }
    case model::BeamKind::kRectangle:
      return sinc4(kPi * beam.aperture_along_mm * per_mm * along) *
             sinc4(kPi * beam.aperture_across_mm * per_mm * across);
    case model::BeamKind::kMeasured: {
      const double deg = std::asin(sine) / kRad;
      for (std::size_t i = 1; i < beam.rows.size(); ++i) {
        const host::PatternRow& left = beam.rows[i - 1];
        const host::PatternRow& right = beam.rows[i];
        if (deg <= right.off_axis_deg) {
          const double f =
              (deg * deg - left.off_axis_deg * left.off_axis_deg) /
              (right.off_axis_deg * right.off_axis_deg - left.off_axis_deg * left.off_axis_deg);
          return std::pow(10.0,
                          (left.two_way_db + f * (right.two_way_db - left.two_way_db)) / 10.0);
        }
      }
      return 0.0;
    }
  }
  return 0.0;
}

}  // namespace leadline::test
