// What the program around the vehicle tells it of commands (proto/SPEC.md, "Command"): one that was authenticated and
// whose counter is safe, or how many were refused. It reaches the vehicle as a chunk of input on kCommandPort, so that
// it stands in the log as every input does: a replay needs neither key nor counter. Nothing that comes over the
// link ever becomes such a chunk but through CommandGate.
//
// A chunk is one event:
//   command   1, key_id u32, counter u64, answer tags u8[8][8] by result, body of the command up to the chunk's end
//   repeated  2, key_id u32, counter u64, answer tags u8[8][8]: the last one again, to be answered again
//   tally     3, key_id u32, refused u32[8] by CommandRefusal, since the program's start: the vehicle has a key
#pragma once

#include <cstddef>
#include <cstdint>

#include "proto/commands.hpp"

namespace leadline::firmware {

/// Port number of these events in InputChunk::port.
inline constexpr std::uint8_t kCommandPort = 252;

/// Why a command was dropped, in the order in which it is looked at.
enum class CommandRefusal : std::uint8_t {
  kMalformed = 0,  ///< too short, too long, a field out of range
  kVersion = 1,    ///< of another version
  kKey = 2,        ///< made with another key
  kVehicle = 3,    ///< meant for another vehicle
  kCounter = 4,    ///< its counter, or a later one, was used before
  kTooMany = 5,    ///< more tags to check than there is time for
  kTag = 6,        ///< its tag is wrong
  kNotSaved = 7,   ///< its counter could not be brought to the disk
};
inline constexpr std::size_t kCommandRefusals = 8;
/// For a text to the pilot.
[[nodiscard]] const char* command_refusal_text(CommandRefusal refusal);

enum class CommandEventKind : std::uint8_t { kCommand = 1, kRepeated = 2, kTally = 3 };

struct CommandEvent {
  CommandEventKind kind;
  std::uint32_t key_id;
  std::uint64_t counter;  ///< kCommand, kRepeated
  std::uint8_t answer_tags[proto::kCommandResults][proto::kAnswerTag_bytes];
  const std::uint8_t* body;  ///< kCommand: span into the event
  std::size_t body_bytes;
  std::uint32_t refused[kCommandRefusals];  ///< kTally: low 32 bits
};

inline constexpr std::size_t kMaxCommandEvent_bytes =
    1 + 4 + 8 + sizeof CommandEvent::answer_tags + proto::kMaxCommandBody_bytes;

/// Bytes written; 0: no room, or a body that is too long. O(bytes).
[[nodiscard]] std::size_t encode_command_event(const CommandEvent& event, std::uint8_t* out,
                                               std::size_t capacity_bytes);
/// False when the bytes are no event. O(bytes).
[[nodiscard]] bool decode_command_event(const std::uint8_t* data, std::size_t size_bytes,
                                        CommandEvent& event);

}  // namespace leadline::firmware
