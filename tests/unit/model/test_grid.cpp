// Storage: addressing, tiles, hashes, and that nothing depends on where a tile's page lies.
#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "model/grid.hpp"
#include "tests/support/plain_table.hpp"
#include "tests/support/test.hpp"

namespace {

using namespace leadline::model;  // NOLINT: a test of this namespace
using leadline::base::Status;
using leadline::test::deepest_cells;
using leadline::test::Random;
using leadline::test::widest_side_cells;

Grid grid;  // tens of megabytes: static

void configure(std::int32_t north, std::int32_t east, std::int32_t down) {
  const std::int32_t size[3] = {north, east, down};
  assert_int_equal(grid.configure(size), Status::kOk);
}

Status try_size(std::int32_t north, std::int32_t east, std::int32_t down) {
  const std::int32_t size[3] = {north, east, down};
  return grid.configure(size);
}

/// Random contents, the same for the same stream.
void fill(std::uint64_t stream) {
  Random random(stream);
  for (std::int32_t n = 0; n < grid.north_cells(); ++n) {
    for (std::int32_t e = 0; e < grid.east_cells(); ++e) {
      Voxel* const voxels = grid.column_voxels(grid.column_index(n, e));
      for (std::int32_t k = 0; k < grid.depth_cells(); ++k) {
        const std::uint64_t bits = random.next();
        voxels[k] =
            Voxel{static_cast<std::uint16_t>(bits), static_cast<std::uint16_t>(bits >> 16U)};
      }
    }
  }
}

TEST(every_voxel_has_an_address_of_its_own) {
  using Size = std::array<std::int32_t, 3>;
  for (const auto [north, east, down] :
       {Size{1, 1, 1}, Size{1, 1, 1024}, Size{16, 16, 5}, Size{17, 33, 7}, Size{100, 1, 3},
        Size{1, 100, 3}, Size{63, 65, 40}}) {
    configure(north, east, down);
    const std::size_t storage = static_cast<std::size_t>(grid.column_count()) *
                                static_cast<std::size_t>(grid.depth_cells());
    std::vector<char> used(storage, 0);
    const Voxel* const base = grid.column_voxels(0U);
    for (std::int32_t n = 0; n < north; ++n) {
      for (std::int32_t e = 0; e < east; ++e) {
        const std::uint32_t column = grid.column_index(n, e);
        assert_true(column < grid.column_count());
        assert_true(grid.tile_of(n, e) < grid.tile_count());
        for (std::int32_t k = 0; k < down; ++k) {
          const auto address = static_cast<std::size_t>(grid.column_voxels(column) + k - base);
          assert_true(address < storage);
          assert_int_equal(used[address], 0);
          used[address] = 1;
        }
      }
    }
  }
}

TEST(tiles_are_sixteen_by_sixteen_and_row_major) {
  configure(40, 50, 4);
  assert_int_equal(grid.tile_count(), 3 * 4);
  assert_int_equal(grid.column_count(), 12 * 256);
  assert_int_equal(grid.tile_of(0, 0), 0);
  assert_int_equal(grid.tile_of(0, 15), 0);
  assert_int_equal(grid.tile_of(0, 16), 1);
  assert_int_equal(grid.tile_of(15, 49), 3);
  assert_int_equal(grid.tile_of(16, 0), 4);
  assert_int_equal(grid.tile_of(39, 49), 11);
  for (TileId id = 0; id < grid.tile_count(); ++id) {
    assert_int_equal(grid.tile(id).generation, 0);
    assert_int_equal(grid.tile(id).page, id);
  }
}

TEST(configuring_clears_everything) {
  configure(20, 20, 8);
  const std::uint64_t empty = grid.map_hash();
  fill(1);
  grid.column(grid.column_index(3, 4)).flags = kColumnTouched;
  grid.column(grid.column_index(3, 4)).depth_q8 = 77;
  grid.tile(1).generation = 9;
  assert_true(grid.map_hash() != empty);
  configure(20, 20, 8);
  assert_true(grid.map_hash() == empty);
  const ColumnRecord& record = grid.column(grid.column_index(3, 4));
  assert_int_equal(record.flags, 0);
  assert_int_equal(record.depth_q8, kUnknownDepth);
  assert_int_equal(record.mass, 0);
  assert_int_equal(grid.tile(1).generation, 0);
}

TEST(the_hash_sees_every_voxel_and_its_place) {
  configure(18, 19, 5);
  fill(2);
  const std::uint64_t before = grid.map_hash();
  Random random(3);
  for (int trial = 0; trial < 300; ++trial) {
    const auto n = static_cast<std::int32_t>(random.between(0, 17));
    const auto e = static_cast<std::int32_t>(random.between(0, 18));
    const auto k = random.between(0, 4);
    Voxel& voxel = grid.column_voxels(grid.column_index(n, e))[k];
    const Voxel kept = voxel;
    const TileId tile = grid.tile_of(n, e);
    const std::uint64_t tile_before = grid.tile_hash(tile);
    const std::uint64_t other_before = grid.tile_hash((tile + 1) % grid.tile_count());
    // One bit of one half.
    const auto bit = static_cast<std::uint16_t>(1U << static_cast<unsigned>(random.between(0, 15)));
    if (random.between(0, 1) == 0) {
      voxel.hit = static_cast<std::uint16_t>(voxel.hit ^ bit);
    } else {
      voxel.miss = static_cast<std::uint16_t>(voxel.miss ^ bit);
    }
    assert_true(grid.map_hash() != before);
    assert_true(grid.tile_hash(tile) != tile_before);
    assert_true(grid.tile_hash((tile + 1) % grid.tile_count()) == other_before);
    voxel = kept;
    assert_true(grid.map_hash() == before);
  }
  // Two columns exchanged.
  for (std::int32_t k = 0; k < 5; ++k) {
    std::swap(grid.column_voxels(grid.column_index(2, 2))[k],
              grid.column_voxels(grid.column_index(2, 3))[k]);
  }
  assert_true(grid.map_hash() != before);
}

TEST(the_hash_does_not_see_side_records_nor_padding) {
  configure(17, 17, 4);
  fill(4);
  const std::uint64_t before = grid.map_hash();
  const std::uint64_t tile_before = grid.tile_hash(3);
  for (std::uint32_t column = 0; column < grid.column_count(); ++column) {
    grid.column(column).depth_q8 = 12345;
    grid.column(column).flags = 0xFF;
  }
  // Tile 3 holds one column of the grid, (16, 16); the other 255 are padding.
  for (std::uint32_t column = 3 * 256 + 1; column < 4 * 256; ++column) {
    grid.column_voxels(column)[0] = Voxel{7, 7};
  }
  assert_true(grid.map_hash() == before);
  assert_true(grid.tile_hash(3) == tile_before);
}

TEST(nothing_depends_on_where_a_page_lies) {
  configure(50, 35, 6);
  fill(5);
  const std::uint64_t map_before = grid.map_hash();
  std::vector<std::uint64_t> tiles_before;
  for (TileId id = 0; id < grid.tile_count(); ++id) {
    tiles_before.push_back(grid.tile_hash(id));
  }
  // Swap pages at random, each with its contents, as a pager would.
  Random random(6);
  for (int swaps = 0; swaps < 50; ++swaps) {
    const auto a = static_cast<TileId>(random.between(0, grid.tile_count() - 1));
    const auto b = static_cast<TileId>(random.between(0, grid.tile_count() - 1));
    if (a == b) {
      continue;
    }
    std::swap_ranges(grid.tile_voxels(a), grid.tile_voxels(a) + grid.tile_voxel_count(),
                     grid.tile_voxels(b));
    std::swap(grid.tile(a).page, grid.tile(b).page);
  }
  assert_true(grid.map_hash() == map_before);
  for (TileId id = 0; id < grid.tile_count(); ++id) {
    assert_true(grid.tile_hash(id) == tiles_before[id]);
  }
}

TEST(an_empty_grids_hash_depends_on_its_shape) {
  configure(8, 8, 8);
  const std::uint64_t cube = grid.map_hash();
  configure(8, 8, 9);
  assert_true(grid.map_hash() != cube);
}

TEST(capacity_is_refused_with_its_status) {
  assert_int_equal(try_size(0, 1, 1), Status::kOutOfRange);
  assert_int_equal(try_size(1, 0, 1), Status::kOutOfRange);
  assert_int_equal(try_size(1, 1, 0), Status::kOutOfRange);
  assert_int_equal(try_size(-1, 1, 1), Status::kOutOfRange);
  assert_int_equal(try_size(kMaxSideCells + 1, 1, 1), Status::kOutOfRange);
  assert_int_equal(try_size(1, kMaxSideCells + 1, 1), Status::kOutOfRange);
  assert_int_equal(try_size(1, 1, kMaxDepthCells + 1), Status::kOutOfRange);
  // Over the columns, not over the voxels.
  const std::int32_t side = widest_side_cells();
  assert_int_equal(try_size(side + kTileCells, side, 1), Status::kOverCapacity);
  assert_int_equal(try_size(side, side, deepest_cells(side, side)), Status::kOk);
  // Over the voxels, not over the columns.
  const std::int32_t half = side / 2 / kTileCells * kTileCells;
  assert_int_equal(try_size(half, half, deepest_cells(half, half) + 1), Status::kOverCapacity);
  assert_int_equal(try_size(half, half, deepest_cells(half, half)), Status::kOk);
  // Padding of tiles counts: a line of single columns takes sixteen times its size.
  const auto line =
      static_cast<std::int32_t>(std::min<std::uint32_t>(kMaxSideCells, kTileCapacity * kTileCells));
  assert_int_equal(try_size(line, 1, deepest_cells(line, kTileCells) + 1), Status::kOverCapacity);
  assert_int_equal(try_size(line, 1, deepest_cells(line, kTileCells)), Status::kOk);
}

TEST(a_refused_size_leaves_the_grid_as_it_was) {
  configure(20, 20, 8);
  fill(7);
  const std::uint64_t before = grid.map_hash();
  assert_int_equal(try_size(widest_side_cells() + kTileCells, widest_side_cells(), 1),
                   Status::kOverCapacity);
  assert_true(grid.map_hash() == before);
}

}  // namespace
