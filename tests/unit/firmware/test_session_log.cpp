// A flight in process, written as the vehicle's program writes it, read back, and flown again from the log.
#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

#include "firmware/pipeline/config_codec.hpp"
#include "firmware/pipeline/host_report.hpp"
#include "firmware/pipeline/session_log.hpp"
#include "model/base/crc32c.hpp"
#include "tests/support/test.hpp"
#include "tests/support/vehicle_rig.hpp"

namespace {

using leadline::base::Status;
using leadline::firmware::CycleInput;
using leadline::firmware::CycleOutput;
using leadline::firmware::InputChunk;
using leadline::firmware::log_begin;
using leadline::firmware::log_cycle;
using leadline::firmware::log_end_of;
using leadline::firmware::TableBlock;
using leadline::firmware::Vehicle;
using leadline::firmware::VehicleConfig;
using leadline::proto::LogReader;
using leadline::proto::LogRecord;
using leadline::proto::LogWriter;
using leadline::proto::MessageType;
using leadline::test::RecordedCycle;

Vehicle vehicle;  // as large as its model

CycleInput input_of(const RecordedCycle& cycle, std::vector<InputChunk>* chunks) {
  chunks->clear();
  for (const auto& chunk : cycle.chunks) {
    chunks->push_back({chunk.t_arrival_us, chunk.bytes.data(),
                       static_cast<std::uint16_t>(chunk.bytes.size()), chunk.port});
  }
  return {cycle.t_us, chunks->data(), chunks->size(), cycle.room_bytes};
}

/// Everything that the records of a log say, as far as a replay needs it.
struct ReadBack {
  leadline::proto::LogHeader header{};
  std::vector<std::uint8_t> config;
  std::vector<std::uint8_t> table;
  leadline::test::Recording recording;
  std::vector<std::uint8_t> downlink_types;
  leadline::proto::LogEnd end{};
};

void take(const LogRecord& record, RecordedCycle* open, ReadBack* out) {
  const std::uint8_t* const payload = record.payload;
  const std::size_t size = record.payload_bytes;
  switch (record.type) {
    case MessageType::kLogHeader:
      out->header = leadline::proto::decode_log_header(payload, size).value();
      return;
    case MessageType::kLogConfig:
    case MessageType::kLogTable: {
      const auto piece = leadline::proto::decode_log_piece(payload, size).value();
      auto& blob = record.type == MessageType::kLogConfig ? out->config : out->table;
      const std::size_t end = piece.offset_bytes + piece.bytes.size_bytes;
      blob.resize(std::max(blob.size(), end));
      std::copy_n(piece.bytes.data, piece.bytes.size_bytes,
                  blob.begin() + static_cast<std::ptrdiff_t>(piece.offset_bytes));
      return;
    }
    case MessageType::kLogChunk: {
      const auto chunk = leadline::proto::decode_log_chunk(payload, size).value();
      open->chunks.push_back({chunk.port,
                              chunk.t_arrival_us,
                              {chunk.bytes.data, chunk.bytes.data + chunk.bytes.size_bytes}});
      return;
    }
    case MessageType::kLogCycle: {
      const auto cycle = leadline::proto::decode_log_cycle(payload, size).value();
      assert_int_equal(cycle.cycle, out->recording.size());
      assert_int_equal(cycle.chunk_count, open->chunks.size());
      assert_int_equal((cycle.flags & leadline::proto::kLogCycleIdle) != 0, cycle.chunk_count == 0);
      open->t_us = cycle.t_us;
      open->room_bytes = cycle.downlink_room_bytes;
      out->recording.push_back(*open);
      *open = {};
      return;
    }
    case MessageType::kLogEnd:
      out->end = leadline::proto::decode_log_end(payload, size).value();
      return;
    default:
      out->downlink_types.push_back(payload[0]);
  }
}

ReadBack read_back(const std::vector<std::uint8_t>& bytes) {
  ReadBack out;
  RecordedCycle open{};
  const auto reader = std::make_unique<LogReader>();
  std::size_t at = 0;
  while (at < bytes.size()) {
    std::size_t used = 0;
    LogRecord record{};
    if (reader->next(bytes.data() + at, bytes.size() - at, used, record)) {
      take(record, &open, &out);
    }
    at += used;
  }
  assert_int_equal(reader->counters().gaps, 0);
  assert_false(reader->mid_record());
  return out;
}

TEST(a_log_flies_again_to_the_same_map_and_the_same_frames) {
  VehicleConfig config = leadline::test::rig_config();
  config.session = 77;
  leadline::test::configure_rig(vehicle, config);
  leadline::test::RigOptions options;
  options.seconds = 8;
  const leadline::test::Recording flown = leadline::test::fly(vehicle, options);

  // The same inputs once more, now written down as the program does.
  leadline::test::configure_rig(vehicle, config);
  std::vector<std::uint8_t> buffer(1U << 18U);
  std::vector<std::uint8_t> log;
  LogWriter writer(buffer.data(), buffer.size());
  const auto keep = [&](Status status) {
    assert_int_equal(status, Status::kOk);
    log.insert(log.end(), writer.data(), writer.data() + writer.size_bytes());
    writer.clear();
  };
  const TableBlock table = {&leadline::test::rig_table(), sizeof leadline::test::rig_table()};
  for (int copy = 0; copy < leadline::firmware::kLogPreambleCopies; ++copy) {
    keep(log_begin(writer, config, &table, 1, flown.front().t_us, 1'700'000'000'000'000));
  }
  std::vector<InputChunk> chunks;
  std::uint32_t number = 0;
  for (const RecordedCycle& cycle : flown) {
    const CycleInput input = input_of(cycle, &chunks);
    CycleOutput output{};
    vehicle.cycle(input, output);
    keep(log_cycle(writer, number, input, output));
    number += 1;
  }
  keep(writer.end(log_end_of(vehicle, flown.back().t_us)));
  assert_true(vehicle.counters().pings_mapped > 20);

  const ReadBack read = read_back(log);
  assert_int_equal(read.header.session, 77);
  assert_int_equal(read.header.survey_id, config.survey_id);
  assert_int_equal(read.header.t_us, flown.front().t_us);
  assert_int_equal(read.header.table_count, 1);
  assert_int_equal(leadline::base::crc32c(read.config.data(), read.config.size()),
                   read.header.config.crc);
  assert_int_equal(read.table.size(), read.header.tables[0].size_bytes);
  assert_memory_equal(read.table.data(), table.bytes, table.size_bytes);
  assert_int_equal(read.downlink_types.size(), vehicle.counters().downlink_frames);
  assert_int_equal(read.end.cycle_count, flown.size());
  assert_int_equal(read.end.pings_in, read.end.pings_fused + read.end.pings_shed +
                                          read.end.pings_rejected +
                                          vehicle.counters().pings_pending);

  // The configuration and the inputs are all in the log: it flies alone.
  const auto again = leadline::firmware::decode_config(read.config.data(), read.config.size());
  assert_true(again.ok());
  const TableBlock logged = {read.table.data(), read.table.size()};
  assert_int_equal(vehicle.configure(again.value(), &logged, 1), Status::kOk);
  leadline::test::run_recording(vehicle, read.recording);
  const leadline::proto::LogEnd end = log_end_of(vehicle, read.end.t_us);
  assert_true(end.map_hash == read.end.map_hash);
  assert_true(end.link_hash == read.end.link_hash);
  assert_true(end.cells_hash == read.end.cells_hash);
  assert_int_equal(end.downlink_bytes, read.end.downlink_bytes);
  assert_int_equal(end.pings_fused, read.end.pings_fused);
}

TEST(what_the_host_knows_reaches_the_status) {
  leadline::test::configure_rig(vehicle, leadline::test::rig_config());
  leadline::firmware::HostReport report{};
  report.alarms = leadline::proto::kAlarmRecorderLost | leadline::proto::kAlarmRestarted |
                  leadline::proto::kAlarmShed;
  report.recorder_lost = 4;
  report.cycle_max_us = 900;
  report.port_count = 2;
  report.port_open[1] = 1;
  report.dropped_bytes[0] = 17;
  std::uint8_t bytes[leadline::firmware::kMaxHostReport_bytes] = {};
  const std::size_t size = encode_host_report(report, bytes, sizeof bytes);
  const InputChunk chunks[] = {
      {20'000, bytes, static_cast<std::uint16_t>(size), leadline::firmware::kHostPort},
      {20'000, bytes, 3, leadline::firmware::kHostPort}};
  leadline::proto::Status status{};
  bool found = false;
  const auto decoder = std::make_unique<leadline::proto::FrameDecoderBuffer<>>();
  for (leadline::base::TimeUs t_us = 20'000; t_us < 20'000'000 && !found; t_us += 20'000) {
    CycleOutput output{};
    vehicle.cycle({t_us, chunks, t_us == 20'000 ? std::size_t{2} : 0, 100'000}, output);
    for (std::size_t i = 0; i < output.downlink.size_bytes; ++i) {
      leadline::proto::FrameView frame{};
      if (t_us > 20'000 && decoder->decoder().feed(output.downlink.data[i], frame)) {
        const auto decoded = leadline::proto::decode_status(frame.payload, frame.payload_bytes);
        found = found || decoded.ok();
        status = decoded.ok() ? decoded.value() : status;
      }
    }
  }
  assert_true(found);
  assert_int_equal(vehicle.counters().chunks_ignored, 1);  // the one that was cut
  assert_true((status.alarms & leadline::proto::kAlarmRecorderLost) != 0);
  assert_true((status.alarms & leadline::proto::kAlarmRestarted) != 0);
  assert_true((status.alarms & leadline::proto::kAlarmShed) == 0);  // not the host's to say
  assert_int_equal(status.recorder_lost, 4);
  assert_int_equal(status.cycle_max_us, 900);
  assert_int_equal(status.ports[0].state, 0);
  assert_int_equal(status.ports[0].dropped_bytes, 17);
  assert_int_equal(status.ports[1].state, 1);
}

TEST(what_does_not_fit_is_refused) {
  std::vector<std::uint8_t> small(1000);
  LogWriter writer(small.data(), small.size());
  const TableBlock table = {&leadline::test::rig_table(), sizeof leadline::test::rig_table()};
  const VehicleConfig config = leadline::test::rig_config();
  assert_int_equal(log_begin(writer, config, &table, 1, 0, 0), Status::kFull);
  assert_int_equal(log_begin(writer, config, &table, 9, 0, 0), Status::kOutOfRange);
  std::vector<std::uint8_t> large(100'000);
  LogWriter roomy(large.data(), large.size());
  const std::vector<std::uint8_t> bytes(leadline::firmware::kMaxChunk_bytes + 1);
  const InputChunk chunk = {0, bytes.data(), static_cast<std::uint16_t>(bytes.size()), 0};
  assert_int_equal(log_cycle(roomy, 0, {0, &chunk, 1, 0}, {}), Status::kOutOfRange);
}

}  // namespace
