#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

#include "proto/coarse.hpp"
#include "proto/framing.hpp"
#include "proto/tile_coder.hpp"
#include "tests/support/proto_samples.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::test::all_cells;
using leadline::test::Bytes;
using leadline::test::Random;
using leadline::test::sample_tile;
using leadline::test::spec_bytes;
using leadline::test::Tile;
using namespace leadline::proto;  // NOLINT: every name of the header is under test
using BaseStatus = leadline::base::Status;

constexpr std::uint16_t kTag = 0x1234;

Bytes coarse_packet(std::uint32_t tile, const Tile& cells, const CellMask& mask) {
  Bytes payload(kMaxPayload_bytes);
  TilePacketEncoder packet(payload.data(), payload.size(), kTag, TileScale::kCoarse);
  CellMask taken{};
  assert_int_equal(packet.add({tile, 5, cells.data(), mask}, taken).value(), mask.count());
  payload.resize(packet.finish());
  return payload;
}

TEST(a_coarse_delta_is_as_specified) {
  Tile cells{};
  CellMask mask{};
  for (int cell = 0; cell < kTileArea_cells; ++cell) {
    if (cell % 16 < 8) {
      cells[static_cast<std::size_t>(cell)] =
          code_cell(1000 + 40 * (cell / 16) + 28 * (cell % 16) + 37 * cell % 13, 900, 0);
      mask.set(cell);
    }
  }
  const Bytes payload = coarse_packet(1, cells, mask);
  assert_true(payload == spec_bytes("Vector: tag `1234`, coarse tile 1"));
  TilePacketDecoder packet;
  assert_int_equal(packet.open(payload.data(), payload.size(), TileScale::kCoarse),
                   BaseStatus::kOk);
  assert_int_equal(packet.survey_tag(), kTag);
  TileDelta delta;
  assert_true(packet.next(delta));
  assert_int_equal(delta.tile, 1);
  assert_int_equal(delta.generation, 5);
  assert_int_equal(delta.hash32, 0);
  assert_int_equal(delta.cell_count, 128);
  assert_memory_equal(delta.cells, cells.data(), sizeof delta.cells);
  assert_false(packet.next(delta));
  assert_int_equal(packet.status(), BaseStatus::kOk);
}

TEST(neither_scale_is_taken_for_the_other) {
  const Bytes coarse = coarse_packet(1, sample_tile(), all_cells());
  TilePacketDecoder packet;
  assert_int_equal(packet.open(coarse.data(), coarse.size()), BaseStatus::kInvalidArgument);
  Bytes fine = coarse;
  fine[0] = 0x02;
  assert_int_equal(packet.open(fine.data(), fine.size(), TileScale::kCoarse),
                   BaseStatus::kInvalidArgument);
}

// Cut anywhere it is refused, or is the packet of other cells (nearly any string is some packet: frames have a CRC).
TEST(every_shorter_coarse_packet_is_refused_or_another) {
  const Bytes payload = coarse_packet(70'000, sample_tile(), all_cells());
  constexpr std::size_t kHeaders_bytes = 4 + 3 + 1 + 1;
  for (std::size_t size = 0; size < payload.size(); ++size) {
    TilePacketDecoder packet;
    const BaseStatus opened = packet.open(payload.data(), size, TileScale::kCoarse);
    assert_int_equal(opened == BaseStatus::kOk, size >= kHeaders_bytes);
    TileDelta delta;
    if (packet.next(delta)) {
      Tile cells{};
      std::copy(std::begin(delta.cells), std::end(delta.cells), cells.begin());
      const Bytes again = coarse_packet(delta.tile, cells, delta.changed);
      assert_int_equal(again.size(), size);
      assert_memory_equal(again.data(), payload.data(), size);
    }
  }
}

TEST(many_coarse_tiles_share_a_packet) {
  Bytes payload(kMaxPayload_bytes);
  TilePacketEncoder encoder(payload.data(), payload.size(), kTag, TileScale::kCoarse);
  const Tile cells = sample_tile();
  const std::uint32_t numbers[] = {9, 0, 300, kMaxTiles - 1};
  CellMask taken{};
  for (const std::uint32_t tile : numbers) {
    assert_true(encoder.add({tile, 0, cells.data(), all_cells()}, taken).ok());
  }
  payload.resize(encoder.finish());
  TilePacketDecoder packet;
  assert_int_equal(packet.open(payload.data(), payload.size(), TileScale::kCoarse),
                   BaseStatus::kOk);
  TileDelta delta;
  for (const std::uint32_t tile : numbers) {
    assert_true(packet.next(delta));
    assert_int_equal(delta.tile, tile);
    assert_memory_equal(delta.cells, cells.data(), sizeof delta.cells);
  }
  assert_false(packet.next(delta));
  assert_int_equal(packet.status(), BaseStatus::kOk);
}

TEST(mean_and_variance_are_exact) {
  Random random(3);
  for (int trial = 0; trial < 2000; ++trial) {
    CoarseSum sum;
    assert_false(sum.known());
    sum.add(kUnknownDepth_q8, 77);
    assert_false(sum.known());
    const auto count = static_cast<int>(random.between(1, 16));
    const std::int64_t most_q8 = random.between(0, kMaxCellDepth_q8);
    std::vector<double> depths;
    double mean = 0;
    double variance = 0;
    for (int i = 0; i < count; ++i) {
      const auto depth_q8 = static_cast<std::int32_t>(random.between(0, most_q8));
      const auto sigma_q12 = static_cast<std::uint32_t>(random.between(0, 1 << 21));
      sum.add(depth_q8, sigma_q12);
      depths.push_back(depth_q8);
      mean += depth_q8 / double(count);
      variance += double(sigma_q12) * sigma_q12 / count;
    }
    for (const double depth : depths) {
      variance += 256.0 * (depth - mean) * (depth - mean) / count;
    }
    assert_true(std::abs(sum.depth_q8() - mean) <= 0.5 + 1e-6);
    assert_true(std::abs(double(sum.variance_q24()) - variance) <= 260.0 + 1e-9 * variance);
  }
  CoarseSum extreme;  // nothing overflows
  for (int i = 0; i < 16; ++i) {
    extreme.add(i % 2 == 0 ? INT32_MIN + 1 : INT32_MAX, UINT32_MAX);
  }
  assert_int_equal(extreme.depth_q8(), kMaxCellDepth_q8 / 2);
  const double half_q12 = kMaxCellDepth_q8 / 2.0 * 16.0;
  assert_true(double(extreme.variance_q24()) == half_q12 * half_q12 + std::pow(2.0, 42));
}

TEST(the_cells_of_a_coarse_tile_have_one_sigma) {
  CoarseTile tile;
  Tile cells{};
  tile.code(cells.data());
  assert_true(cells == Tile{});
  assert_int_equal(tile.known().count(), 0);
  CoarseSum flat;
  flat.add(1000, 300);
  CoarseSum steep;
  steep.add(2000, 400);
  steep.add(2400, 400);
  tile.set(3, flat);
  tile.set(200, steep);
  tile.set(201, CoarseSum{});
  assert_int_equal(tile.known().count(), 2);
  tile.code(cells.data());
  // (300^2 + 400^2 + (16 * 200)^2) / 2, its root.
  const auto sigma_q12 = static_cast<std::uint32_t>(std::sqrt((90'000 + 160'000 + 10'240'000) / 2));
  assert_int_equal(cells[3], code_cell(1000, sigma_q12, 0));
  assert_int_equal(cells[200], code_cell(2200, sigma_q12, 0));
  assert_int_equal(cells[201], kUnknownCell);
}

TEST(places_of_coarse_cells_cover_the_grid_once) {
  for (const std::int32_t east_cells : {1, 16, 17, 64, 65, 200}) {
    const std::int32_t north_cells = 130;
    const std::int32_t tiles_east = (east_cells + 15) / 16;
    const std::int32_t tiles_north = (north_cells + 15) / 16;
    std::vector<int> met(
        static_cast<std::size_t>(coarse_tiles(east_cells) * coarse_tiles(north_cells)) * 256, 0);
    for (std::int32_t tile = 0; tile < tiles_east * tiles_north; ++tile) {
      const CoarsePlace place = coarse_place(static_cast<std::uint32_t>(tile), east_cells);
      for (int index = 0; index < kCoarseOfTile_cells; ++index) {
        met.at(place.tile * std::size_t{256} + static_cast<std::size_t>(place.cell(index))) += 1;
        // The coarse cell's own place, from its tile's and its number: as SPEC.md says.
        const std::int32_t north = tile / tiles_east * 4 + index / 4;
        const std::int32_t east = tile % tiles_east * 4 + index % 4;
        assert_int_equal(place.tile, north / 16 * ((east_cells + 63) / 64) + east / 16);
        assert_int_equal(place.cell(index), north % 16 * 16 + east % 16);
      }
    }
    for (const int times : met) {
      assert_in_range(times, 0, 1);
    }
  }
}

}  // namespace
