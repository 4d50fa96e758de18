// Depth of one column from known histograms: accuracy, edges, unknown, two surfaces, empty evidence.
#include <algorithm>
#include <cstring>
#include <vector>

#include "model/column_depth.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::model;  // NOLINT: a test of this namespace
using leadline::test::Random;

/// A column under construction; positions in cells from the top, voxel k spans [k, k + 1).
struct Column {
  std::vector<Voxel> voxels;

  explicit Column(std::int32_t depth_cells) : voxels(static_cast<std::size_t>(depth_cells)) {
    // The vector form reads on past the end, as the grid's storage allows (what is there must not
    // matter: test_column_kernels.cpp).
    voxels.reserve(voxels.size() + 16);
  }
  // A copy of a vector does not keep the room.
  Column(const Column& other) : Column(static_cast<std::int32_t>(other.voxels.size())) {
    voxels.assign(other.voxels.begin(), other.voxels.end());
  }
  Column& operator=(const Column&) = delete;

  /// Hits of a surface at `centre`: Gaussian, `peak` units high.
  Column& surface(double centre, double sigma, double peak) {
    for (std::size_t k = 0; k < voxels.size(); ++k) {
      const double x = (static_cast<double>(k) + 0.5 - centre) / sigma;
      const double hit = voxels[k].hit + peak * std::exp(-0.5 * x * x);
      voxels[k].hit = static_cast<std::uint16_t>(std::min(65535.0, std::floor(hit + 0.5)));
    }
    return *this;
  }
  /// Empty evidence in [from, to).
  Column& empty(std::size_t from, std::size_t to, std::uint16_t miss) {
    for (std::size_t k = from; k < to && k < voxels.size(); ++k) {
      voxels[k].miss = miss;
    }
    return *this;
  }
  [[nodiscard]] ColumnDepth read(DepthMethod method = DepthMethod::kRobustMoment,
                                 Rule rule = Rule::kLogOdds) const {
    return column_depth(voxels.data(), static_cast<std::int32_t>(voxels.size()), method, rule);
  }
};

constexpr DepthMethod kMethods[] = {DepthMethod::kRobustMoment, DepthMethod::kFirstMoment,
                                    DepthMethod::kUpperCrossing};
constexpr Rule kRules[] = {Rule::kLogOdds, Rule::kWeightedMean};

double cells(const ColumnDepth& depth) { return depth.depth_q8 / 256.0; }

TEST(an_untouched_column_is_unknown_at_every_height) {
  for (std::int32_t depth_cells = 1; depth_cells <= kMaxDepthCells; ++depth_cells) {
    for (const DepthMethod method : kMethods) {
      for (const Rule rule : kRules) {
        const ColumnDepth depth = Column(depth_cells).read(method, rule);
        assert_int_equal(depth.depth_q8, kUnknownDepth);
        assert_int_equal(depth.mass, 0);
        assert_true(!depth.multi_surface);
      }
    }
  }
}

TEST(empty_evidence_alone_is_unknown) {
  for (const DepthMethod method : kMethods) {
    for (const Rule rule : kRules) {
      assert_int_equal(Column(64).empty(0, 64, 500).read(method, rule).depth_q8, kUnknownDepth);
    }
  }
}

TEST(one_hit_is_at_its_voxels_centre_at_every_height) {
  for (std::int32_t depth_cells = 1; depth_cells <= kMaxDepthCells; ++depth_cells) {
    const std::int32_t step = std::max(1, depth_cells / 7);
    for (std::int32_t k = 0; k < depth_cells; k += step) {
      Column column(depth_cells);
      column.voxels[static_cast<std::size_t>(k)].hit = 200;
      for (const DepthMethod method : kMethods) {
        for (const Rule rule : kRules) {
          const ColumnDepth depth = column.read(method, rule);
          assert_int_equal(depth.depth_q8, 256 * k + 128);
          assert_int_equal(depth.mass, 200);
        }
      }
    }
  }
}

TEST(symmetric_histograms_are_read_to_the_unit) {
  // Symmetric about a voxel's centre or about a boundary: the answer is exact by symmetry, 1/256 cell
  // is what integer division may take.
  Random random(1);
  for (int trial = 0; trial < 20'000; ++trial) {
    const auto depth_cells = static_cast<std::int32_t>(random.between(24, 200));
    const double centre = 0.5 * static_cast<double>(random.between(20, 2 * depth_cells - 20));
    const double sigma = 0.6 + 2.0 * random.uniform();
    const ColumnDepth depth =
        Column(depth_cells).surface(centre, sigma, 100.0 + 40000.0 * random.uniform()).read();
    assert_near(depth.depth_q8, 256.0 * centre, 1.0);
  }
}

TEST(any_position_is_read_to_a_fraction_of_a_cell) {
  // Gaussians of the widths that the kernels have, anywhere inside the column.
  Random random(2);
  double squares = 0.0;
  double worst = 0.0;
  constexpr int kTrials = 20'000;
  for (int trial = 0; trial < kTrials; ++trial) {
    const auto depth_cells = static_cast<std::int32_t>(random.between(40, 200));
    const double centre = 14.0 + (depth_cells - 28.0) * random.uniform();
    const double sigma = 0.8 + 2.2 * random.uniform();
    const ColumnDepth depth = Column(depth_cells).surface(centre, sigma, 20000.0).read();
    const double error = cells(depth) - centre;
    squares += error * error;
    worst = std::max(worst, std::fabs(error));
  }
  const double rms = std::sqrt(squares / kTrials);
  print_message("robust moment: rms error %.4f, worst %.4f cells (1/256 = 0.0039)\n", rms, worst);
  // The iteration ends at moves below 1/64 cell: what it leaves is of that order at worst.
  assert_true(rms < 1.5 / 256.0);
  assert_true(worst < 5.0 / 256.0);
}

TEST(the_grids_top_and_bottom_do_not_pull) {
  // A surface whose lower or upper tail is outside the grid: a plain mean of what is inside would be
  // off by the missing tail; the symmetric window is not.
  Random random(3);
  double worst = 0.0;
  double worst_mean = 0.0;
  for (int trial = 0; trial < 4000; ++trial) {
    const std::int32_t depth_cells = 32;
    const double sigma = 1.0 + random.uniform();
    const double edge = sigma * (1.0 + random.uniform());  // distance to the grid's end
    const bool top = random.between(0, 1) == 0;
    const double centre = top ? edge : depth_cells - edge;
    const Column column = Column(depth_cells).surface(centre, sigma, 20000.0);
    double sum = 0.0;
    double moment = 0.0;
    for (std::size_t k = 0; k < column.voxels.size(); ++k) {
      sum += column.voxels[k].hit;
      moment += column.voxels[k].hit * (static_cast<double>(k) + 0.5);
    }
    worst_mean = std::max(worst_mean, std::fabs(moment / sum - centre));
    worst = std::max(worst, std::fabs(cells(column.read()) - centre));
  }
  print_message("near an edge: worst error %.3f cells, of the plain mean %.3f\n", worst,
                worst_mean);
  assert_true(worst < 0.2);
  assert_true(worst_mean > 0.5);
}

TEST(a_depth_is_always_inside_the_grid) {
  Random random(4);
  for (int trial = 0; trial < 50'000; ++trial) {
    const auto depth_cells = static_cast<std::int32_t>(random.between(1, 40));
    Column column(depth_cells);
    for (Voxel& voxel : column.voxels) {
      voxel.hit = static_cast<std::uint16_t>(random.next() >>
                                             static_cast<unsigned>(random.between(48, 63)));
      voxel.miss = static_cast<std::uint16_t>(random.next() >>
                                              static_cast<unsigned>(random.between(48, 63)));
    }
    for (const DepthMethod method : kMethods) {
      for (const Rule rule : kRules) {
        const ColumnDepth depth = column.read(method, rule);
        if (depth.depth_q8 != kUnknownDepth) {
          assert_in_range(depth.depth_q8, 0, 256 * depth_cells);
          assert_true(depth.mass > 0);
        }
      }
    }
  }
}

TEST(saturated_columns_of_the_largest_height_do_not_overflow) {
  for (std::int32_t depth_cells : {1, 2, 3, 512, 1023, 1024}) {
    Column column(depth_cells);
    for (Voxel& voxel : column.voxels) {
      voxel.hit = 65535;
    }
    const ColumnDepth depth = column.read();
    // Uniform: the centre, as nearly as the run around the first peak reaches.
    assert_in_range(depth.depth_q8, 0, 256 * depth_cells);
    assert_int_equal(depth.mass, 65535U * static_cast<std::uint32_t>(depth_cells));
    assert_near(cells(column.read(DepthMethod::kFirstMoment)), depth_cells / 2.0, 0.01);
  }
}

TEST(two_surfaces_are_flagged_and_the_stronger_is_the_depth) {
  const ColumnDepth even = Column(64).surface(15.5, 1.0, 1000.0).surface(40.5, 1.0, 900.0).read();
  assert_true(even.multi_surface);
  assert_near(cells(even), 15.5, 0.02);
  const ColumnDepth lower = Column(64).surface(15.5, 1.0, 400.0).surface(40.5, 1.0, 900.0).read();
  assert_true(lower.multi_surface);
  assert_near(cells(lower), 40.5, 0.02);
  // Under a quarter as strong: noise.
  assert_true(
      !Column(64).surface(15.5, 1.0, 1000.0).surface(40.5, 1.0, 200.0).read().multi_surface);
  // Over a quarter.
  assert_true(Column(64).surface(15.5, 1.0, 1000.0).surface(40.5, 1.0, 300.0).read().multi_surface);
  // One surface, however wide, is one.
  assert_true(!Column(64).surface(30.0, 1.0, 1000.0).read().multi_surface);
  assert_true(!Column(64).surface(30.0, 4.0, 1000.0).read().multi_surface);
}

TEST(a_second_surface_within_the_robust_window_does_not_move_the_depth_much) {
  // A weak outlier 8 cells above: the first moment of the hits would move by 8 * 0.1 / 1.1 = 0.73.
  const ColumnDepth depth = Column(64).surface(30.5, 1.0, 1000.0).surface(22.5, 1.0, 100.0).read();
  assert_near(cells(depth), 30.5, 0.02);
}

TEST(empty_evidence_vetoes_a_false_surface) {
  // Ghost above the bottom, looked through by later pings.
  const Column ghost = Column(64).surface(20.5, 1.0, 1000.0).surface(45.5, 1.0, 400.0);
  assert_near(cells(ghost.read()), 20.5, 0.02);
  Column seen_through = ghost;
  seen_through.empty(15, 27, 5000);
  for (const Rule rule : kRules) {
    const ColumnDepth depth = seen_through.read(DepthMethod::kRobustMoment, rule);
    assert_near(cells(depth), 45.5, 0.02);
    assert_true(!depth.multi_surface);
  }
  // Log-odds: some empty evidence is what every bottom sees; as much as for it is the limit.
  Column edge(8);
  edge.voxels[4] = Voxel{100, 100};
  assert_int_equal(edge.read().depth_q8, 4 * 256 + 128);
  edge.voxels[4].miss = 101;
  assert_int_equal(edge.read().depth_q8, kUnknownDepth);
  // Weighted mean: where evidence against prevails there is no surface; what prevails otherwise counts.
  edge.voxels[4] = Voxel{100, 100};
  assert_int_equal(edge.read(DepthMethod::kRobustMoment, Rule::kWeightedMean).depth_q8,
                   kUnknownDepth);
  edge.voxels[4].miss = 60;
  const ColumnDepth rest = edge.read(DepthMethod::kRobustMoment, Rule::kWeightedMean);
  assert_int_equal(rest.depth_q8, 4 * 256 + 128);
  assert_int_equal(rest.mass, 40);
}

TEST(what_more_pings_stand_for_is_chosen) {
  // One near, false, precise echo above a bottom that many wide echoes have met: higher, and with more
  // evidence in all, but narrower and passed through.
  const Column ghost = Column(64).surface(12.5, 0.6, 3000.0).surface(44.5, 2.5, 600.0);
  assert_near(cells(Column(ghost).empty(8, 17, 100).read()), 44.5, 0.05);
  // The same where nothing went through it: evidence and width decide, 4500 x 0.6 against 3760 x 2.5.
  assert_near(cells(ghost.read()), 44.5, 0.05);
  // A ledge of equal width: what was passed through is less credible.
  const Column ledge = Column(64).surface(12.5, 1.0, 1200.0).surface(44.5, 1.0, 1000.0);
  assert_near(cells(ledge.read()), 12.5, 0.05);
  assert_true(ledge.read().multi_surface);
  const Column contested = Column(ledge).empty(8, 17, 200);
  assert_near(cells(contested.read()), 44.5, 0.05);
}

TEST(support_counts_pings) {
  // Evidence of one ping of variance v is 255 min_variance / v: evidence x variance does not depend on it.
  const auto support = [](double sigma, double count) {
    const double peak = count * 2000.0 / (sigma * sigma * sigma);
    return static_cast<double>(Column(64).surface(30.5, sigma, peak).read().support_q4);
  };
  const double one = support(1.0, 1.0);
  // A run ends at a tenth of its peak, which takes more of a wide one.
  assert_near(support(2.0, 1.0) / one, 1.0, 0.3);
  assert_near(support(3.0, 1.0) / one, 1.0, 0.3);
  assert_near(support(2.0, 5.0) / support(2.0, 1.0), 5.0, 0.1);
}

TEST(first_moment_is_the_sources) {
  // S > 0.7 qualifies: S = 0.8 and 0.9 do, 0.6 does not.
  Column column(16);
  column.voxels[4] = Voxel{80, 20};
  column.voxels[5] = Voxel{90, 10};
  column.voxels[9] = Voxel{60, 40};
  const double expected = (0.8 * 4.5 + 0.9 * 5.5) / 1.7;
  assert_near(cells(column.read(DepthMethod::kFirstMoment)), expected, 1.0 / 128.0);
  // Nothing qualified: no depth, though there is evidence.
  Column weak(16);
  weak.voxels[4] = Voxel{60, 40};
  assert_int_equal(weak.read(DepthMethod::kFirstMoment).depth_q8, kUnknownDepth);
  assert_true(weak.read(DepthMethod::kFirstMoment).mass > 0);
}

TEST(upper_crossing_interpolates) {
  // S rises from 0.25 (voxel 4) to 0.75 (voxel 5): 0.5 lies half-way between their centres.
  Column column(16);
  column.empty(0, 4, 100);
  column.voxels[4] = Voxel{100, 300};
  column.voxels[5] = Voxel{300, 100};
  assert_near(cells(column.read(DepthMethod::kUpperCrossing)), 5.0, 1.0 / 128.0);
  // From unknown (0.5) there is nothing to interpolate with: the voxel's own centre.
  Column bare(16);
  bare.voxels[7] = Voxel{300, 100};
  assert_near(cells(bare.read(DepthMethod::kUpperCrossing)), 7.5, 0.0);
  // Never over one half.
  Column low(16);
  low.voxels[7] = Voxel{100, 150};
  assert_int_equal(low.read(DepthMethod::kUpperCrossing).depth_q8, kUnknownDepth);
}

TEST(reading_a_column_changes_nothing) {
  const Column column = Column(64).surface(20.3, 1.5, 700.0).empty(0, 16, 300);
  const std::vector<Voxel> before = column.voxels;
  for (const DepthMethod method : kMethods) {
    static_cast<void>(column.read(method));
  }
  assert_memory_equal(before.data(), column.voxels.data(), before.size() * sizeof(Voxel));
}

TEST(cells_without_hits_only_move_a_depth) {
  // Where evidence lies in the column decides nothing else, as long as no window meets its ends.
  constexpr std::int32_t kMiddle = 60;
  for (std::int32_t above = 0; above <= 40; ++above) {
    const auto column_of = [above](double middle) {
      Column column(3 * kMiddle + above);
      column.surface(middle, 1.5, 900).surface(middle + 20, 2, 700);
      column.empty(0, static_cast<std::size_t>(middle) + 1, 30);
      return column;
    };
    const ColumnDepth before = column_of(kMiddle + 0.3).read();
    const ColumnDepth after = column_of(kMiddle + 0.3 + above).read();
    assert_int_equal(after.depth_q8, before.depth_q8 + 256 * above);
    assert_int_equal(after.mass, before.mass);
    assert_int_equal(after.support_q4, before.support_q4);
    assert_true(after.multi_surface == before.multi_surface);
    assert_true(before.multi_surface);
  }
}

}  // namespace
