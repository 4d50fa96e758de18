// The recorded log: frames of proto/framing, one record each, the downlink's own frames among them as
// they were sent. Bit by bit in proto/SPEC.md, "Log".
//
//   log = header, config pieces, table pieces, the same once more, then per cycle: its chunks, the cycle
//         record, the downlink frames that it made; gaps where something was lost; end
//
// A log that is cut at any byte loses at most its last record; a byte that changed costs one record.
// Encoders and decoders keep the rules of messages.hpp; spans of decoded records point into the payload.
#pragma once

#include <cstddef>
#include <cstdint>

#include "model/base/status.hpp"
#include "model/base/units.hpp"
#include "proto/framing.hpp"
#include "proto/messages.hpp"

namespace leadline::proto {

/// Version of the log's own records. Readers read every version ever released.
inline constexpr std::uint16_t kLogFormat = 1;
inline constexpr int kMaxLogTables = 8;

/// Bytes that a record carries: a piece of a blob, or a chunk of input.
struct LogBytes {
  const std::uint8_t* data;
  std::uint32_t size_bytes;
};
/// Longest piece of configuration or table in one record, and longest chunk of input.
inline constexpr std::size_t kMaxLogPiece_bytes = 4080;
inline constexpr std::size_t kMaxLogChunk_bytes = 4080;

struct LogBlob {
  std::uint32_t crc;  ///< CRC-32C of all its bytes
  std::uint32_t size_bytes;
};

struct LogHeader {
  std::uint16_t format;  ///< 1 .. kLogFormat
  std::uint8_t protocol_major;
  std::uint8_t protocol_minor;
  std::uint32_t schema_hash;
  std::uint64_t survey_id;
  std::uint32_t session;
  base::TimeUs t_us;    ///< vehicle time of the first cycle
  std::int64_t utc_us;  ///< since 1970 at that time; 0 = not known
  LogBlob config;
  std::uint8_t table_count;  ///< 0 .. kMaxLogTables
  LogBlob tables[kMaxLogTables];
};

/// A piece of the configuration blob (its layout: firmware/pipeline) or of a table.
struct LogPiece {
  std::uint8_t table;  ///< tables: 0 .. kMaxLogTables - 1; configuration: 0
  std::uint32_t offset_bytes;
  LogBytes bytes;  ///< 1 .. kMaxLogPiece_bytes
};

/// Bytes of one port that arrived together, taken in cycle `cycle`, whose record follows its chunks.
struct LogChunk {
  std::uint32_t cycle;
  base::TimeUs t_arrival_us;
  std::uint8_t port;
  LogBytes bytes;  ///< 0 .. kMaxLogChunk_bytes
};

enum LogCycleFlags : std::uint16_t {
  kLogCycleIdle = 1U << 0U,  ///< informative: nothing came in
};

struct LogCycle {
  std::uint32_t cycle;  ///< from 0, one more each; wraps
  base::TimeUs t_us;
  std::uint32_t downlink_room_bytes;
  std::uint16_t chunk_count;  ///< chunks of this cycle, in order, right before
  std::uint16_t flags;        ///< LogCycleFlags
};

enum class LogGapReason : std::uint8_t {
  kRingFull = 0,  ///< the recorder could not keep up
  kDiskFull = 1,
  kWriteError = 2,
  kRestart = 3,  ///< the recorder was closed and opened again
};

struct LogGap {
  base::TimeUs t_us;
  LogGapReason reason;
  std::uint32_t lost_records;
  std::uint64_t lost_bytes;
};

struct LogEnd {
  base::TimeUs t_us;
  std::uint32_t cycle_count;
  std::uint64_t map_hash;    ///< model's, over all voxels
  std::uint64_t cells_hash;  ///< cell.hpp, over all tiles as coded
  std::uint64_t link_hash;   ///< 64-bit FNV-1a over all downlink bytes in order
  std::uint64_t pings_in;    ///< decoded
  std::uint64_t pings_fused;
  std::uint64_t pings_shed;
  std::uint64_t pings_rejected;  ///< all other outcomes
  std::uint64_t cells_sent;
  std::uint64_t downlink_bytes;
};

[[nodiscard]] base::Result<std::size_t> encode_log_header(const LogHeader& header,
                                                          std::uint8_t* out,
                                                          std::size_t capacity_bytes);
/// kInvalidArgument also for a wrong magic; kBadVersion: a format or protocol major that this reader
/// does not know.
[[nodiscard]] base::Result<LogHeader> decode_log_header(const std::uint8_t* payload,
                                                        std::size_t size_bytes);
/// `type`: kLogConfig or kLogTable.
[[nodiscard]] base::Result<std::size_t> encode_log_piece(MessageType type, const LogPiece& piece,
                                                         std::uint8_t* out,
                                                         std::size_t capacity_bytes);
[[nodiscard]] base::Result<LogPiece> decode_log_piece(const std::uint8_t* payload,
                                                      std::size_t size_bytes);
[[nodiscard]] base::Result<std::size_t> encode_log_chunk(const LogChunk& chunk, std::uint8_t* out,
                                                         std::size_t capacity_bytes);
[[nodiscard]] base::Result<LogChunk> decode_log_chunk(const std::uint8_t* payload,
                                                      std::size_t size_bytes);
[[nodiscard]] base::Result<std::size_t> encode_log_cycle(const LogCycle& cycle, std::uint8_t* out,
                                                         std::size_t capacity_bytes);
[[nodiscard]] base::Result<LogCycle> decode_log_cycle(const std::uint8_t* payload,
                                                      std::size_t size_bytes);
[[nodiscard]] base::Result<std::size_t> encode_log_gap(const LogGap& gap, std::uint8_t* out,
                                                       std::size_t capacity_bytes);
[[nodiscard]] base::Result<LogGap> decode_log_gap(const std::uint8_t* payload,
                                                  std::size_t size_bytes);
[[nodiscard]] base::Result<std::size_t> encode_log_end(const LogEnd& end, std::uint8_t* out,
                                                       std::size_t capacity_bytes);
[[nodiscard]] base::Result<LogEnd> decode_log_end(const std::uint8_t* payload,
                                                  std::size_t size_bytes);

/// Writes whole frames, back to back, into a span of the caller (who empties it: disk, ring). Nothing is
/// written in part: kFull leaves the span as it was. Errors of the encoders are passed on. O(bytes).
class LogWriter {
 public:
  LogWriter(std::uint8_t* out, std::size_t capacity_bytes)
      : out_(out), capacity_bytes_(capacity_bytes) {}

  [[nodiscard]] base::Status header(const LogHeader& header);
  /// The whole blob, in as many records as it takes. All or nothing.
  [[nodiscard]] base::Status config(const std::uint8_t* blob, std::size_t size_bytes);
  [[nodiscard]] base::Status table(std::uint8_t table, const std::uint8_t* blob,
                                   std::size_t size_bytes);
  [[nodiscard]] base::Status chunk(const LogChunk& chunk);
  [[nodiscard]] base::Status cycle(const LogCycle& cycle);
  [[nodiscard]] base::Status gap(const LogGap& gap);
  [[nodiscard]] base::Status end(const LogEnd& end);
  /// Downlink frames as sent, whole: copied as they are.
  [[nodiscard]] base::Status frames(const std::uint8_t* frames, std::size_t size_bytes);

  [[nodiscard]] const std::uint8_t* data() const { return out_; }
  [[nodiscard]] std::size_t size_bytes() const { return size_bytes_; }
  /// Starts again at the front of the span.
  void clear() { size_bytes_ = 0; }

 private:
  [[nodiscard]] base::Status put(const base::Result<std::size_t>& payload_bytes);
  [[nodiscard]] base::Status pieces(MessageType type, std::uint8_t table, const std::uint8_t* blob,
                                    std::size_t size_bytes);

  std::uint8_t* out_;
  std::size_t capacity_bytes_;
  std::size_t size_bytes_ = 0;
  std::uint8_t payload_[kMaxPayload_bytes] = {};
};

/// Bytes that LogWriter needs at most for a blob of that size.
constexpr std::size_t log_blob_bound_bytes(std::size_t blob_bytes) {
  return (blob_bytes / kMaxLogPiece_bytes + 1) * frame_bound_bytes(kMaxPayload_bytes);
}

/// A record as it stands in the log: payload by type, valid until the next call of next().
struct LogRecord {
  MessageType type;
  const std::uint8_t* payload;
  std::size_t payload_bytes;
  /// Something between the record before and this one could not be read.
  bool gap_before;
};

struct LogReaderCounters {
  std::uint32_t records;        ///< delivered
  std::uint32_t unknown_types;  ///< skipped: a newer minor's
  std::uint32_t gaps;           ///< places where frames were damaged or missing
};

/// Yields the records of a log from bytes in pieces of any size.
///   while (size > 0) { if (reader.next(data, size, used, record)) use(record); data += used; ... }
class LogReader {
 public:
  /// Forgets everything: the next byte is the first of another log.
  void reset();
  [[nodiscard]] bool next(const std::uint8_t* data, std::size_t size_bytes,
                          std::size_t& consumed_bytes, LogRecord& record);
  [[nodiscard]] const LogReaderCounters& counters() const { return counters_; }
  [[nodiscard]] const FrameCounters& frame_counters() const { return buffer_.decoder().counters(); }
  /// Whether the bytes so far end inside a record: a log that was cut, when no more bytes come.
  [[nodiscard]] bool mid_record() const { return buffer_.decoder().mid_frame(); }

 private:
  FrameDecoderBuffer<> buffer_;
  LogReaderCounters counters_{};
  std::uint32_t bad_frames_ = 0;  ///< of the decoder, when last looked
  bool gap_ = false;              ///< something was lost since the last record
};

}  // namespace leadline::proto
