// The table generator's numbers: sweeps of whole tables against independent double precision (libm, other
// quadratures), known answers, identical bytes.
#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <type_traits>
#include <utility>
#include <vector>

#include "host_tools/table/beam_profile.hpp"
#include "host_tools/table/first_return.hpp"
#include "host_tools/table/generator.hpp"
#include "host_tools/table/kernel_rows.hpp"
#include "tests/support/table_beams.hpp"
#include "tests/support/test.hpp"

namespace {

namespace model = leadline::model;

using leadline::host::AveragedFirstReturn;
using leadline::host::BeamDescription;
using leadline::host::BeamPattern;
using leadline::host::BeamProfile;
using leadline::host::generate_table;
using leadline::test::all_kinds;
using leadline::test::capped;
using leadline::test::cone;
using leadline::test::kPi;
using leadline::test::kRad;
using leadline::test::measured;
using leadline::test::piston;
using leadline::test::plain_two_way;
using leadline::test::Random;
using leadline::test::rectangle;
using leadline::test::table_of;
using model::LocalizationTable;

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

}  // namespace
