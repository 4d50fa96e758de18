// What frames say. Every message is one frame's payload: type, then fields, little-endian. Bit by bit in
// proto/SPEC.md; sizes and limits here.
//
// Encoders check what they are given (what `out` holds after an error is of no use); decoders check
// every field against its range and never trust a length. Rules for all of them, after "type" matched:
//   encode_x(message, out, capacity)   bytes written; kFull: no room; kOutOfRange: a field out of range
//   decode_x(payload, size)            kInvalidArgument: another type; kTruncated: shorter than its
//                                      fields; kOutOfRange: a field out of range
// Bytes behind the last field known here belong to a newer minor and are ignored. No state, reentrant,
// O(bytes).
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/base/status.hpp"
#include "model/base/units.hpp"
#include "proto/cell.hpp"

namespace leadline::proto {

/// Version of the messages. A peer of another major refuses; a minor adds fields at the end or types.
inline constexpr std::uint8_t kProtocolMajor = 1;
inline constexpr std::uint8_t kProtocolMinor = 1;

/// First byte of every payload. 0x01..0x3f downlink, 0x40..0x7f uplink, 0x80..0xff log only.
enum class MessageType : std::uint8_t {
  kHello = 0x01,
  kTileDelta = 0x02,  ///< tile_coder.hpp
  kStatus = 0x03,
  kText = 0x04,
  kBrief = 0x05,
  kDigest = 0x06,         ///< minor 1
  kCommandAnswer = 0x07,  ///< minor 1; commands.hpp, as are the next and kCommand
  kSlice = 0x08,          ///< minor 1
  kCoarseDelta = 0x09,    ///< minor 1; tile_coder.hpp, coarse.hpp
  kQuestion = 0x0A,       ///< minor 1
  kResendRequest = 0x40,
  kHelloRequest = 0x41,
  kReport = 0x42,         ///< minor 1
  kDigestRequest = 0x43,  ///< minor 1
  kLook = 0x44,           ///< minor 1
  kCommand = 0x45,        ///< minor 1
  kLogHeader = 0x80,      ///< log.hpp, all of 0x80 on
  kLogConfig = 0x81,
  kLogTable = 0x82,
  kLogChunk = 0x83,
  kLogCycle = 0x84,
  kLogGap = 0x85,
  kLogEnd = 0x86,
};

/// Type of a payload; false when it is empty or the type is not one of the above (skip and count it).
[[nodiscard]] bool message_type(const std::uint8_t* payload, std::size_t size_bytes,
                                MessageType& type);

// --- Hello: who speaks, and what the numbers of all other messages mean

inline constexpr int kMaxHelloTables = 8;
inline constexpr std::size_t kMaxHelloText_bytes = 64;

/// A name of the configuration, as much of it as the link's frames hold.
struct HelloText {
  std::uint8_t size_bytes;         ///< 0 .. kMaxHelloText_bytes; 0: none
  char text[kMaxHelloText_bytes];  ///< UTF-8, not terminated, no control characters
};

/// CRC-32C of the schema text in SPEC.md: two ends that share it share every field of every message.
[[nodiscard]] std::uint32_t schema_hash();
/// The text itself (ASCII, lines end with \n); never null.
[[nodiscard]] const char* schema_text();

struct Hello {
  std::uint8_t protocol_major;  ///< kProtocolMajor
  std::uint8_t protocol_minor;
  std::uint8_t tile_side_cells;  ///< kTileSide_cells
  std::uint8_t table_count;      ///< 0 .. kMaxHelloTables
  std::uint32_t schema_hash;     ///< schema_hash()
  std::uint64_t survey_id;
  std::uint32_t session;       ///< differs whenever the vehicle starts over with an empty map
  std::uint32_t config_crc;    ///< CRC-32C of the configuration blob
  std::int32_t cell_mm;        ///< 1 .. 1'000'000
  std::int32_t size_cells[3];  ///< north, east 1 .. 16000, down 1 .. 2048
  std::int64_t origin_mm[3];   ///< NED of the grid's numerically lowest corner, +-2^40
  /// Where NED has its zero. Without has_geodetic_origin the two numbers are 0 and mean nothing.
  std::uint8_t has_geodetic_origin;  ///< 0, 1
  std::int64_t latitude_e9deg;       ///< +-90e9
  std::int64_t longitude_e9deg;      ///< +-180e9
  std::int32_t epsg;                 ///< of the projection to export to, 0 = none, 0 .. 999999
  std::uint32_t table_crc[kMaxHelloTables];  ///< localization tables in use; 0 beyond table_count
  /// From minor 1 on; empty and 0 in a hello of minor 0, and not written into one.
  HelloText survey_name;
  HelloText vertical_datum;         ///< what depth 0 means
  std::uint32_t link_rate_bytes_s;  ///< most that the vehicle puts into the downlink; 0: not said
};

/// A hello without tables and with both texts empty.
inline constexpr std::size_t kLeastHello_bytes = 92;
inline constexpr std::size_t kMaxHello_bytes =
    kLeastHello_bytes + std::size_t{4} * kMaxHelloTables + 2 * kMaxHelloText_bytes;

/// Sets the texts (null is ""; at most kMaxHelloText_bytes of each are read), as much of them as a payload
/// of `payload_bytes` has room for beside the rest of the hello: first the datum, which every depth needs, then
/// the name, each cut without splitting a character.
void name_survey(Hello& hello, const char* survey_name, const char* vertical_datum,
                 std::size_t payload_bytes);

/// Tag that tile deltas and resend requests carry instead of survey and session: both ends compute it.
[[nodiscard]] std::uint16_t survey_tag(std::uint64_t survey_id, std::uint32_t session);

/// kBadVersion when protocol_major is not ours (checked before anything else of it).
[[nodiscard]] base::Result<Hello> decode_hello(const std::uint8_t* payload, std::size_t size_bytes);
[[nodiscard]] base::Result<std::size_t> encode_hello(const Hello& hello, std::uint8_t* out,
                                                     std::size_t capacity_bytes);

// --- Status: how the vehicle fares. Counters count since its start and wrap at 2^32

enum Alarm : std::uint32_t {
  kAlarmMappingPaused = 1U << 0U,  ///< pings are not written, by policy (navigation too poor)
  kAlarmNoPose = 1U << 1U,         ///< no valid pose now
  kAlarmPortLost = 1U << 2U,       ///< a configured port is closed
  kAlarmPortSilent = 1U << 3U,     ///< a port is open and says nothing intelligible
  kAlarmRecorderLost = 1U << 4U,   ///< the recorder lost records, or has no disk
  kAlarmShed = 1U << 5U,           ///< pings were shed in the last status interval
  kAlarmQueueFull = 1U << 6U,      ///< the queue of pending pings is full
  kAlarmLinkBehind = 1U << 7U,     ///< changes wait for longer than the link can carry them
  kAlarmTimeStepped = 1U << 8U,    ///< time went back, and was clamped
  kAlarmOutsideGrid = 1U << 9U,    ///< the vehicle is outside the grid
  kAlarmInputDropped = 1U << 10U,  ///< device bytes were dropped for want of room
  kAlarmPoseEpoch = 1U << 11U,     ///< navigation jumped: a new epoch since the last status
  kAlarmRestarted = 1U << 12U,     ///< the vehicle failed and started over, with an empty map
  kAlarmLeak = 1U << 13U,          ///< a leak switch is wet
  kAlarmStopped = 1U << 14U,       ///< the survey was stopped by a command: nothing is mapped
  kAlarmForeignTopside =
      1U << 15U,                   ///< a topside of another major asked in the last minute: refused
  kAlarmStoreFailing = 1U << 16U,  ///< the vehicle's store does not take the map's pages
};

inline constexpr int kMaxStatusPorts = 8;
/// What became of pings, in the order of model::PingResult, and two of the pipeline's own.
inline constexpr int kPingOutcomes = 16;
enum PingOutcome : std::uint8_t {
  kPingFused = 0,
  kPingNoReturn = 1,
  kPingRangeTooShort = 2,
  kPingRangeTooLong = 3,
  kPingPoseInvalid = 4,
  kPingTooFar = 5,
  kPingNotDetected = 6,  ///< a profile without a detection
  kPingNotConfigured = 7,
  kPingShed = 8,      ///< the queue was full
  kPingNoPose = 9,    ///< no pose at its time, after waiting
  kPingBad = 10,      ///< fields out of range
  kPingPaused = 11,   ///< mapping was paused
  kPingStopped = 12,  ///< the survey was stopped by a command
};

/// A beam of now, from where the pose is.
struct BeamOfNow {
  std::uint8_t azimuth_bam8;    ///< 2^8 = one turn, from north to east
  std::int8_t depression_bam8;  ///< -64 up .. 64 straight down
  std::uint16_t range_dm;       ///< to the return; saturates
};

inline constexpr int kMaxSwathBeams = 2;

/// The first and the last mapped beam of the newest transmission: of a single beam one, of a fan its edges.
struct Swath {
  std::uint8_t beam_count;  ///< 0 .. kMaxSwathBeams
  BeamOfNow beams[kMaxSwathBeams];
};

inline constexpr std::size_t kMaxSwath_bytes = 1 + 5 * kMaxSwathBeams;

struct PortStatus {
  std::uint8_t state;           ///< 0 closed, 1 open
  std::uint32_t bytes_in;       ///< low 32 bits
  std::uint32_t records;        ///< decoded
  std::uint32_t bad_frames;     ///< dropped by the codec, all reasons
  std::uint32_t dropped_bytes;  ///< for want of room, both directions
};

struct Status {
  base::TimeUs t_us;  ///< of the cycle
  std::uint32_t cycle;
  std::uint32_t alarms;  ///< Alarm bits; unknown bits are a newer minor's

  /// The newest pose. Units are the wire's; sigmas saturate.
  base::TimeUs pose_t_us;
  std::uint8_t pose_validity;  ///< base::PoseValidity bits
  std::uint16_t pose_epoch;
  std::int32_t position_mm[3];  ///< NED
  std::uint16_t roll_bam16;     ///< 2^16 = one turn
  std::uint16_t pitch_bam16;
  std::uint16_t heading_bam16;
  std::uint16_t sigma_position_cm[3];
  std::uint16_t sigma_attitude_urad16[3];  ///< units of 16 microradians

  std::uint32_t work_last_voxels;   ///< written in the last cycle
  std::uint32_t work_max_voxels;    ///< most in any cycle
  std::uint32_t work_bound_voxels;  ///< no cycle can write more; 0: said by minor 0, none
  std::uint32_t cycle_last_us;      ///< time that the last cycle took; 0 where nobody measures
  std::uint32_t cycle_max_us;

  std::uint32_t
      pings[kPingOutcomes];     ///< by PingOutcome; their sum is what came in and left the queue
  std::uint32_t pings_pending;  ///< in the queue now
  std::uint32_t nav_fused;
  std::uint32_t nav_rejected;

  std::uint32_t tiles_known;   ///< with at least one known cell
  std::uint32_t tiles_dirty;   ///< with changes that were not sent yet
  std::uint32_t cells_sent;    ///< changed cells in tile deltas
  std::uint32_t link_bytes;    ///< put into the downlink, framing included
  std::uint32_t queued_bytes;  ///< in the downlink buffer now
  std::uint32_t uplink_frames;
  std::uint32_t uplink_bad;     ///< frames dropped, and messages not understood
  std::uint32_t recorder_lost;  ///< records that the recorder lost

  std::uint8_t port_count;  ///< 0 .. kMaxStatusPorts
  PortStatus ports[kMaxStatusPorts];
  Swath swath;  ///< from minor 1 on; no beam in a status of minor 0
};

inline constexpr std::size_t kMaxStatus_bytes =
    64 + 5 * 40 + 21 * kMaxStatusPorts + kMaxSwath_bytes;

[[nodiscard]] base::Result<std::size_t> encode_status(const Status& status, std::uint8_t* out,
                                                      std::size_t capacity_bytes);
[[nodiscard]] base::Result<Status> decode_status(const std::uint8_t* payload,
                                                 std::size_t size_bytes);

// --- Brief: what of a status the pilot and the topside want at once; most statuses are briefs

struct Brief {
  std::uint32_t t_ms;  ///< of the cycle: t_us / 1000 modulo 2^32
  std::uint32_t alarms;
  std::uint8_t pose_validity;         ///< base::PoseValidity bits
  std::int32_t position_cm[3];        ///< NED, rounded towards 0
  std::uint16_t heading_bam16;        ///< 2^16 = one turn
  std::uint16_t sigma_horizontal_cm;  ///< larger of north and east; saturates
  std::uint32_t pings_fused;
  std::uint32_t tiles_known;
  std::uint32_t tiles_dirty;
  std::uint32_t cells_sent;
  Swath swath;  ///< from minor 1 on; no beam in a brief of minor 0
};

inline constexpr std::size_t kMaxBrief_bytes = 51 + kMaxSwath_bytes;

[[nodiscard]] Brief brief_of(const Status& status);
/// What the brief says of them becomes the status's fields; the others stay. Its time stays within 2^31 ms of
/// the status's.
void apply_brief(const Brief& brief, Status& status);
[[nodiscard]] base::Result<std::size_t> encode_brief(const Brief& brief, std::uint8_t* out,
                                                     std::size_t capacity_bytes);
[[nodiscard]] base::Result<Brief> decode_brief(const std::uint8_t* payload, std::size_t size_bytes);

// --- Text: a line for the pilot

inline constexpr std::size_t kMaxText_bytes = 200;

enum class Severity : std::uint8_t { kInfo = 0, kWarning = 1, kError = 2 };

struct Text {
  base::TimeUs t_us;
  Severity severity;
  std::uint8_t size_bytes;    ///< 0 .. kMaxText_bytes
  char text[kMaxText_bytes];  ///< UTF-8, not terminated, no control characters
};

/// Whether all of it is UTF-8 without control characters. O(bytes).
[[nodiscard]] bool clean_text(const char* text, std::size_t size_bytes);
/// `text` cut at kMaxText_bytes without splitting a character. Null is "".
[[nodiscard]] Text make_text(base::TimeUs t_us, Severity severity, const char* text);
/// kOutOfRange also for bytes that are not UTF-8 and for control characters.
[[nodiscard]] base::Result<std::size_t> encode_text(const Text& text, std::uint8_t* out,
                                                    std::size_t capacity_bytes);
[[nodiscard]] base::Result<Text> decode_text(const std::uint8_t* payload, std::size_t size_bytes);

// --- Resend request (uplink): tiles that the topside wants again. It sets dirty bits, nothing else

inline constexpr int kMaxResendRanges = 64;

/// Tiles first .. first + count - 1.
struct TileRange {
  std::uint32_t first;
  std::uint32_t count;  ///< 1 .. kMaxTiles
};

struct ResendRequest {
  std::uint16_t survey_tag;
  std::uint8_t range_count;            ///< 0 .. kMaxResendRanges
  TileRange ranges[kMaxResendRanges];  ///< ascending, apart from each other by at least one tile
};

inline constexpr std::size_t kMaxResendRequest_bytes = 4 + 8 * kMaxResendRanges;

[[nodiscard]] base::Result<std::size_t> encode_resend_request(const ResendRequest& request,
                                                              std::uint8_t* out,
                                                              std::size_t capacity_bytes);
[[nodiscard]] base::Result<ResendRequest> decode_resend_request(const std::uint8_t* payload,
                                                                std::size_t size_bytes);

// --- Hello request (uplink): a topside that knows no hello asks for one, and which version it speaks

/// The fields came with minor 1: a request without them is one of 1.0.
struct HelloRequest {
  std::uint8_t protocol_major;
  std::uint8_t protocol_minor;
};

inline constexpr std::size_t kHelloRequest_bytes = 3;

/// One of this version.
[[nodiscard]] base::Result<std::size_t> encode_hello_request(std::uint8_t* out,
                                                             std::size_t capacity_bytes);
/// kBadVersion when its major is not ours.
[[nodiscard]] base::Result<HelloRequest> decode_hello_request(const std::uint8_t* payload,
                                                              std::size_t size_bytes);

// --- Digest: hashes over ranges of tiles, so that two ends find where they differ in a few packets

inline constexpr int kMaxDigestHashes = 64;
inline constexpr std::uint8_t kMaxDigestLog2 = 24;

/// Hash k is of the tiles [first + k * 2^tiles_log2, first + (k + 1) * 2^tiles_log2) of the grid, as the
/// vehicle's link map has them.
struct Digest {
  std::uint16_t survey_tag;
  std::uint32_t first;      ///< < kMaxTiles
  std::uint8_t tiles_log2;  ///< 0 .. kMaxDigestLog2
  std::uint8_t hash_count;  ///< 1 .. kMaxDigestHashes
  std::uint32_t hashes[kMaxDigestHashes];
};

inline constexpr std::size_t kMaxDigest_bytes = 1 + 2 + 5 + 1 + 1 + 4 * kMaxDigestHashes;

/// Hash of a range of one tile: the tile's hash32 (fold_hash of tile_hash). Of more: FNV-1a over their hash32
/// in order, four bytes each, least significant first, folded. Begin with kFnvOffset.
[[nodiscard]] std::uint64_t add_digest_tile(std::uint64_t hash, std::uint32_t tile_hash32);

[[nodiscard]] base::Result<std::size_t> encode_digest(const Digest& digest, std::uint8_t* out,
                                                      std::size_t capacity_bytes);
[[nodiscard]] base::Result<Digest> decode_digest(const std::uint8_t* payload,
                                                 std::size_t size_bytes);

// --- Report (uplink): frames of cells that came, by the generation of their tiles. What it leaves out was lost or is
// under way

inline constexpr int kMaxReportMask_bytes = 32;

struct Report {
  std::uint16_t survey_tag;
  bool asked;  ///< answers a question: what of numbers up to `newest` did not come was lost
  std::uint16_t newest;     ///< the newest that came or was asked for: its number, modulo 2^16
  std::uint8_t mask_bytes;  ///< 0 .. kMaxReportMask_bytes
  /// Bit i, from the lowest of the first byte on: number newest - i came.
  std::uint8_t mask[kMaxReportMask_bytes];

  [[nodiscard]] bool came(std::uint32_t before_newest) const {
    return ((static_cast<unsigned>(mask[before_newest / 8]) >> (before_newest % 8)) & 1U) != 0;
  }
};

inline constexpr std::size_t kMaxReport_bytes = 6 + kMaxReportMask_bytes;

[[nodiscard]] base::Result<std::size_t> encode_report(const Report& report, std::uint8_t* out,
                                                      std::size_t capacity_bytes);
[[nodiscard]] base::Result<Report> decode_report(const std::uint8_t* payload,
                                                 std::size_t size_bytes);

// --- Question: the vehicle has nothing else to say, and asks for a report

struct Question {
  std::uint16_t survey_tag;
  std::uint16_t newest;  ///< number of the newest frame of cells that left, modulo 2^16
};

inline constexpr std::size_t kQuestion_bytes = 5;

[[nodiscard]] base::Result<std::size_t> encode_question(const Question& question, std::uint8_t* out,
                                                        std::size_t capacity_bytes);
[[nodiscard]] base::Result<Question> decode_question(const std::uint8_t* payload,
                                                     std::size_t size_bytes);

// --- Digest request (uplink): hashes of a range, as fine as one digest has room for

struct DigestRequest {
  std::uint16_t survey_tag;
  TileRange range;
};

inline constexpr std::size_t kMaxDigestRequest_bytes = 3 + 2 * 5;

[[nodiscard]] base::Result<std::size_t> encode_digest_request(const DigestRequest& request,
                                                              std::uint8_t* out,
                                                              std::size_t capacity_bytes);
[[nodiscard]] base::Result<DigestRequest> decode_digest_request(const std::uint8_t* payload,
                                                                std::size_t size_bytes);

// --- Look (uplink): where the topside looks. These tiles go before others, nothing else

struct Look {
  std::uint16_t survey_tag;
  std::uint32_t tile;         ///< in the middle; < kMaxTiles
  std::uint8_t radius_tiles;  ///< 0: looks nowhere any more
};

inline constexpr std::size_t kMaxLook_bytes = 3 + 5 + 1;

[[nodiscard]] base::Result<std::size_t> encode_look(const Look& look, std::uint8_t* out,
                                                    std::size_t capacity_bytes);
[[nodiscard]] base::Result<Look> decode_look(const std::uint8_t* payload, std::size_t size_bytes);

}  // namespace leadline::proto
