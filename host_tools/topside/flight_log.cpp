#include "host_tools/topside/flight_log.hpp"

#include <cstring>
#include <filesystem>

#include "firmware/pipeline/config_codec.hpp"
#include "host_tools/exit_codes.hpp"
#include "model/base/crc32c.hpp"

namespace leadline::host {
namespace {

constexpr std::size_t kBuffer_bytes = 65536;
// A header that promises more than this is not believed.
constexpr std::uint32_t kMaxBlob_bytes = 1U << 20U;

[[noreturn]] void refuse(const std::string& path, const std::string& what) {
  throw HostError(ExitCode::kInput, path + ": " + what);
}

bool is_piece(const proto::LogRecord& record) {
  return record.type == proto::MessageType::kLogConfig ||
         record.type == proto::MessageType::kLogTable;
}

/// Puts a piece where it belongs. False when it lies outside the blob.
bool place_piece(const proto::LogPiece& piece, std::vector<std::uint8_t>* blob) {
  const std::size_t offset = piece.offset_bytes;
  if (offset > blob->size() || piece.bytes.size_bytes > blob->size() - offset) {
    return false;
  }
  std::memcpy(blob->data() + offset, piece.bytes.data, piece.bytes.size_bytes);
  return true;
}

}  // namespace

FlightLog::FlightLog(const std::string& path)
    : path_(path), file_(path, std::ios::binary), buffer_(kBuffer_bytes) {
  std::error_code error;
  if (!file_ || std::filesystem::is_directory(path, error)) {
    refuse(path, "cannot be read");
  }
  size_bytes_ = std::filesystem::file_size(path, error);
  if (error) {
    size_bytes_ = 0;  // a pipe: length not known
  }
  read_preamble();
  check_preamble();
}

bool FlightLog::next_record(proto::LogRecord* record) {
  if (ahead_) {
    *record = *ahead_;
    ahead_.reset();
    return true;
  }
  for (;;) {
    while (begin_ < filled_) {
      std::size_t used = 0;
      const auto* const data = reinterpret_cast<const std::uint8_t*>(buffer_.data()) + begin_;
      const bool complete = reader_.next(data, filled_ - begin_, used, *record);
      begin_ += used;
      if (complete) {
        counters_.records += 1;
        return true;
      }
    }
    file_.read(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
    filled_ = static_cast<std::size_t>(file_.gcount());
    begin_ = 0;
    counters_.bytes += filled_;
    counters_.damaged_places = reader_.counters().gaps;
    counters_.unknown_records = reader_.counters().unknown_types;
    if (filled_ == 0) {
      counters_.cut = reader_.mid_record();
      if (file_.bad()) {
        refuse(path_, "cannot be read to its end");
      }
      return false;
    }
  }
}

void FlightLog::read_preamble() {
  // Header, configuration and tables stand there twice: what the first copy lacks comes with the second.
  bool has_header = false;
  proto::LogRecord record{};
  while (next_record(&record)) {
    if (record.type == proto::MessageType::kLogHeader) {
      if (!has_header) {
        take_header(record);
      }
      has_header = true;
    } else if (!is_piece(record)) {
      ahead_ = record;
      break;
    } else if (has_header) {
      take_piece(record);
    }
  }
  if (!has_header) {
    refuse(path_, "is no log of a vehicle, or its header is damaged");
  }
}

void FlightLog::take_header(const proto::LogRecord& record) {
  const auto header = proto::decode_log_header(record.payload, record.payload_bytes);
  if (header.status() == base::Status::kBadVersion) {
    refuse(path_, "is of another version (format or protocol) than this program reads");
  }
  if (!header.ok()) {
    refuse(path_, std::string("its header is wrong: ") + base::status_text(header.status()));
  }
  header_ = header.value();
  if (header_.config.size_bytes > kMaxBlob_bytes) {
    refuse(path_, "its header promises a configuration of " +
                      std::to_string(header_.config.size_bytes) + " bytes");
  }
  config_blob_.resize(header_.config.size_bytes);
  for (std::size_t k = 0; k < header_.table_count; ++k) {
    if (header_.tables[k].size_bytes > kMaxBlob_bytes) {
      refuse(path_, "its header promises a table of " +
                        std::to_string(header_.tables[k].size_bytes) + " bytes");
    }
    tables_.emplace_back(header_.tables[k].size_bytes);
  }
}

void FlightLog::take_piece(const proto::LogRecord& record) {
  const bool config = record.type == proto::MessageType::kLogConfig;
  const auto piece = proto::decode_log_piece(record.payload, record.payload_bytes);
  const bool known = piece.ok() && (config || piece.value().table < tables_.size());
  if (!known ||
      !place_piece(piece.value(), config ? &config_blob_ : &tables_[piece.value().table])) {
    refuse(path_, config ? "a piece of its configuration is wrong" : "a piece of a table is wrong");
  }
}

void FlightLog::check_preamble() {
  if (base::crc32c(config_blob_.data(), config_blob_.size()) != header_.config.crc) {
    refuse(path_, "its configuration is damaged: the flight cannot be repeated");
  }
  const auto config = firmware::decode_config(config_blob_.data(), config_blob_.size());
  if (!config.ok()) {
    refuse(path_,
           std::string("its configuration is of no use: ") + base::status_text(config.status()));
  }
  config_ = config.value();
  for (std::size_t k = 0; k < tables_.size(); ++k) {
    if (base::crc32c(tables_[k].data(), tables_[k].size()) != header_.tables[k].crc) {
      refuse(path_,
             "its table " + std::to_string(k) + " is damaged: the flight cannot be repeated");
    }
  }
}

bool FlightLog::next(FlightCycle* cycle) {
  proto::LogRecord record{};
  while (next_record(&record)) {
    if (record.type == proto::MessageType::kLogChunk) {
      const auto chunk = proto::decode_log_chunk(record.payload, record.payload_bytes);
      if (chunk.ok()) {
        const proto::LogBytes& bytes = chunk.value().bytes;
        chunks_.push_back({chunk.value().port,
                           chunk.value().t_arrival_us,
                           {bytes.data, bytes.data + bytes.size_bytes}});
      }
    } else if (record.type == proto::MessageType::kLogCycle) {
      if (take_cycle(record, cycle)) {
        return true;
      }
    } else {
      take_other(record);
    }
  }
  return false;
}

bool FlightLog::take_cycle(const proto::LogRecord& record, FlightCycle* cycle) {
  const auto decoded = proto::decode_log_cycle(record.payload, record.payload_bytes);
  if (!decoded.ok()) {
    return false;
  }
  const proto::LogCycle& said = decoded.value();
  cycle->number = said.cycle;
  cycle->t_us = said.t_us;
  cycle->downlink_room_bytes = said.downlink_room_bytes;
  cycle->chunks = std::move(chunks_);
  chunks_.clear();
  // Chunks of a lost cycle before may be among them, or some be missing: either way not this cycle.
  cycle->whole = cycle->chunks.size() == said.chunk_count;
  counters_.broken_cycles += cycle->whole ? 0U : 1U;
  const std::uint32_t expected = last_cycle_ ? *last_cycle_ + 1U : 0U;
  const std::uint32_t skipped = said.cycle - expected;
  counters_.missing_cycles += skipped < 0x80000000U ? skipped : 0U;
  last_cycle_ = said.cycle;
  return true;
}

void FlightLog::take_other(const proto::LogRecord& record) {
  if (record.type == proto::MessageType::kLogGap) {
    const auto gap = proto::decode_log_gap(record.payload, record.payload_bytes);
    if (gap.ok()) {
      counters_.recorder_gaps += 1;
      counters_.recorder_lost += gap.value().lost_records;
    }
  } else if (record.type == proto::MessageType::kLogEnd) {
    const auto end = proto::decode_log_end(record.payload, record.payload_bytes);
    if (end.ok()) {
      end_ = end.value();
    }
  }
}

}  // namespace leadline::host
