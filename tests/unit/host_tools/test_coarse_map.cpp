// Coarse cells at the topside: shown where nothing is known, gone with what comes, never part of the map; and the page
// gets them the same way.
#include <cstdint>
#include <string>
#include <vector>

#include "host_tools/monitor/live_map.hpp"
#include "host_tools/monitor/page_messages.hpp"
#include "host_tools/topside/coarse_map.hpp"
#include "host_tools/topside/receiver.hpp"
#include "proto/framing.hpp"
#include "tests/support/proto_samples.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::host::CoarseMap;
using leadline::host::LiveMap;
using leadline::host::Receiver;
using leadline::host::TileStore;
using leadline::proto::cell_known;
using leadline::proto::code_cell;
using leadline::proto::CodedCell;
using leadline::proto::Hello;
using leadline::proto::kTileArea_cells;
using leadline::proto::TileDelta;
using leadline::proto::TileScale;

// 5 x 6 tiles, so that a coarse tile reaches beyond the grid.
Hello grid_hello() { return leadline::test::grid_hello(80, 90); }

constexpr std::uint32_t kTilesEast = 6;

/// The coarse cell for the map's cells from (4 n, 4 e) on.
void set_coarse(TileDelta* coarse, int n, int e, std::int32_t depth_q8) {
  const int cell = n % 16 * 16 + e % 16;
  coarse->changed.set(cell);
  coarse->cells[cell] = code_cell(depth_q8, 2000, 0);
  coarse->cell_count += 1;
}

TileDelta coarse_tile(std::uint32_t tile) {
  TileDelta coarse{};
  coarse.tile = tile;
  return coarse;
}

/// All cells of a tile, or the first of them.
TileDelta fine_delta(std::uint32_t tile, std::uint32_t generation, int cells) {
  CodedCell whole[kTileArea_cells];
  TileDelta delta{};
  delta.tile = tile;
  delta.generation = generation;
  delta.cell_count = cells;
  for (int cell = 0; cell < kTileArea_cells; ++cell) {
    whole[cell] = code_cell(3000 + 10 * cell, 500, 0);
    if (cell < cells) {
      delta.changed.set(cell);
      delta.cells[cell] = whole[cell];
    }
  }
  delta.hash32 = leadline::proto::fold_hash(leadline::proto::tile_hash(whole));
  return delta;
}

TEST(coarse_cells_are_there_until_theirs_come) {
  TileStore store(grid_hello());
  CoarseMap coarse;
  TileDelta delta = coarse_tile(0);
  for (int n = 0; n < 8; ++n) {
    for (int e = 4; e < 8; ++e) {
      set_coarse(&delta, n, e, 100 * n + e);
    }
  }
  assert_true(coarse.apply(delta, store));
  assert_int_equal(coarse.tiles(), 2);  // (0, 1), (1, 1)
  assert_null(coarse.tile(0));
  const auto* const upper = coarse.tile(kTilesEast + 1);
  assert_non_null(upper);
  assert_int_equal((*upper)[4 * 2 + 3], code_cell(100 * 6 + 7, 2000, 0));
  assert_int_equal(coarse.changed_since(0).size(), 2);
  assert_int_equal(coarse.changed_since(coarse.sequence()).size(), 0);

  // The first five rows and eleven cells of a tile: they stand in for the others.
  (void)store.apply(fine_delta(1, 1, 5 * 16 + 11));
  coarse.settle(1, store);
  const auto* const lower = coarse.tile(1);
  assert_non_null(lower);
  for (std::size_t index = 0; index < 16; ++index) {
    assert_true(cell_known((*lower)[index]));
  }

  // All of it: nothing stands in any more, nor will it.
  (void)store.apply(fine_delta(1, 1, kTileArea_cells));
  coarse.settle(1, store);
  assert_null(coarse.tile(1));
  assert_true(coarse.apply(delta, store));
  assert_null(coarse.tile(1));
  assert_int_equal(coarse.tiles(), 1);
  coarse.clear();
  assert_int_equal(coarse.tiles(), 0);
}

TEST(what_is_unknown_in_a_whole_tile_is_a_gap) {
  TileStore store(grid_hello());
  CoarseMap coarse;
  TileDelta hole = fine_delta(7, 1, 16);  // one row
  CodedCell whole[kTileArea_cells] = {};
  for (int cell = 0; cell < 16; ++cell) {
    whole[cell] = hole.cells[cell];
  }
  hole.hash32 = leadline::proto::fold_hash(leadline::proto::tile_hash(whole));
  (void)store.apply(hole);
  TileDelta delta = coarse_tile(0);
  set_coarse(&delta, 7, 4, 900);  // under the tile's last rows
  assert_true(coarse.apply(delta, store));
  assert_int_equal(coarse.tiles(), 0);
}

// A lost coarse tile goes again with what still waits of it: what came of it before stays.
TEST(a_later_word_adds_to_an_earlier_one) {
  const TileStore store(grid_hello());
  CoarseMap coarse;
  TileDelta first = coarse_tile(0);
  set_coarse(&first, 0, 0, 700);
  set_coarse(&first, 0, 1, 701);
  assert_true(coarse.apply(first, store));
  TileDelta second = coarse_tile(0);
  set_coarse(&second, 0, 1, 900);
  set_coarse(&second, 0, 2, 902);
  assert_true(coarse.apply(second, store));
  const auto* const cells = coarse.tile(0);
  assert_int_equal((*cells)[0], code_cell(700, 2000, 0));
  assert_int_equal((*cells)[1], code_cell(900, 2000, 0));
  assert_int_equal((*cells)[2], code_cell(902, 2000, 0));
  assert_int_equal((*cells)[3], leadline::proto::kUnknownCell);
}

TEST(a_coarse_cell_outside_the_grid_takes_all_of_its_tile_along) {
  TileStore store(grid_hello());
  CoarseMap coarse;
  TileDelta good = coarse_tile(3);  // rows from 64, columns from 64
  set_coarse(&good, 19, 22, 500);   // cells 76 .., 88 ..: the last ones
  assert_true(coarse.apply(good, store));
  assert_int_equal(coarse.tiles(), 1);
  for (const auto& [n, e] : {std::pair<int, int>{20, 16}, {16, 23}}) {
    TileDelta bad = coarse_tile(3);
    set_coarse(&bad, 16, 16, 500);
    set_coarse(&bad, n, e, 500);
    assert_false(coarse.apply(bad, store));
  }
  TileDelta far = coarse_tile((1U << 24U) - 1);
  set_coarse(&far, 0, 0, 500);
  assert_false(coarse.apply(far, store));
  assert_int_equal(coarse.tiles(), 1);
}

std::vector<std::uint8_t> framed(const std::uint8_t* payload, std::size_t size) {
  std::vector<std::uint8_t> bytes(leadline::proto::frame_bound_bytes(size));
  bytes.resize(leadline::proto::encode_frame(payload, size, bytes.data(), bytes.size()).value());
  return bytes;
}

std::vector<std::uint8_t> packet(const TileDelta& delta, std::uint16_t tag, TileScale scale) {
  std::uint8_t payload[1400];
  leadline::proto::TilePacketEncoder encoder(payload, sizeof payload, tag, scale);
  leadline::proto::CellMask taken{};
  assert_true(encoder.add({delta.tile, delta.generation, delta.cells, delta.changed}, taken).ok());
  return framed(payload, encoder.finish());
}

void feed(Receiver* receiver, const std::vector<std::uint8_t>& bytes) {
  receiver->feed(bytes.data(), bytes.size());
}

TEST(a_receiver_keeps_them_apart_and_a_page_sees_them_come_and_go) {
  const Hello hello = grid_hello();
  const std::uint16_t tag = leadline::proto::survey_tag(hello.survey_id, hello.session);
  Receiver receiver;
  TileDelta delta = coarse_tile(0);
  for (int e = 0; e < 4; ++e) {
    set_coarse(&delta, 0, e, 1000 + e);
  }
  feed(&receiver, packet(delta, tag, TileScale::kCoarse));  // before the hello that explains it
  assert_int_equal(receiver.coarse().tiles(), 0);
  std::uint8_t payload[leadline::proto::kMaxHello_bytes];
  feed(&receiver, framed(payload, encode_hello(hello, payload, sizeof payload).value()));
  assert_int_equal(receiver.coarse().tiles(), 1);
  const std::uint64_t empty_hash = receiver.store()->cells_hash();

  feed(&receiver, packet(delta, tag, TileScale::kCoarse));
  feed(&receiver, packet(delta, static_cast<std::uint16_t>(tag + 1), TileScale::kCoarse));
  TileDelta outside = coarse_tile(3);
  set_coarse(&outside, 16, 23, 500);
  feed(&receiver, packet(outside, tag, TileScale::kCoarse));
  assert_int_equal(receiver.counters().coarse_deltas, 3);
  assert_int_equal(receiver.counters().other_surveys, 0);  // one waits for its hello
  assert_int_equal(receiver.counters().outside_grid, 1);
  assert_int_equal(receiver.counters().malformed, 0);
  assert_int_equal(receiver.coarse().tiles(), 1);
  // The map has nothing of them.
  assert_int_equal(receiver.store()->known_cells(), 0);
  assert_int_equal(receiver.store()->known_tiles(), 0);
  assert_true(receiver.store()->cells_hash() == empty_hash);

  LiveMap live;
  live.follow(*receiver.store(), 1'000'000, &receiver.coarse());
  assert_int_equal(live.change(), 1);
  assert_int_equal(live.tile(0)->coarse[2], delta.cells[2]);
  assert_int_equal(live.tile(0)->cells[2], 0);
  live.follow(*receiver.store(), 2'000'000, &receiver.coarse());
  assert_int_equal(live.change(), 1);
  // To a page: a message of its own kind, between those of other tiles.
  const std::string text = "{}";
  const leadline::host::Track track;
  leadline::host::PageCursor cursor;
  const auto tiles_sent = [&] {
    std::vector<std::vector<std::uint8_t>> messages;
    while (const auto message =
               next_page_message({&text, &live, &track, 1, &text, true}, &cursor)) {
      if (!message->text && message->bytes[0] != 3) {
        messages.push_back(message->bytes);
      }
    }
    return messages;
  };
  auto sent = tiles_sent();
  assert_int_equal(sent.size(), 1);
  assert_int_equal(sent[0][0], 4);
  assert_int_equal(sent[0].size(),
                   leadline::host::kTileHeader_bytes + leadline::host::kCoarsePageTile_bytes);
  const std::size_t third = sent[0].size() - 4 * std::size_t{14};
  for (unsigned k = 0; k < 4; ++k) {
    assert_int_equal(sent[0][third + k], delta.cells[2] >> (8 * k) & 255U);
  }

  feed(&receiver, packet(fine_delta(0, 1, kTileArea_cells), tag, TileScale::kFine));
  assert_int_equal(receiver.coarse().tiles(), 0);
  live.follow(*receiver.store(), 3'000'000, &receiver.coarse());
  assert_int_equal(live.change(), 2);
  assert_int_equal(live.tile(0)->coarse[2], 0);
  assert_true(cell_known(live.tile(0)->cells[2]));
  assert_int_equal(live.tile(0)->time_ds[2], 30);
  sent = tiles_sent();
  assert_int_equal(sent.size(), 1);
  assert_int_equal(sent[0][0], 1);
  assert_int_equal(sent[0].size(),
                   leadline::host::kTileHeader_bytes + leadline::host::kPageTile_bytes);

  // Another map knows nothing of it.
  feed(&receiver, packet(delta, tag, TileScale::kCoarse));
  TileDelta other = coarse_tile(1);
  set_coarse(&other, 0, 16, 700);
  feed(&receiver, packet(other, tag, TileScale::kCoarse));
  assert_int_equal(receiver.coarse().tiles(), 1);
  Hello next = hello;
  next.session = 2;
  feed(&receiver, framed(payload, encode_hello(next, payload, sizeof payload).value()));
  assert_int_equal(receiver.coarse().tiles(), 0);
}

}  // namespace
