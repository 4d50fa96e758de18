#include <vector>

#include "host_tools/voxel_walk.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::CellIndex;
using leadline::host::CellLattice;
using leadline::host::PointMm;
using leadline::host::segment_cell_count;
using leadline::host::walk_segment;

std::vector<CellIndex> walk(const CellLattice& lattice, const PointMm& from, const PointMm& to) {
  std::vector<CellIndex> cells;
  double previous = 0.0;
  walk_segment(lattice, from, to, [&](const CellIndex& cell, double share) {
    assert_true(share >= previous && share <= 1.0);
    previous = share;
    cells.push_back(cell);
    return true;
  });
  return cells;
}

TEST(a_point_is_one_cell) {
  const CellLattice lattice{{0, 0, 0}, 10};
  assert_true(walk(lattice, {5, 5, 5}, {5, 5, 5}) == std::vector<CellIndex>({{0, 0, 0}}));
  assert_true(walk(lattice, {-1, 10, 0}, {-1, 10, 0}) == std::vector<CellIndex>({{-1, 1, 0}}));
}

TEST(cells_are_half_open_in_both_directions) {
  const CellLattice lattice{{0, 0, 0}, 10};
  // The border belongs to the upper cell, from either side.
  assert_true(walk(lattice, {5, 0, 0}, {10, 0, 0}) ==
              std::vector<CellIndex>({{0, 0, 0}, {1, 0, 0}}));
  assert_true(walk(lattice, {15, 0, 0}, {10, 0, 0}) == std::vector<CellIndex>({{1, 0, 0}}));
  assert_true(walk(lattice, {10, 0, 0}, {5, 0, 0}) ==
              std::vector<CellIndex>({{1, 0, 0}, {0, 0, 0}}));
}

TEST(corners_are_passed_without_their_neighbours) {
  const CellLattice lattice{{0, 0, 0}, 10};
  assert_true(walk(lattice, {5, 5, 5}, {15, 15, 15}) ==
              std::vector<CellIndex>({{0, 0, 0}, {1, 1, 1}}));
  assert_true(walk(lattice, {15, 15, 5}, {5, 5, 5}) ==
              std::vector<CellIndex>({{1, 1, 0}, {0, 0, 0}}));
  // One axis up, one down: the corner itself belongs to the cell that is upper in both.
  assert_true(walk(lattice, {5, 15, 5}, {15, 5, 5}) ==
              std::vector<CellIndex>({{0, 1, 0}, {1, 1, 0}, {1, 0, 0}}));
}

TEST(the_walk_can_be_stopped) {
  const CellLattice lattice{{0, 0, 0}, 10};
  int visits = 0;
  walk_segment(lattice, {0, 0, 0}, {1000, 0, 0},
               [&](const CellIndex&, double) { return ++visits < 3; });
  assert_int_equal(visits, 3);
}

TEST(random_segments_equal_sampling_every_border) {
  leadline::test::Random random(1);
  for (int round = 0; round < 3000; ++round) {
    const CellLattice lattice{
        {random.between(-50, 50), random.between(-50, 50), random.between(-50, 50)},
        random.between(1, 12)};
    PointMm from{};
    PointMm to{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      from[axis] = random.between(-60, 60);
      to[axis] = random.between(0, 3) == 0 ? from[axis] : random.between(-60, 60);
    }
    const std::vector<CellIndex> cells = walk(lattice, from, to);
    assert_true(cells.front() == lattice.cell_of(from));
    assert_true(cells.back() == lattice.cell_of(to));
    assert_true(cells.size() <= segment_cell_count(lattice, from, to));

    // Reference: the points at all shares k / steps, which hit every border exactly when steps is a
    // common multiple of the lengths; and the middles between them.
    std::int64_t steps = 2;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::int64_t length = std::abs(to[axis] - from[axis]);
      if (length > 0) {
        std::int64_t a = steps;
        std::int64_t b = length;
        while (b != 0) {
          const std::int64_t rest = a % b;
          a = b;
          b = rest;
        }
        steps = steps / a * length;
      }
    }
    if (steps > 20'000) {
      continue;
    }
    std::vector<CellIndex> expected;
    for (std::int64_t k = 0; k <= 2 * steps; ++k) {
      CellIndex cell{};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::int64_t scale = 2 * steps;
        const std::int64_t scaled =
            (from[axis] - lattice.origin_mm[axis]) * scale + (to[axis] - from[axis]) * k;
        const std::int64_t size = lattice.cell_mm * scale;
        cell[axis] = scaled >= 0 ? scaled / size : -((-scaled + size - 1) / size);
      }
      if (expected.empty() || expected.back() != cell) {
        expected.push_back(cell);
      }
    }
    assert_true(cells == expected);
  }
}

}  // namespace
