#include "firmware/pipeline/command_event.hpp"

#include <cstring>

#include "proto/wire.hpp"

namespace leadline::firmware {

const char* command_refusal_text(CommandRefusal refusal) {
  switch (refusal) {
    case CommandRefusal::kMalformed:
      return "Command refused: malformed";
    case CommandRefusal::kVersion:
      return "Command refused: of another version";
    case CommandRefusal::kKey:
      return "Command refused: another key";
    case CommandRefusal::kVehicle:
      return "Command refused: for another vehicle";
    case CommandRefusal::kCounter:
      return "Command refused: its counter was used before";
    case CommandRefusal::kTooMany:
      return "Command refused: too many at once";
    case CommandRefusal::kTag:
      return "Command refused: not authentic";
    case CommandRefusal::kNotSaved:
      return "Command refused: its counter cannot be saved";
  }
  return "Command refused";
}

std::size_t encode_command_event(const CommandEvent& event, std::uint8_t* out,
                                 std::size_t capacity_bytes) {
  if (event.kind == CommandEventKind::kCommand && event.body_bytes > proto::kMaxCommandBody_bytes) {
    return 0;
  }
  proto::ByteWriter fields(out, capacity_bytes);
  fields.u8(static_cast<std::uint8_t>(event.kind));
  fields.u32(event.key_id);
  if (event.kind == CommandEventKind::kTally) {
    for (const std::uint32_t count : event.refused) {
      fields.u32(count);
    }
  } else {
    fields.u64(event.counter);
    fields.bytes(event.answer_tags, sizeof event.answer_tags);
    if (event.kind == CommandEventKind::kCommand) {
      fields.bytes(event.body, event.body_bytes);
    }
  }
  return fields.full() ? 0 : fields.size_bytes();
}

bool decode_command_event(const std::uint8_t* data, std::size_t size_bytes, CommandEvent& event) {
  proto::ByteReader fields(data, size_bytes);
  event = CommandEvent{};
  const std::uint8_t kind = fields.u8();
  if (kind < static_cast<std::uint8_t>(CommandEventKind::kCommand) ||
      kind > static_cast<std::uint8_t>(CommandEventKind::kTally)) {
    return false;
  }
  event.kind = static_cast<CommandEventKind>(kind);
  event.key_id = fields.u32();
  if (event.kind == CommandEventKind::kTally) {
    for (std::uint32_t& count : event.refused) {
      count = fields.u32();
    }
    return !fields.truncated();
  }
  event.counter = fields.u64();
  const std::uint8_t* const tags = fields.bytes(sizeof event.answer_tags);
  if (tags == nullptr || event.counter == 0) {
    return false;
  }
  std::memcpy(event.answer_tags, tags, sizeof event.answer_tags);
  if (event.kind == CommandEventKind::kCommand) {
    event.body_bytes = fields.left_bytes();
    event.body = fields.bytes(event.body_bytes);
    return event.body_bytes >= 1 && event.body_bytes <= proto::kMaxCommandBody_bytes;
  }
  return true;
}

}  // namespace leadline::firmware
