// The inner loops: vector form against scalar form, both against wide arithmetic, exhaustively.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "model/base/fixed.hpp"
#include "model/column_depth.hpp"
#include "model/column_kernels.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::model;  // NOLINT: a test of this namespace
using leadline::test::Random;

constexpr std::uint32_t kFull = 65535;
constexpr std::size_t kSlack = 16;  // what a vector form may read and rewrite unchanged

/// One half of a voxel by the header's text, in arithmetic that cannot overflow.
std::uint16_t wide_sum(std::uint32_t value, std::uint64_t weight_q7, std::uint64_t tap_q15,
                       std::uint64_t dither) {
  const std::uint64_t sum = value + ((weight_q7 * tap_q15 + dither) >> 22U);
  return static_cast<std::uint16_t>(sum > kFull ? kFull : sum);
}

/// Values that matter more than others: ends, and what surrounds saturation.
std::uint16_t random_half(Random& random) {
  switch (random.between(0, 5)) {
    case 0:
      return 0;
    case 1:
      return kFull;
    case 2:
      return static_cast<std::uint16_t>(kFull - static_cast<std::uint32_t>(random.between(0, 300)));
    default:
      return static_cast<std::uint16_t>(random.next());
  }
}

Evidence random_evidence(Random& random) {
  const auto half = [&random]() -> std::uint32_t {
    switch (random.between(0, 4)) {
      case 0:
        return 0;
      case 1:
        return static_cast<std::uint32_t>(random.between(1, 128));
      case 2:
        return kMaxWeight_q7;
      default:
        return static_cast<std::uint32_t>(random.between(0, kMaxWeight_q7));
    }
  };
  return Evidence{half(), half()};
}

bool same(const std::vector<Voxel>& a, const std::vector<Voxel>& b) {
  return std::memcmp(a.data(), b.data(), a.size() * sizeof(Voxel)) == 0;
}

TEST(vector_form_equals_scalar_form_and_touches_nothing_else) {
  Random random(1);
  constexpr std::size_t kColumn = 64;
  std::vector<std::int16_t> taps(64 + kSlack);
  for (std::int32_t count = 0; count <= 40; ++count) {
    for (std::size_t offset = 0; offset < 24; ++offset) {
      for (int repeat = 0; repeat < 6; ++repeat) {
        std::vector<Voxel> before(kColumn + kSlack);
        for (Voxel& voxel : before) {
          voxel = Voxel{random_half(random), random_half(random)};
        }
        for (std::int16_t& tap : taps) {
          tap = static_cast<std::int16_t>(random.between(0, 32767));
        }
        const Evidence evidence = random_evidence(random);
        const auto first = static_cast<std::uint32_t>(random.between(0, 1023));
        const auto dither = static_cast<std::uint32_t>(random.next());

        std::vector<Voxel> vector = before;
        std::vector<Voxel> scalar = before;
        add_shell(vector.data() + offset, taps.data(), count, first, evidence, dither);
        add_shell_scalar(scalar.data() + offset, taps.data(), count, first, evidence, dither);
        assert_true(same(vector, scalar));
        for (std::size_t i = 0; i < before.size(); ++i) {
          if (i < offset || i >= offset + static_cast<std::size_t>(count)) {
            assert_int_equal(scalar[i].hit, before[i].hit);
            assert_int_equal(scalar[i].miss, before[i].miss);
          }
        }

        vector = before;
        scalar = before;
        add_uniform(vector.data() + offset, count, first, evidence, dither);
        add_uniform_scalar(scalar.data() + offset, count, first, evidence, dither);
        assert_true(same(vector, scalar));
        for (std::size_t i = 0; i < before.size(); ++i) {
          if (i < offset || i >= offset + static_cast<std::size_t>(count)) {
            assert_int_equal(scalar[i].hit, before[i].hit);
            assert_int_equal(scalar[i].miss, before[i].miss);
          }
        }
      }
    }
  }
}

TEST(whole_kernel_rows_are_added_as_their_taps_are) {
  Random random(11);
  constexpr std::size_t kColumn = 64;
  for (std::int32_t first = 0; first < leadline::model::kKernelTaps; ++first) {
    for (std::int32_t count = 1; first + count <= leadline::model::kKernelTaps; ++count) {
      for (int repeat = 0; repeat < 20; ++repeat) {
        // What follows the row in a table is another row: it must not leak in.
        std::int16_t rows[2][leadline::model::kKernelTaps] = {};
        for (std::int32_t i = 0; i < count; ++i) {
          rows[0][first + i] = static_cast<std::int16_t>(random.between(0, 32767));
        }
        for (std::int16_t& tap : rows[1]) {
          tap = 32767;
        }
        std::vector<Voxel> vector(kColumn + kSlack);
        for (Voxel& voxel : vector) {
          voxel = Voxel{random_half(random), random_half(random)};
        }
        std::vector<Voxel> scalar = vector;
        const Evidence evidence = random_evidence(random);
        const auto dither = static_cast<std::uint32_t>(random.next());
        add_shell_taps(vector.data() + 5, rows[0], first, count, dither, evidence);
        add_shell_scalar(scalar.data() + 5, rows[0] + first, count, 0, evidence, dither);
        assert_true(same(vector, scalar));
      }
    }
  }
}

/// The two pulling rules as the source writes them, in double.
double certainty_reference(double x, double y) {
  const bool same_sign = x * y > 0.0;
  return same_sign ? x + y - std::fabs(x) * y : x + y;
}

TEST(pulled_voxels_follow_the_source_within_one_unit) {
  Random random(12);
  double worst_recursive = 0.0;
  double worst_certainty = 0.0;
  for (int trial = 0; trial < 200'000; ++trial) {
    const auto dither = static_cast<std::uint32_t>(random.next());
    // Past one: limited to the whole voxel.
    const Pull pull{static_cast<std::uint32_t>(random.between(0, 90'000)),
                    static_cast<std::uint32_t>(random.between(0, 65535))};
    const std::int16_t tap = static_cast<std::int16_t>(random.between(0, 32767));
    const double share =
        std::min(1.0, static_cast<double>(pull.gain_q15) / 32768.0 * tap / 32768.0);
    const double rho = pull.signal_q16 / 65535.0;

    const std::uint16_t hit = random_half(random);
    const auto miss = static_cast<std::uint16_t>(random.between(0, kFull - hit));
    Voxel voxel{hit, miss};
    pull_shell(Rule::kRecursive, &voxel, &tap, 1, 3, pull, dither);
    const double hit_expected = hit + (65535.0 * rho - hit) * share;
    const double miss_expected = miss + (65535.0 * (1.0 - rho) - miss) * share;
    worst_recursive = std::max({worst_recursive, std::fabs(voxel.hit - hit_expected),
                                std::fabs(voxel.miss - miss_expected)});

    const bool against = random.between(0, 1) == 1;
    voxel = against ? Voxel{0, hit} : Voxel{hit, 0};
    const double x = (against ? -1.0 : 1.0) * hit / 65535.0;
    pull_shell(Rule::kCertaintyFactor, &voxel, &tap, 1, 3, pull, dither);
    const double expected =
        std::clamp(certainty_reference(x, share * (2.0 * rho - 1.0)), -1.0, 1.0);
    worst_certainty =
        std::max(worst_certainty, std::fabs((voxel.hit - voxel.miss) - 65535.0 * expected));
    assert_true(voxel.hit == 0 || voxel.miss == 0);
  }
  print_message("worst difference, voxel units: recursive %.3f, certainty factor %.3f\n",
                worst_recursive, worst_certainty);
  // Rounding: one unit; the share's own rounding to 2^-15: up to four (65535 * 2 / 32768).
  assert_true(worst_recursive < 1.0 + 2.0 + 0.01);
  assert_true(worst_certainty < 1.0 + 2.0 + 0.01);
}

TEST(small_pulls_neither_vanish_nor_drift) {
  // A share far below one unit, many times: the mean follows the exact filter.
  for (const Rule rule : {Rule::kRecursive, Rule::kCertaintyFactor}) {
    constexpr int kVoxels = 512;
    constexpr int kPings = 4000;
    std::vector<Voxel> voxels(kVoxels);
    double exact = 0.0;
    const Pull pull{1, 65535};  // 2^-15 of a voxel
    for (std::uint32_t ping = 0; ping < kPings; ++ping) {
      pull_uniform(rule, voxels.data(), kVoxels, 0, pull, leadline::base::mix_u32(ping));
      exact += (1.0 - exact) / 32768.0;
    }
    double mean = 0.0;
    for (const Voxel& voxel : voxels) {
      mean += voxel.hit / 65535.0 / kVoxels;
      assert_int_equal(voxel.miss, 0);
    }
    assert_near(mean, exact, 0.001 * exact);
  }
}

TEST(pulled_halves_stay_within_the_whole) {
  // hit + miss never exceeds one voxel by more than the rounding of both, whatever the sequence.
  Random random(13);
  Voxel voxel{};
  for (int ping = 0; ping < 100'000; ++ping) {
    const Pull pull{static_cast<std::uint32_t>(random.between(0, 40'000)),
                    static_cast<std::uint32_t>(random.between(0, 65535))};
    pull_uniform(Rule::kRecursive, &voxel, 1, 0, pull, static_cast<std::uint32_t>(random.next()));
    assert_true(voxel.hit + voxel.miss <= kFull + 2);
  }
  assert_true(voxel.hit + voxel.miss >= kFull - 2);
}

TEST(column_profiles_in_vector_and_scalar_form_are_the_same) {
  Random random(8);
  constexpr std::size_t kMost = 1024;
  for (int trial = 0; trial < 4000; ++trial) {
    const auto depth_cells =
        trial < 200 ? trial % 100 + 1 : static_cast<std::int32_t>(random.between(1, kMost));
    const auto depth = static_cast<std::size_t>(depth_cells);
    // The next column follows at once: its voxels must not leak in.
    std::vector<Voxel> voxels(depth + kSlack);
    const auto quiet = static_cast<unsigned>(random.between(0, 15));
    for (Voxel& voxel : voxels) {
      voxel = Voxel{static_cast<std::uint16_t>(random_half(random) >> quiet),
                    static_cast<std::uint16_t>(random_half(random) >> quiet)};
    }
    struct Profile {
      std::vector<std::uint16_t> evidence, smoothed;
      ProfileSummary summary{};
    };
    const auto room = depth + 2 * kProfileGuard + 8;
    Profile vector{std::vector<std::uint16_t>(room, 9999),
                   std::vector<std::uint16_t>(depth + 8, 9999)};
    Profile scalar = vector;
    const Rule rule = trial % 2 == 0 ? Rule::kLogOdds : Rule::kWeightedMean;
    vector.summary = gather_profile(voxels.data(), depth_cells, rule,
                                    vector.evidence.data() + kProfileGuard, vector.smoothed.data());
    scalar.summary =
        gather_profile_scalar(voxels.data(), depth_cells, rule,
                              scalar.evidence.data() + kProfileGuard, scalar.smoothed.data());
    assert_int_equal(vector.summary.mass, scalar.summary.mass);
    assert_int_equal(vector.summary.peak, scalar.summary.peak);
    assert_int_equal(vector.summary.shift, scalar.summary.shift);
    std::uint64_t mass = 0;
    std::uint32_t peak = 0;
    for (std::size_t k = 0; k < depth; ++k) {
      const std::uint32_t hit = voxels[k].hit;
      const std::uint32_t miss = voxels[k].miss;
      const std::uint32_t value = miss > hit ? 0 : (rule == Rule::kLogOdds ? hit : hit - miss);
      const std::size_t at = k + kProfileGuard;
      assert_int_equal(vector.evidence[at], value);
      assert_int_equal(scalar.evidence[at], value);
      assert_int_equal(vector.smoothed[k], scalar.smoothed[k]);
      const auto near = [&](std::size_t offset) {
        return static_cast<std::uint32_t>(scalar.evidence[at + offset - 2]) >> scalar.summary.shift;
      };
      const std::uint32_t smooth = near(0) + 2 * near(1) + 3 * near(2) + 2 * near(3) + near(4);
      assert_int_equal(scalar.smoothed[k], smooth);
      // 15 bits: the vector form compares lanes as signed.
      assert_true(smooth < 32768);
      mass += value;
      peak = smooth > peak ? smooth : peak;
    }
    assert_int_equal(scalar.summary.mass, mass);
    assert_int_equal(scalar.summary.peak, peak);
  }
}

TEST(a_hit_span_is_from_the_first_hit_to_the_last) {
  Random random(14);
  for (int trial = 0; trial < 4000; ++trial) {
    const auto depth = static_cast<std::size_t>(random.between(1, 100));
    // All misses, and hits in the next column.
    std::vector<Voxel> voxels(depth + kSlack, Voxel{0, 0xFFFF});
    for (std::size_t i = depth; i < voxels.size(); ++i) {
      voxels[i].hit = static_cast<std::uint16_t>(random_half(random) | 1U);
    }
    std::size_t first = depth;
    std::size_t end = 0;
    for (std::int64_t hits = random.between(0, 3); hits > 0; --hits) {
      const auto at =
          static_cast<std::size_t>(random.between(0, static_cast<std::int64_t>(depth) - 1));
      voxels[at].hit = static_cast<std::uint16_t>(random_half(random) | 1U);
      first = std::min(first, at);
      end = std::max(end, at + 1);
    }
    const HitSpan span = hit_span(voxels.data(), static_cast<std::int32_t>(depth));
    if (first >= end) {
      assert_true(span.first >= span.end);
    } else {
      assert_int_equal(span.first, first);
      assert_int_equal(span.end, end);
    }
  }
}

TEST(every_voxel_value_saturates_as_wide_arithmetic_does) {
  constexpr std::uint32_t kWeights[] = {0,    1,     2,     3,     63,    64,   127,
                                        128,  129,   255,   256,   1000,  4095, 4096,
                                        8191, 16383, 16384, 32638, 32639, 32640};
  constexpr std::size_t kValues = 65536;
  std::vector<Voxel> before(kValues + kSlack);
  for (std::size_t i = 0; i < kValues; ++i) {
    before[i] = Voxel{static_cast<std::uint16_t>(i), static_cast<std::uint16_t>(kFull - i)};
  }
  std::vector<std::int16_t> taps(kValues + kSlack);
  Random random(2);
  for (const std::uint32_t weight : kWeights) {
    const Evidence evidence{weight, kMaxWeight_q7 - weight};
    const auto dither_base = static_cast<std::uint32_t>(random.next());
    for (const int tap : {0, 1, 2, 255, 8192, 16384, 32766, 32767, -1}) {
      // -1: a different tap for every voxel.
      for (std::size_t i = 0; i < kValues; ++i) {
        taps[i] = static_cast<std::int16_t>(tap >= 0 ? tap : random.between(0, 32767));
      }
      std::vector<Voxel> after = before;
      add_shell(after.data(), taps.data(), kValues, 0, evidence, dither_base);
      for (std::size_t i = 0; i < kValues; ++i) {
        const std::uint32_t dither = dither_q22(dither_base, static_cast<std::uint32_t>(i));
        const auto tap_q15 = static_cast<std::uint64_t>(taps[i]);
        if (after[i].hit != wide_sum(before[i].hit, evidence.hit_q7, tap_q15, dither) ||
            after[i].miss != wide_sum(before[i].miss, evidence.miss_q7, tap_q15, dither)) {
          fail_msg("value %zu, weight %u, tap %d", i, weight, taps[i]);
        }
      }
    }
    std::vector<Voxel> after = before;
    add_uniform(after.data(), kValues, 7, evidence, dither_base);
    for (std::size_t i = 0; i < kValues; ++i) {
      const std::uint32_t dither = dither_q22(dither_base, static_cast<std::uint32_t>(i + 7));
      if (after[i].hit != wide_sum(before[i].hit, evidence.hit_q7, 32768, dither) ||
          after[i].miss != wide_sum(before[i].miss, evidence.miss_q7, 32768, dither)) {
        fail_msg("value %zu, weight %u, uniform", i, weight);
      }
    }
  }
}

TEST(the_sum_of_every_value_and_increment_saturates) {
  // saturated_sum over the whole square of voxel values and increments that can occur (0..256).
  for (std::uint32_t value = 0; value <= kFull; ++value) {
    for (std::uint32_t increment = 0; increment <= 256; ++increment) {
      const std::uint32_t sum = value + increment;
      if (leadline::base::saturated_sum(value, increment) != (sum > kFull ? kFull : sum)) {
        fail_msg("%u + %u", value, increment);
      }
    }
  }
}

/// Sum of one voxel's increments over all 2^16 dithers, each once.
std::uint64_t sum_over_dither(std::uint32_t weight_q7, std::int16_t tap_q15) {
  std::vector<std::int16_t> taps(1 + kSlack, tap_q15);
  std::vector<Voxel> voxels(1 + kSlack);
  std::uint64_t total = 0;
  for (std::uint32_t dither = 0; dither < 65536; ++dither) {
    voxels[0] = Voxel{};
    add_shell(voxels.data(), taps.data(), 1, 0, Evidence{weight_q7, 0}, dither);
    total += voxels[0].hit;
  }
  return total;
}

TEST(rounding_is_exactly_unbiased_over_the_dither_period) {
  // Over all dithers the increments add up to the product, to the dither's own step: no weight is
  // favoured, and one of 2^-16 of a unit is still counted once.
  struct Pair {
    std::uint32_t weight_q7;
    std::int16_t tap_q15;
  };
  for (const Pair pair : {Pair{1, 1}, Pair{1, 32767}, Pair{3, 5}, Pair{127, 1}, Pair{128, 16384},
                          Pair{8, 8}, Pair{12345, 321}, Pair{kMaxWeight_q7, 32767}}) {
    const auto product =
        static_cast<std::uint64_t>(pair.weight_q7) * static_cast<std::uint64_t>(pair.tap_q15);
    assert_int_equal(sum_over_dither(pair.weight_q7, pair.tap_q15), product >> 6U);
  }
}

TEST(rounding_is_unbiased_over_the_columns_and_pings_that_occur) {
  // The dithers of a real sequence: mix(ping) + column * constant, voxels in a column by golden ratio.
  constexpr std::int32_t kCount = 32;
  constexpr int kPings = 200'000;
  for (const std::uint32_t weight : {1U, 5U, 40U}) {
    std::vector<std::int16_t> taps(kCount + kSlack, 4096);  // an eighth
    double total = 0.0;
    for (int ping = 0; ping < kPings; ++ping) {
      std::vector<Voxel>::value_type voxels[kCount + kSlack] = {};
      const std::uint32_t seed = leadline::base::mix_u32(static_cast<std::uint32_t>(ping)) +
                                 (static_cast<std::uint32_t>(ping) % 977U) * 0x85EBCA6BU;
      add_shell(voxels, taps.data(), kCount, 0, Evidence{weight, 0}, seed);
      for (std::int32_t k = 0; k < kCount; ++k) {
        total += voxels[k].hit;
      }
    }
    const double expected = weight / 128.0 / 8.0;
    const double mean = total / (static_cast<double>(kPings) * kCount);
    // Independent rounding would scatter by this much; the golden-ratio sequence does better.
    const double sigma = std::sqrt(expected * (1.0 - expected) / (kPings * kCount));
    print_message("weight %u/128 * 1/8: mean increment %.6f, product %.6f (sigma %.1e)\n", weight,
                  mean, expected, sigma);
    assert_near(mean, expected, 3.0 * sigma);
  }
}

TEST(both_halves_are_dithered_alike) {
  // hit and miss of one voxel round together: with equal evidence they stay equal, so that rounding
  // alone never turns "undecided" into an opinion.
  std::vector<std::int16_t> taps(40 + kSlack, 12345);
  std::vector<Voxel> voxels(40 + kSlack);
  for (std::uint32_t ping = 0; ping < 1000; ++ping) {
    add_shell(voxels.data(), taps.data(), 40, 0, Evidence{77, 77}, leadline::base::mix_u32(ping));
  }
  for (const Voxel& voxel : voxels) {
    assert_int_equal(voxel.hit, voxel.miss);
  }
}

TEST(rescaling_halves_without_bias) {
  constexpr std::int32_t kDepth = 1024;
  Random random(3);
  std::vector<Voxel> column(kDepth);
  for (Voxel& voxel : column) {
    voxel = Voxel{static_cast<std::uint16_t>(random.between(0, 60000)),
                  static_cast<std::uint16_t>(random.between(0, 60000))};
  }
  column[500].hit = 65535;
  const std::vector<Voxel> before = column;
  assert_true(rescale_column(column.data(), kDepth));
  double sum_before = 0.0;
  double sum_after = 0.0;
  for (std::size_t k = 0; k < before.size(); ++k) {
    // Ratios of all pairs survive to within half a unit per voxel.
    assert_near(column[k].hit, before[k].hit / 2.0, 0.5);
    assert_near(column[k].miss, before[k].miss / 2.0, 0.5);
    sum_before += before[k].hit + before[k].miss;
    sum_after += column[k].hit + column[k].miss;
  }
  // 2048 halves: odd ones round by half a unit, half of them up.
  assert_near(sum_after, sum_before / 2.0, 4.0 * 0.5 * std::sqrt(2.0 * kDepth));

  // All odd and equal: up and down alternate, the sum is exact.
  for (Voxel& voxel : column) {
    voxel = Voxel{50001, 1};
  }
  assert_true(rescale_column(column.data(), kDepth));
  double hits = 0.0;
  double misses = 0.0;
  for (const Voxel& voxel : column) {
    hits += voxel.hit;
    misses += voxel.miss;
  }
  assert_near(hits, kDepth * 25000.5, 0.0);
  assert_near(misses, kDepth * 0.5, 0.0);
}

TEST(rescaling_waits_for_half_of_the_range) {
  // Below half of its range a voxel can take as much again before it saturates.
  static_assert(2 * kRescaleAbove <= kFull + 1);
  std::vector<Voxel> column(8);
  column[3] = Voxel{kRescaleAbove - 1, kRescaleAbove - 1};
  const std::vector<Voxel> before = column;
  assert_true(!rescale_column(column.data(), 8));
  assert_true(same(column, before));
  column[3].miss = kRescaleAbove;
  assert_true(rescale_column(column.data(), 8));
  column.assign(8, Voxel{});
  column[7].hit = kRescaleAbove;
  assert_true(rescale_column(column.data(), 8));
  assert_int_equal(column[7].hit, kRescaleAbove / 2);
}

}  // namespace
