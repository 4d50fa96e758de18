// The short ways of a plain cone against the long ones of every cone, to the bit: cells of a column, evidence of a run.
#include <algorithm>
#include <cmath>

#include "model/plain_cone.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::model;  // NOLINT: a test of this namespace
using leadline::test::Random;

constexpr double kPi = 3.14159265358979323846;

/// Of one axis; the pattern falls from 1 to 0.
LocalizationTable& table_of_one_axis() {
  static LocalizationTable table{};
  for (std::uint32_t i = 0; i <= kBeamWeightSteps; ++i) {
    table.beam_weight_q15[0][i] = static_cast<std::uint16_t>(32767 - 500 * i);
  }
  return table;
}

struct Case {
  Scale scale;
  Frustum frustum;
  std::uint32_t end_q14;
  std::uint32_t growth_q24;
  std::uint64_t inverse_range_q36;
};

Case random_case(Random& random, int trial) {
  Case c{};
  const double tangent = std::exp(std::log(0.001) + std::log(6000.0) * random.uniform());
  double elevation = (random.uniform() - 0.1) * kPi;
  elevation = trial % 8 == 0 ? 0.002 * random.normal() : elevation;
  elevation = trial % 8 == 1 ? kPi / 2 + 0.02 * random.normal() : elevation;
  elevation = trial % 4 == 3 ? kPi / 2 + 0.5 * std::atan(tangent) * random.normal() : elevation;
  elevation = trial % 8 == 2 ? kPi / 2 - std::atan(tangent) + 0.02 * random.normal() : elevation;
  const double heading = 2.0 * kPi * random.uniform();
  const double range = 0.1 + 250.0 * random.uniform() * random.uniform();
  const auto range_q10 = static_cast<std::int32_t>(std::lround(range * 1024.0));
  c.scale.cone_tan_q20 = static_cast<std::int32_t>(std::lround(tangent * 0x1.0p20));
  const double longest_q10 = range_q10 * (1.0 + 3.0 * random.uniform());
  c.scale.confidence_scale_q22 = static_cast<std::uint32_t>(64.0 * 0x1.0p22 / longest_q10);
  BeamFrame frame{};
  frame.axis = {
      {static_cast<std::int32_t>(std::lround(std::cos(elevation) * std::cos(heading) * 0x1.0p30)),
       static_cast<std::int32_t>(std::lround(std::cos(elevation) * std::sin(heading) * 0x1.0p30)),
       static_cast<std::int32_t>(std::lround(std::sin(elevation) * 0x1.0p30))}};
  Sighting sighting{};
  sighting.origin_q16[2] =
      static_cast<std::int32_t>(std::lround((300.0 * random.uniform() - 150.0) * 65536.0));
  c.frustum = make_frustum(c.scale, table_of_one_axis(), frame, sighting, range_q10);
  c.end_q14 = static_cast<std::uint32_t>(random.between(0, 1 << 21));
  // None, little, all, and anything.
  const double growth = trial % 4 == 0 ? 0 : (trial % 4 == 1 ? 1.0 : random.uniform());
  c.growth_q24 = static_cast<std::uint32_t>(std::lround(growth * 0x1.0p24));
  c.inverse_range_q36 = (1ULL << 36U) / static_cast<std::uint32_t>(range_q10);
  return c;
}

/// Evidence of a run whose middle is z below the transducer, as the general cone of carve.cpp has it, in 64 bits.
std::uint32_t strength(const Case& c, std::int64_t x, std::int64_t y, std::int64_t z) {
  const Cone& cone = c.frustum.cone;
  const std::int64_t slant =
      std::max<std::int64_t>(0, (cone.horizontal_q30 * x + cone.down_q30 * z) >> 30);
  const std::int64_t off = (cone.down_q30 * x - cone.horizontal_q30 * z) >> 30;
  const std::int64_t half_width = kTouch_q10 + ((cone.growth_q20 * slant) >> 20);
  const std::int64_t entry = std::min<std::int64_t>(
      ((off * off + y * y) >> 4) / ((half_width * half_width) >> 10), kBeamWeightSteps);
  const std::uint32_t pattern_q15 = table_of_one_axis().beam_weight_q15[0][entry];
  const auto share_q16 = static_cast<std::uint32_t>(std::min<std::uint64_t>(
      (static_cast<std::uint64_t>(slant) * c.inverse_range_q36) >> 20U, 65536));
  const std::uint64_t gain_q8 = c.growth_q24 == 0 ? 256 : peak_gain_q8(c.growth_q24, share_q16);
  const auto strength_q7 = static_cast<std::uint32_t>(
      std::min<std::uint64_t>((c.end_q14 * gain_q8) >> 15U, kMaxWeight_q7 >> 1U));
  const std::uint32_t distance = range_entry(c.scale, static_cast<std::int32_t>(slant));
  return (((strength_q7 * pattern_q15) >> 15U) * kEmptyLogit_q15[distance]) >> 15U;
}

TEST(columns_and_runs_of_a_plain_cone_are_those_of_any) {
  Random random(41);
  int plain = 0;
  int forms[3] = {};
  int held = 0;
  for (int trial = 0; trial < 20'000; ++trial) {
    const Case c = random_case(random, trial);
    if (!is_plain(c.frustum, c.inverse_range_q36)) {
      continue;
    }
    ++plain;
    const PlainCone cone =
        make_plain_cone(c.frustum, c.scale, table_of_one_axis(), c.end_q14, c.growth_q24,
                        static_cast<std::uint32_t>(c.inverse_range_q36));
    ++forms[static_cast<int>(cone.form)];
    const std::int32_t radius = c.frustum.cone.radius_q10;
    for (int i = 0; i < 20; ++i) {
      const auto x = static_cast<std::int32_t>(random.between(-radius, c.frustum.reach_q10));
      const auto y = static_cast<std::int32_t>(random.between(-radius, radius));
      const auto deepest = static_cast<std::int32_t>(random.between(-1, kMaxDepthCells - 1));
      CellRange want = narrow_cells(c.frustum.cone, x, y, c.frustum.origin_q10[2], kMaxDepthCells);
      want.last = std::min(want.last, deepest);
      const CellRange got = cone.form == ConeForm::kUpright
                                ? plain_cells<ConeForm::kUpright>(cone, x, y, deepest)
                                : (cone.form == ConeForm::kSlanted
                                       ? plain_cells<ConeForm::kSlanted>(cone, x, y, deepest)
                                       : plain_cells<ConeForm::kAny>(cone, x, y, deepest));
      const bool none = want.last < want.first;
      if (none != (got.last < got.first) ||
          (!none && (got.first != want.first || got.last != want.last))) {
        fail_msg("trial %d, column (%d, %d): cells %d .. %d, not %d .. %d", trial, x, y, got.first,
                 got.last, want.first, want.last);
      }
      if (none) {
        continue;
      }
      ++held;
      const PlainColumn column = plain_column(cone, x, y);
      const std::int32_t count = std::min(24, want.last - want.first + 1);
      const std::int32_t z = want.first * 1024 + count * 512 - c.frustum.origin_q10[2];
      const std::uint32_t expected = strength(c, x, y, z);
      const std::uint32_t strength_q7 = plain_strength_q7(cone, column, z * 4);
      if (strength_q7 != expected) {
        fail_msg("trial %d, column (%d, %d), %d below: %u, not %u", trial, x, y, z, strength_q7,
                 expected);
      }
    }
  }
  print_message("plain cones: %d, upright %d, slanted %d, columns that hold cells: %d\n", plain,
                forms[1], forms[2], held);
  assert_true(plain > 15'000 && forms[1] > 4'000 && forms[2] > 4'000 && held > 80'000);
}

}  // namespace
