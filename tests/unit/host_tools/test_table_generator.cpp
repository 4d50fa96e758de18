// The table generator: known answers, sweeps of whole tables against independent double precision
// (libm, other quadratures), identical bytes, files, refusals.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <sstream>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "host_tools/exit_codes.hpp"
#include "host_tools/table/beam_profile.hpp"
#include "host_tools/table/first_return.hpp"
#include "host_tools/table/generator.hpp"
#include "host_tools/table/kernel_rows.hpp"
#include "host_tools/table/run_table.hpp"
#include "host_tools/table/table_io.hpp"
#include "host_tools/table/table_math.hpp"
#include "tests/support/host_errors.hpp"
#include "tests/support/test.hpp"

namespace {

namespace exact = leadline::host::exact;
namespace model = leadline::model;

using leadline::host::AveragedFirstReturn;
using leadline::host::beam_description;
using leadline::host::BeamCut;
using leadline::host::BeamDescription;
using leadline::host::BeamPattern;
using leadline::host::BeamProfile;
using leadline::host::ExitCode;
using leadline::host::FirstReturn;
using leadline::host::generate_table;
using leadline::host::GeneratedTable;
using leadline::host::load_pattern;
using leadline::host::load_table;
using leadline::host::parse_map_config;
using leadline::host::parse_pattern;
using leadline::host::parse_table;
using leadline::host::PatternRow;
using leadline::host::run_table;
using leadline::host::save_table;
using leadline::host::table_to_json;
using leadline::host::table_to_text;
using leadline::host::TableOptions;
using leadline::test::assert_contains;
using leadline::test::error_of;
using leadline::test::Random;
using model::LocalizationTable;

constexpr double kPi = 3.14159265358979323846;
constexpr double kRad = kPi / 180.0;

BeamDescription cone(double half_angle_deg, double sigma_pointing_deg = 0.0) {
  BeamDescription beam;
  beam.half_angle_deg = half_angle_deg;
  beam.sigma_pointing_deg = sigma_pointing_deg;
  return beam;
}

BeamDescription piston(double diameter_mm, double frequency_hz, double sigma_pointing_deg = 0.0) {
  BeamDescription beam;
  beam.kind = model::BeamKind::kPiston;
  beam.piston_diameter_mm = diameter_mm;
  beam.frequency_hz = frequency_hz;
  beam.sigma_pointing_deg = sigma_pointing_deg;
  return beam;
}

BeamDescription rectangle(double along_mm, double across_mm, double frequency_hz,
                          double sigma_pointing_deg = 0.0) {
  BeamDescription beam;
  beam.kind = model::BeamKind::kRectangle;
  beam.aperture_along_mm = along_mm;
  beam.aperture_across_mm = across_mm;
  beam.frequency_hz = frequency_hz;
  beam.sigma_pointing_deg = sigma_pointing_deg;
  return beam;
}

BeamDescription measured() {
  BeamDescription beam;
  beam.kind = model::BeamKind::kMeasured;
  beam.rows =
      parse_pattern("one_way\n0 -1\n2, -4.0\n4 -12\n6 -30 # null\n8 -18\n10 -40\n", "p.txt");
  beam.sigma_pointing_deg = 0.5;
  return beam;
}

BeamDescription capped(BeamDescription beam, double max_half_angle_deg) {
  beam.max_half_angle_deg = max_half_angle_deg;
  return beam;
}

/// Descriptions that between them take every way through the generator.
std::vector<BeamDescription> all_kinds() {
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

/// generate_table(), once per description.
const LocalizationTable& table_of(const BeamDescription& beam) {
  static std::vector<std::pair<BeamDescription, LocalizationTable>> made;
  const auto same = [&](const BeamDescription& other) {
    const bool rows =
        std::equal(beam.rows.begin(), beam.rows.end(), other.rows.begin(), other.rows.end(),
                   [](const PatternRow& a, const PatternRow& b) {
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
  made.emplace_back(beam, generate_table(beam).table);
  return made.back().second;
}

/// The two-way pattern from the textbook, with libm; the cut is applied by the caller.
double plain_two_way(const BeamDescription& beam, double along, double across) {
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
        const PatternRow& left = beam.rows[i - 1];
        const PatternRow& right = beam.rows[i];
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

struct Ray {
  double along;
  double across;
  double axial;
  double weight;
};

/// The beam inside its envelope as rays of equal solid angle: a sunflower (axisymmetric), or a grid
/// in the coordinates in which the envelope of two axes is a rectangle.
std::vector<Ray> rays_of(const BeamDescription& beam, const BeamPattern& pattern, int count) {
  std::vector<Ray> rays;
  if (pattern.two_axis()) {
    const int side = static_cast<int>(std::sqrt(count));
    const double v_end = std::sin(pattern.envelope_rad(1));
    for (int i = 0; i < side; ++i) {
      for (int j = 0; j < side; ++j) {
        // A lattice turned against the axes would need its own weights at the rim; shifting every
        // other line is enough to keep rays from arriving in ranks.
        const double a = pattern.envelope_rad(0) * (2.0 * (i + 0.5) / side - 1.0);
        const double shift = i % 2 == 0 ? 0.25 : 0.75;
        const double v = v_end * (2.0 * (j + shift) / side - 1.0);
        const double r = std::sqrt(1.0 - v * v);
        rays.push_back({r * std::sin(a), v, r * std::cos(a), 0.0});
      }
    }
  } else {
    const double edge = std::cos(pattern.envelope_rad(0));
    for (int k = 0; k < count; ++k) {
      const double cosine = 1.0 - (k + 0.5) / count * (1.0 - edge);
      const double sine = std::sqrt(1.0 - cosine * cosine);
      const double turn = k * kPi * (3.0 - std::sqrt(5.0));
      rays.push_back({sine * std::cos(turn), sine * std::sin(turn), cosine, 0.0});
    }
  }
  for (Ray& ray : rays) {
    const bool inside = !pattern.two_axis() ||
                        std::fabs(ray.across / ray.axial) <= std::tan(pattern.envelope_rad(1));
    ray.weight = inside ? plain_two_way(beam, ray.along, ray.across) : 0.0;
  }
  return rays;
}

struct FirstEcho {
  double cosine;          ///< of the angle to the normal at which the fraction has arrived
  double patch_variance;  ///< mean of radial and transverse
};

/// The definition, ray by ray: sort by time of arrival, add up.
FirstEcho plain_first_echo(const std::vector<Ray>& rays, std::size_t axis, double incidence_rad,
                           double fraction) {
  std::vector<std::pair<double, std::size_t>> order;
  double total = 0.0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const double in_plane = axis == 0 ? rays[i].along : rays[i].across;
    order.emplace_back(
        -(rays[i].axial * std::cos(incidence_rad) + in_plane * std::sin(incidence_rad)), i);
    total += rays[i].weight;
  }
  std::sort(order.begin(), order.end());
  double arrived = 0.0;
  double x1 = 0.0;
  double x2 = 0.0;
  double y2 = 0.0;
  for (const auto& [minus_cosine, i] : order) {
    const Ray& ray = rays[i];
    const double x = (axis == 0 ? ray.along : ray.across) / ray.axial;
    const double y = (axis == 0 ? ray.across : ray.along) / ray.axial;
    arrived += ray.weight;
    x1 += ray.weight * x;
    x2 += ray.weight * x * x;
    y2 += ray.weight * y * y;
    if (arrived >= fraction * total) {
      const double mean = x1 / arrived;
      return {-minus_cosine, 0.5 * (x2 / arrived - mean * mean + y2 / arrived)};
    }
  }
  return {-1.0, 0.0};
}

/// What the field can hold: an unsigned one nothing below zero.
double storable_excess(double excess) {
  return std::is_signed_v<decltype(model::FirstReturnEntry::excess_q30)> ? excess
                                                                         : std::max(0.0, excess);
}

/// Linear interpolation as the vehicle does it, `position` in entries.
double stored_excess(const LocalizationTable& table, std::size_t axis, double position) {
  const int k = std::min(static_cast<int>(position), model::kIncidenceSteps - 1);
  const double left = table.first_return[axis][k].excess_q30;
  const double right = table.first_return[axis][k + 1].excess_q30;
  return (left + (position - k) * (right - left)) * 0x1.0p-30;
}

std::string pattern_error(const std::string& text) {
  return error_of(ExitCode::kUsage, [&] { (void)parse_pattern(text, "p.txt"); });
}

std::string description_error(const BeamDescription& beam) {
  return error_of(ExitCode::kUsage, [&] { (void)generate_table(beam); });
}

/// Standard output of `action`.
std::string output_of(const std::function<void()>& action) {
  std::ostringstream captured;
  std::streambuf* const before = std::cout.rdbuf(captured.rdbuf());
  try {
    action();
  } catch (...) {
    std::cout.rdbuf(before);
    throw;
  }
  std::cout.rdbuf(before);
  return captured.str();
}

void write_text(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

}  // namespace

// --- special functions ---------------------------------------------------------------------------

TEST(bessel_j1_agrees_with_the_library) {
  for (double x = 0.0; x < 400.0; x += 0.0137) {
    assert_near(exact::bessel_j1(x), std::cyl_bessel_j(1.0, x), x < 100.0 ? 2e-13 : 1e-11);
  }
  assert_near(exact::bessel_j1(3.8317059702075123), 0.0, 1e-14);
  assert_near(exact::bessel_j1(exact::kJ1SecondZero), 0.0, 1e-14);
}

TEST(scaled_modified_bessel_functions_agree_with_the_library) {
  for (double x = 0.0; x < 600.0; x = x * 1.01 + 0.003) {
    const double i0 = std::cyl_bessel_i(0.0, x) * std::exp(-x);
    const double i1 = std::cyl_bessel_i(1.0, x) * std::exp(-x);
    assert_near(exact::bessel_i0e(x), i0, 2e-11 * i0);
    assert_near(exact::bessel_i1e(x), i1, 2e-11 * i0);
  }
  // Far out, where the library overflows: the leading terms.
  assert_near(exact::bessel_i0e(1e9) * std::sqrt(2.0 * kPi * 1e9), 1.0, 1e-9);
}

TEST(elementary_functions_agree_with_the_library) {
  for (double x = -1.0; x <= 1.0; x += 0.00037) {
    assert_near(exact::acos(x), std::acos(x), 3e-14);
    assert_near(exact::asin(x), std::asin(x), 3e-14);
  }
  assert_near(exact::acos(1.0 + 1e-15), 0.0, 0.0);
  assert_near(exact::acos(-1.0 - 1e-15), kPi, 1e-15);
  for (double x = -690.0; x < 690.0; x += 0.173) {
    assert_near(exact::exp_fast(x), std::exp(x), 3e-14 * std::exp(x));
  }
  assert_near(exact::exp_fast(-1000.0), 0.0, 0.0);
  assert_int_equal(exact::round_to_integer(2.5), 3);
  assert_int_equal(exact::round_to_integer(-2.5), -2);
}

TEST(gauss_nodes_integrate_polynomials_exactly) {
  double sum = 0.0;
  double weight = 0.0;
  for (const exact::Node& node : exact::gauss_nodes(-1.0, 2.0, 1)) {
    sum += node.weight * std::pow(node.x, 15);
    weight += node.weight;
  }
  assert_near(sum, (65536.0 - 1.0) / 16.0, 1e-10);
  assert_near(weight, 3.0, 1e-14);
}

// --- beams
// -----------------------------------------------------------------------------------------

TEST(patterns_agree_with_the_textbook) {
  Random random(1);
  for (const BeamDescription& beam : all_kinds()) {
    const BeamPattern pattern(beam);
    assert_near(pattern.two_way(0.0, 0.0), 1.0, 1e-15);
    for (int i = 0; i < 2000; ++i) {
      const double sine = std::pow(random.uniform(), 2.0);
      const double turn = 2.0 * kPi * random.uniform();
      const double along = sine * std::cos(turn);
      const double across = sine * std::sin(turn);
      assert_near(pattern.two_way(along, across), plain_two_way(beam, along, across), 1e-11);
    }
  }
}

TEST(a_piston_is_cut_at_its_second_null) {
  const BeamDescription beam = piston(100.0, 200e3);
  const BeamPattern pattern(beam);
  const double ka = kPi * 100.0 * 200e3 / 1500e3;
  assert_int_equal(pattern.cut(0), BeamCut::kSecondNull);
  assert_near(pattern.envelope_rad(0), std::asin(7.015586669815619 / ka), 1e-13);
  assert_near(pattern.envelope_rad(1), pattern.envelope_rad(0), 0.0);
  assert_near(pattern.two_way(std::sin(pattern.envelope_rad(0)), 0.0), 0.0, 1e-25);
  // First null, first sidelobe (-17.57 dB one way) and half power, as tabulated for pistons.
  assert_near(pattern.two_way(3.8317059702 / ka, 0.0), 0.0, 1e-25);
  assert_near(10.0 * std::log10(pattern.two_way(5.1356223 / ka, 0.0)), -35.14, 0.01);
  assert_near(10.0 * std::log10(pattern.two_way(1.61633995 / ka, 0.0)), -6.0206, 0.001);
}

TEST(a_small_piston_is_cut_at_minus_30_dB) {
  // An altimeter: 115 kHz, 20 mm: no second null.
  const BeamPattern pattern(piston(20.0, 115e3));
  assert_int_equal(pattern.cut(0), BeamCut::kMinus30dB);
  assert_near(10.0 * std::log10(pattern.two_way(std::sin(pattern.envelope_rad(0)), 0.0)), -30.0,
              1e-9);
  // Just too small for a second null, and just large enough: both sides of ka = 7.0156, the cut of
  // the second at the widest envelope.
  const double edge_mm = 7.015586669815619 / kPi * 1500e3 / 115e3;
  assert_int_equal(BeamPattern(piston(edge_mm * 0.9999, 115e3)).cut(0), BeamCut::kMinus30dB);
  assert_int_equal(BeamPattern(piston(edge_mm * 1.0001, 115e3)).cut(0), BeamCut::kWidestEnvelope);
  assert_int_equal(BeamPattern(piston(edge_mm * 1.03, 115e3)).cut(0), BeamCut::kSecondNull);
  // So small that it never falls under -30 dB.
  const BeamPattern omnidirectional(piston(1.0, 100.0));
  assert_int_equal(omnidirectional.cut(0), BeamCut::kWidestEnvelope);
  assert_near(omnidirectional.envelope_rad(0), 80.0 * kRad, 1e-12);
  assert_near(omnidirectional.discarded_fraction(), std::cos(80.0 * kRad), 1e-6);
}

TEST(a_rectangle_is_cut_per_axis) {
  const BeamPattern pattern(rectangle(300.0, 30.0, 200e3));
  assert_true(pattern.two_axis());
  assert_int_equal(pattern.cut(0), BeamCut::kSecondNull);
  assert_int_equal(pattern.cut(1), BeamCut::kSecondNull);
  assert_near(pattern.envelope_rad(0), std::asin(2.0 * 7.5 / 300.0), 1e-13);
  assert_near(pattern.envelope_rad(1), std::asin(2.0 * 7.5 / 30.0), 1e-13);
  const BeamPattern fan(rectangle(300.0, 10.0, 200e3));
  assert_int_equal(fan.cut(1), BeamCut::kMinus30dB);
  assert_near(10.0 * std::log10(fan.axis_two_way(1, std::sin(fan.envelope_rad(1)))), -30.0, 1e-9);
}

TEST(max_half_angle_caps_every_beam) {
  for (const BeamDescription& beam : all_kinds()) {
    const BeamPattern pattern(capped(beam, 2.0));
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const bool narrower = BeamPattern(beam).envelope_rad(axis) <= 2.0 * kRad;
      assert_true(narrower == (pattern.cut(axis) != BeamCut::kMaxHalfAngle));
      assert_true(pattern.envelope_rad(axis) <= 2.0 * kRad);
    }
  }
  // A cap that is wider changes nothing.
  assert_int_equal(generate_table(capped(cone(3.0), 20.0)).table.crc32c,
                   generate_table(cone(3.0)).table.crc32c);
}

TEST(discarded_energy_agrees_with_plain_sums) {
  // Axisymmetric, by fine steps over the hemisphere.
  for (const BeamDescription& beam :
       {piston(100.0, 200e3), piston(20.0, 115e3), capped(piston(100.0, 200e3), 3.0),
        capped(cone(12.5), 5.0), cone(90.0), measured(), cone(3.0)}) {
    const BeamPattern pattern(beam);
    double inside = 0.0;
    double total = 0.0;
    constexpr int kSteps = 400000;
    for (int i = 0; i < kSteps; ++i) {
      const double t = (i + 0.5) / kSteps * 0.5 * kPi;
      const double energy = plain_two_way(beam, std::sin(t), 0.0) * std::sin(t);
      total += energy;
      inside += t <= pattern.envelope_rad(0) ? energy : 0.0;
    }
    assert_near(pattern.discarded_fraction(), 1.0 - inside / total, 2e-5);
  }
  // Two axes, by a grid of direction cosines: solid angle is du dv / w.
  for (const BeamDescription& beam : {rectangle(60.0, 30.0, 200e3), rectangle(60.0, 4.0, 200e3)}) {
    const BeamPattern pattern(beam);
    double inside = 0.0;
    double total = 0.0;
    constexpr int kSteps = 1500;
    for (int i = 0; i < kSteps; ++i) {
      const double v = (i + 0.5) / kSteps;
      for (int j = 0; j < kSteps; ++j) {
        const double a = (j + 0.5) / kSteps * 0.5 * kPi;
        const double r = std::sqrt(1.0 - v * v);
        const double energy = plain_two_way(beam, r * std::sin(a), v);
        total += energy;
        const bool in = a <= pattern.envelope_rad(0) &&
                        v / (r * std::cos(a)) <= std::tan(pattern.envelope_rad(1));
        inside += in ? energy : 0.0;
      }
    }
    assert_near(pattern.discarded_fraction(), 1.0 - inside / total, 2e-4);
  }
  // The known share of a long line: beyond the second null 0.04424 % of the two-way energy each.
  assert_near(BeamPattern(rectangle(3000.0, 3000.0, 200e3)).discarded_fraction(), 0.00088468, 1e-6);
}

TEST(the_variance_of_a_cone_is_a_sixth_of_its_square) {
  for (const double half_deg : {0.05, 0.5, 3.0}) {
    const double half = half_deg * kRad;
    assert_near(BeamPattern(cone(half_deg)).variance(0) / (half * half / 6.0), 1.0, half * half);
  }
  for (const BeamDescription& beam : all_kinds()) {
    const BeamPattern pattern(beam);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      double weight = 0.0;
      double moment = 0.0;
      constexpr int kSteps = 200000;
      for (int i = 0; i < kSteps; ++i) {
        const double t = (i + 0.5) / kSteps * pattern.envelope_rad(axis);
        const double ring = pattern.two_axis() ? 1.0 : std::sin(t);
        const double energy = ring * (axis == 0 ? plain_two_way(beam, std::sin(t), 0.0)
                                                : plain_two_way(beam, 0.0, std::sin(t)));
        weight += energy;
        moment += energy * std::tan(t) * std::tan(t);
      }
      const double plain = moment / weight * (pattern.two_axis() ? 1.0 : 0.5);
      assert_near(pattern.variance(axis) / plain, 1.0, 1e-6);
    }
  }
}

// --- first return
// ------------------------------------------------------------------------------------

TEST(a_slope_reads_shallow_by_the_known_share_of_the_beam) {
  // Where the incidence is large against the beam, iso-range lines are straight: the share of the
  // weight 1 - x^2 - y^2 beyond x = s is the integral of 8 / (3 pi) (1 - x^2)^(3/2).
  double s = 0.0;
  for (double arrived = 1.0; arrived > 0.1; s += 1e-6) {
    arrived = s == 0.0 ? 0.5 : arrived;
    arrived -= 8.0 / (3.0 * kPi) * std::pow(1.0 - s * s, 1.5) * 1e-6;
  }
  assert_near(s, 0.5508, 1e-3);
  const LocalizationTable table = generate_table(cone(0.5)).table;
  const double half = 0.5 * kRad;
  for (const int k : {64, 128, 192}) {
    const double sine = k / 256.0;
    assert_near(stored_excess(table, 0, k) / (half * sine), s, 0.02);
    assert_near(table.first_return[0][k].shift_q20 * 0x1.0p-20 * sine / half, s, 0.02);
    assert_near(table.first_return[0][k].slope_q20 * 0x1.0p-20, -sine, 0.01);
  }
  // And about half of it at moderate slopes with a wider beam.
  const LocalizationTable wide = generate_table(cone(3.0)).table;
  assert_near(stored_excess(wide, 0, 128) / (3.0 * kRad * 0.5), 0.535, 0.02);
}

TEST(facing_the_plane_the_range_is_that_of_the_inner_rays) {
  // 10 % of a cone's weight: (1 - y)^2 = 0.9, y = share of the solid angle.
  const double half = 12.5 * kRad;
  const double cosine = 1.0 - (1.0 - std::sqrt(0.9)) * (1.0 - std::cos(half));
  const BeamPattern pattern(cone(12.5));
  assert_near(AveragedFirstReturn(pattern, 0.1, 0.0).q(0, 0.0), cosine, 2e-5 * half);
}

TEST(first_returns_agree_with_rays_over_the_whole_domain) {
  for (BeamDescription beam : {cone(3.0), cone(12.5), cone(60.0), piston(100.0, 200e3),
                               piston(20.0, 115e3), rectangle(300.0, 30.0, 200e3), measured()}) {
    beam.sigma_pointing_deg = 0.0;
    for (const double fraction : {0.1, 0.4}) {
      beam.detection_fraction = fraction;
      const BeamPattern pattern(beam);
      const LocalizationTable& table = table_of(beam);
      const std::vector<Ray> rays = rays_of(beam, pattern, 6000);
      for (std::size_t axis = 0; axis < (pattern.two_axis() ? 2U : 1U); ++axis) {
        const double scale = std::sqrt(pattern.variance(axis));
        for (double position = 0.37; position < 256.0; position += 9.7) {
          const double sine = position / 256.0;
          const double incidence = std::asin(sine);
          const FirstEcho plain = plain_first_echo(rays, axis, incidence, fraction);
          const double q0 = std::max(leadline::host::kMinReturnCosine, plain.cosine);
          const double excess = storable_excess(q0 - std::cos(incidence));
          // The rays themselves are good to about a hundredth of the beam.
          const double tolerance =
              table.error_excess_q30 * 0x1.0p-30 + 0.02 * scale * std::max(sine, 0.5 * scale);
          assert_near(stored_excess(table, axis, position), excess, tolerance);
          const auto& entry = table.first_return[axis][static_cast<int>(position + 0.5)];
          if (sine > 4.0 * scale && sine < 0.9) {
            assert_near(entry.patch_variance_q30 * 0x1.0p-30 / plain.patch_variance, 1.0, 0.08);
          }
        }
      }
    }
  }
}

TEST(pointing_errors_are_averaged_over_their_plane) {
  const double sigma = 1.0 * kRad;
  for (const BeamDescription& beam :
       {cone(3.0, 1.0), cone(0.5, 1.0), rectangle(300.0, 30.0, 200e3, 1.0)}) {
    const BeamPattern pattern(beam);
    const AveragedFirstReturn first(pattern, 0.1, sigma);
    for (std::size_t axis = 0; axis < (pattern.two_axis() ? 2U : 1U); ++axis) {
      for (const double incidence : {0.0, 0.004, 0.02, 0.05, 0.2, 0.7, 1.3, 1.5}) {
        // Steps of a tenth sigma over both error angles: exact for smooth functions.
        double weight_sum = 0.0;
        double sum = 0.0;
        for (int i = -60; i <= 60; ++i) {
          for (int j = -60; j <= 60; ++j) {
            const double a = incidence + 0.1 * sigma * i;
            const double b = 0.1 * sigma * j;
            const double weight = std::exp(-0.005 * (i * i + j * j));
            const double r = std::hypot(a, b);
            const auto inverse = [&](std::size_t plane) {
              return 1.0 / std::max(0.02, std::cos(first.geometry(plane).cap_rad(r)));
            };
            const double across = r == 0.0 ? 0.5 : b * b / (r * r);
            sum += weight * (inverse(axis) + across * (inverse(1 - axis) - inverse(axis)));
            weight_sum += weight;
          }
        }
        // Near grazing the floor under the cosine is a kink, which steps of a tenth sigma feel.
        const double tolerance = incidence < 1.4 ? 2e-6 : 2e-4;
        assert_near(first.q(axis, incidence), weight_sum / sum, tolerance);
      }
    }
  }
  // Facing the plane, both axes of a two-axis beam see the same.
  const AveragedFirstReturn first(BeamPattern(rectangle(300.0, 30.0, 200e3)), 0.1, sigma);
  assert_near(first.q(0, 0.0), first.q(1, 0.0), 1e-5);
}

TEST(entries_stay_within_the_stated_error_everywhere) {
  for (const BeamDescription& beam : all_kinds()) {
    const BeamPattern pattern(beam);
    const LocalizationTable& table = table_of(beam);
    const AveragedFirstReturn first(pattern, beam.detection_fraction,
                                    beam.sigma_pointing_deg * kRad);
    for (std::size_t axis = 0; axis < (pattern.two_axis() ? 2U : 1U); ++axis) {
      for (double position = 0.0; position <= 256.0; position += 0.31) {
        const double incidence = std::asin(position / 256.0);
        const double truth = storable_excess(first.q(axis, incidence) - std::cos(incidence));
        // A twentieth more: the stated error was found at quarters between the entries.
        assert_near(stored_excess(table, axis, position), truth,
                    table.error_excess_q30 * 0x1.0p-30 * 1.05);
      }
    }
  }
}

TEST(first_return_entries_are_smooth) {
  const LocalizationTable table = generate_table(cone(3.0, 1.0)).table;
  // Third differences of an analytic function on this grid; quadrature noise would stand out.
  for (int k = 40; k < 200; ++k) {
    const auto& e = table.first_return[0];
    const double third = static_cast<double>(e[k + 3].excess_q30) - 3.0 * e[k + 2].excess_q30 +
                         3.0 * e[k + 1].excess_q30 - e[k].excess_q30;
    assert_true(std::fabs(third) < 2000.0);  // 2e-6 of the range
  }
}

// --- lateral profile, beam weight
// ----------------------------------------------------------------------

TEST(profiles_agree_with_a_convolution_on_a_grid) {
  constexpr double kCut2 = model::kProfileCut2_q8 / 256.0;
  for (const BeamDescription& beam :
       {cone(3.0), cone(60.0), piston(100.0, 200e3), rectangle(300.0, 4.0, 200e3), measured()}) {
    const BeamPattern pattern(beam);
    const LocalizationTable& table = table_of(beam);
    for (std::size_t axis = 0; axis < (pattern.two_axis() ? 2U : 1U); ++axis) {
      // Density over the plane of tangents, on squares (two axes: steps of one line).
      const double reach = std::tan(pattern.envelope_rad(axis));
      const int side = pattern.two_axis() ? 4000 : 240;
      struct Cell {
        double x;
        double y;
        double weight;
      };
      std::vector<Cell> cells;
      double weight = 0.0;
      double moment = 0.0;
      for (int i = 0; i < side; ++i) {
        const double x = reach * (2.0 * (i + 0.5) / side - 1.0);
        for (int j = 0; j < (pattern.two_axis() ? 1 : side); ++j) {
          const double y = pattern.two_axis() ? 0.0 : reach * (2.0 * (j + 0.5) / side - 1.0);
          const double tangent = std::hypot(x, y);
          if (tangent > reach) {
            continue;
          }
          const double t = std::atan(tangent);
          const double area = std::pow(std::cos(t), pattern.two_axis() ? 2.0 : 3.0);
          const double sine = std::sin(t);
          const double two_way =
              axis == 0 ? plain_two_way(beam, sine, 0.0) : plain_two_way(beam, 0.0, sine);
          cells.push_back({x, y, area * two_way});
          weight += cells.back().weight;
          moment += cells.back().weight * x * x;
        }
      }
      const double sigma = std::sqrt(moment / weight);
      for (int c = 1; c < model::kProfileClasses - 1; c += 2) {
        const double share = c / 7.0;
        const auto plain = [&](double m) {
          double sum = 0.0;
          for (const Cell& cell : cells) {
            const double dx = m - cell.x / sigma * std::sqrt(share);
            const double dy = cell.y / sigma * std::sqrt(share);
            sum += cell.weight * std::exp(-(dx * dx + dy * dy) / (2.0 * (1.0 - share)));
          }
          return sum;
        };
        const double peak = plain(0.0);
        for (int j = 0; j <= model::kProfileSteps; j += 16) {
          const double m = std::sqrt(j * kCut2 / model::kProfileSteps);
          assert_near(table.profile_q15[axis][c][j], 32767.0 * plain(m) / peak, 20.0);
        }
      }
    }
  }
}

TEST(profiles_end_in_the_two_known_curves) {
  constexpr double kCut2 = model::kProfileCut2_q8 / 256.0;
  for (const BeamDescription& beam : all_kinds()) {
    const BeamPattern pattern(beam);
    const LocalizationTable& table = table_of(beam);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      for (int j = 0; j <= model::kProfileSteps; ++j) {
        const double m2 = j * kCut2 / model::kProfileSteps;
        assert_near(table.profile_q15[axis][0][j], 32767.0 * std::exp(-0.5 * m2), 0.51);
        // Beam alone.
        const double tangent = std::sqrt(m2 * pattern.variance(axis));
        const double t = std::atan(tangent);
        double alone = axis == 0 ? plain_two_way(beam, std::sin(t), 0.0)
                                 : plain_two_way(beam, 0.0, std::sin(t));
        alone *= std::pow(std::cos(t), pattern.two_axis() ? 2.0 : 3.0);
        const bool inside = t <= pattern.envelope_rad(axis);
        assert_near(table.profile_q15[axis][7][j], inside ? 32767.0 * alone : 0.0, 0.51);
      }
      for (const auto& profile : table.profile_q15[axis]) {
        assert_int_equal(profile[0], 32767);
        for (int j = model::kProfileSteps + 1; j < model::kProfileSteps + 4; ++j) {
          assert_int_equal(profile[j], profile[model::kProfileSteps]);
        }
      }
    }
  }
}

TEST(profiles_stay_within_the_stated_error_everywhere) {
  constexpr double kCut2 = model::kProfileCut2_q8 / 256.0;
  std::vector<BeamDescription> beams = all_kinds();
  // Cut where the beam is still loud: the beam alone ends in a jump.
  beams.push_back(capped(piston(100.0, 200e3), 1.0));
  for (const BeamDescription& beam : beams) {
    const BeamPattern pattern(beam);
    const LocalizationTable& table = table_of(beam);
    for (std::size_t axis = 0; axis < (pattern.two_axis() ? 2U : 1U); ++axis) {
      for (int c = 0; c < model::kProfileClasses; ++c) {
        const BeamProfile profile(pattern, axis, c / 7.0);
        for (double position = 0.0; position < model::kProfileSteps; position += 0.37) {
          const int j = static_cast<int>(position);
          const auto* const entries = table.profile_q15[axis][c];
          const double stored = entries[j] + (position - j) * (entries[j + 1] - entries[j]);
          const double truth =
              32767.0 * profile.weight(std::sqrt(position * kCut2 / model::kProfileSteps));
          assert_near(stored, truth, table.error_profile_q15 * 1.05);
        }
      }
    }
  }
}

TEST(the_beam_weight_is_the_pattern_over_the_envelope) {
  for (const BeamDescription& beam : all_kinds()) {
    const BeamPattern pattern(beam);
    const LocalizationTable& table = table_of(beam);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      for (int j = 0; j < model::kBeamWeightSteps; ++j) {
        const double t = std::atan(std::tan(pattern.envelope_rad(axis)) * std::sqrt(j / 64.0));
        const double plain = axis == 0 ? plain_two_way(beam, std::sin(t), 0.0)
                                       : plain_two_way(beam, 0.0, std::sin(t));
        assert_near(table.beam_weight_q15[axis][j], 32767.0 * plain, 0.51);
      }
      assert_int_equal(table.beam_weight_q15[axis][64], table.beam_weight_q15[axis][65]);
    }
  }
  const LocalizationTable& table = table_of(cone(3.0));
  assert_int_equal(table.beam_weight_q15[0][64], 0);
  assert_near(table.beam_weight_q15[0][32], 16384.0, 40.0);  // 1 - (t/T)^2
}

// --- kernels
// -------------------------------------------------------------------------------------------

TEST(kernel_rows_keep_weight_and_place) {
  const LocalizationTable& table = table_of(cone(3.0));
  for (int level = 0; level < model::kKernelLevels; ++level) {
    const double variance = 0.25 * std::pow(2.0, level / 4.0);
    assert_near(leadline::host::kernel_variance(static_cast<std::size_t>(level)), variance,
                1e-14 * variance);
    const double cut = std::max(1.5, std::min(2.0 * std::sqrt(variance), 7.0));
    for (int phase = 0; phase < model::kKernelPhases; ++phase) {
      const auto& row = table.kernel_q15[level][phase];
      std::int64_t sum = 0;
      std::int64_t moment_32 = 0;
      double moment2 = 0.0;
      for (int tap = 0; tap < model::kKernelTaps; ++tap) {
        const int offset_32 = 32 * tap - 208 - (2 * phase + 1);
        const double x = offset_32 / 32.0;
        assert_near(x, tap - 6.5 - (phase + 0.5) / 16.0, 0.0);
        // Inside the cut every voxel has its tap, outside none.
        assert_true((row[tap] > 0) == (std::fabs(x) <= cut));
        sum += row[tap];
        moment_32 += std::int64_t{row[tap]} * offset_32;
        moment2 += row[tap] * x * x / 32768.0;
        const int first = table.kernel_first[level][phase];
        const int count = table.kernel_count[level][phase];
        assert_true((tap >= first && tap < first + count) == (row[tap] != 0));
      }
      assert_int_equal(sum, model::kKernelSum);
      assert_int_equal(moment_32, 0);
      // Cut at two sigma: 0.774 of the variance in the continuum, more where a voxel is coarse.
      assert_true(moment2 > 0.6 * variance && moment2 < 1.35 * variance);
    }
  }
  assert_int_equal(table.error_kernel_moment_q15, 0);
}

TEST(kernel_rows_agree_with_a_tilted_gaussian) {
  const LocalizationTable& table = table_of(cone(3.0));
  for (int level = 0; level < model::kKernelLevels; ++level) {
    const double variance = 0.25 * std::pow(2.0, level / 4.0);
    const double cut = std::max(1.5, std::min(2.0 * std::sqrt(variance), 7.0));
    for (int phase = 0; phase < model::kKernelPhases; ++phase) {
      // The tilt by bisection.
      std::array<double, model::kKernelTaps> taps{};
      double low = -5.0;
      double high = 5.0;
      for (int i = 0; i < 100; ++i) {
        const double tilt = 0.5 * (low + high);
        double sum = 0.0;
        double moment = 0.0;
        for (int tap = 0; tap < model::kKernelTaps; ++tap) {
          const double x = tap - 6.5 - (phase + 0.5) / 16.0;
          const double value =
              std::fabs(x) <= cut ? std::exp(-x * x / (2.0 * variance) + tilt * x) : 0.0;
          taps[static_cast<std::size_t>(tap)] = value;
          sum += value;
          moment += value * x;
        }
        for (double& tap : taps) {
          tap /= sum;
        }
        (moment > 0.0 ? high : low) = tilt;
      }
      for (int tap = 0; tap < model::kKernelTaps; ++tap) {
        assert_near(table.kernel_q15[level][phase][tap],
                    32768.0 * taps[static_cast<std::size_t>(tap)], 2.0);
      }
    }
  }
}

TEST(kernels_stay_within_the_stated_error_for_every_phase) {
  const LocalizationTable& table = table_of(cone(3.0));
  for (std::size_t level = 0; level < model::kKernelLevels; ++level) {
    for (int i = 0; i < 4000; ++i) {
      const double phase = (i + 0.5) / 4000.0;
      const auto taps = leadline::host::kernel_taps(leadline::host::kernel_variance(level), phase);
      const auto& row = table.kernel_q15[level][static_cast<int>(phase * 16.0)];
      for (std::size_t tap = 0; tap < model::kKernelTaps; ++tap) {
        assert_near(row[tap], 32768.0 * taps.tap[tap], table.error_kernel_q15);
      }
    }
  }
}

// --- the block
// -----------------------------------------------------------------------------------------

TEST(the_header_carries_the_description) {
  BeamDescription beam = rectangle(300.0, 30.0, 200e3, 1.0);
  beam.sigma_range_mm = 12.345;
  beam.detection_fraction = 0.25;
  const GeneratedTable generated = generate_table(beam);
  const LocalizationTable& table = generated.table;
  assert_int_equal(table.beam_kind, model::BeamKind::kRectangle);
  assert_int_equal(table.two_axis, 1);
  assert_int_equal(table.detection_fraction_q16, 16384);
  assert_int_equal(table.sigma_range_um, 12345);
  assert_near(table.tan_envelope_along_q24 * 0x1.0p-24, std::tan(std::asin(0.05)), 1e-7);
  assert_near(table.tan_envelope_across_q24 * 0x1.0p-24, std::tan(std::asin(0.5)), 1e-7);
  assert_near(table.pointing_variance_q30 * 0x1.0p-30, std::pow(std::tan(kRad), 2), 1e-9);
  assert_near(table.discarded_energy_ppm * 1e-6, generated.facts.discarded_fraction, 1e-6);
  assert_int_equal(table.crc32c, model::table_crc(table));
  // An axisymmetric beam has the same on both axes.
  const LocalizationTable round = generate_table(piston(100.0, 200e3, 0.3)).table;
  assert_int_equal(round.two_axis, 0);
  assert_memory_equal(round.first_return[0], round.first_return[1], sizeof(round.first_return[0]));
  assert_memory_equal(round.profile_q15[0], round.profile_q15[1], sizeof(round.profile_q15[0]));
  assert_memory_equal(round.beam_weight_q15[0], round.beam_weight_q15[1],
                      sizeof(round.beam_weight_q15[0]));
}

TEST(tables_are_the_same_bytes_on_every_host) {
  // Found on x86-64 with g++ -O0, -O2, -O3 -march=native and clang++, and on aarch64: all the same.
  // When the generator changes on purpose, these change with it, and the version of the table only
  // if the meaning of a field does.
  const std::vector<BeamDescription> beams = all_kinds();
  const std::vector<std::uint32_t> golden = {0x01264878, 0x4c6d6c57, 0x5347f5aa, 0xeef40c13,
                                             0xdc55eb71, 0xfc55b5ff, 0xcade05d4, 0x15addcf8,
                                             0xd7161fda, 0xf9b4839c, 0xa11f7927};
  assert_int_equal(beams.size(), golden.size());
  for (std::size_t i = 0; i < beams.size(); ++i) {
    assert_int_equal(generate_table(beams[i]).table.crc32c, golden[i]);
  }
}

TEST(random_descriptions_make_tables_that_pass) {
  Random random(2);
  const auto between = [&](double low, double high) {
    return low * std::pow(high / low, random.uniform());
  };
  for (int i = 0; i < 12; ++i) {
    BeamDescription beam;
    switch (i % 3) {
      case 0:
        beam = cone(between(0.01, 90.0));
        break;
      case 1:
        beam = piston(between(1.0, 1000.0), between(100.0, 1e6));
        break;
      default:
        beam = rectangle(between(1.0, 1000.0), between(1.0, 1000.0), between(100.0, 1e6));
        break;
    }
    beam.sigma_pointing_deg = random.uniform() < 0.2 ? 0.0 : between(0.001, 45.0);
    beam.detection_fraction = between(1e-4, 0.9999);
    beam.sigma_range_mm = between(0.001, 1e6);
    const LocalizationTable& table = table_of(beam);
    assert_int_equal(model::check_table(&table, sizeof(table)), leadline::base::Status::kOk);
  }
}

TEST(a_table_takes_less_than_half_a_second) {
#ifndef NDEBUG
  leadline::test::skip_test("speed is measured in the release build");
#else
  for (const BeamDescription& beam : {cone(3.0, 1.0), rectangle(300.0, 30.0, 200e3, 0.5)}) {
    const std::clock_t begin = std::clock();
    (void)generate_table(beam);
    const double cpu_s = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
    print_message("%.3f s\n", cpu_s);
    assert_true(cpu_s < 0.5);
  }
#endif
}

TEST(descriptions_outside_their_limits_are_refused) {
  assert_contains(description_error(cone(0.0)), "beam_half_angle_deg = 0");
  assert_contains(description_error(cone(90.1)), "beam_half_angle_deg = 90.1");
  assert_contains(description_error(cone(std::nan(""))), "beam_half_angle_deg");
  assert_contains(description_error(cone(3.0, -1.0)), "sigma_pointing_deg = -1");
  assert_contains(description_error(cone(3.0, 46.0)), "sigma_pointing_deg");
  assert_contains(description_error(capped(cone(3.0), 0.0)), "max_half_angle_deg = 0");
  assert_contains(description_error(piston(0.5, 200e3)), "piston_diameter_mm = 0.5");
  assert_contains(description_error(piston(100.0, 99.0)), "frequency_hz = 99");
  assert_contains(description_error(piston(1e4, 1e8)), "too narrow for a table");
  assert_contains(description_error(rectangle(0.0, 30.0, 200e3)), "aperture_along_mm");
  assert_contains(description_error(rectangle(30.0, 1e5, 200e3)), "aperture_across_mm = 1e+05");
  BeamDescription beam = piston(100.0, 200e3);
  beam.sound_speed_mm_s = 0.0;
  assert_contains(description_error(beam), "sound_speed_mm_s");
  for (const double fraction : {0.0, 1.0, -0.1, std::nan("")}) {
    beam = cone(3.0);
    beam.detection_fraction = fraction;
    assert_contains(description_error(beam), "detection_fraction");
  }
  beam = cone(3.0);
  beam.sigma_range_mm = 1e7;
  assert_contains(description_error(beam), "sigma_range_mm");
  beam = measured();
  beam.rows.resize(1);
  assert_contains(description_error(beam), "rows of the pattern");
  beam = measured();
  beam.rows[2].off_axis_deg = 0.5;
  assert_contains(description_error(beam), "off_axis_deg");
  beam = measured();
  beam.rows[1].two_way_db = 0.5;
  assert_contains(description_error(beam), "two_way_db");
}

TEST(descriptions_come_from_the_configuration) {
  const std::string grid =
      "[grid]\ncell_mm = 1000\nsize = [8, 8, 8]\norigin_mm = [0, 0, 0]\n[sonar]\n";
  const auto of = [&](const std::string& sonar) {
    return beam_description(parse_map_config(grid + sonar, "map.toml", "").sonar);
  };
  BeamDescription beam =
      of("beam_half_angle_deg = 3\nsigma_pointing_deg = 1\nsigma_range_mm = 1500\n");
  assert_int_equal(beam.kind, model::BeamKind::kCone);
  assert_near(beam.detection_fraction, 0.1, 0.0);
  assert_near(beam.sigma_range_mm, 1500.0, 0.0);
  assert_int_equal(generate_table(beam).table.sigma_range_um, 1500000);
  beam =
      of("piston_diameter_mm = 60\nfrequency_hz = 2e5\nmax_half_angle_deg = 10\n"
         "sound_speed_mm_s = 1480000\ndetection_fraction = 0.3\n");
  assert_int_equal(beam.kind, model::BeamKind::kPiston);
  assert_near(beam.piston_diameter_mm, 60.0, 0.0);
  assert_near(beam.frequency_hz, 2e5, 0.0);
  assert_near(beam.sound_speed_mm_s, 1480000.0, 0.0);
  assert_near(beam.max_half_angle_deg.value(), 10.0, 0.0);
  assert_near(beam.detection_fraction, 0.3, 0.0);
  beam = of("aperture_along_mm = 300\naperture_across_mm = 30\nfrequency_hz = 2e5\n");
  assert_int_equal(beam.kind, model::BeamKind::kRectangle);
  assert_near(beam.aperture_along_mm, 300.0, 0.0);
  assert_near(beam.aperture_across_mm, 30.0, 0.0);
  const std::string path = leadline::test::scratch_directory() + "/beam.txt";
  write_text(path, "0 0\n5 -20\n10 -40\n");
  beam = of("pattern_file = \"" + path + "\"\n");
  assert_int_equal(beam.kind, model::BeamKind::kMeasured);
  assert_int_equal(beam.rows.size(), 3);
}

// --- measured patterns
// -----------------------------------------------------------------------------------

TEST(patterns_are_read_in_all_their_forms) {
  const std::vector<PatternRow> rows = parse_pattern(
      "# a head\r\none_way  # each way\r\n\r\n0, 3\r\n1.5\t,\t-1e0 \n\t 20 -200.5", "p.txt");
  assert_int_equal(rows.size(), 3);
  assert_near(rows[0].two_way_db, 0.0, 0.0);
  assert_near(rows[1].off_axis_deg, 1.5, 0.0);
  assert_near(rows[1].two_way_db, -8.0, 0.0);
  assert_near(rows[2].two_way_db, -300.0, 0.0);  // the floor
  assert_near(parse_pattern("two_way\n0 0\n1 -3\n", "p.txt")[1].two_way_db, -3.0, 0.0);
}

TEST(patterns_that_cannot_be_meant_are_refused_by_line_and_value) {
  assert_contains(pattern_error(""), "p.txt:0: a pattern needs at least two rows");
  assert_contains(pattern_error("0 0\n"), "at least two rows");
  assert_contains(pattern_error("0 0\n1 x\n"), "p.txt:2: \"x\": not a number");
  assert_contains(pattern_error("0 0\n1 nan\n"), "not a number");
  assert_contains(pattern_error("0 0\n1 inf\n"), "not a number");
  assert_contains(pattern_error("0 0\n1 -1e999\n"), "not a number");
  assert_contains(pattern_error("0 0\n1 -1 -2\n"), "p.txt:2: \"1 -1 -2\": expected two numbers");
  assert_contains(pattern_error("0 0\n1,,2\n"), "expected two numbers");
  assert_contains(pattern_error("0 0\none_way\n1 2\n"), "expected two numbers");
  assert_contains(pattern_error("0 0\n# c\n91 -3\n"), "p.txt:3: \"91\": off-axis angle outside");
  assert_contains(pattern_error("0 0\n-1 -3\n"), "off-axis angle outside");
  assert_contains(pattern_error("0 0\n1 -301\n"), "level outside");
  assert_contains(pattern_error("0.5 0\n1 -3\n"), "the first row must be the axis");
  assert_contains(pattern_error("0 0\n1 -3\n1 -4\n"),
                  "p.txt:3: \"1\": off-axis angles must ascend");
  assert_contains(pattern_error("0 -3\n1 -2\n"), "louder than the axis");
  assert_contains(pattern_error(std::string("0 0\n1 \x01\xff\n")), "\\x01\\xff");
  std::string many = "0 0\n";
  for (int i = 1; i <= 10000; ++i) {
    many += std::to_string(i * 0.009) + " -3\n";
  }
  assert_contains(pattern_error(many), "p.txt:10001: more than 10,000 rows");
  const std::string folder = leadline::test::scratch_directory();
  for (const std::string& path : {folder + "/missing.txt", folder}) {
    assert_contains(error_of(ExitCode::kUsage, [&] { (void)load_pattern(path); }),
                    path + ": cannot be read: ");
  }
  write_text(folder + "/long.txt", std::string((4U << 20U) + 1, '#'));
  assert_contains(error_of(ExitCode::kUsage, [&] { (void)load_pattern(folder + "/long.txt"); }),
                  "longer than 4 MiB");
}

TEST(a_measured_piston_is_a_piston) {
  // Sampled finely from the formula, one way, and cut by hand where the formula is.
  const BeamDescription formula = capped(piston(100.0, 200e3, 0.5), 4.5);
  std::string text = "one_way\n";
  for (int i = 0; i <= 900; ++i) {
    const double deg = i * 0.1;
    const double level = 5.0 * std::log10(plain_two_way(formula, std::sin(deg * kRad), 0.0));
    text += std::to_string(deg) + " " + std::to_string(std::max(-150.0, level)) + "\n";
  }
  BeamDescription samples = formula;
  samples.kind = model::BeamKind::kMeasured;
  samples.rows = parse_pattern(text, "p.txt");
  const LocalizationTable a = generate_table(formula).table;
  const LocalizationTable b = generate_table(samples).table;
  assert_near(static_cast<double>(b.beam_variance_along_q30) / a.beam_variance_along_q30, 1.0,
              0.002);
  for (int k = 0; k <= 250; ++k) {
    assert_near(stored_excess(b, 0, k), stored_excess(a, 0, k), 2e-5);
  }
  for (int j = 0; j <= 128; ++j) {
    assert_near(b.profile_q15[0][4][j], a.profile_q15[0][4][j], 60.0);
  }
  // Without the cap it is cut at its first fall under -30 dB.
  samples.max_half_angle_deg.reset();
  const BeamPattern pattern(samples);
  assert_int_equal(pattern.cut(0), BeamCut::kMinus30dB);
  samples.rows = {{0.0, 0.0}, {2.0, -6.0}};
  assert_int_equal(BeamPattern(samples).cut(0), BeamCut::kEndOfPattern);
  assert_near(BeamPattern(samples).envelope_rad(0), 2.0 * kRad, 1e-12);
}

// --- files and the command
// ---------------------------------------------------------------------------------

TEST(tables_survive_a_file) {
  const std::string path = leadline::test::scratch_directory() + "/beam.llt";
  const LocalizationTable table = generate_table(cone(3.0, 1.0)).table;
  save_table(path, table);
  assert_int_equal(std::filesystem::file_size(path), sizeof(table));
  const LocalizationTable loaded = load_table(path);
  assert_memory_equal(&loaded, &table, sizeof(table));
  assert_contains(error_of(ExitCode::kOutput, [&] { save_table(path + "/x.llt", table); }), path);
}

TEST(files_that_are_no_tables_are_refused) {
  const LocalizationTable& table = table_of(cone(3.0));
  const std::string bytes(reinterpret_cast<const char*>(&table), sizeof(table));
  const auto error = [](const std::string& text) {
    return error_of(ExitCode::kInput, [&] { (void)parse_table(text, "t.llt"); });
  };
  assert_contains(error(""), "t.llt: truncated: 0 of 25832 bytes");
  assert_contains(error(bytes.substr(0, 1000)), "truncated: 1000 of 25832 bytes");
  assert_contains(error(bytes + "x"), "longer than the 25832 bytes of a table");
  std::string changed = bytes;
  changed[4] = 9;
  assert_contains(error(changed), "table version 9, this program reads version 1");
  assert_contains(error(changed + "longer than ours"), "table version 9");
  changed = bytes;
  changed[5000] = static_cast<char>(changed[5000] ^ 1);
  assert_contains(error(changed), "damaged: the checksum says 0x");
  assert_contains(error("PNG" + bytes.substr(3)), "not a localization table");
  LocalizationTable bad = table;
  bad.kernel_count[3][3] = 200;
  bad.crc32c = model::table_crc(bad);
  assert_contains(error(std::string(reinterpret_cast<const char*>(&bad), sizeof(bad))),
                  "outside its range");
  const std::string folder = leadline::test::scratch_directory();
  for (const std::string& path : {folder + "/missing.llt", folder}) {
    assert_contains(error_of(ExitCode::kInput, [&] { (void)load_table(path); }),
                    path + ": cannot be read");
  }
}

TEST(a_table_describes_itself) {
  const LocalizationTable table = generate_table(rectangle(300.0, 30.0, 200e3, 1.0)).table;
  const std::string text = table_to_text(table);
  assert_contains(text, "Beam: rectangle, different along and across");
  assert_contains(text, "Envelope half-angle: 2.8660 deg along, 30.0000 deg across");
  assert_contains(text, "Energy discarded outside the envelope: 0.09");
  const nlohmann::json json = nlohmann::json::parse(table_to_json(table));
  assert_string_equal(json.at("beam").get<std::string>().c_str(), "rectangle");
  assert_true(json.at("two_axis").get<bool>());
  assert_near(json.at("envelope_deg").at(1).get<double>(), 30.0, 1e-4);
  assert_near(json.at("sigma_pointing_deg").get<double>(), 1.0, 1e-4);
  assert_near(json.at("error_first_return").get<double>(), table.error_excess_q30 * 0x1.0p-30,
              1e-8);
  assert_int_equal(std::stoul(json.at("table_crc").get<std::string>(), nullptr, 16), table.crc32c);
  assert_contains(generate_table(cone(3.0)).report, "Cut: edge of the cone");
  assert_contains(generate_table(cone(3.0)).report, "up to 75 degrees of incidence");
  assert_contains(generate_table(rectangle(300.0, 4.0, 200e3)).report,
                  "Cut: second null along, widest envelope of a table, 80 degrees across");
}

TEST(the_command_makes_and_shows_tables) {
  const std::string folder = leadline::test::scratch_directory();
  write_text(folder + "/map.toml",
             "[grid]\ncell_mm = 1000\nsize = [8, 8, 8]\norigin_mm = [0, 0, 0]\n"
             "[sonar]\nbeam_half_angle_deg = 3\n");
  TableOptions options;
  options.config_path = folder + "/map.toml";
  options.out_path = folder + "/beam.llt";
  assert_contains(output_of([&] { assert_int_equal(run_table(options), 0); }),
                  "Envelope half-angle: 3.0000 deg\n");
  assert_int_equal(load_table(options.out_path).crc32c, generate_table(cone(3.0)).table.crc32c);
  options.json = true;
  const std::string made = output_of([&] { (void)run_table(options); });
  TableOptions show;
  show.show_path = options.out_path;
  show.json = true;
  assert_string_equal(output_of([&] { (void)run_table(show); }).c_str(), made.c_str());
  show.json = false;
  assert_contains(output_of([&] { (void)run_table(show); }), "Beam: cone, axisymmetric");

  assert_contains(error_of(ExitCode::kUsage, [] { (void)run_table({}); }), "nothing to do");
  show.config_path = options.config_path;
  assert_contains(error_of(ExitCode::kUsage, [&] { (void)run_table(show); }), "not both");
  show.config_path = "";
  show.out_path = "x";
  assert_contains(error_of(ExitCode::kUsage, [&] { (void)run_table(show); }),
                  "--out goes with --config");
  options.out_path = folder + "/no/such/beam.llt";
  (void)error_of(ExitCode::kOutput, [&] { (void)run_table(options); });
}
