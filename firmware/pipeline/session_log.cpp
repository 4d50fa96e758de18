#include "firmware/pipeline/session_log.hpp"

#include "firmware/pipeline/config_codec.hpp"
#include "model/base/crc32c.hpp"
#include "proto/messages.hpp"

namespace leadline::firmware {

using base::Status;

Status log_begin(proto::LogWriter& writer, const VehicleConfig& config, const TableBlock* tables,
                 std::size_t table_count, base::TimeUs t_us, std::int64_t utc_us) {
  if (table_count > static_cast<std::size_t>(proto::kMaxLogTables)) {
    return Status::kOutOfRange;
  }
  std::uint8_t blob[kMaxConfigBlob_bytes];
  const base::Result<std::size_t> blob_bytes = encode_config(config, blob, sizeof blob);
  if (!blob_bytes.ok()) {
    return blob_bytes.status();
  }
  proto::LogHeader header{};
  header.format = proto::kLogFormat;
  header.protocol_major = proto::kProtocolMajor;
  header.protocol_minor = proto::kProtocolMinor;
  header.schema_hash = proto::schema_hash();
  header.survey_id = config.survey_id;
  header.session = config.session;
  header.t_us = t_us;
  header.utc_us = utc_us;
  header.config = {base::crc32c(blob, blob_bytes.value()),
                   static_cast<std::uint32_t>(blob_bytes.value())};
  header.table_count = static_cast<std::uint8_t>(table_count);
  for (std::size_t i = 0; i < table_count; ++i) {
    header.tables[i] = {base::crc32c(tables[i].bytes, tables[i].size_bytes),
                        static_cast<std::uint32_t>(tables[i].size_bytes)};
  }
  Status status = writer.header(header);
  if (status == Status::kOk) {
    status = writer.config(blob, blob_bytes.value());
  }
  for (std::size_t i = 0; i < table_count && status == Status::kOk; ++i) {
    const auto* const bytes = static_cast<const std::uint8_t*>(tables[i].bytes);
    status = writer.table(static_cast<std::uint8_t>(i), bytes, tables[i].size_bytes);
  }
  return status;
}

Status log_cycle(proto::LogWriter& writer, std::uint32_t cycle, const CycleInput& input,
                 const CycleOutput& output) {
  if (input.chunk_count > kMaxCycleChunks) {
    return Status::kOutOfRange;
  }
  for (std::size_t i = 0; i < input.chunk_count; ++i) {
    const InputChunk& chunk = input.chunks[i];
    const Status status = writer.chunk(
        {cycle, chunk.t_arrival_us, chunk.port, {chunk.data, std::uint32_t{chunk.size_bytes}}});
    if (status != Status::kOk) {
      return status;
    }
  }
  proto::LogCycle record{};
  record.cycle = cycle;
  record.t_us = input.t_us;
  record.downlink_room_bytes = input.downlink_room_bytes;
  record.chunk_count = static_cast<std::uint16_t>(input.chunk_count);
  record.flags = static_cast<std::uint16_t>(input.chunk_count == 0 ? proto::kLogCycleIdle : 0);
  const Status status = writer.cycle(record);
  if (status != Status::kOk || output.downlink.size_bytes == 0) {
    return status;
  }
  return writer.frames(output.downlink.data, output.downlink.size_bytes);
}

proto::LogEnd log_end_of(const Vehicle& vehicle, base::TimeUs t_us) {
  const VehicleCounters& counters = vehicle.counters();
  const model::ModelCounters& model = vehicle.model().counters();
  proto::LogEnd end{};
  end.t_us = t_us;
  end.cycle_count = static_cast<std::uint32_t>(counters.cycles);
  end.map_hash = vehicle.map_hash();
  end.cells_hash = vehicle.cells_hash();
  end.link_hash = vehicle.link_hash();
  end.pings_in = counters.pings_in;
  end.pings_fused = model.pings[static_cast<int>(model::PingResult::kFused)];
  end.pings_shed = counters.pings_lost[static_cast<int>(PingLoss::kShed)];
  end.pings_rejected =
      counters.pings_in - counters.pings_pending - end.pings_fused - end.pings_shed;
  end.cells_sent = counters.cells_sent;
  end.downlink_bytes = counters.downlink_bytes;
  return end;
}

}  // namespace leadline::firmware
