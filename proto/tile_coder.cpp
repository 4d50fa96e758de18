#include "proto/tile_coder.hpp"

#include <cstring>

#include "proto/framing.hpp"
#include "proto/messages.hpp"
#include "proto/tile_walk.hpp"
#include "proto/wire.hpp"

namespace leadline::proto {
namespace {

/// Type, survey tag, number of tiles.
constexpr std::size_t kPacketHeader_bytes = 4;

struct Encode {
  RangeEncoder& range;
  bool bit(BitModel& model, bool value) {
    range.put(model, value);
    return value;
  }
  std::uint32_t raw(std::uint32_t value, unsigned count) {
    range.put_raw(value, count);
    return value;
  }
};

struct Decode {
  RangeDecoder& range;
  bool bit(BitModel& model, bool /*value*/) { return range.get(model); }
  std::uint32_t raw(std::uint32_t /*value*/, unsigned count) { return range.get_raw(count); }
};

/// Differences of tile numbers as unsigned numbers, small ones small: 0, -1, 1, -2 ...
constexpr std::uint32_t zigzag(std::uint32_t from, std::uint32_t to) {
  return to >= from ? (to - from) << 1U : ((from - to) << 1U) - 1U;
}
/// `kMaxTiles` when that leads outside the tile numbers.
constexpr std::uint32_t unzigzag(std::uint32_t from, std::uint32_t code) {
  const std::uint32_t by = (code >> 1U) + (code & 1U);
  if ((code & 1U) != 0) {
    return by <= from ? from - by : kMaxTiles;
  }
  return by < kMaxTiles - from ? from + by : kMaxTiles;
}

constexpr std::uint8_t type_of(TileScale scale) {
  return static_cast<std::uint8_t>(scale == TileScale::kFine ? MessageType::kTileDelta
                                                             : MessageType::kCoarseDelta);
}

/// The first `count` of the cells.
CellMask first_cells(const CellMask& mask, int count) {
  CellMask first{};
  for (int cell = 0; cell < kTileArea_cells && count > 0; ++cell) {
    if (mask.test(cell)) {
      first.set(cell);
      --count;
    }
  }
  return first;
}

bool valid_update(const TileUpdate& update) {
  if (update.tile >= kMaxTiles || update.changed.count() == 0) {
    return false;
  }
  for (int cell = 0; cell < kTileArea_cells; ++cell) {
    if (update.changed.test(cell) && !cell_valid(update.cells[cell])) {
      return false;
    }
  }
  return true;
}

}  // namespace

CellMask changed_cells(const CodedCell* before, const CodedCell* after) {
  CellMask changed{};
  for (int cell = 0; cell < kTileArea_cells; ++cell) {
    if (before[cell] != after[cell]) {
      changed.set(cell);
    }
  }
  return changed;
}

// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): headers_ is written before it is read
TilePacketEncoder::TilePacketEncoder(std::uint8_t* out, std::size_t capacity_bytes,
                                     std::uint16_t survey_tag, TileScale scale)
    : out_(out),
      capacity_bytes_(base::min_of(capacity_bytes, kMaxPayload_bytes)),
      survey_tag_(survey_tag),
      scale_(scale) {
  start_tile_model(model_);
  if (capacity_bytes_ >= kPacketHeader_bytes) {
    coder_.start(out_ + kPacketHeader_bytes, capacity_bytes_ - kPacketHeader_bytes);
  }
}

std::size_t TilePacketEncoder::size_bytes() const {
  return tile_count_ == 0 ? 0 : kPacketHeader_bytes + header_bytes_ + coder_.needed_bytes();
}

// Walks the first `cell_count` changed cells. False when they do not fit: `fitting` are those that did
// before the body overflowed, and the coder is in no state to go on.
bool TilePacketEncoder::put_cells(const TileUpdate& update, int cell_count,
                                  std::size_t capacity_bytes, CellMask& taken, int& fitting) {
  Encode encode{coder_};
  TileWalk<Encode> walk(encode, model_, memory_);
  taken = first_cells(update.changed, cell_count);
  fitting = 0;
  walk.mask(taken, cell_count);
  for (int cell = 0; cell < kTileArea_cells; ++cell) {
    if (!taken.test(cell)) {
      continue;
    }
    CodedCell own = update.cells[cell];
    static_cast<void>(walk.cell(taken, cell, own, update.cells));
    if (coder_.needed_bytes() > capacity_bytes) {
      return false;
    }
    ++fitting;
  }
  return true;
}

base::Result<int> TilePacketEncoder::add(const TileUpdate& update, int least_cells,
                                         CellMask& taken) {
  if (!valid_update(update)) {
    return base::Status::kInvalidArgument;
  }
  std::array<std::uint8_t, kTileHeaderBound_bytes> header{};
  ByteWriter fields(header.data(), header.size());
  fields.varint(zigzag(last_tile_, update.tile));
  fields.varint(update.generation);
  if (scale_ == TileScale::kFine) {
    fields.u32(fold_hash(tile_hash(update.cells)));
  }
  const std::size_t header_bytes = fields.size_bytes() + 1;  // and the count
  const std::size_t offset = kPacketHeader_bytes + header_bytes_ + header_bytes;
  if (finished_ || tile_count_ == kMaxPacketTiles || offset >= capacity_bytes_) {
    return base::Status::kFull;
  }
  const std::size_t body_capacity = capacity_bytes_ - offset;
  // A copy is what to come back to when the cells do not fit.
  const RangeEncoder coder_before = coder_;
  const TileModel model_before = model_;
  const PacketMemory memory_before = memory_;
  int count = update.changed.count();
  int fitting = 0;
  while (!put_cells(update, count, body_capacity, taken, fitting)) {
    coder_ = coder_before;
    model_ = model_before;
    memory_ = memory_before;
    // Fewer cells have a mask of other length: what fitted may just not, hence one by one from there.
    // When the mask alone was too long nothing is known yet but that fewer may do.
    count = fitting > 0 ? base::min_of(fitting, count - 1) : count / 2;
    if (count < least_cells) {
      return base::Status::kFull;
    }
  }
  fields.u8(static_cast<std::uint8_t>(count - 1));
  std::memcpy(headers_.data() + header_bytes_, header.data(), header_bytes);
  header_bytes_ += header_bytes;
  last_tile_ = update.tile;
  ++tile_count_;
  return count;
}

std::size_t TilePacketEncoder::finish() {
  if (finished_ || tile_count_ == 0) {
    return 0;
  }
  finished_ = true;
  const std::size_t body_bytes = coder_.finish();
  // The headers' length was not known while the body grew behind them.
  const std::size_t body_at = kPacketHeader_bytes + header_bytes_;
  std::memmove(out_ + body_at, out_ + kPacketHeader_bytes, body_bytes);
  std::memcpy(out_ + kPacketHeader_bytes, headers_.data(), header_bytes_);
  ByteWriter packet(out_, kPacketHeader_bytes);
  packet.u8(type_of(scale_));
  packet.u16(survey_tag_);
  packet.u8(static_cast<std::uint8_t>(tile_count_));
  return body_at + body_bytes;
}

base::Result<std::size_t> encode_tile(const TileUpdate& update, std::uint16_t survey_tag,
                                      std::uint8_t* out, std::size_t capacity_bytes,
                                      CellMask& taken) {
  TilePacketEncoder packet(out, capacity_bytes, survey_tag);
  const auto added = packet.add(update, taken);
  if (!added.ok()) {
    return added.status();
  }
  return packet.finish();
}

void apply_delta(const TileDelta& delta, CodedCell* tile_cells) {
  for (int cell = 0; cell < kTileArea_cells; ++cell) {
    if (delta.changed.test(cell)) {
      tile_cells[cell] = delta.cells[cell];
    }
  }
}

// One tile's header into `delta`; the tile before it has number `last_tile`.
base::Status TilePacketDecoder::read_header(ByteReader& fields, std::uint32_t last_tile,
                                            TileDelta& delta) const {
  delta.tile = unzigzag(last_tile, fields.varint());
  delta.generation = fields.varint();
  if (scale_ == TileScale::kFine) {
    delta.hash32 = fields.u32();
  }
  delta.cell_count = fields.u8() + 1;
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  return delta.tile < kMaxTiles ? base::Status::kOk : base::Status::kOutOfRange;
}

base::Status TilePacketDecoder::open(const std::uint8_t* payload, std::size_t size_bytes,
                                     TileScale scale) {
  *this = TilePacketDecoder{};
  scale_ = scale;
  ByteReader fields(payload, size_bytes);
  if (size_bytes == 0 || fields.u8() != type_of(scale)) {
    return status_ = base::Status::kInvalidArgument;
  }
  survey_tag_ = fields.u16();
  const int tile_count = fields.u8();
  if (fields.truncated()) {
    return status_ = base::Status::kTruncated;
  }
  if (tile_count < 1 || tile_count > kMaxPacketTiles) {
    return status_ = base::Status::kOutOfRange;
  }
  headers_ = fields;
  std::uint32_t last_tile = 0;
  for (int i = 0; i < tile_count; ++i) {
    TileDelta delta{};
    status_ = read_header(fields, last_tile, delta);
    if (status_ != base::Status::kOk) {
      return status_;
    }
    last_tile = delta.tile;
  }
  tile_count_ = tile_count;
  start_tile_model(model_);
  coder_.start(fields.at(), fields.left_bytes());
  return base::Status::kOk;
}

bool TilePacketDecoder::next(TileDelta& delta) {
  if (status_ != base::Status::kOk || tiles_done_ == tile_count_) {
    return false;
  }
  delta = TileDelta{};
  status_ = read_header(headers_, last_tile_, delta);
  last_tile_ = delta.tile;
  ++tiles_done_;
  Decode decode{coder_};
  TileWalk<Decode> walk(decode, model_, memory_);
  walk.mask(delta.changed, delta.cell_count);
  for (int cell = 0; cell < kTileArea_cells; ++cell) {
    if (delta.changed.test(cell) &&
        !walk.cell(delta.changed, cell, delta.cells[cell], delta.cells)) {
      status_ = base::Status::kOutOfRange;
      return false;
    }
  }
  if (tiles_done_ == tile_count_ && !coder_.finished_exactly()) {
    status_ = base::Status::kBadChecksum;
    return false;
  }
  return true;
}

}  // namespace leadline::proto
