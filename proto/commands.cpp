#include "proto/commands.hpp"

#include <cstring>

#include "proto/tile_coder.hpp"
#include "proto/wire.hpp"

namespace leadline::proto {
namespace {

using base::Result;

constexpr std::int64_t kMaxOrigin_mm = std::int64_t{1} << 40U;
constexpr std::uint32_t kMaxSliceCell = 16'384;
// A run of one level: its length less one above the level; 15 there, and what is over 16 follows.
constexpr std::uint32_t kLongRun = 16;

bool box_in_range(const SliceBox& box) {
  bool good =
      static_cast<std::uint8_t>(box.plane) <= static_cast<std::uint8_t>(SlicePlane::kEast) &&
      box.rows >= 1 && box.rows <= kMaxSliceSide && box.columns >= 1 &&
      box.columns <= kMaxSliceSide;
  for (const std::uint32_t first : box.first) {
    good = good && first < kMaxSliceCell;
  }
  return good;
}

void put_box(const SliceBox& box, ByteWriter& fields) {
  fields.u8(static_cast<std::uint8_t>(box.plane));
  for (const std::uint32_t first : box.first) {
    fields.varint(first);
  }
  fields.u8(box.rows);
  fields.u8(box.columns);
}

SliceBox take_box(ByteReader& fields) {
  SliceBox box{};
  box.plane = static_cast<SlicePlane>(fields.u8());
  for (std::uint32_t& first : box.first) {
    first = fields.varint();
  }
  box.rows = fields.u8();
  box.columns = fields.u8();
  return box;
}

bool tiles_in_range(const TileRange& tiles) {
  return tiles.first < kMaxTiles && tiles.count >= 1 && tiles.count <= kMaxTiles - tiles.first;
}

bool origin_in_range(const Command& command) {
  bool good = command.centred <= 1;
  for (const std::int64_t mm : command.origin_mm) {
    good = good && mm >= -kMaxOrigin_mm && mm <= kMaxOrigin_mm && (command.centred == 0 || mm == 0);
  }
  return good;
}

bool command_in_range(const Command& command) {
  switch (command.kind) {
    case CommandKind::kStart:
      return command.name.size_bytes <= kMaxHelloText_bytes &&
             clean_text(command.name.text, command.name.size_bytes);
    case CommandKind::kSet:
      return static_cast<std::uint8_t>(command.parameter) >= 1 &&
             static_cast<std::uint8_t>(command.parameter) <= kCommandParameters;
    case CommandKind::kOrigin:
      return origin_in_range(command);
    case CommandKind::kTiles:
      return tiles_in_range(command.tiles);
    case CommandKind::kSlice:
      return box_in_range(command.slice);
    case CommandKind::kStop:
    case CommandKind::kSave:
      return true;
  }
  return false;
}

void put_body(const Command& command, ByteWriter& fields) {
  fields.u8(static_cast<std::uint8_t>(command.kind));
  if (command.kind == CommandKind::kStart) {
    fields.u8(command.name.size_bytes);
    fields.bytes(command.name.text, command.name.size_bytes);
  } else if (command.kind == CommandKind::kSet) {
    fields.u8(static_cast<std::uint8_t>(command.parameter));
    fields.i32(command.value);
  } else if (command.kind == CommandKind::kOrigin) {
    fields.u8(command.centred);
    for (const std::int64_t mm : command.origin_mm) {
      fields.i64(mm);
    }
  } else if (command.kind == CommandKind::kTiles) {
    fields.varint(command.tiles.first);
    fields.varint(command.tiles.count - 1);
  } else if (command.kind == CommandKind::kSlice) {
    put_box(command.slice, fields);
  }
}

base::Status take_name(ByteReader& fields, HelloText& name) {
  name.size_bytes = fields.u8();
  if (!fields.truncated() && name.size_bytes > kMaxHelloText_bytes) {
    return base::Status::kOutOfRange;
  }
  const std::uint8_t* const bytes = fields.bytes(name.size_bytes);
  if (bytes != nullptr && name.size_bytes > 0) {
    std::memcpy(name.text, bytes, name.size_bytes);
  }
  return base::Status::kOk;
}

}  // namespace

SliceCell slice_cell(const SliceBox& box, std::uint32_t row, std::uint32_t column) {
  SliceCell cell{box.first[0], box.first[1], box.first[2]};
  std::uint32_t& rows = box.plane == SlicePlane::kHorizontal ? cell.north : cell.down;
  std::uint32_t& columns = box.plane == SlicePlane::kNorth ? cell.north : cell.east;
  rows += row;
  columns += column;
  return cell;
}

Result<CommandView> read_command(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (size_bytes == 0 || fields.u8() != static_cast<std::uint8_t>(MessageType::kCommand)) {
    return base::Status::kInvalidArgument;
  }
  if (size_bytes < kCommandHeader_bytes + 1 + kCommandTag_bytes) {
    return base::Status::kTruncated;
  }
  if (fields.u8() != kCommandVersion) {
    return base::Status::kBadVersion;
  }
  if (size_bytes > kMaxCommand_bytes) {
    return base::Status::kOutOfRange;
  }
  CommandView view{};
  view.header.key_id = fields.u32();
  view.header.vehicle = fields.u16();
  view.header.counter = fields.u64();
  if (view.header.vehicle == 0 || view.header.counter == 0) {
    return base::Status::kOutOfRange;
  }
  view.covered = payload;
  view.covered_bytes = size_bytes - kCommandTag_bytes;
  view.body = payload + kCommandHeader_bytes;
  view.body_bytes = view.covered_bytes - kCommandHeader_bytes;
  view.tag = payload + view.covered_bytes;
  return view;
}

Result<std::size_t> encode_command_body(const Command& command, std::uint8_t* out,
                                        std::size_t capacity_bytes) {
  if (!command_in_range(command)) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  put_body(command, fields);
  return fields.result();
}

Result<std::size_t> encode_command(const CommandHeader& header, const Command& command,
                                   std::uint8_t* out, std::size_t capacity_bytes) {
  if (header.vehicle == 0 || header.counter == 0 || !command_in_range(command)) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(MessageType::kCommand));
  fields.u8(kCommandVersion);
  fields.u32(header.key_id);
  fields.u16(header.vehicle);
  fields.u64(header.counter);
  put_body(command, fields);
  return fields.result();
}

Result<Command> decode_command_body(const std::uint8_t* body, std::size_t size_bytes) {
  ByteReader fields(body, size_bytes);
  Command command{};
  command.kind = static_cast<CommandKind>(fields.u8());
  if (command.kind == CommandKind::kStart) {
    const base::Status status = take_name(fields, command.name);
    if (status != base::Status::kOk) {
      return status;
    }
  } else if (command.kind == CommandKind::kSet) {
    command.parameter = static_cast<CommandParameter>(fields.u8());
    command.value = fields.i32();
  } else if (command.kind == CommandKind::kOrigin) {
    command.centred = fields.u8();
    for (std::int64_t& mm : command.origin_mm) {
      mm = fields.i64();
    }
  } else if (command.kind == CommandKind::kTiles) {
    command.tiles.first = fields.varint();
    // Beyond every range where it would wrap.
    command.tiles.count = fields.varint() + 1U;
  } else if (command.kind == CommandKind::kSlice) {
    command.slice = take_box(fields);
  }
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  if (fields.left_bytes() != 0 || !command_in_range(command)) {
    return base::Status::kOutOfRange;
  }
  return command;
}

Result<std::size_t> encode_command_answer(const CommandAnswer& answer, std::uint8_t* out,
                                          std::size_t capacity_bytes) {
  if (answer.counter == 0 || static_cast<std::uint8_t>(answer.result) >= kCommandResults) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(MessageType::kCommandAnswer));
  fields.u32(answer.key_id);
  fields.u64(answer.counter);
  fields.u8(static_cast<std::uint8_t>(answer.result));
  fields.bytes(answer.tag, sizeof answer.tag);
  return fields.result();
}

Result<CommandAnswer> decode_command_answer(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (size_bytes == 0 || fields.u8() != static_cast<std::uint8_t>(MessageType::kCommandAnswer)) {
    return base::Status::kInvalidArgument;
  }
  CommandAnswer answer{};
  answer.key_id = fields.u32();
  answer.counter = fields.u64();
  answer.result = static_cast<CommandResult>(fields.u8());
  const std::uint8_t* const tag = fields.bytes(sizeof answer.tag);
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  std::memcpy(answer.tag, tag, sizeof answer.tag);
  if (answer.counter == 0 || static_cast<std::uint8_t>(answer.result) >= kCommandResults) {
    return base::Status::kOutOfRange;
  }
  return answer;
}

// --- Slices

std::uint8_t slice_level(std::uint16_t hit, std::uint16_t miss) {
  const std::uint32_t all = std::uint32_t{hit} + miss;
  return all == 0 ? std::uint8_t{0}
                  : static_cast<std::uint8_t>(1U + (kMaxSliceLevel - 1U) * hit / all);
}

SliceWriter::SliceWriter(const SlicePart& part, std::uint8_t* out, std::size_t capacity_bytes)
    : out_(out), capacity_(capacity_bytes), columns_(part.box.columns) {
  ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(MessageType::kSlice));
  fields.u16(part.survey_tag);
  fields.u32(part.request);
  put_box(part.box, fields);
  fields.u8(part.first_row);
  count_at_ = fields.size_bytes();
  fields.u8(0);
  size_ = fields.full() ? capacity_ : fields.size_bytes();
}

bool SliceWriter::add_row(const std::uint8_t* levels) {
  ByteWriter fields(out_ + size_, capacity_ - size_);
  std::uint32_t at = 0;
  while (at < columns_) {
    std::uint32_t run = 1;
    while (at + run < columns_ && levels[at + run] == levels[at]) {
      ++run;
    }
    const std::uint32_t code = run < kLongRun ? run - 1 : kLongRun - 1;
    fields.u8(static_cast<std::uint8_t>(levels[at] | (code << 4U)));
    if (run >= kLongRun) {
      fields.varint(run - kLongRun);
    }
    at += run;
  }
  if (fields.full()) {
    return false;
  }
  size_ += fields.size_bytes();
  ++rows_;
  out_[count_at_] = rows_;
  return true;
}

namespace {

// One row of `columns` levels; false: runs that do not end where it ends.
bool take_row(ByteReader& fields, std::uint32_t columns, std::uint8_t* levels) {
  std::uint32_t at = 0;
  while (at < columns && fields.status() == base::Status::kOk) {
    const std::uint32_t code = fields.u8();
    const std::uint32_t high = code >> 4U;
    const std::uint32_t over = high == kLongRun - 1 ? fields.varint() : 0;
    if (over > columns || high + 1 + over > columns - at) {
      return false;
    }
    std::memset(levels + at, static_cast<int>(code & kMaxSliceLevel), high + 1 + over);
    at += high + 1 + over;
  }
  return true;
}

}  // namespace

Result<SlicePart> decode_slice(const std::uint8_t* payload, std::size_t size_bytes,
                               std::uint8_t* levels) {
  ByteReader fields(payload, size_bytes);
  if (size_bytes == 0 || fields.u8() != static_cast<std::uint8_t>(MessageType::kSlice)) {
    return base::Status::kInvalidArgument;
  }
  SlicePart part{};
  part.survey_tag = fields.u16();
  part.request = fields.u32();
  part.box = take_box(fields);
  part.first_row = fields.u8();
  part.row_count = fields.u8();
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  if (!box_in_range(part.box) || part.row_count == 0 || part.first_row >= part.box.rows ||
      part.row_count > part.box.rows - part.first_row) {
    return base::Status::kOutOfRange;
  }
  for (std::uint32_t row = 0; row < part.row_count; ++row) {
    if (!take_row(fields, part.box.columns, levels + std::size_t{row} * part.box.columns)) {
      return base::Status::kOutOfRange;
    }
  }
  if (fields.status() != base::Status::kOk) {
    return fields.status();
  }
  return part;
}

}  // namespace leadline::proto
