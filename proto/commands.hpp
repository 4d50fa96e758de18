// Commands to a vehicle, its answers, and slices of its voxels: bit by bit in proto/SPEC.md, "Command". The rules of
// messages.hpp hold; but a command ends where its tag ends, and bytes that nobody knows are refused: half
// understood is not what the sender meant.
//
// Nothing here knows a key. A command is read in two steps: its header (read_command), on which cheap checks and
// the tag's are done by whoever has the key (firmware/pipeline/command_gate.hpp), and then its body.
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/base/status.hpp"
#include "proto/messages.hpp"

namespace leadline::proto {

/// Of header, tag and what the tag covers. There is no other, and none without a tag.
inline constexpr std::uint8_t kCommandVersion = 1;
inline constexpr std::size_t kCommandTag_bytes = 16;
inline constexpr std::size_t kAnswerTag_bytes = 8;

enum class CommandKind : std::uint8_t {
  kStart = 1,   ///< maps (again); with a name: begins a new survey, in an empty map
  kStop = 2,    ///< maps nothing until kStart
  kSet = 3,     ///< a parameter
  kOrigin = 4,  ///< the grid lies elsewhere from now on, and begins empty
  kSave = 5,    ///< what changed goes to the store without delay
  kTiles = 6,   ///< these tiles, whole
  kSlice = 7,   ///< these voxels
};

/// What may change in flight. Ranges are those of vehicle.toml, all of them in SPEC.md.
enum class CommandParameter : std::uint8_t {
  kLinkRate = 1,        ///< bytes/s
  kMaxTileAge = 2,      ///< ms
  kStatusInterval = 3,  ///< ms
  kHelloInterval = 4,   ///< ms
  kSoundSpeed = 5,      ///< mm/s, of the water; refused where a profile of it is given
  kVoxelBudget = 6,     ///< of a cycle
  kTileBudget = 7,      ///< of a cycle
  kMaxWait = 8,         ///< ms, of a ping for its pose
  kQualityWeight = 9,   ///< percent
  kMinRange = 10,       ///< mm, of the nearest echo that is looked for in profiles
};
inline constexpr std::uint8_t kCommandParameters = 10;

enum class SlicePlane : std::uint8_t {
  kHorizontal = 0,  ///< rows to the north, columns to the east
  kNorth = 1,       ///< rows downwards, columns to the north
  kEast = 2,        ///< rows downwards, columns to the east
};

inline constexpr std::uint8_t kMaxSliceSide = 64;

/// Voxels of a plane: `rows` x `columns` of them from `first` on.
struct SliceBox {
  SlicePlane plane;
  std::uint32_t first[3];  ///< north, east, down in cells from the grid's corner, < 16'384
  std::uint8_t rows;       ///< 1 .. kMaxSliceSide
  std::uint8_t columns;    ///< the same
};

/// Voxel of row i, column j.
struct SliceCell {
  std::uint32_t north, east, down;
};
[[nodiscard]] SliceCell slice_cell(const SliceBox& box, std::uint32_t row, std::uint32_t column);

/// Which fields count follows from `kind`.
struct Command {
  CommandKind kind;
  HelloText name;              ///< kStart; size 0: none
  CommandParameter parameter;  ///< kSet
  std::int32_t value;          ///< kSet
  std::uint8_t centred;  ///< kOrigin: 1: on where the vehicle is, origin_mm is 0; 0: at origin_mm
  std::int64_t origin_mm[3];  ///< kOrigin: NED of the grid's lowest corner, +-2^40
  TileRange tiles;            ///< kTiles
  SliceBox slice;             ///< kSlice
};

struct CommandHeader {
  std::uint32_t key_id;
  std::uint16_t vehicle;  ///< 1 ..
  std::uint64_t counter;  ///< 1 .., each once with a key
};

/// A command as it stands in a payload: spans into it.
struct CommandView {
  CommandHeader header;
  const std::uint8_t* covered;  ///< what the tag covers: the payload from its type on
  std::size_t covered_bytes;
  const std::uint8_t* body;
  std::size_t body_bytes;
  const std::uint8_t* tag;  ///< kCommandTag_bytes
};

/// Type, version, key, vehicle, counter.
inline constexpr std::size_t kCommandHeader_bytes = 1 + 1 + 4 + 2 + 8;
inline constexpr std::size_t kMaxCommandBody_bytes = 2 + kMaxHelloText_bytes;
inline constexpr std::size_t kMaxCommand_bytes =
    kCommandHeader_bytes + kMaxCommandBody_bytes + kCommandTag_bytes;

/// Header and spans; the body is not looked at.
/// * kInvalidArgument: another type; kBadVersion: another version; kTruncated: no room for a body and a tag;
///   kOutOfRange: longer than any command, or vehicle or counter 0
[[nodiscard]] base::Result<CommandView> read_command(const std::uint8_t* payload,
                                                     std::size_t size_bytes);
/// Everything but the tag, which goes behind it.
[[nodiscard]] base::Result<std::size_t> encode_command(const CommandHeader& header,
                                                       const Command& command, std::uint8_t* out,
                                                       std::size_t capacity_bytes);
/// kOutOfRange also for kinds and parameters that are not known, and for bytes behind the last field.
[[nodiscard]] base::Result<Command> decode_command_body(const std::uint8_t* body,
                                                        std::size_t size_bytes);
[[nodiscard]] base::Result<std::size_t> encode_command_body(const Command& command,
                                                            std::uint8_t* out,
                                                            std::size_t capacity_bytes);

// --- Answer: what became of a command

enum class CommandResult : std::uint8_t {
  kDone = 0,
  kUnknown =
      1,  ///< a kind or parameter that this vehicle does not know, or fields that make no sense
  kOutOfRange = 2,  ///< a value outside its range
  kNotHere = 3,  ///< not with this configuration (no store, or one that holds this map; a profile)
  kNoPosition = 4,   ///< where the vehicle is, is not known
  kOutsideGrid = 5,  ///< tiles or voxels that are not in the grid
  kBusy = 6,         ///< a slice is under way
  kInterrupted =
      7,  ///< taken before the vehicle started over: perhaps done, perhaps not, not done again
};
inline constexpr std::uint8_t kCommandResults = 8;

struct CommandAnswer {
  std::uint32_t key_id;
  std::uint64_t counter;  ///< of the command
  CommandResult result;
  std::uint8_t tag[kAnswerTag_bytes];
};

inline constexpr std::size_t kCommandAnswer_bytes = 1 + 4 + 8 + 1 + kAnswerTag_bytes;

[[nodiscard]] base::Result<std::size_t> encode_command_answer(const CommandAnswer& answer,
                                                              std::uint8_t* out,
                                                              std::size_t capacity_bytes);
[[nodiscard]] base::Result<CommandAnswer> decode_command_answer(const std::uint8_t* payload,
                                                                std::size_t size_bytes);

// --- Slice: voxels, as asked for by a command

/// 0: never observed (or out of the vehicle's memory). Else 1 + 14 hit / (hit + miss): from 1, all evidence says that
/// nothing is there, to 15, all says that a surface is.
inline constexpr std::uint8_t kMaxSliceLevel = 15;
[[nodiscard]] std::uint8_t slice_level(std::uint16_t hit, std::uint16_t miss);

/// Rows of a slice; stands alone.
struct SlicePart {
  std::uint16_t survey_tag;
  std::uint32_t request;   ///< low half of the command's counter
  SliceBox box;            ///< all that was asked for
  std::uint8_t first_row;  ///< of those in this part
  std::uint8_t row_count;  ///< 1 ..
};

/// Writes the head, then rows as long as there is room.
class SliceWriter {
 public:
  /// `part.row_count` is counted here.
  SliceWriter(const SlicePart& part, std::uint8_t* out, std::size_t capacity_bytes);
  /// The next row, box.columns levels of it. False, and nothing written: no room. O(columns).
  [[nodiscard]] bool add_row(const std::uint8_t* levels);
  /// Size of the payload; 0: no row found room.
  [[nodiscard]] std::size_t finish() const { return rows_ > 0 ? size_ : 0; }
  [[nodiscard]] std::uint8_t rows() const { return rows_; }

 private:
  std::uint8_t* out_;
  std::size_t capacity_;
  std::size_t size_ = 0;
  std::size_t count_at_ = 0;
  std::uint8_t columns_;
  std::uint8_t rows_ = 0;
};

/// Head, and `levels` of row_count * columns voxels, row by row; room for all of them: kMaxSliceSide^2.
[[nodiscard]] base::Result<SlicePart> decode_slice(const std::uint8_t* payload,
                                                   std::size_t size_bytes, std::uint8_t* levels);

}  // namespace leadline::proto
