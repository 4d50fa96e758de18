// Geometry of one event against double precision: beam axes, kernel levels, the cone, the shell's plane.
#include <algorithm>
#include <array>
#include <cstring>

#include "model/base/fixed.hpp"
#include "model/capacity.hpp"
#include "model/cone_column.hpp"
#include "model/event.hpp"
#include "model/work_bound.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::model;  // NOLINT: a test of this namespace
using leadline::base::Attitude;
using leadline::base::Bam32;
using leadline::test::bam;
using leadline::test::plain_table;
using leadline::test::PlainBeam;
using leadline::test::Random;

constexpr double kPi = 3.14159265358979323846;
using Vector = std::array<double, 3>;

double radians(Bam32 angle) { return angle * (2.0 * kPi / 4294967296.0); }

/// Rz(heading) Ry(pitch) Rx(roll) v, written as three rotations.
Vector rotate(const Attitude& attitude, Vector v) {
  const double roll = radians(attitude.roll_bam32);
  const double pitch = radians(attitude.pitch_bam32);
  const double heading = radians(attitude.heading_bam32);
  v = {v[0], std::cos(roll) * v[1] - std::sin(roll) * v[2],
       std::sin(roll) * v[1] + std::cos(roll) * v[2]};
  v = {std::cos(pitch) * v[0] + std::sin(pitch) * v[2], v[1],
       -std::sin(pitch) * v[0] + std::cos(pitch) * v[2]};
  return {std::cos(heading) * v[0] - std::sin(heading) * v[1],
          std::sin(heading) * v[0] + std::cos(heading) * v[1], v[2]};
}

Vector to_double(const Direction& d) {
  return {d.q30[0] * 0x1.0p-30, d.q30[1] * 0x1.0p-30, d.q30[2] * 0x1.0p-30};
}

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

void assert_vector(const Direction& actual, const Vector& expected) {
  // Six sines and three products, each truncated: a few of the sine's own errors.
  constexpr double kTolerance = 6.0 * leadline::base::kSineError_q30 * 0x1.0p-30;
  const Vector value = to_double(actual);
  for (std::size_t i = 0; i < 3; ++i) {
    assert_near(value[i], expected[i], kTolerance);
  }
}

TEST(signs_of_heading_pitch_and_roll) {
  const Bam32 down = bam(90.0);
  // Level, heading north: a beam without elevation looks north; azimuth 90 looks to starboard, east.
  assert_vector(beam_frame({0, 0, 0}, 0, 0, 0).axis, {1, 0, 0});
  assert_vector(beam_frame({0, 0, 0}, bam(90), 0, 0).axis, {0, 1, 0});
  assert_vector(beam_frame({0, 0, 0}, 0, down, 0).axis, {0, 0, 1});
  // Heading east: forward is east, starboard is south.
  assert_vector(beam_frame({0, 0, bam(90)}, 0, 0, 0).axis, {0, 1, 0});
  assert_vector(beam_frame({0, 0, bam(90)}, bam(90), 0, 0).axis, {-1, 0, 0});
  // Nose up 30: forward rises (negative down), the downward beam swings forward.
  assert_vector(beam_frame({0, bam(30), 0}, 0, 0, 0).axis, {std::sqrt(0.75), 0, -0.5});
  assert_vector(beam_frame({0, bam(30), 0}, 0, down, 0).axis, {0.5, 0, std::sqrt(0.75)});
  // Starboard down 30: starboard sinks, the downward beam swings to port.
  assert_vector(beam_frame({bam(30), 0, 0}, bam(90), 0, 0).axis, {0, std::sqrt(0.75), 0.5});
  assert_vector(beam_frame({bam(30), 0, 0}, 0, down, 0).axis, {0, -0.5, std::sqrt(0.75)});
  // Angles wrap: a full turn more, or its negative complement, is the same bits.
  const BeamFrame a = beam_frame({bam(-30), bam(10), bam(-90)}, bam(-45), bam(20), 0);
  const BeamFrame b = beam_frame({bam(330), bam(370), bam(270)}, bam(315), bam(-340), 0);
  assert_memory_equal(&a, &b, sizeof(a));
}

TEST(footprint_axes_and_their_rotation) {
  // Looking down, unrotated: `along` is the derivative by elevation (backwards over the keel line),
  // `across` points to starboard.
  const BeamFrame plain = beam_frame({0, 0, 0}, 0, bam(90), 0);
  assert_vector(plain.along, {-1, 0, 0});
  assert_vector(plain.across, {0, 1, 0});
  const BeamFrame turned = beam_frame({0, 0, 0}, 0, bam(90), bam(90));
  assert_vector(turned.along, {0, 1, 0});
  assert_vector(turned.across, {1, 0, 0});
}

TEST(beam_frames_of_random_attitudes) {
  Random random(1);
  for (int trial = 0; trial < 20'000; ++trial) {
    const Attitude attitude{static_cast<Bam32>(random.next()), static_cast<Bam32>(random.next()),
                            static_cast<Bam32>(random.next())};
    const auto azimuth = static_cast<Bam32>(random.next());
    const auto elevation = static_cast<Bam32>(random.next());
    const auto rotation = static_cast<Bam32>(random.next());
    const BeamFrame frame = beam_frame(attitude, azimuth, elevation, rotation);
    const double az = radians(azimuth);
    const double el = radians(elevation);
    assert_vector(frame.axis, rotate(attitude, {std::cos(el) * std::cos(az),
                                                std::cos(el) * std::sin(az), std::sin(el)}));
    const Vector axis = to_double(frame.axis);
    const Vector along = to_double(frame.along);
    const Vector across = to_double(frame.across);
    constexpr double kSlack = 1e-5;
    assert_near(dot(axis, axis), 1.0, kSlack);
    assert_near(dot(along, along), 1.0, kSlack);
    assert_near(dot(across, across), 1.0, kSlack);
    assert_near(dot(axis, along), 0.0, kSlack);
    assert_near(dot(axis, across), 0.0, kSlack);
    assert_near(dot(along, across), 0.0, kSlack);
  }
}

TEST(kernel_levels_are_the_nearest_on_a_logarithmic_scale) {
  for (std::int64_t variance_q12 = 0; variance_q12 < (1 << 20); ++variance_q12) {
    const double variance = static_cast<double>(variance_q12) / 4096.0;
    const double exact = variance_q12 == 0 ? 0.0 : 4.0 * std::log2(variance / 0.25);
    const double level = std::clamp(exact, 0.0, kKernelLevels - 1.0);
    // Half a level, and what 16-bit thresholds leave.
    if (std::fabs(kernel_level(variance_q12) - level) > 0.5 + 1e-4) {
      fail_msg("variance %g: level %d, exact %g", variance, kernel_level(variance_q12), level);
    }
  }
  assert_int_equal(kernel_level(INT64_MAX), kKernelLevels - 1);
}

TEST(kernel_reach_is_the_tables_cut) {
  for (std::uint8_t level = 0; level < kKernelLevels; ++level) {
    const double sigma = std::sqrt(0.25 * std::pow(2.0, level / 4.0));
    const double reach = std::max(1.5, std::min(2.0 * sigma, 7.0));
    assert_near(kernel_reach_q16(level) / 65536.0, reach, 1e-4);
  }
}

Scale scale_of(double cone_tan) {
  Scale scale{};
  scale.cell_um = 1'000'000;
  scale.size[0] = scale.size[1] = scale.size[2] = 1000;
  scale.cone_tan_q20 = static_cast<std::int32_t>(std::lround(cone_tan * 0x1.0p20));
  scale.tan_along_q20 = scale.cone_tan_q20;
  scale.tan_across_q20 = scale.cone_tan_q20;
  return scale;
}

TEST(the_cone_holds_the_beam_and_the_tube_of_crossed_voxels) {
  for (const double tangent : {0.0005, 0.01, 0.1, 1.0, 5.6}) {
    for (const std::int32_t range_q10 : {1, 1024, 20 * 1024, 300 * 1024, 8000 * 1024}) {
      const auto tan_q20 = static_cast<std::int32_t>(std::lround(tangent * 0x1.0p20));
      const double growth = cone_growth_q20(tan_q20, range_q10) * 0x1.0p-20;
      const double range = range_q10 / 1024.0;
      const double end = kTouch_q10 / 1024.0 + growth * range;
      // At its end as wide as the beam, and nowhere thinner than half a voxel's diagonal.
      assert_true(growth > 0.0);
      assert_true(end >= std::max(tangent * range, std::sqrt(0.75)) - 2e-3 - range * 0x1.0p-19);
      assert_true(end <= std::max(tangent * range, 0.867) + 1e-3 + range / 1000.0);
    }
  }
  assert_true(kTouch_q10 / 1024.0 >= std::sqrt(0.75));
  assert_true(cone_growth_q20(1 << 20, 0) > 0);
}

TEST(cone_span_against_the_frustum_point_by_point) {
  // A point of a column is inside when the frustum's own definition says so in double precision. Points
  // within a margin of the surface may go either way: the margin is the Q10 grid's, grown by range.
  Random random(2);
  int inside_count = 0;
  int columns = 0;
  for (int trial = 0; trial < 4000; ++trial) {
    const double tangent = std::exp(std::log(0.001) + std::log(2000.0) * random.uniform());
    const Scale scale = scale_of(tangent);
    const double elevation =
        trial % 10 == 0 ? (trial % 20 == 0 ? kPi / 2 : 0.0) : (random.uniform() - 0.3) * kPi;
    const double azimuth = 2.0 * kPi * random.uniform();
    const Vector u = {std::cos(elevation) * std::cos(azimuth),
                      std::cos(elevation) * std::sin(azimuth), std::sin(elevation)};
    const Direction axis{{static_cast<std::int32_t>(std::lround(u[0] * 0x1.0p30)),
                          static_cast<std::int32_t>(std::lround(u[1] * 0x1.0p30)),
                          static_cast<std::int32_t>(std::lround(u[2] * 0x1.0p30))}};
    const double range = 2.0 + 60.0 * random.uniform();
    const Cone cone = make_cone(scale, axis, static_cast<std::int32_t>(range * 1024.0));
    const double growth = static_cast<double>(cone.growth_q20) * 0x1.0p-20;
    const double touch = kTouch_q10 / 1024.0;
    const double radius = touch + growth * range;
    for (int column = 0; column < 20; ++column) {
      const double along = range * random.uniform();
      const double dn = u[0] * along + (2.0 * random.uniform() - 1.0) * radius;
      const double de = u[1] * along + (2.0 * random.uniform() - 1.0) * radius;
      const double hn = static_cast<double>(cone.heading_north_q20) * 0x1.0p-20;
      const double he = static_cast<double>(cone.heading_east_q20) * 0x1.0p-20;
      const ColumnSpan span =
          cone_span(cone, static_cast<std::int32_t>(std::lround((hn * dn + he * de) * 1024.0)),
                    static_cast<std::int32_t>(std::lround((hn * de - he * dn) * 1024.0)));
      ++columns;
      const double margin = 0.02 + 0.002 * range;
      for (double z = -radius - range; z <= radius + range; z += 0.37) {
        const double slant = u[0] * dn + u[1] * de + u[2] * z;
        const double off = std::sqrt(std::max(0.0, dn * dn + de * de + z * z - slant * slant));
        const double allowed = touch + growth * slant;
        const bool in = slant >= 0.0 && slant <= range && off <= allowed;
        const bool near = std::fabs(slant) < margin || std::fabs(slant - range) < margin ||
                          std::fabs(off - allowed) < margin;
        const bool spanned = z * 1024.0 >= static_cast<double>(span.top_q10) &&
                             z * 1024.0 <= static_cast<double>(span.bottom_q10);
        inside_count += in ? 1 : 0;
        if (!near && in != spanned) {
          fail_msg(
              "trial %d: tan %g, elevation %g deg, range %g, column (%g, %g), z %g: slant %g, "
              "off %g of %g, span %g .. %g",
              trial, tangent, elevation * 180.0 / kPi, range, dn, de, z, slant, off, allowed,
              static_cast<double>(span.top_q10) / 1024.0,
              static_cast<double>(span.bottom_q10) / 1024.0);
        }
      }
    }
  }
  print_message("cone: %d columns, %d points inside\n", columns, inside_count);
  assert_true(inside_count > 100'000);
}

TEST(cells_of_a_narrow_cone_are_those_of_its_span) {
  // The integrator's short ways against the long one, cell by cell and to the bit: few divisions, 32 bits.
  Random random(5);
  constexpr std::int32_t kCells = 64;
  int narrow = 0;
  int held = 0;
  for (int trial = 0; trial < 20'000; ++trial) {
    const double tangent = std::exp(std::log(0.001) + std::log(2000.0) * random.uniform());
    const double elevation =
        trial % 8 == 0 ? (trial % 16 == 0 ? kPi / 2 : 0.0) : (random.uniform() - 0.3) * kPi;
    const double azimuth = 2.0 * kPi * random.uniform();
    const Direction axis{
        {static_cast<std::int32_t>(std::lround(std::cos(elevation) * std::cos(azimuth) * 0x1.0p30)),
         static_cast<std::int32_t>(std::lround(std::cos(elevation) * std::sin(azimuth) * 0x1.0p30)),
         static_cast<std::int32_t>(std::lround(std::sin(elevation) * 0x1.0p30))}};
    const double range = 0.5 + 60.0 * random.uniform();
    const Cone cone = make_cone(scale_of(tangent), axis, static_cast<std::int32_t>(range * 1024.0));
    if (!cone.narrow) {
      continue;
    }
    ++narrow;
    const double radius = cone.radius_q10;
    const auto origin_q10 =
        static_cast<std::int32_t>(1024.0 * (kCells * random.uniform() * 1.5 - 16.0));
    for (int column = 0; column < 30; ++column) {
      const auto x_q10 = static_cast<std::int32_t>(
          std::lround(range * 1024.0 * random.uniform() + (2.0 * random.uniform() - 1.0) * radius));
      const auto y_q10 =
          static_cast<std::int32_t>(std::lround((2.0 * random.uniform() - 1.0) * radius));
      const ColumnSpan span = cone_span(cone, x_q10, y_q10);
      const CellRange want =
          cells_between(span.top_q10 + origin_q10, span.bottom_q10 + origin_q10, kCells);
      const CellRange got = narrow_cells(cone, x_q10, y_q10, origin_q10, kCells);
      const bool none = want.last < want.first;
      held += none ? 0 : 1;
      if (none != (got.last < got.first) ||
          (!none && (got.first != want.first || got.last != want.last))) {
        fail_msg("trial %d, column (%d, %d): cells %d .. %d, not %d .. %d", trial, x_q10, y_q10,
                 got.first, got.last, want.first, want.last);
      }
      // And those of the form for cones of every size.
      const ColumnSpan wide = wide_cone_span(cone, x_q10, y_q10);
      const CellRange other =
          cells_between(wide.top_q10 + origin_q10, wide.bottom_q10 + origin_q10, kCells);
      assert_true(none ? other.last < other.first
                       : other.first == want.first && other.last == want.last);
    }
  }
  print_message("narrow cones: %d, columns that hold cells: %d\n", narrow, held);
  assert_true(narrow > 15'000 && held > 100'000);
}

TEST(cone_volume_is_the_integral) {
  for (const double tangent : {0.001, 0.05, 0.5}) {
    const Scale scale = scale_of(tangent);
    for (const double range : {1.0, 20.0, 150.0}) {
      const auto range_q10 = static_cast<std::int32_t>(range * 1024.0);
      const double growth = cone_growth_q20(scale.cone_tan_q20, range_q10) * 0x1.0p-20;
      double volume = 0.0;
      constexpr int kSteps = 10'000;
      for (int i = 0; i < kSteps; ++i) {
        const double radius = kTouch_q10 / 1024.0 + growth * range * (i + 0.5) / kSteps;
        volume += kPi * radius * radius * range / kSteps;
      }
      assert_near(cone_volume(scale, range_q10, INT64_MAX), volume, 1.0 + 0.005 * volume);
    }
  }
  assert_int_equal(cone_volume(scale_of(0.1), 0, INT64_MAX), 0);
  assert_int_equal(cone_volume(scale_of(0.1), -5, INT64_MAX), 0);
}

Sighting sighting_at(double north, double east, double down, double range) {
  Sighting sighting{};
  const double position[3] = {north, east, down};
  for (int axis = 0; axis < 3; ++axis) {
    sighting.origin_q16[axis] = static_cast<std::int32_t>(std::lround(position[axis] * 65536.0));
  }
  sighting.range_q16 = static_cast<std::int32_t>(std::lround(range * 65536.0));
  return sighting;
}

Scale shell_scale() {
  Scale scale = scale_of(std::tan(0.05));
  scale.sigma_range_q12 = 2048;
  scale.min_variance_q12 = 1024 + 82;
  scale.footprint_cells = kMaxFootprintCells;
  scale.max_range_q16 = 500 << 16;
  scale.confidence_scale_q22 = (64U << 22U) / (500U << 10U);
  return scale;
}

TEST(the_shells_plane_on_slopes_is_at_the_range) {
  // Plain table: the plane is at perpendicular distance range * cos(incidence), so the axis meets it at
  // the range, whatever the slope.
  const LocalizationTable table = plain_table(PlainBeam{});
  const Scale scale = shell_scale();
  Random random(3);
  double worst = 0.0;
  for (int trial = 0; trial < 20'000; ++trial) {
    const double slope_n = 1.4 * (2.0 * random.uniform() - 1.0);
    const double slope_e = 1.4 * (2.0 * random.uniform() - 1.0);
    const Attitude attitude{bam(20.0 * random.normal()), bam(20.0 * random.normal()),
                            static_cast<Bam32>(random.next())};
    const BeamFrame frame = beam_frame(attitude, 0, bam(90), 0);
    const Vector u = to_double(frame.axis);
    const double range = 5.0 + 100.0 * random.uniform();
    const Sighting sighting = sighting_at(400.0, 450.0, 30.0, range);
    const Slope slope{static_cast<std::int32_t>(std::lround(slope_n * 4096.0)),
                      static_cast<std::int32_t>(std::lround(slope_e * 4096.0))};
    const double secant = std::sqrt(1.0 + slope_n * slope_n + slope_e * slope_e);
    const double cosine = (u[2] - slope_n * u[0] - slope_e * u[1]) / secant;
    if (cosine < 0.25) {
      continue;  // wall mode begins at 0.2
    }
    const ShellEvent event = make_shell(scale, table, frame, sighting, slope);
    assert_true(!event.wall);
    assert_true(event.north0 <= event.north1 && event.east0 <= event.east1);
    // Depth of the plane at the axis' end, from the event's own form.
    const double north = 400.0 + range * u[0];
    const double east = 450.0 + range * u[1];
    const double depth = (event.depth0_q16 + (north - event.north0 - 0.5) * event.depth_dn_q16 +
                          (east - event.east0 - 0.5) * event.depth_de_q16) /
                         65536.0;
    const double error = depth - (30.0 + range * u[2]);
    worst = std::max(worst, std::fabs(error) / range);
    // plane0 is the same plane for the cone.
    const double again = (static_cast<double>(event.plane0_q16) +
                          (north - 0.5) * event.depth_dn_q16 + (east - 0.5) * event.depth_de_q16) /
                         65536.0;
    assert_near(again, depth, 0.01);
  }
  print_message("plane at the axis' end: worst error %.2e of the range\n", worst);
  // An eighth of a kernel phase at 100 cells.
  assert_true(worst < 1e-4);
}

TEST(walls_and_grazing_beams) {
  const LocalizationTable table = plain_table(PlainBeam{});
  const Scale scale = shell_scale();
  const Sighting sighting = sighting_at(400.0, 450.0, 300.0, 60.0);
  // Horizontal, upwards and straight up: no bottom can explain the echo.
  for (const double elevation : {0.0, -30.0, -90.0, 10.0}) {
    const ShellEvent event = make_shell(
        scale, table, beam_frame({0, 0, 0}, bam(30), bam(elevation), 0), sighting, Slope{0, 0});
    assert_true(event.wall);
    assert_true(event.north0 <= event.north1 && event.east0 <= event.east1);
    // The box surrounds the end of the axis.
    const double c = std::cos(elevation * kPi / 180.0);
    const double north = 400.0 + 60.0 * c * std::cos(kPi / 6);
    const double east = 450.0 + 60.0 * c * std::sin(kPi / 6);
    assert_true(event.north0 <= north && north <= event.north1 + 1);
    assert_true(event.east0 <= east && east <= event.east1 + 1);
    // Surely empty up to some radial deviations before the shell, never beyond it.
    assert_true(event.empty_range_q10 < 60 * 1024);
    assert_true(event.empty_range_q10 > 57 * 1024);
  }
  // A slope that faces the beam explains it again.
  const ShellEvent slope =
      make_shell(scale, table, beam_frame({0, 0, 0}, 0, bam(10), 0), sighting, Slope{-2 * 4096, 0});
  assert_true(!slope.wall);
}

TEST(steep_slopes_are_limited) {
  const LocalizationTable table = plain_table(PlainBeam{});
  const Scale scale = shell_scale();
  const Sighting sighting = sighting_at(400.0, 450.0, 300.0, 60.0);
  const BeamFrame frame = beam_frame({0, 0, 0}, 0, bam(90), 0);
  const ShellEvent event = make_shell(scale, table, frame, sighting, Slope{30 * 4096, 40 * 4096});
  const double slope = std::hypot(event.depth_dn_q16, event.depth_de_q16) / 65536.0;
  assert_near(slope, 2.5, 0.01);
  assert_near(static_cast<double>(event.depth_de_q16) / event.depth_dn_q16, 4.0 / 3.0, 0.01);
}

TEST(boxes_never_leave_the_grid_nor_grow_beyond_the_footprint) {
  const LocalizationTable table = plain_table(PlainBeam{});
  Scale scale = shell_scale();
  scale.size[0] = 40;
  scale.size[1] = 30;
  scale.footprint_cells = 9;
  Random random(4);
  int empty = 0;
  for (int trial = 0; trial < 50'000; ++trial) {
    const Attitude attitude{static_cast<Bam32>(random.next()), static_cast<Bam32>(random.next()),
                            static_cast<Bam32>(random.next())};
    const BeamFrame frame = beam_frame(attitude, static_cast<Bam32>(random.next()),
                                       static_cast<Bam32>(random.next()), 0);
    Sighting sighting = sighting_at(60.0 * random.uniform() - 10.0, 60.0 * random.uniform() - 10.0,
                                    20.0 * random.uniform(), 60.0 * random.uniform() + 0.1);
    for (std::int64_t& variance_q12 : sighting.position_variance_q12) {
      variance_q12 = random.between(0, 100 * 4096);
    }
    const Slope slope{static_cast<std::int32_t>(random.between(-20000, 20000)),
                      static_cast<std::int32_t>(random.between(-20000, 20000))};
    const ShellEvent event = make_shell(scale, table, frame, sighting, slope);
    assert_true(event.level < kKernelLevels);
    assert_true(event.profile_class < kProfileClasses);
    assert_true(event.weight_q7 <= 32767);
    if (event.north0 > event.north1 || event.east0 > event.east1) {
      ++empty;
      continue;
    }
    assert_true(event.north0 >= 0 && event.north1 < 40 && event.east0 >= 0 && event.east1 < 30);
    assert_true(event.north1 - event.north0 + 1 <= 18);
    assert_true(event.east1 - event.east0 + 1 <= 18);
  }
  print_message("of 50000 random shells %d missed the grid\n", empty);
  assert_true(empty > 0 && empty < 45'000);
}

TEST(position_error_widens_the_event_and_weakens_it) {
  const LocalizationTable table = plain_table(PlainBeam{});
  const Scale scale = shell_scale();
  const BeamFrame frame = beam_frame({0, 0, 0}, 0, bam(90), 0);
  Sighting sighting = sighting_at(400.0, 450.0, 300.0, 40.0);
  const ShellEvent sharp = make_shell(scale, table, frame, sighting, Slope{0, 0});
  sighting.position_variance_q12[0] = 9 * 4096;
  const ShellEvent north = make_shell(scale, table, frame, sighting, Slope{0, 0});
  // 3 cells of error in north only: wider there, and only there.
  assert_true(north.north1 - north.north0 > sharp.north1 - sharp.north0 + 3);
  assert_int_equal(north.east1 - north.east0, sharp.east1 - sharp.east0);
  assert_true(north.blur_q8 > sharp.blur_q8);
  // On a flat bottom a horizontal error says nothing about the depth.
  assert_int_equal(north.level, sharp.level);
  assert_int_equal(north.weight_q7, sharp.weight_q7);
  // On a slope, and from a vertical error, it does.
  const ShellEvent sloped = make_shell(scale, table, frame, sighting, Slope{4096, 0});
  assert_true(sloped.level > sharp.level);
  assert_true(sloped.weight_q7 < sharp.weight_q7);
  sighting.position_variance_q12[0] = 0;
  sighting.position_variance_q12[2] = 4 * 4096;
  const ShellEvent vertical = make_shell(scale, table, frame, sighting, Slope{0, 0});
  assert_true(vertical.level > sharp.level);
  assert_true(vertical.weight_q7 < sharp.weight_q7);
}

TEST(wide_events_follow_the_longer_axis_of_a_two_axis_beam) {
  PlainBeam beam;
  beam.two_axis = true;
  beam.half_angle_along_rad = 0.02;
  beam.half_angle_across_rad = 0.3;
  beam.sigma_pointing_rad = 0.0;
  const LocalizationTable table = plain_table(beam);
  const Scale scale = shell_scale();
  const Sighting sighting = sighting_at(400.0, 450.0, 300.0, 60.0);
  const ShellEvent plain =
      make_shell(scale, table, beam_frame({0, 0, 0}, 0, bam(90), 0), sighting, Slope{0, 0});
  assert_true(plain.east1 - plain.east0 > 3 * (plain.north1 - plain.north0));
  const ShellEvent turned =
      make_shell(scale, table, beam_frame({0, 0, 0}, 0, bam(90), bam(90)), sighting, Slope{0, 0});
  assert_true(turned.north1 - turned.north0 > 3 * (turned.east1 - turned.east0));
  // Heading does to the ship what rotation does to the beam.
  const ShellEvent headed =
      make_shell(scale, table, beam_frame({0, 0, bam(90)}, 0, bam(90), 0), sighting, Slope{0, 0});
  assert_true(headed.north1 - headed.north0 > 3 * (headed.east1 - headed.east0));
}

TEST(nearer_shells_weigh_more_by_the_power_of_their_variance) {
  // v^-1.5, v = 1 - growth (1 - share^2), over the domain; 4096 at most.
  double worst = 0.0;
  for (std::uint32_t growth_q24 = 0; growth_q24 <= 1U << 24U; growth_q24 += 1U << 16U) {
    std::uint32_t before = UINT32_MAX;
    for (std::uint32_t share_q16 = 0; share_q16 <= 65536; share_q16 += 256) {
      const std::uint32_t gain_q8 = peak_gain_q8(growth_q24, share_q16);
      assert_true(gain_q8 <= before);
      before = gain_q8;
      const double growth = growth_q24 * 0x1.0p-24;
      const double share = share_q16 * 0x1.0p-16;
      const double v = 1.0 - growth * (1.0 - share * share);
      const double expected = std::min(4096.0, v <= 0.0 ? 4096.0 : std::pow(v, -1.5));
      // One unit of the result, and what the interpolation leaves.
      worst = std::max(worst, (std::fabs(gain_q8 / 256.0 - expected) - 1.0 / 256.0) / expected);
    }
  }
  print_message("peak_gain: worst relative error beyond a unit %.5f\n", worst);
  assert_true(worst < 0.001);
  assert_int_equal(peak_gain_q8(0, 0), 256);
  assert_int_equal(peak_gain_q8(1U << 24U, 65536), 256);
  assert_int_equal(peak_gain_q8(1U << 24U, 70000), 256);
}

}  // namespace
