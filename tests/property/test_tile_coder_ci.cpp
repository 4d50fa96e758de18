// Any tile, any changes, any room: what the packets carry is what the sender had.
#include <array>
#include <vector>

#include "proto/tile_coder.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::test::Random;
using namespace leadline::proto;  // NOLINT: every name of the header is under test

constexpr std::size_t kTiles = 5;
using Tile = std::array<CodedCell, kTileArea_cells>;

/// Terrain, noise, holes, extremes, by turns.
Tile random_tile(Random& random, int style) {
  Tile cells{};
  const auto base = random.between(0, kMaxCellDepth_q8);
  const auto slope_n = random.between(-300, 300);
  const auto slope_e = random.between(-300, 300);
  const auto rough = random.between(1, 400);
  const auto holes = random.between(0, 2) == 0 ? random.between(2, 40) : 1'000'000;
  for (int i = 0; i < kTileArea_cells; ++i) {
    std::int64_t depth_q8 =
        base + slope_n * (i / 16) + slope_e * (i % 16) + random.between(-rough, rough);
    auto sigma_q12 = static_cast<std::uint32_t>(random.between(600, 1400));
    std::uint8_t flags = 0;
    if (style == 1) {
      depth_q8 = random.between(0, kMaxCellDepth_q8);
      sigma_q12 = static_cast<std::uint32_t>(random.next() >> random.between(33, 63));
      flags = static_cast<std::uint8_t>(random.between(0, 7));
    } else if (style == 2) {
      depth_q8 = random.between(0, 1) * kMaxCellDepth_q8;
      sigma_q12 = random.between(0, 1) == 0 ? 0 : UINT32_MAX;
    }
    depth_q8 = depth_q8 < 0 ? 0 : depth_q8;
    const bool hole = random.between(1, holes) == 1;
    cells[static_cast<std::size_t>(i)] =
        hole ? kUnknownCell : code_cell(static_cast<std::int32_t>(depth_q8), sigma_q12, flags);
  }
  return cells;
}

CellMask random_mask(Random& random) {
  CellMask mask{};
  const auto sparse = random.between(1, 6);
  for (int cell = 0; cell < kTileArea_cells; ++cell) {
    if (random.between(1, sparse * sparse * sparse) == 1) {
      mask.set(cell);
    }
  }
  mask.set(static_cast<int>(random.between(0, 255)));
  return mask;
}

TEST(packets_carry_what_the_sender_has) {
  Random random;
  std::vector<std::uint8_t> payload;
  for (int round = 0; round < 4000; ++round) {
    std::array<Tile, kTiles> sender{};
    std::array<Tile, kTiles> receiver{};
    std::array<CellMask, kTiles> left{};
    for (std::size_t i = 0; i < kTiles; ++i) {
      sender[i] = random_tile(random, static_cast<int>(random.between(0, 3)));
      left[i] = random_mask(random);
      receiver[i] = random_tile(random, 0);
      for (int cell = 0; cell < kTileArea_cells; ++cell) {
        const auto at = static_cast<std::size_t>(cell);
        receiver[i][at] = left[i].test(cell) ? receiver[i][at] : sender[i][at];
      }
    }
    payload.assign(static_cast<std::size_t>(random.between(30, 1400)), 0xEE);
    std::size_t next = 0;
    for (int packets = 0; next < kTiles; ++packets) {
      assert_true(packets < 2000);
      TilePacketEncoder packet(payload.data(), payload.size(), 9);
      CellMask taken{};
      while (next < kTiles) {
        TileUpdate update{};
        update.tile = static_cast<std::uint32_t>(next * 77'777 % 300'000);
        update.generation = static_cast<std::uint32_t>(round);
        update.cells = sender[next].data();
        update.changed = left[next];
        const auto added = packet.add(update, taken);
        if (!added.ok()) {
          break;
        }
        assert_int_equal(added.value(), taken.count());
        for (std::size_t row = 0; row < kTileSide_cells; ++row) {
          assert_int_equal(taken.rows[row] & ~left[next].rows[row], 0);
          left[next].rows[row] =
              static_cast<std::uint16_t>(left[next].rows[row] & ~taken.rows[row]);
        }
        if (left[next].count() > 0) {
          break;
        }
        ++next;
      }
      const std::size_t size = packet.finish();
      assert_in_range(size, 1, payload.size());
      TilePacketDecoder reader;
      assert_int_equal(static_cast<int>(reader.open(payload.data(), size)), 0);
      TileDelta delta;
      int tiles = 0;
      while (reader.next(delta)) {
        std::size_t tile = 0;
        while (tile * 77'777 % 300'000 != delta.tile) {
          ++tile;
          assert_true(tile < kTiles);
        }
        apply_delta(delta, receiver[tile].data());
        assert_int_equal(delta.generation, round);
        assert_int_equal(delta.hash32, fold_hash(tile_hash(sender[tile].data())));
        ++tiles;
      }
      assert_int_equal(static_cast<int>(reader.status()), 0);
      assert_int_equal(tiles, reader.tile_count());
    }
    assert_true(sender == receiver);
  }
}

TEST(changed_bytes_end_in_an_error_or_in_valid_cells) {
  Random random(1);
  std::vector<std::uint8_t> payload(1400);
  int unnoticed = 0;
  for (int round = 0; round < 20'000; ++round) {
    const Tile cells = random_tile(random, static_cast<int>(random.between(0, 2)));
    TileUpdate update{};
    update.cells = cells.data();
    update.changed = random_mask(random);
    CellMask taken{};
    const auto size = encode_tile(update, 9, payload.data(), payload.size(), taken);
    assert_true(size.ok());
    const auto at =
        static_cast<std::size_t>(random.between(11, static_cast<std::int64_t>(size.value())));
    std::vector<std::uint8_t> changed(payload.begin(),
                                      payload.begin() + static_cast<std::ptrdiff_t>(size.value()));
    if (at == changed.size()) {
      continue;
    }
    changed[at] = static_cast<std::uint8_t>(changed[at] ^ random.between(1, 255));
    TilePacketDecoder reader;
    TileDelta delta;
    assert_int_equal(static_cast<int>(reader.open(changed.data(), changed.size())), 0);
    while (reader.next(delta)) {
      ++unnoticed;
      for (const CodedCell cell : delta.cells) {
        assert_true(cell_valid(cell));
      }
    }
  }
  // The end of a body is checked, and that shows most changes before the frame's CRC would.
  assert_in_range(unnoticed, 0, 2000);
}

}  // namespace
