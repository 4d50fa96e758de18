// Tile deltas: changed cells of tiles, in as few bytes as one packet that stands alone allows. Bit by
// bit in proto/SPEC.md, "Tile delta"; what it reaches in README.md.
//
// A packet is the payload of one frame. It holds the changed cells of one or more tiles; cells are
// predicted from others of the same packet only, so a lost packet costs its own cells and nothing else.
// Integer arithmetic, fixed buffers, work bounded by cells and bytes. One object per packet.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "model/base/status.hpp"
#include "proto/cell.hpp"
#include "proto/tile_model.hpp"
#include "proto/wire.hpp"

namespace leadline::proto {

/// Which map a packet speaks of: the map itself, or its coarse picture (coarse.hpp), whose tiles have no hash.
enum class TileScale : std::uint8_t { kFine, kCoarse };

/// Most tiles of one packet.
inline constexpr int kMaxPacketTiles = 32;
/// Largest tile number + 1.
inline constexpr std::uint32_t kMaxTiles = 1U << 24U;

/// A set of cells of a tile: bit e of rows[n].
struct CellMask {
  std::uint16_t rows[kTileSide_cells];

  [[nodiscard]] bool test(int cell) const {
    return ((static_cast<unsigned>(rows[cell >> 4]) >> static_cast<unsigned>(cell & 15)) & 1U) != 0;
  }
  void set(int cell) {
    rows[cell >> 4] = static_cast<std::uint16_t>(rows[cell >> 4] | (1U << (cell & 15)));
  }
  /// 0 .. 256.
  [[nodiscard]] int count() const {
    int sum = 0;
    for (const std::uint16_t row : rows) {
      sum += __builtin_popcount(row);
    }
    return sum;
  }
};

/// Cells in which two states of a tile differ: O(tile).
[[nodiscard]] CellMask changed_cells(const CodedCell* before, const CodedCell* after);

/// What the sender wants told about one tile.
struct TileUpdate {
  std::uint32_t tile;  ///< < kMaxTiles; row-major over the tiles of the grid, north first
  std::uint32_t
      generation;  ///< goes up (modulo 2^32) from packet to packet of the tile; this sender: number of the frame
  const CodedCell* cells;  ///< all 256, as they are now: valid cells (cell_valid)
  CellMask changed;        ///< which of them to send; at least one
};

/// What a packet's later cells know of the cells before them, over tiles.
struct PacketMemory {
  std::int32_t depth_q8 = 0;
  int sigma_code = 8;
};

/// Fills one packet with the changes of one tile after the other, until it is full.
///
///   TilePacketEncoder packet(payload, capacity, tag);
///   while (... && packet.add(update, taken).ok()) { mark `taken` of update.tile as sent; }
///   size = packet.finish();
///
/// A tile that does not fit whole is cut: its first cells in north-major order go into this packet
/// (`taken`), the caller sends the rest in the next.
class TilePacketEncoder {
 public:
  /// `out` takes at most `capacity_bytes` (for an MTU: max_payload_bytes(mtu)); capacities beyond
  /// kMaxPayload_bytes are used up to that.
  TilePacketEncoder(std::uint8_t* out, std::size_t capacity_bytes, std::uint16_t survey_tag,
                    TileScale scale = TileScale::kFine);

  /// Adds as many of update's changed cells as fit and tells which: the number, > 0, and `taken`, a
  /// subset of update.changed. O(tile), a few times. Else nothing is taken and the packet is unchanged:
  /// * kFull: not one cell fits, kMaxPacketTiles are in, or the packet is finished
  /// * kInvalidArgument: no changed cell, a tile number or a changed cell out of range
  [[nodiscard]] base::Result<int> add(const TileUpdate& update, CellMask& taken) {
    return add(update, 1, taken);
  }
  /// The same, and kFull unless all of them fit.
  [[nodiscard]] base::Result<int> add_whole(const TileUpdate& update, CellMask& taken) {
    return add(update, update.changed.count(), taken);
  }

  /// Bytes of the packet so far; 0 while it has no cell. Within one byte of what finish() gives.
  [[nodiscard]] std::size_t size_bytes() const;
  [[nodiscard]] int tile_count() const { return tile_count_; }

  /// Completes the payload at `out` and returns its size; 0 when nothing was added. The object takes
  /// nothing more afterwards.
  [[nodiscard]] std::size_t finish();

 private:
  static constexpr std::size_t kTileHeaderBound_bytes = 15;

  [[nodiscard]] base::Result<int> add(const TileUpdate& update, int least_cells, CellMask& taken);
  [[nodiscard]] bool put_cells(const TileUpdate& update, int cell_count, std::size_t capacity_bytes,
                               CellMask& taken, int& fitting);

  std::uint8_t* out_;
  std::size_t capacity_bytes_;
  std::uint16_t survey_tag_;
  TileScale scale_;
  int tile_count_ = 0;
  std::uint32_t last_tile_ = 0;
  std::size_t header_bytes_ = 0;
  std::array<std::uint8_t, kMaxPacketTiles * kTileHeaderBound_bytes> headers_;
  bool finished_ = false;
  RangeEncoder coder_;
  PacketMemory memory_;
  TileModel model_;
};

/// One tile alone in a packet. Payload size in bytes, `taken` as with TilePacketEncoder::add, or its
/// errors.
[[nodiscard]] base::Result<std::size_t> encode_tile(const TileUpdate& update,
                                                    std::uint16_t survey_tag, std::uint8_t* out,
                                                    std::size_t capacity_bytes, CellMask& taken);

/// What one packet says about one tile.
struct TileDelta {
  std::uint32_t tile;
  std::uint32_t generation;
  /// fold_hash(tile_hash) of the sender's whole tile: equals the receiver's after applying, when the
  /// receiver has missed nothing and the tile was not cut. 0 in a coarse packet.
  std::uint32_t hash32;
  int cell_count;                    ///< 1 .. 256
  CellMask changed;                  ///< cell_count bits
  CodedCell cells[kTileArea_cells];  ///< valid where changed, kUnknownCell elsewhere
};

/// Writes the changed cells over `tile_cells` (256). O(tile).
void apply_delta(const TileDelta& delta, CodedCell* tile_cells);

/// Reads the packet of one frame.
///
///   TilePacketDecoder packet;
///   if (packet.open(payload, size) != Status::kOk) { count it; }
///   while (packet.next(delta)) { apply }
///   if (packet.status() != Status::kOk) { count it }   // what came before was whole
///
/// Never reads outside the payload, whatever is in it. A payload that encode made decodes to the same
/// cells; one that is cut, longer or not in canonical form ends in an error status.
class TilePacketDecoder {
 public:
  /// Checks type and headers; `payload` must stay as it is until the last next(). O(tiles).
  /// * kInvalidArgument: not a tile delta of that scale
  /// * kTruncated: ends inside the headers
  /// * kOutOfRange: a count or tile number out of range
  [[nodiscard]] base::Status open(const std::uint8_t* payload, std::size_t size_bytes,
                                  TileScale scale = TileScale::kFine);

  [[nodiscard]] std::uint16_t survey_tag() const { return survey_tag_; }
  [[nodiscard]] int tile_count() const { return tile_count_; }

  /// The next tile; false at the end or at the first error. O(tile). The last tile is delivered only
  /// when the packet was used up exactly.
  [[nodiscard]] bool next(TileDelta& delta);
  /// kOk while nothing was wrong. kOutOfRange: a cell that cannot be; kBadChecksum: the body is not the
  /// one that encoding the same cells gives (cut, longer, changed).
  [[nodiscard]] base::Status status() const { return status_; }

 private:
  [[nodiscard]] base::Status read_header(ByteReader& fields, std::uint32_t last_tile,
                                         TileDelta& delta) const;

  ByteReader headers_{nullptr, 0};  ///< those of the tiles to come
  std::uint16_t survey_tag_ = 0;
  TileScale scale_ = TileScale::kFine;
  int tile_count_ = 0;
  int tiles_done_ = 0;
  std::uint32_t last_tile_ = 0;
  base::Status status_ = base::Status::kNotReady;
  RangeDecoder coder_;
  PacketMemory memory_;
  TileModel model_{};
};

}  // namespace leadline::proto
