#include "firmware/pipeline/log_player.hpp"

#include <cstring>

#include "firmware/pipeline/command_event.hpp"
#include "firmware/pipeline/host_report.hpp"
#include "model/base/crc32c.hpp"
#include "model/base/fixed.hpp"

namespace leadline::firmware {
namespace {

using base::Status;
using proto::LogRecord;
using proto::MessageType;

/// Puts a piece where it belongs. False when it lies outside the blob.
bool place_piece(const proto::LogPiece& piece, std::uint8_t* blob, std::size_t size_bytes) {
  const std::size_t offset_bytes = piece.offset_bytes;
  if (offset_bytes > size_bytes || piece.bytes.size_bytes > size_bytes - offset_bytes) {
    return false;
  }
  std::memcpy(blob + offset_bytes, piece.bytes.data, piece.bytes.size_bytes);
  return true;
}

constexpr std::size_t aligned(std::size_t size_bytes) { return (size_bytes + 7) / 8 * 8; }

/// Appends text without its zero; the caller has counted the room.
char* put_text(char* out, const char* text) {
  for (; *text != '\0'; ++text) {
    *out = *text;
    ++out;
  }
  return out;
}

char* put_hash(char* out, std::uint64_t value) {
  out = put_text(out, "0x");
  for (unsigned shift = 64; shift > 0; shift -= 4) {
    *out = "0123456789abcdef"[(value >> (shift - 4U)) & 0xFU];
    ++out;
  }
  return out;
}

}  // namespace

const char* log_refusal_text(LogRefusal refusal) {
  switch (refusal) {
    case LogRefusal::kNone:
      break;
    case LogRefusal::kNoHeader:
      return "is no log of a vehicle, or its header is damaged";
    case LogRefusal::kVersion:
      return "is of another version (format or protocol) than this program reads";
    case LogRefusal::kHeader:
      return "its header is wrong";
    case LogRefusal::kTooLong:
      return "its header promises a longer configuration or more table than a vehicle of this "
             "build "
             "takes";
    case LogRefusal::kPiece:
      return "a piece of its configuration or of a table is wrong";
    case LogRefusal::kConfigDamaged:
      return "its configuration is damaged: the flight cannot be repeated";
    case LogRefusal::kConfigBad:
      return "its configuration is of no use";
    case LogRefusal::kTableDamaged:
      return "a table is damaged: the flight cannot be repeated";
  }
  return "is a log";
}

std::size_t finding_texts(const LogFindings& findings, bool has_end,
                          FindingText (&out)[kMaxFindingTexts]) {
  const FindingText counted[] = {
      {findings.damaged_places, "places in the log cannot be read"},
      {findings.missing_cycles, "cycles are missing"},
      {findings.broken_cycles, "cycles lack some of their bytes"},
      {findings.recorder_gaps, "times the recorder could not keep up or write"},
      {findings.recorder_lost, "records were lost by the recorder"},
  };
  static_assert(sizeof counted / sizeof counted[0] + 1 == kMaxFindingTexts, "and the missing end");
  std::size_t count = 0;
  for (const FindingText& finding : counted) {
    if (finding.count > 0) {
      out[count] = finding;
      ++count;
    }
  }
  if (!has_end) {
    out[count] = {
        0, findings.cut ? "the log ends in the middle of a record" : "the log has no end record"};
    ++count;
  }
  return count;
}

void LogPlayer::begin() {
  reader_.reset();
  findings_ = LogFindings{};
  refusal_ = LogRefusal::kNone;
  refusal_status_ = Status::kOk;
  refused_table_ = 0;
  has_header_ = false;
  configured_ = false;
  has_ahead_ = false;
  header_ = proto::LogHeader{};
  config_ = VehicleConfig{};
  input_ = CycleInput{};
  cycle_number_ = 0;
  cycle_whole_ = false;
  any_cycle_ = false;
  cycle_given_ = false;
  clear_chunks();
  t_us_ = 0;
  end_.reset();
}

LogEvent LogPlayer::refuse(LogRefusal refusal, Status status, std::size_t table) {
  refusal_ = refusal;
  refusal_status_ = status;
  refused_table_ = table;
  return LogEvent::kRefused;
}

LogEvent LogPlayer::feed(const std::uint8_t* data, std::size_t size_bytes,
                         std::size_t& consumed_bytes) {
  consumed_bytes = 0;
  if (refusal_ != LogRefusal::kNone) {
    consumed_bytes = size_bytes;
    return LogEvent::kRefused;
  }
  if (cycle_given_) {
    cycle_given_ = false;
    clear_chunks();
  }
  if (has_ahead_) {
    has_ahead_ = false;
    const LogEvent event = take(ahead_);
    if (event != LogEvent::kMore) {
      return event;
    }
  }
  while (consumed_bytes < size_bytes) {
    LogRecord record{};
    std::size_t used_bytes = 0;
    const bool complete =
        reader_.next(data + consumed_bytes, size_bytes - consumed_bytes, used_bytes, record);
    consumed_bytes += used_bytes;
    findings_.damaged_places = reader_.counters().gaps;
    findings_.unknown_records = reader_.counters().unknown_types;
    if (!complete) {
      continue;
    }
    ++findings_.records;
    const LogEvent event = take(record);
    if (event != LogEvent::kMore) {
      return event;
    }
  }
  return LogEvent::kMore;
}

LogEvent LogPlayer::finish() {
  if (refusal_ != LogRefusal::kNone) {
    return LogEvent::kRefused;
  }
  findings_.cut = reader_.mid_record();
  if (has_ahead_) {  // the record that told the end of the tables was the last
    has_ahead_ = false;
    return take(ahead_);
  }
  return configured_ ? LogEvent::kMore : check_preamble();
}

LogEvent LogPlayer::take(const LogRecord& record) {
  return configured_ ? take_flight(record) : take_preamble(record);
}

// --- Header, configuration, tables: there twice, what the first copy lacks comes with the second.

LogEvent LogPlayer::take_preamble(const LogRecord& record) {
  if (record.type == MessageType::kLogHeader) {
    return has_header_ ? LogEvent::kMore : take_header(record);
  }
  if (record.type == MessageType::kLogConfig || record.type == MessageType::kLogTable) {
    return has_header_ ? take_piece(record) : LogEvent::kMore;
  }
  ahead_ = record;
  has_ahead_ = true;
  return check_preamble();
}

LogEvent LogPlayer::take_header(const LogRecord& record) {
  const auto header = proto::decode_log_header(record.payload, record.payload_bytes);
  if (!header.ok()) {
    return refuse(
        header.status() == Status::kBadVersion ? LogRefusal::kVersion : LogRefusal::kHeader,
        header.status());
  }
  header_ = header.value();
  has_header_ = true;
  t_us_ = header_.t_us;
  if (header_.config.size_bytes > config_blob_.size()) {
    return refuse(LogRefusal::kTooLong, Status::kOverCapacity);
  }
  std::size_t offset_bytes = 0;
  for (std::size_t k = 0; k < header_.table_count; ++k) {
    const std::size_t size_bytes = header_.tables[k].size_bytes;
    if (size_bytes > table_bytes_.size() - offset_bytes) {
      return refuse(LogRefusal::kTooLong, Status::kOverCapacity, k);
    }
    table_offset_bytes_[k] = offset_bytes;
    tables_[k] = {table_bytes_.data() + offset_bytes, size_bytes};
    offset_bytes = base::min_of(aligned(offset_bytes + size_bytes), table_bytes_.size());
  }
  return LogEvent::kMore;
}

LogEvent LogPlayer::take_piece(const LogRecord& record) {
  const auto decoded = proto::decode_log_piece(record.payload, record.payload_bytes);
  if (!decoded.ok()) {
    return refuse(LogRefusal::kPiece, decoded.status());
  }
  const proto::LogPiece& piece = decoded.value();
  const bool table = record.type == MessageType::kLogTable;
  const bool known = !table || piece.table < header_.table_count;
  const bool placed =
      known && (table ? place_piece(piece, table_bytes_.data() + table_offset_bytes_[piece.table],
                                    header_.tables[piece.table].size_bytes)
                      : place_piece(piece, config_blob_.data(), header_.config.size_bytes));
  return placed ? LogEvent::kMore : refuse(LogRefusal::kPiece, Status::kOutOfRange, piece.table);
}

LogEvent LogPlayer::check_preamble() {
  if (!has_header_) {
    return refuse(LogRefusal::kNoHeader, Status::kInvalidArgument);
  }
  if (base::crc32c(config_blob_.data(), header_.config.size_bytes) != header_.config.crc) {
    return refuse(LogRefusal::kConfigDamaged, Status::kBadChecksum);
  }
  const auto config = decode_config(config_blob_.data(), header_.config.size_bytes);
  if (!config.ok()) {
    return refuse(LogRefusal::kConfigBad, config.status());
  }
  config_ = config.value();
  for (std::size_t k = 0; k < header_.table_count; ++k) {
    if (base::crc32c(tables_[k].bytes, tables_[k].size_bytes) != header_.tables[k].crc) {
      return refuse(LogRefusal::kTableDamaged, Status::kBadChecksum, k);
    }
  }
  configured_ = true;
  return LogEvent::kConfigured;
}

// --- The flight

LogEvent LogPlayer::take_flight(const LogRecord& record) {
  if (record.type == MessageType::kLogChunk) {
    const auto chunk = proto::decode_log_chunk(record.payload, record.payload_bytes);
    if (chunk.ok()) {
      take_chunk(chunk.value());
    }
  } else if (record.type == MessageType::kLogCycle) {
    const auto cycle = proto::decode_log_cycle(record.payload, record.payload_bytes);
    if (cycle.ok()) {
      take_cycle(cycle.value());
      return LogEvent::kCycle;
    }
  } else if (record.type == MessageType::kLogGap) {
    const auto gap = proto::decode_log_gap(record.payload, record.payload_bytes);
    if (gap.ok()) {
      findings_.recorder_gaps += 1;
      findings_.recorder_lost += gap.value().lost_records;
    }
  } else if (record.type == MessageType::kLogEnd) {
    const auto end = proto::decode_log_end(record.payload, record.payload_bytes);
    if (end.ok()) {
      end_ = end.value();
    }
  }
  return LogEvent::kMore;
}

void LogPlayer::take_chunk(const proto::LogChunk& chunk) {
  // Of what is beyond the cycle's limit the vehicle counts the bytes and reads none (kMaxCycleBytes), so the
  // size is kept as it was said, and the bytes as far as they are read. Reports and edges it reads before all others,
  // wherever they stand.
  const bool first =
      chunk.port == kHostPort || chunk.port == kCommandPort ||
      (chunk.port < config_.port_count && config_.ports[chunk.port].driver == Driver::kLine);
  const std::size_t size_bytes = chunk.bytes.size_bytes;
  const std::size_t kept_bytes =
      first ? size_bytes : base::min_of(size_bytes, kMaxCycleBytes - device_bytes_);
  if (chunk_count_ == chunks_.size() || kept_bytes > chunk_bytes_.size() - filled_bytes_) {
    ++chunks_dropped_;
    return;
  }
  std::uint8_t* const bytes = chunk_bytes_.data() + filled_bytes_;
  if (kept_bytes > 0) {
    std::memcpy(bytes, chunk.bytes.data, kept_bytes);
  }
  filled_bytes_ += kept_bytes;
  device_bytes_ += first ? 0 : kept_bytes;
  chunks_[chunk_count_] = {chunk.t_arrival_us, bytes, static_cast<std::uint16_t>(size_bytes),
                           chunk.port};
  ++chunk_count_;
}

void LogPlayer::take_cycle(const proto::LogCycle& cycle) {
  input_ = {cycle.t_us, chunks_.data(), chunk_count_, cycle.downlink_room_bytes};
  cycle_given_ = true;
  // Chunks of a lost cycle before may be among them, or some be missing: either way not this cycle.
  cycle_whole_ = chunks_dropped_ == 0 && chunk_count_ == cycle.chunk_count;
  findings_.broken_cycles += cycle_whole_ ? 0U : 1U;
  const std::uint32_t expected = any_cycle_ ? cycle_number_ + 1U : 0U;
  const std::uint32_t skipped = cycle.cycle - expected;
  findings_.missing_cycles += skipped < 0x80000000U ? skipped : 0U;
  any_cycle_ = true;
  cycle_number_ = cycle.cycle;
  t_us_ = cycle.t_us;
}

void LogPlayer::clear_chunks() {
  chunk_count_ = 0;
  chunks_dropped_ = 0;
  filled_bytes_ = 0;
  device_bytes_ = 0;
}

// --- Results

bool same_results(const proto::LogEnd& a, const proto::LogEnd& b) {
  return a.map_hash == b.map_hash && a.link_hash == b.link_hash && a.cells_hash == b.cells_hash;
}

std::size_t hash_line(const proto::LogEnd& end, char (&out)[kHashLine_bytes]) {
  char* at = put_hash(put_text(out, "map_hash="), end.map_hash);
  at = put_hash(put_text(at, " link_hash="), end.link_hash);
  at = put_hash(put_text(at, " cells_hash="), end.cells_hash);
  *at = '\0';
  return static_cast<std::size_t>(at - out);
}

const char* same_as_flight_text(const proto::LogEnd& now, const proto::LogEnd* then) {
  if (then == nullptr) {
    return "unknown";
  }
  return same_results(now, *then) ? "true" : "false";
}

}  // namespace leadline::firmware
