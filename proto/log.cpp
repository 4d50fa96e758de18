#include "proto/log.hpp"

#include <cstring>

#include "model/base/crc32c.hpp"
#include "model/base/fixed.hpp"
#include "proto/wire.hpp"

namespace leadline::proto {
namespace {

using Size = base::Result<std::size_t>;

constexpr std::uint32_t kMagic = 0x474F4C4CU;  // "LLOG"

void put_type(ByteWriter& fields, MessageType type) { fields.u8(static_cast<std::uint8_t>(type)); }

bool opens_as(ByteReader& fields, MessageType type) {
  return fields.left_bytes() > 0 && fields.u8() == static_cast<std::uint8_t>(type);
}

/// All that is left: records whose last field is bytes have no length of their own.
LogBytes rest_of(ByteReader& fields) {
  const auto size = static_cast<std::uint32_t>(fields.left_bytes());
  return LogBytes{fields.bytes(size), size};
}

bool piece_in_range(MessageType type, const LogPiece& piece) {
  const int most_table = type == MessageType::kLogTable ? kMaxLogTables - 1 : 0;
  return (type == MessageType::kLogTable || type == MessageType::kLogConfig) &&
         piece.table <= most_table && piece.bytes.size_bytes >= 1 &&
         piece.bytes.size_bytes <= kMaxLogPiece_bytes;
}

}  // namespace

// --- Records

Size encode_log_header(const LogHeader& header, std::uint8_t* out, std::size_t capacity_bytes) {
  if (header.format < 1 || header.format > kLogFormat || header.table_count > kMaxLogTables) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  put_type(fields, MessageType::kLogHeader);
  fields.u32(kMagic);
  fields.u16(header.format);
  fields.u8(header.protocol_major);
  fields.u8(header.protocol_minor);
  fields.u32(header.schema_hash);
  fields.u64(header.survey_id);
  fields.u32(header.session);
  fields.i64(header.t_us);
  fields.i64(header.utc_us);
  fields.u32(header.config.crc);
  fields.u32(header.config.size_bytes);
  fields.u8(header.table_count);
  for (std::size_t i = 0; i < header.table_count; ++i) {
    fields.u32(header.tables[i].crc);
    fields.u32(header.tables[i].size_bytes);
  }
  return fields.result();
}

base::Result<LogHeader> decode_log_header(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kLogHeader)) {
    return base::Status::kInvalidArgument;
  }
  if (fields.u32() != kMagic) {
    return fields.truncated() ? base::Status::kTruncated : base::Status::kInvalidArgument;
  }
  LogHeader header{};
  header.format = fields.u16();
  header.protocol_major = fields.u8();
  header.protocol_minor = fields.u8();
  if (fields.truncated()) {
    return base::Status::kTruncated;
  }
  if (header.format < 1 || header.format > kLogFormat || header.protocol_major != kProtocolMajor) {
    return base::Status::kBadVersion;
  }
  header.schema_hash = fields.u32();
  header.survey_id = fields.u64();
  header.session = fields.u32();
  header.t_us = fields.i64();
  header.utc_us = fields.i64();
  header.config.crc = fields.u32();
  header.config.size_bytes = fields.u32();
  header.table_count = fields.u8();
  if (!fields.truncated() && header.table_count > kMaxLogTables) {
    return base::Status::kOutOfRange;
  }
  for (std::size_t i = 0; i < header.table_count; ++i) {
    header.tables[i].crc = fields.u32();
    header.tables[i].size_bytes = fields.u32();
  }
  if (fields.truncated()) {
    return base::Status::kTruncated;
  }
  return header;
}

Size encode_log_piece(MessageType type, const LogPiece& piece, std::uint8_t* out,
                      std::size_t capacity_bytes) {
  if (!piece_in_range(type, piece)) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  put_type(fields, type);
  fields.u8(piece.table);
  fields.u32(piece.offset_bytes);
  fields.bytes(piece.bytes.data, piece.bytes.size_bytes);
  return fields.result();
}

base::Result<LogPiece> decode_log_piece(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  const auto type = static_cast<MessageType>(fields.u8());
  if (type != MessageType::kLogConfig && type != MessageType::kLogTable) {
    return base::Status::kInvalidArgument;
  }
  LogPiece piece{};
  piece.table = fields.u8();
  piece.offset_bytes = fields.u32();
  if (fields.truncated()) {
    return base::Status::kTruncated;
  }
  piece.bytes = rest_of(fields);
  if (!piece_in_range(type, piece)) {
    return base::Status::kOutOfRange;
  }
  return piece;
}

Size encode_log_chunk(const LogChunk& chunk, std::uint8_t* out, std::size_t capacity_bytes) {
  if (chunk.bytes.size_bytes > kMaxLogChunk_bytes) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  put_type(fields, MessageType::kLogChunk);
  fields.u32(chunk.cycle);
  fields.i64(chunk.t_arrival_us);
  fields.u8(chunk.port);
  fields.bytes(chunk.bytes.data, chunk.bytes.size_bytes);
  return fields.result();
}

base::Result<LogChunk> decode_log_chunk(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kLogChunk)) {
    return base::Status::kInvalidArgument;
  }
  LogChunk chunk{};
  chunk.cycle = fields.u32();
  chunk.t_arrival_us = fields.i64();
  chunk.port = fields.u8();
  if (fields.truncated()) {
    return base::Status::kTruncated;
  }
  chunk.bytes = rest_of(fields);
  if (chunk.bytes.size_bytes > kMaxLogChunk_bytes) {
    return base::Status::kOutOfRange;
  }
  return chunk;
}

Size encode_log_cycle(const LogCycle& cycle, std::uint8_t* out, std::size_t capacity_bytes) {
  ByteWriter fields(out, capacity_bytes);
  put_type(fields, MessageType::kLogCycle);
  fields.u32(cycle.cycle);
  fields.i64(cycle.t_us);
  fields.u32(cycle.downlink_room_bytes);
  fields.u16(cycle.chunk_count);
  fields.u16(cycle.flags);
  return fields.result();
}

base::Result<LogCycle> decode_log_cycle(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kLogCycle)) {
    return base::Status::kInvalidArgument;
  }
  LogCycle cycle{};
  cycle.cycle = fields.u32();
  cycle.t_us = fields.i64();
  cycle.downlink_room_bytes = fields.u32();
  cycle.chunk_count = fields.u16();
  cycle.flags = fields.u16();
  if (fields.truncated()) {
    return base::Status::kTruncated;
  }
  return cycle;
}

Size encode_log_gap(const LogGap& gap, std::uint8_t* out, std::size_t capacity_bytes) {
  if (gap.reason > LogGapReason::kRestart) {
    return base::Status::kOutOfRange;
  }
  ByteWriter fields(out, capacity_bytes);
  put_type(fields, MessageType::kLogGap);
  fields.i64(gap.t_us);
  fields.u8(static_cast<std::uint8_t>(gap.reason));
  fields.u32(gap.lost_records);
  fields.u64(gap.lost_bytes);
  return fields.result();
}

base::Result<LogGap> decode_log_gap(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kLogGap)) {
    return base::Status::kInvalidArgument;
  }
  LogGap gap{};
  gap.t_us = fields.i64();
  gap.reason = static_cast<LogGapReason>(fields.u8());
  gap.lost_records = fields.u32();
  gap.lost_bytes = fields.u64();
  if (fields.truncated()) {
    return base::Status::kTruncated;
  }
  if (gap.reason > LogGapReason::kRestart) {
    return base::Status::kOutOfRange;
  }
  return gap;
}

Size encode_log_end(const LogEnd& end, std::uint8_t* out, std::size_t capacity_bytes) {
  ByteWriter fields(out, capacity_bytes);
  put_type(fields, MessageType::kLogEnd);
  fields.i64(end.t_us);
  fields.u32(end.cycle_count);
  fields.u64(end.map_hash);
  fields.u64(end.cells_hash);
  fields.u64(end.link_hash);
  fields.u64(end.pings_in);
  fields.u64(end.pings_fused);
  fields.u64(end.pings_shed);
  fields.u64(end.pings_rejected);
  fields.u64(end.cells_sent);
  fields.u64(end.downlink_bytes);
  return fields.result();
}

base::Result<LogEnd> decode_log_end(const std::uint8_t* payload, std::size_t size_bytes) {
  ByteReader fields(payload, size_bytes);
  if (!opens_as(fields, MessageType::kLogEnd)) {
    return base::Status::kInvalidArgument;
  }
  LogEnd end{};
  end.t_us = fields.i64();
  end.cycle_count = fields.u32();
  end.map_hash = fields.u64();
  end.cells_hash = fields.u64();
  end.link_hash = fields.u64();
  end.pings_in = fields.u64();
  end.pings_fused = fields.u64();
  end.pings_shed = fields.u64();
  end.pings_rejected = fields.u64();
  end.cells_sent = fields.u64();
  end.downlink_bytes = fields.u64();
  if (fields.truncated()) {
    return base::Status::kTruncated;
  }
  return end;
}

// --- Writer

base::Status LogWriter::put(const Size& payload_bytes) {
  if (!payload_bytes.ok()) {
    return payload_bytes.status();
  }
  const auto frame = encode_frame(payload_, payload_bytes.value(), out_ + size_bytes_,
                                  capacity_bytes_ - size_bytes_);
  if (frame.ok()) {
    size_bytes_ += frame.value();
  }
  return frame.status();
}

base::Status LogWriter::header(const LogHeader& header) {
  return put(encode_log_header(header, payload_, sizeof payload_));
}

base::Status LogWriter::pieces(MessageType type, std::uint8_t table, const std::uint8_t* blob,
                               std::size_t size_bytes) {
  const std::size_t before = size_bytes_;
  for (std::size_t at = 0; at < size_bytes; at += kMaxLogPiece_bytes) {
    LogPiece piece{};
    piece.table = table;
    piece.offset_bytes = static_cast<std::uint32_t>(at);
    piece.bytes.data = blob + at;
    piece.bytes.size_bytes =
        static_cast<std::uint32_t>(base::min_of(kMaxLogPiece_bytes, size_bytes - at));
    const base::Status status = put(encode_log_piece(type, piece, payload_, sizeof payload_));
    if (status != base::Status::kOk) {
      size_bytes_ = before;
      return status;
    }
  }
  return base::Status::kOk;
}

base::Status LogWriter::config(const std::uint8_t* blob, std::size_t size_bytes) {
  return pieces(MessageType::kLogConfig, 0, blob, size_bytes);
}

base::Status LogWriter::table(std::uint8_t table, const std::uint8_t* blob,
                              std::size_t size_bytes) {
  return pieces(MessageType::kLogTable, table, blob, size_bytes);
}

base::Status LogWriter::chunk(const LogChunk& chunk) {
  return put(encode_log_chunk(chunk, payload_, sizeof payload_));
}

base::Status LogWriter::cycle(const LogCycle& cycle) {
  return put(encode_log_cycle(cycle, payload_, sizeof payload_));
}

base::Status LogWriter::gap(const LogGap& gap) {
  return put(encode_log_gap(gap, payload_, sizeof payload_));
}

base::Status LogWriter::end(const LogEnd& end) {
  return put(encode_log_end(end, payload_, sizeof payload_));
}

base::Status LogWriter::frames(const std::uint8_t* frames, std::size_t size_bytes) {
  if (size_bytes > capacity_bytes_ - size_bytes_) {
    return base::Status::kFull;
  }
  if (size_bytes > 0) {
    std::memcpy(out_ + size_bytes_, frames, size_bytes);
  }
  size_bytes_ += size_bytes;
  return base::Status::kOk;
}

// --- Reader

void LogReader::reset() {
  buffer_.decoder().reset();
  counters_ = LogReaderCounters{};
  bad_frames_ = buffer_.decoder().counters().bad_frames();
  gap_ = false;
}

bool LogReader::next(const std::uint8_t* data, std::size_t size_bytes, std::size_t& consumed_bytes,
                     LogRecord& record) {
  consumed_bytes = 0;
  while (consumed_bytes < size_bytes) {
    FrameView frame{};
    std::size_t used = 0;
    const bool complete =
        buffer_.decoder().feed(data + consumed_bytes, size_bytes - consumed_bytes, used, frame);
    consumed_bytes += used;
    const std::uint32_t bad_frames = buffer_.decoder().counters().bad_frames();
    if (bad_frames != bad_frames_) {
      // Frames lost side by side are one gap.
      counters_.gaps += gap_ ? 0U : 1U;
      gap_ = true;
      bad_frames_ = bad_frames;
    }
    if (!complete) {
      continue;
    }
    MessageType type{};
    if (!message_type(frame.payload, frame.payload_bytes, type)) {
      ++counters_.unknown_types;
      continue;
    }
    ++counters_.records;
    record = LogRecord{type, frame.payload, frame.payload_bytes, gap_};
    gap_ = false;
    return true;
  }
  return false;
}

}  // namespace leadline::proto
