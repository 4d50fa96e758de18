// Beam patterns of the table generator and the functions under them, against libm, the textbook and plain sums.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "host_tools/exit_codes.hpp"
#include "host_tools/table/generator.hpp"
#include "host_tools/table/table_io.hpp"
#include "host_tools/table/table_math.hpp"
#include "tests/support/host_errors.hpp"
#include "tests/support/table_beams.hpp"
#include "tests/support/test.hpp"

namespace {

namespace exact = leadline::host::exact;
namespace model = leadline::model;

using leadline::host::BeamCut;
using leadline::host::BeamDescription;
using leadline::host::BeamPattern;
using leadline::host::ExitCode;
using leadline::host::generate_table;
using leadline::host::load_pattern;
using leadline::host::parse_pattern;
using leadline::host::PatternRow;
using leadline::test::all_kinds;
using leadline::test::assert_contains;
using leadline::test::capped;
using leadline::test::cone;
using leadline::test::error_of;
using leadline::test::kPi;
using leadline::test::kRad;
using leadline::test::measured;
using leadline::test::piston;
using leadline::test::plain_two_way;
using leadline::test::Random;
using leadline::test::rectangle;
using model::LocalizationTable;

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

void write_text(const std::string& path, const std::string& text) {
  std::ofstream(path, std::ios::binary) << text;
}

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

}  // namespace
