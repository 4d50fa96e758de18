// Tile packets of any bytes: the decoder never reads or writes outside, delivers valid cells only, and a
// packet that it takes whole has the body that encoding those cells gives. The same bytes as cells: what is
// encoded, cut over packets of any room, comes back.
#include <array>
#include <cstdint>
#include <cstring>
#include <vector>

#include "proto/framing.hpp"
#include "proto/tile_coder.hpp"
#include "tests/support/fuzz_require.hpp"

namespace {

using leadline::fuzz::require;

using namespace leadline::proto;  // NOLINT: every name of the header is under test

void decode_any(const std::uint8_t* data, std::size_t size, TileScale scale) {
  TilePacketDecoder packet;
  if (packet.open(data, size, scale) != leadline::base::Status::kOk) {
    return;
  }
  std::vector<std::uint8_t> again(kMaxPayload_bytes);
  TilePacketEncoder encoder(again.data(), again.size(), packet.survey_tag(), scale);
  TileDelta delta;
  bool all = true;
  while (packet.next(delta)) {
    require(delta.changed.count() == delta.cell_count);
    for (int cell = 0; cell < kTileArea_cells; ++cell) {
      const CodedCell value = delta.cells[cell];
      require(cell_valid(value) && (delta.changed.test(cell) || value == kUnknownCell));
    }
    const TileUpdate update{delta.tile, delta.generation, delta.cells, delta.changed};
    CellMask taken{};
    const auto added = encoder.add(update, taken);
    all = all && added.ok() && added.value() == delta.cell_count;
  }
  if (packet.status() != leadline::base::Status::kOk || !all) {
    return;
  }
  // Headers may differ in their hash only.
  const std::size_t again_bytes = encoder.finish();
  require(again_bytes == size);
  std::size_t body = 4;
  for (int tile = 0; tile < packet.tile_count(); ++tile) {
    const bool fine = scale == TileScale::kFine;
    for (int varint = 0; varint < (fine ? 2 : 1); ++varint) {
      while (data[body] >= 0x80U) {
        ++body;
      }
      ++body;
    }
    body += fine ? 5 : 1;
  }
  require(std::memcmp(again.data() + body, data + body, size - body) == 0);
}

void encode_any(const std::uint8_t* data, std::size_t size) {
  std::array<CodedCell, kTileArea_cells> cells{};
  CellMask left{};
  for (std::size_t i = 0; i < cells.size() && 4 * i + 4 < size; ++i) {
    std::uint32_t word = 0;
    std::memcpy(&word, data + 1 + 4 * i, 4);
    if ((word & 1U) != 0) {
      left.set(static_cast<int>(i));
    }
    if ((word & 2U) != 0) {
      cells[i] = code_cell(static_cast<std::int32_t>(word >> 12U), 1U << ((word >> 2U) & 31U),
                           static_cast<std::uint8_t>((word >> 7U) & 7U));
    }
  }
  const std::size_t capacity = 30 + std::size_t{data[0]};
  std::vector<std::uint8_t> payload(capacity);
  std::array<CodedCell, kTileArea_cells> received{};
  CellMask all = left;
  while (left.count() > 0) {
    CellMask taken{};
    const auto encoded =
        encode_tile({5, 6, cells.data(), left}, 7, payload.data(), capacity, taken);
    require(encoded.ok() && encoded.value() <= capacity && taken.count() > 0);
    TilePacketDecoder packet;
    require(packet.open(payload.data(), encoded.value()) == leadline::base::Status::kOk);
    TileDelta delta;
    require(packet.next(delta));
    apply_delta(delta, received.data());
    for (std::size_t row = 0; row < kTileSide_cells; ++row) {
      require((taken.rows[row] & ~left.rows[row]) == 0);
      left.rows[row] = static_cast<std::uint16_t>(left.rows[row] & ~taken.rows[row]);
    }
  }
  for (int cell = 0; cell < kTileArea_cells; ++cell) {
    const auto at = static_cast<std::size_t>(cell);
    require(received[at] == (all.test(cell) ? cells[at] : kUnknownCell));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  // On the heap, so that ASan knows the exact end.
  const std::vector<std::uint8_t> exact(data, data + size);
  const std::size_t payload_bytes = size < kMaxPayload_bytes ? size : kMaxPayload_bytes;
  decode_any(exact.data(), payload_bytes, TileScale::kFine);
  decode_any(exact.data(), payload_bytes, TileScale::kCoarse);
  encode_any(exact.data(), size);
  return 0;
}
