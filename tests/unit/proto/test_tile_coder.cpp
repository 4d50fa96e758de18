#include <algorithm>

#include "proto/framing.hpp"
#include "proto/tile_coder.hpp"
#include "tests/support/proto_samples.hpp"
#include "tests/support/test.hpp"

namespace {

using leadline::test::all_cells;
using leadline::test::Bytes;
using leadline::test::from_hex;
using leadline::test::Random;
using leadline::test::sample_tile;
using leadline::test::spec_bytes;
using leadline::test::Tile;
using namespace leadline::proto;  // NOLINT: every name of the header is under test
using BaseStatus = leadline::base::Status;

constexpr std::uint16_t kTag = 0x1234;

TileUpdate update_of(std::uint32_t tile, const Tile& cells, const CellMask& changed) {
  TileUpdate update{};
  update.tile = tile;
  update.generation = 300;
  update.cells = cells.data();
  update.changed = changed;
  return update;
}

Bytes packet_of(const TileUpdate& update) {
  Bytes payload(kMaxPayload_bytes);
  CellMask taken{};
  const auto size = encode_tile(update, kTag, payload.data(), payload.size(), taken);
  assert_true(size.ok());
  assert_memory_equal(taken.rows, update.changed.rows, sizeof taken.rows);
  payload.resize(size.value());
  return payload;
}

BaseStatus status_of(const Bytes& payload) {
  TilePacketDecoder packet;
  const BaseStatus opened = packet.open(payload.data(), payload.size());
  TileDelta delta;
  while (packet.next(delta)) {
  }
  return opened != BaseStatus::kOk ? opened : packet.status();
}

TEST(one_cell_is_as_specified) {
  Tile cells{};
  cells[0] = code_cell(1000, 1024, 0);
  CellMask changed{};
  changed.set(0);
  const Bytes payload = packet_of(update_of(7, cells, changed));
  assert_true(payload == spec_bytes("Tag `1234`, tile 7, generation 300"));
  TilePacketDecoder packet;
  assert_int_equal(static_cast<int>(packet.open(payload.data(), payload.size())), 0);
  assert_int_equal(packet.survey_tag(), kTag);
  assert_int_equal(packet.tile_count(), 1);
  TileDelta delta;
  assert_true(packet.next(delta));
  assert_int_equal(delta.tile, 7);
  assert_int_equal(delta.generation, 300);
  assert_int_equal(delta.cell_count, 1);
  assert_int_equal(delta.hash32, fold_hash(tile_hash(cells.data())));
  assert_int_equal(delta.cells[0], cells[0]);
  assert_false(packet.next(delta));
  assert_int_equal(static_cast<int>(packet.status()), 0);
}

TEST(a_whole_tile_is_as_specified) {
  const Tile cells = sample_tile();
  assert_true(packet_of(update_of(7, cells, all_cells())) == spec_bytes("The same tag, tile 7"));
}

TEST(two_tiles_are_as_specified) {
  const Tile cells = sample_tile();
  const Tile unknown{};
  Bytes payload(200);
  TilePacketEncoder packet(payload.data(), payload.size(), kTag);
  assert_int_equal(packet.size_bytes(), 0);
  CellMask taken{};
  TileUpdate first = update_of(7, cells, {});
  first.generation = 1;
  for (const int cell : {17, 18, 34}) {
    first.changed.set(cell);
  }
  assert_int_equal(packet.add(first, taken).value(), 3);
  TileUpdate second = update_of(6, unknown, {});
  second.generation = 2;
  second.changed.set(255);
  assert_int_equal(packet.add(second, taken).value(), 1);
  const std::size_t promised = packet.size_bytes();
  payload.resize(packet.finish());
  assert_true(payload == spec_bytes("Two tiles: 17, 18 and 34"));
  assert_in_range(promised, payload.size(), payload.size() + 2);
  assert_int_equal(packet.finish(), 0);
  assert_int_equal(static_cast<int>(packet.add(first, taken).status()),
                   static_cast<int>(BaseStatus::kFull));
}

TEST(start_values_stand_in_the_specification) {
  TileModel model{};
  start_tile_model(model);
  const auto* bits = reinterpret_cast<const BitModel*>(&model);
  std::size_t index = 0;
  std::string row;
  for (const char c : leadline::test::spec_block("### Tile model") + "\n") {
    if (c != '\n') {
      row += c;
      continue;
    }
    // Names stand at the margin, numbers do not.
    const Bytes values = row.rfind("  ", 0) == 0 ? from_hex(row.substr(2) + " ") : Bytes{};
    for (const std::uint8_t value : values) {
      assert_int_equal(bits[index].fast_q15, 128 * value);
      assert_int_equal(bits[index].slow_q15, 128 * value);
      ++index;
    }
    row.clear();
  }
  assert_int_equal(index, kTileModels);
}

TEST(what_cannot_be_sent_is_refused) {
  Tile cells = sample_tile();
  Bytes payload(1000);
  CellMask taken{};
  const auto refusal = [&](const TileUpdate& update, std::size_t capacity) {
    return static_cast<int>(encode_tile(update, kTag, payload.data(), capacity, taken).status());
  };
  const int invalid = static_cast<int>(BaseStatus::kInvalidArgument);
  assert_int_equal(refusal(update_of(7, cells, {}), 1000), invalid);
  assert_int_equal(refusal(update_of(kMaxTiles, cells, all_cells()), 1000), invalid);
  cells[9] = 0x00000100;
  assert_int_equal(refusal(update_of(7, cells, all_cells()), 1000), invalid);
  CellMask others = all_cells();
  others.rows[0] = 0;
  assert_int_equal(refusal(update_of(7, cells, others), 1000), 0);  // it is not among the changed
  cells[9] = 0;
  for (std::size_t capacity = 0; capacity < 13; ++capacity) {
    assert_int_equal(refusal(update_of(7, cells, all_cells()), capacity),
                     static_cast<int>(BaseStatus::kFull));
  }
}

TEST(a_packet_holds_so_many_tiles_and_no_more) {
  const Tile cells = sample_tile();
  Bytes payload(kMaxPayload_bytes);
  TilePacketEncoder packet(payload.data(), payload.size(), kTag);
  CellMask one{};
  one.set(40);
  CellMask taken{};
  for (std::uint32_t i = 0; i < kMaxPacketTiles; ++i) {
    assert_true(packet.add(update_of(kMaxTiles - 1 - i * 500'000, cells, one), taken).ok());
  }
  assert_int_equal(packet.tile_count(), kMaxPacketTiles);
  assert_int_equal(static_cast<int>(packet.add(update_of(1, cells, one), taken).status()),
                   static_cast<int>(BaseStatus::kFull));
  payload.resize(packet.finish());
  TilePacketDecoder reader;
  assert_int_equal(static_cast<int>(reader.open(payload.data(), payload.size())), 0);
  TileDelta delta;
  for (std::uint32_t i = 0; i < kMaxPacketTiles; ++i) {
    assert_true(reader.next(delta));
    assert_int_equal(delta.tile, kMaxTiles - 1 - i * 500'000);
    assert_int_equal(delta.cells[40], cells[40]);
  }
  assert_false(reader.next(delta));
  assert_int_equal(static_cast<int>(reader.status()), 0);
}

TEST(a_tile_that_does_not_fit_is_cut_and_the_parts_make_it_whole) {
  Random random;
  for (int i = 0; i < 300; ++i) {
    Tile cells{};
    for (auto& cell : cells) {
      cell = code_cell(static_cast<std::int32_t>(random.between(0, 200'000)),
                       static_cast<std::uint32_t>(random.between(64, 4096)), 0);
    }
    Tile received{};
    CellMask left = all_cells();
    const auto capacity = static_cast<std::size_t>(random.between(40, 200));
    int packets = 0;
    while (left.count() > 0) {
      Bytes payload(capacity);
      CellMask taken{};
      const auto size =
          encode_tile(update_of(3, cells, left), kTag, payload.data(), capacity, taken);
      assert_true(size.ok());
      assert_true(size.value() <= capacity);
      // A packet that is not the last is full: no cell of these costs more than some bytes.
      assert_true(taken.count() == left.count() || size.value() + 8 >= capacity);
      TilePacketDecoder packet;
      assert_int_equal(static_cast<int>(packet.open(payload.data(), size.value())), 0);
      TileDelta delta;
      assert_true(packet.next(delta));
      assert_memory_equal(delta.changed.rows, taken.rows, sizeof taken.rows);
      apply_delta(delta, received.data());
      for (std::size_t row = 0; row < kTileSide_cells; ++row) {
        left.rows[row] = static_cast<std::uint16_t>(left.rows[row] & ~taken.rows[row]);
      }
      const bool whole = fold_hash(tile_hash(received.data())) == delta.hash32;
      assert_int_equal(whole, left.count() == 0);
      ++packets;
    }
    assert_true(received == cells);
    assert_true(packets > 1);
  }
}

TEST(a_tile_that_did_not_fit_leaves_the_packet_as_it_was) {
  const Tile cells = sample_tile();
  CellMask few{};
  few.set(5);
  few.set(6);
  for (std::size_t capacity = 20; capacity < 90; ++capacity) {
    Bytes alone(capacity);
    Bytes tried(capacity);
    CellMask taken{};
    TilePacketEncoder first(alone.data(), capacity, kTag);
    TilePacketEncoder second(tried.data(), capacity, kTag);
    if (!first.add(update_of(1, cells, few), taken).ok()) {
      continue;
    }
    assert_true(second.add(update_of(1, cells, few), taken).ok());
    const auto whole = second.add_whole(update_of(3, cells, all_cells()), taken);
    if (whole.ok()) {
      assert_int_equal(whole.value(), kTileArea_cells);
      continue;
    }
    const auto more = second.add(update_of(2, cells, all_cells()), taken);
    if (more.ok()) {
      assert_true(more.value() == taken.count());
      continue;
    }
    alone.resize(first.finish());
    tried.resize(second.finish());
    assert_true(alone == tried);
  }
}

/// Whether the payload is taken; if so, that encoding its cells gives the same body again. (Nearly every
/// body says some cells: what protects a packet is its frame's CRC, and the tile's hash.)
bool taken_and_canonical(const Bytes& payload) {
  TilePacketDecoder packet;
  TileDelta delta;
  if (packet.open(payload.data(), payload.size()) != BaseStatus::kOk || !packet.next(delta)) {
    return false;
  }
  TileUpdate update{};
  update.tile = delta.tile;
  update.generation = delta.generation;
  update.cells = delta.cells;
  update.changed = delta.changed;
  Bytes again = packet_of(update);
  assert_int_equal(again.size(), payload.size());
  constexpr std::ptrdiff_t kHash_at = 7;  // behind a tile number of one byte, a generation of two
  std::copy_n(payload.begin() + kHash_at, 4, again.begin() + kHash_at);
  assert_true(again == payload);
  return true;
}

TEST(a_packet_that_is_longer_is_refused) {
  const Bytes payload = packet_of(update_of(7, sample_tile(), all_cells()));
  assert_true(taken_and_canonical(payload));
  for (int byte = 0; byte < 256; ++byte) {
    Bytes longer = payload;
    longer.push_back(static_cast<std::uint8_t>(byte));
    assert_int_equal(static_cast<int>(status_of(longer)),
                     static_cast<int>(BaseStatus::kBadChecksum));
  }
}

TEST(a_packet_that_is_cut_is_refused_or_another_packet) {
  const Bytes payload = packet_of(update_of(7, sample_tile(), all_cells()));
  for (std::size_t size = 0; size < payload.size(); ++size) {
    const Bytes cut(payload.begin(), payload.begin() + static_cast<std::ptrdiff_t>(size));
    const bool taken = taken_and_canonical(cut);
    assert_true(!taken || size >= 12);
  }
}

TEST(bad_headers_are_refused) {
  const Bytes payload = packet_of(update_of(7, sample_tile(), all_cells()));
  const auto with = [&payload](std::size_t at, std::uint8_t value) {
    Bytes changed = payload;
    changed[at] = value;
    return static_cast<int>(status_of(changed));
  };
  assert_int_equal(with(0, 0x03), static_cast<int>(BaseStatus::kInvalidArgument));
  assert_int_equal(with(3, 0), static_cast<int>(BaseStatus::kOutOfRange));
  assert_int_equal(with(3, 33), static_cast<int>(BaseStatus::kOutOfRange));
  assert_int_equal(with(4, 0x01), static_cast<int>(BaseStatus::kOutOfRange));  // tile -1
  assert_int_equal(static_cast<int>(status_of({})), static_cast<int>(BaseStatus::kInvalidArgument));
  assert_int_equal(static_cast<int>(status_of({0x02, 0, 0})),
                   static_cast<int>(BaseStatus::kTruncated));
  // Tile 2^24, and a number that would wrap.
  for (const Bytes& tile : {Bytes{0x80, 0x80, 0x80, 0x10}, Bytes{0xFE, 0xFF, 0xFF, 0xFF, 0x0F},
                            Bytes{0xFF, 0xFF, 0xFF, 0xFF, 0x0F}}) {
    Bytes changed = {0x02, 0, 0, 1};
    changed.insert(changed.end(), tile.begin(), tile.end());
    changed.insert(changed.end(), {0, 0, 0, 0, 0, 0});
    assert_int_equal(static_cast<int>(status_of(changed)),
                     static_cast<int>(BaseStatus::kOutOfRange));
  }
  TilePacketDecoder unopened;
  TileDelta delta;
  assert_false(unopened.next(delta));
}

TEST(a_tile_that_became_unknown_costs_nothing_but_its_header) {
  const Tile unknown{};
  assert_int_equal(packet_of(update_of(7, unknown, all_cells())).size(), 12);
}

TEST(any_body_is_refused_or_canonical) {
  // One value throughout runs into every "more" there is.
  int refused = 0;
  for (int fill = 0; fill < 256; ++fill) {
    for (std::size_t size = 1; size < 60; ++size) {
      Bytes payload = {0x02, 0x34, 0x12, 1, 0, 0x80, 0x01, 0, 0, 0, 0, 0xFF};
      payload.insert(payload.end(), size, static_cast<std::uint8_t>(fill));
      refused += taken_and_canonical(payload) ? 0 : 1;
    }
  }
  assert_in_range(refused, 1000, 256 * 59);
}

TEST(changed_cells_are_those_that_differ) {
  Tile before = sample_tile();
  Tile after = before;
  assert_int_equal(changed_cells(before.data(), after.data()).count(), 0);
  after[0] = kUnknownCell;
  after[255] = code_cell(5, 64, 0);
  const CellMask changed = changed_cells(before.data(), after.data());
  assert_int_equal(changed.count(), 2);
  assert_true(changed.test(0) && changed.test(255) && !changed.test(100));
}

TEST(largest_payload_of_an_mtu) {
  assert_int_equal(max_payload_bytes(0), 0);
  for (std::size_t mtu = frame_bound_bytes(0) + 1; mtu < 4500; ++mtu) {
    const std::size_t payload = max_payload_bytes(mtu);
    assert_true(frame_bound_bytes(payload) <= mtu);
    assert_true(payload == kMaxPayload_bytes || frame_bound_bytes(payload + 1) > mtu);
  }
}

}  // namespace
